//! Acclaim motion: a skeleton (`.asf`) and its motion (`.amc`), as CMU gives them.
//!
//! A joint is where a bone begins: `lfemur` is the left hip. Size and up axis
//! are set as for BVH. The files say no frame rate; CMU's is mostly 120.
//! Refuses, with file and line, what is not Acclaim, invalid numbers and
//! bones that the skeleton does not have.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::bvh::NamedMotion;
use super::joint_search::map_joints;
use super::named_skeleton::{FileJoint, GivenNames, settle};
use servodance_model::motion::rotation::{IDENTITY, Matrix, about, apply, multiply, transposed};
use servodance_model::motion::vec3::{Vec3, add, narrow, scale, unit_or};
use servodance_model::motion::{Clip, MotionError, Pose};

const MOST_BONES: usize = 1000;
/// Frames that are kept at most: nine hours at 120 a second.
const MOST_FRAMES: usize = 4_000_000;

#[derive(Clone, Copy, Debug, PartialEq)]
enum DegreeOfFreedom {
    Move(usize),
    Turn(usize),
    Length,
}

#[derive(Clone, Debug, Default)]
struct AcclaimBone {
    name: String,
    parent: Option<usize>,
    offset: Vec3,
    axes: Matrix,
    freedoms: Vec<DegreeOfFreedom>,
}

/// Bones with parents before children; the first is the root.
#[derive(Debug)]
struct AcclaimSkeleton {
    bones: Vec<AcclaimBone>,
    radians: bool,
}

/// With the `.asf` file beside it; `given` corrects the guess of which joint is which.
pub fn read_amc(path: &Path, fps: f64, given: &GivenNames) -> Result<NamedMotion, MotionError> {
    let skeleton_path = skeleton_of(path)?;
    let skeleton = parse_asf(&text(&skeleton_path)?)
        .map_err(|reason| MotionError::content(&skeleton_path, reason))?;
    let content = |reason: String| MotionError::content(path, reason);
    let joint = |bone: &AcclaimBone| FileJoint {
        name: bone.name.clone(),
        parent: bone.parent,
        offset: bone.offset,
    };
    let mut joints: Vec<FileJoint> = skeleton.bones.iter().map(joint).collect();
    for (at, bone) in skeleton.bones.iter().enumerate() {
        if !skeleton.bones.iter().any(|other| other.parent == Some(at)) {
            joints.push(FileJoint {
                name: format!("{} end", bone.name),
                parent: Some(at),
                offset: bone.offset,
            });
        }
    }
    let mapping = map_joints(&joints, given).map_err(content)?;
    let mut poses: Vec<Pose> = Vec::new();
    let mut points = vec![[0.0; 3]; joints.len()];
    let mut ends = vec![[0.0; 3]; skeleton.bones.len()];
    for frame in frames(&text(path)?, &skeleton).map_err(content)? {
        skeleton.place(&frame, &mut points, &mut ends);
        for (at, joint) in joints.iter().enumerate().skip(skeleton.bones.len()) {
            points[at] = ends[joint.parent.unwrap_or(0)];
        }
        poses.push(mapping.pose(&points).map(narrow));
    }
    settle(&mut poses).map_err(content)?;
    Ok(NamedMotion { clip: Clip::of_file(path, fps, poses), mapping })
}

fn text(path: &Path) -> Result<String, MotionError> {
    let bytes = std::fs::read(path).map_err(|error| MotionError::read(path, error))?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// `05.asf` for `05_02.amc`, or the one skeleton of the folder.
fn skeleton_of(motion: &Path) -> Result<PathBuf, MotionError> {
    let stem = motion.file_stem().unwrap_or_default().to_string_lossy();
    let subject = stem.split('_').next().unwrap_or_default();
    let folder = motion.parent().unwrap_or(Path::new("."));
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut skeletons: Vec<PathBuf> = entries
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|end| end.eq_ignore_ascii_case("asf")))
        .collect();
    skeletons.sort();
    let named = |name: &str| {
        let is = |path: &&PathBuf| path.file_stem().is_some_and(|stem| stem == name);
        skeletons.iter().find(is).cloned()
    };
    let only = || (skeletons.len() == 1).then(|| skeletons[0].clone());
    let found = named(&stem).or_else(|| named(subject)).or_else(only);
    found.ok_or_else(|| {
        MotionError::content(motion, format!("there is no skeleton {subject}.asf beside it"))
    })
}

/// Rotations about x, then y, then z: the order `XYZ`; others alike.
fn turned(angles: Vec3, order: &[usize]) -> Matrix {
    order.iter().fold(IDENTITY, |before, &axis| {
        let mut vector = [0.0; 3];
        vector[axis] = angles[axis];
        multiply(&about(vector), &before)
    })
}

impl AcclaimSkeleton {
    fn place(&self, frame: &[Vec<f64>], points: &mut [Vec3], ends: &mut [Vec3]) {
        let mut turns: Vec<Matrix> = Vec::with_capacity(self.bones.len());
        for (at, bone) in self.bones.iter().enumerate() {
            let mut shift = [0.0; 3];
            let mut turn = IDENTITY;
            let mut stretch = 0.0;
            for (freedom, value) in bone.freedoms.iter().zip(&frame[at]) {
                match *freedom {
                    DegreeOfFreedom::Move(axis) => shift[axis] = *value,
                    DegreeOfFreedom::Length => stretch = *value,
                    DegreeOfFreedom::Turn(axis) => {
                        let mut angles = [0.0; 3];
                        angles[axis] = if self.radians { *value } else { value.to_radians() };
                        turn = multiply(&turned(angles, &[axis]), &turn);
                    }
                }
            }
            let local = multiply(&bone.axes, &multiply(&turn, &transposed(&bone.axes)));
            let (begin, turn) = match bone.parent {
                Some(parent) => (ends[parent], multiply(&turns[parent], &local)),
                None => (shift, local),
            };
            let longer = scale(unit_or(bone.offset, [0.0; 3]), stretch);
            points[at] = begin;
            ends[at] = add(begin, apply(&turn, add(bone.offset, longer)));
            turns.push(turn);
        }
    }
}

fn axis_of(letter: char) -> Option<usize> {
    "xyz".find(letter.to_ascii_lowercase())
}

fn freedom(word: &str) -> Option<DegreeOfFreedom> {
    let lower = word.to_ascii_lowercase();
    let axis = lower.chars().nth(1).and_then(axis_of);
    match (lower.chars().next(), axis) {
        (Some('t'), Some(axis)) => Some(DegreeOfFreedom::Move(axis)),
        (Some('r'), Some(axis)) => Some(DegreeOfFreedom::Turn(axis)),
        (Some('l'), None) => Some(DegreeOfFreedom::Length),
        _ => None,
    }
}

fn parse_asf(text: &str) -> Result<AcclaimSkeleton, String> {
    let mut bones =
        vec![AcclaimBone { name: "root".into(), axes: IDENTITY, ..AcclaimBone::default() }];
    let mut radians = false;
    let mut parents: Vec<(String, Vec<String>)> = Vec::new();
    let (mut section, mut length) = (String::new(), 0.0);
    let (mut root_angles, mut root_order) = ([0.0; 3], vec![0, 1, 2]);
    for (index, line) in text.lines().enumerate() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let at_line = |reason: String| format!("line {}: {reason}", index + 1);
        let number = |at: usize| number(&words, at).map_err(at_line);
        let vector = || Ok::<_, String>([number(1)?, number(2)?, number(3)?]);
        let Some(first) = words.first().filter(|word| !word.starts_with('#')) else {
            continue;
        };
        if let Some(name) = first.strip_prefix(':') {
            section = name.to_ascii_lowercase();
            continue;
        }
        let order = |word: Option<&&str>| -> Vec<usize> {
            word.map_or(vec![0, 1, 2], |word| word.chars().filter_map(axis_of).collect())
        };
        let freedoms = || -> Result<Vec<DegreeOfFreedom>, String> {
            let read = |word: &&str| {
                freedom(word).ok_or_else(|| at_line(format!("\"{word}\" is no degree of freedom")))
            };
            words[1..].iter().map(read).collect()
        };
        let last = bones.len() - 1;
        match (section.as_str(), *first) {
            ("units", "angle") => {
                radians = words.get(1).is_some_and(|unit| unit.starts_with("rad"))
            }
            ("root", "order") => bones[0].freedoms = freedoms()?,
            ("root", "axis") => root_order = order(words.get(1)),
            ("root", "orientation") => root_angles = vector()?,
            ("bonedata", "begin") if bones.len() < MOST_BONES => bones.push(AcclaimBone::default()),
            ("bonedata", "begin") => return Err(at_line(format!("more than {MOST_BONES} bones"))),
            ("bonedata", _) if last == 0 => {
                return Err(at_line("a bone begins without `begin`".into()));
            }
            ("bonedata", "name") => bones[last].name = words.get(1).unwrap_or(&"").to_string(),
            ("bonedata", "direction") => bones[last].offset = scale(vector()?, length),
            ("bonedata", "length") => {
                length = number(1)?;
                bones[last].offset = scale(unit_or(bones[last].offset, [0.0; 3]), length);
            }
            ("bonedata", "axis") => {
                let angles =
                    vector()?.map(|angle| if radians { angle } else { angle.to_radians() });
                bones[last].axes = turned(angles, &order(words.get(4)));
            }
            ("bonedata", "dof") => bones[last].freedoms = freedoms()?,
            ("bonedata", "end") => length = 1.0,
            ("hierarchy", "begin" | "end") => {}
            ("hierarchy", parent) => {
                let children = words[1..].iter().map(|word| (*word).to_owned()).collect();
                parents.push((parent.to_owned(), children));
            }
            _ => {}
        }
    }
    let angles = root_angles.map(|angle: f64| if radians { angle } else { angle.to_radians() });
    bones[0].axes = turned(angles, &root_order);
    in_order(bones, &parents).map(|bones| AcclaimSkeleton { bones, radians })
}

fn number(words: &[&str], at: usize) -> Result<f64, String> {
    let word = words.get(at).ok_or("a number is missing")?;
    let value = word.parse().ok().filter(|value: &f64| value.is_finite());
    value.ok_or_else(|| format!("\"{word}\" is not a number"))
}

fn in_order(
    bones: Vec<AcclaimBone>,
    parents: &[(String, Vec<String>)],
) -> Result<Vec<AcclaimBone>, String> {
    let by_name: HashMap<&str, &AcclaimBone> = bones.iter().map(|b| (b.name.as_str(), b)).collect();
    let mut out = vec![bones[0].clone()];
    let mut at = 0;
    while at < out.len() {
        let name = out[at].name.clone();
        for child in parents.iter().filter(|(parent, _)| *parent == name).flat_map(|(_, c)| c) {
            let bone = by_name.get(child.as_str());
            let bone =
                bone.ok_or_else(|| format!("the hierarchy names \"{child}\", which is no bone"))?;
            if out.len() >= bones.len() {
                return Err(format!("the hierarchy comes to \"{child}\" more than once"));
            }
            out.push(AcclaimBone { parent: Some(at), ..(*bone).clone() });
        }
        at += 1;
    }
    Ok(out)
}

fn frames(text: &str, skeleton: &AcclaimSkeleton) -> Result<Vec<Vec<Vec<f64>>>, String> {
    let places: HashMap<&str, usize> =
        (skeleton.bones.iter().enumerate()).map(|(at, bone)| (bone.name.as_str(), at)).collect();
    let still = || -> Vec<Vec<f64>> {
        let zeros = |bone: &AcclaimBone| vec![0.0; bone.freedoms.len()];
        skeleton.bones.iter().map(zeros).collect()
    };
    let mut out: Vec<Vec<Vec<f64>>> = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let at_line = |reason: String| format!("line {}: {reason}", index + 1);
        match words[..] {
            [] => {}
            [first, ..] if first.starts_with(['#', ':']) => {}
            [one] if one.bytes().all(|b| b.is_ascii_digit()) => {
                if out.len() >= MOST_FRAMES {
                    return Err(at_line(format!("more than {MOST_FRAMES} frames")));
                }
                out.push(still());
            }
            [name, ref values @ ..] => {
                let place = places.get(name);
                let at = *place
                    .ok_or_else(|| at_line(format!("\"{name}\" is no bone of the skeleton")))?;
                let frame = out
                    .last_mut()
                    .ok_or_else(|| at_line("motion before the first frame".into()))?;
                let wanted = frame[at].len();
                if values.len() != wanted {
                    let found = values.len();
                    return Err(at_line(format!("{name} has {found} numbers, expected {wanted}")));
                }
                for (k, value) in frame[at].iter_mut().enumerate() {
                    *value = number(values, k).map_err(at_line)?;
                }
            }
        }
    }
    match out.is_empty() {
        true => Err("there are no frames".into()),
        false => Ok(out),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_types::BodyJoint;

    /// A body of straight bones, 10 units a leg bone, arms to the sides.
    fn skeleton() -> String {
        let mut bones = String::new();
        let mut tree = String::from("root lhipjoint rhipjoint lowerback\n");
        let mut bone = |name: &str, direction: &str, length: f64, dof: &str| {
            bones += &format!(
                "begin\nid 1\nname {name}\ndirection {direction}\nlength {length}\naxis 0 0 90 XYZ\n{dof}end\n"
            );
        };
        bone("lowerback", "0 1 0", 4.0, "dof rx ry rz\nlimits (-1 1)\n(-1 1)\n(-1 1)\n");
        bone("thorax", "0 1 0", 4.0, "");
        bone("lowerneck", "0 1 0", 2.0, "");
        bone("head", "0 1 0", 2.0, "");
        for (side, x) in [("l", "1"), ("r", "-1")] {
            bone(&format!("{side}hipjoint"), &format!("{x} 0 0"), 2.0, "");
            bone(&format!("{side}femur"), "0 -1 0", 10.0, "dof rx ry rz\n");
            bone(&format!("{side}tibia"), "0 -1 0", 10.0, "dof rx\n");
            bone(&format!("{side}foot"), "0 0 1", 3.0, "");
            bone(&format!("{side}toes"), "0 0 1", 1.0, "");
            bone(&format!("{side}clavicle"), &format!("{x} 0 0"), 3.0, "");
            bone(&format!("{side}humerus"), &format!("{x} 0 0"), 6.0, "dof rx ry rz\n");
            bone(&format!("{side}radius"), &format!("{x} 0 0"), 6.0, "dof rz\n");
            bone(&format!("{side}wrist"), &format!("{x} 0 0"), 1.0, "");
            tree += &format!(
                "{side}hipjoint {side}femur\n{side}femur {side}tibia\n{side}tibia {side}foot\n{side}foot {side}toes\n\
                 {side}clavicle {side}humerus\n{side}humerus {side}radius\n{side}radius {side}wrist\n"
            );
        }
        tree += "lowerback thorax\nthorax lowerneck lclavicle rclavicle\nlowerneck head\n";
        format!(
            ":version 1.10\n:units\nmass 1.0\nlength 0.45\nangle deg\n:root\norder TX TY TZ RX RY RZ\n\
             axis XYZ\nposition 0 0 0\norientation 0 0 0\n:bonedata\n{bones}:hierarchy\nbegin\n{tree}end\n"
        )
    }

    fn read(motion: &str) -> Result<NamedMotion, MotionError> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("05.asf"), skeleton()).unwrap();
        let path = folder.path().join("05_02.amc");
        std::fs::write(&path, motion).unwrap();
        read_amc(&path, 120.0, &GivenNames::new())
    }

    const HEADER: &str = "#!OML:ASF\n:FULLY-SPECIFIED\n:DEGREES\n";

    #[test]
    fn bones_turn_in_their_own_axes() {
        // Own axes are turned by 90 degrees about z: own x is y of the world.
        let motion = format!(
            "{HEADER}1\nroot 0 20 0 0 0 0\n2\nroot 0 20 0 0 90 0\nlradius 0\nlhumerus 90 0 0\n"
        );
        let clip = read(&motion).unwrap().clip;
        assert_eq!((clip.fps, clip.poses.len()), (120.0, 2));
        let at = |frame: usize, joint: BodyJoint| clip.poses[frame][joint as usize];
        let arm = |frame: usize| -> [f32; 3] {
            let (a, b) = (at(frame, BodyJoint::LeftShoulder), at(frame, BodyJoint::LeftWrist));
            std::array::from_fn(|k| b[k] - a[k])
        };
        let length = arm(0)[0];
        assert!(length > 0.4 && arm(0)[1].abs() < 1e-5 && arm(0)[2].abs() < 1e-5);
        // Turned by 90 degrees about y in the frame of the body, x goes to -z;
        // the root's turn about y takes -z to -x.
        assert!((arm(1)[0] + length).abs() < 1e-5, "{:?}", arm(1));
        let thigh = at(0, BodyJoint::LeftHip)[1] - at(0, BodyJoint::LeftKnee)[1];
        assert!((0.35..0.5).contains(&thigh), "{thigh}");
        assert!(at(0, BodyJoint::LeftFoot)[2] > at(0, BodyJoint::LeftAnkle)[2]);
        assert!(at(0, BodyJoint::Head)[1] > at(0, BodyJoint::Neck)[1]);
    }

    #[test]
    fn mistakes_name_file_and_line() {
        for (motion, says) in [
            ("1\nroot 0 0 0 0 0\n", "05_02.amc: line 5: root has 5 numbers, expected 6"),
            ("1\ntail 1\n", "\"tail\" is no bone"),
            ("1\nlradius x\n", "\"x\" is not a number"),
            ("1\nlradius nan\n", "\"nan\" is not a number"),
            ("lradius 1\n", "before the first frame"),
            ("", "there are no frames"),
        ] {
            let error = read(&format!("{HEADER}{motion}")).unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
        }
    }

    #[test]
    fn a_hierarchy_that_bites_its_tail_is_refused() {
        let text = skeleton().replace("ltibia lfoot\n", "ltibia lfemur\n");
        let error = parse_asf(&text).unwrap_err();
        assert!(error.contains("more than once"), "{error}");
    }
}
