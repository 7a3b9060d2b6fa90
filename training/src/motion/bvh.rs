//! Reads BVH: a skeleton with any names, becomes 22 points a frame.
//!
//! Positions only; the size is set so that the legs have the common length
//! (files say neither unit nor scale), z-up files are turned to y-up. Refuses,
//! with file and line: what is not BVH, invalid numbers, more frames than
//! memory should hold, and skeletons whose arms and legs cannot be identified.

use std::path::Path;

use super::joint_search::map_joints;
use super::named_skeleton::{FileJoint, GivenNames, JointMapping, settle};
use servodance_model::motion::rotation::{IDENTITY, Matrix, about, apply, multiply};
use servodance_model::motion::vec3::{Vec3, add, narrow};
use servodance_model::motion::{Clip, MotionError, Pose};

const MOST_JOINTS: usize = 1000;
/// Numbers that are kept at most: an hour of 100 joints at 60 frames a second.
const MOST_NUMBERS: usize = 64_000_000;

#[derive(Clone, Copy, Debug, PartialEq)]
enum BvhChannel {
    Move(usize),
    Turn(usize),
}

#[derive(Debug, Default)]
struct BvhSkeleton {
    joints: Vec<FileJoint>,
    channels: Vec<Vec<BvhChannel>>,
}

#[derive(Clone, Debug)]
pub struct NamedMotion {
    pub clip: Clip,
    /// Which joint of the file each body joint is.
    pub mapping: JointMapping,
}

/// Reads a BVH file; `given` corrects the guess of which joint is which.
pub fn read_bvh(path: &Path, given: &GivenNames) -> Result<NamedMotion, MotionError> {
    let text = std::fs::read(path).map_err(|error| MotionError::read(path, error))?;
    parse_bvh(&String::from_utf8_lossy(&text), path, given)
}

/// Reads the text of a BVH file; `path` is for messages.
fn parse_bvh(text: &str, path: &Path, given: &GivenNames) -> Result<NamedMotion, MotionError> {
    let content = |reason: String| MotionError::content(path, reason);
    let mut words = BvhWords::new(text);
    let (skeleton, fps, values) = parse(&mut words).map_err(content)?;
    let mapping = map_joints(&skeleton.joints, given).map_err(content)?;
    let width: usize = skeleton.channels.iter().map(Vec::len).sum();
    let mut poses: Vec<Pose> = Vec::with_capacity(values.len() / width.max(1));
    let mut points = vec![[0.0; 3]; skeleton.joints.len()];
    for frame in values.chunks_exact(width) {
        skeleton.place(frame, &mut points);
        poses.push(mapping.pose(&points).map(narrow));
    }
    settle(&mut poses).map_err(content)?;
    Ok(NamedMotion { clip: Clip::of_file(path, fps, poses), mapping })
}

type ParsedBvh = (BvhSkeleton, f64, Vec<f64>);

fn parse(words: &mut BvhWords) -> Result<ParsedBvh, String> {
    words.expect("HIERARCHY")?;
    words.expect("ROOT")?;
    let mut skeleton = BvhSkeleton::default();
    joint(words, None, &mut skeleton)?;
    words.expect("MOTION")?;
    words.expect("Frames:")?;
    let frames = words.number()?;
    words.expect("Frame")?;
    words.expect("Time:")?;
    let frame_s = words.number()?;
    if !(1e-4..=1.0).contains(&frame_s) {
        return Err(words.error(&format!("frame time {frame_s} s, expected 0.0001 to 1")));
    }
    let width: usize = skeleton.channels.iter().map(Vec::len).sum();
    let most = MOST_NUMBERS / width.max(1);
    if !(1.0..=most as f64).contains(&frames) || frames.fract() != 0.0 || width == 0 {
        return Err(words.error(&format!("{frames} frames, expected 1 to {most}")));
    }
    let wanted = frames as usize * width;
    let mut values = Vec::new();
    while values.len() < wanted {
        values.push(words.number().map_err(|why| {
            let (frame, channel) = (values.len() / width, values.len() % width);
            format!("{why} (frame {frame} of {frames}, number {channel} of {width})")
        })?);
    }
    Ok((skeleton, 1.0 / frame_s, values))
}

/// A joint with all below it, on a list, not on the stack; an end site has no channels.
fn joint(
    words: &mut BvhWords,
    parent: Option<usize>,
    skeleton: &mut BvhSkeleton,
) -> Result<(), String> {
    let name = words.line_rest()?;
    let mut open = vec![begin(words, name, parent, skeleton)?];
    while let Some(&at) = open.last() {
        match words.next()? {
            "OFFSET" => {
                skeleton.joints[at].offset = [words.number()?, words.number()?, words.number()?];
            }
            "CHANNELS" => skeleton.channels[at] = channels(words)?,
            "JOINT" => {
                let name = words.line_rest()?;
                open.push(begin(words, name, Some(at), skeleton)?);
            }
            "End" => {
                words.expect("Site")?;
                let name = format!("{} end", skeleton.joints[at].name);
                open.push(begin(words, name, Some(at), skeleton)?);
            }
            "}" => {
                open.pop();
            }
            other => {
                let reason =
                    format!("\"{other}\", expected OFFSET, CHANNELS, JOINT, End Site or }}");
                return Err(words.error(&reason));
            }
        }
    }
    Ok(())
}

fn begin(
    words: &mut BvhWords,
    name: String,
    parent: Option<usize>,
    skeleton: &mut BvhSkeleton,
) -> Result<usize, String> {
    words.expect("{")?;
    if skeleton.joints.len() >= MOST_JOINTS {
        return Err(words.error(&format!("more than {MOST_JOINTS} joints")));
    }
    skeleton.joints.push(FileJoint { name, parent, offset: [0.0; 3] });
    skeleton.channels.push(Vec::new());
    Ok(skeleton.joints.len() - 1)
}

fn channels(words: &mut BvhWords) -> Result<Vec<BvhChannel>, String> {
    let count = words.number()?;
    if !(0.0..=6.0).contains(&count) {
        return Err(words.error(&format!("{count} channels, expected 0 to 6")));
    }
    (0..count as usize)
        .map(|_| {
            let word = words.next()?;
            let (axis, kind) = word.split_at(word.len().min(1));
            let axis = "XYZ".find(axis).filter(|_| !axis.is_empty());
            match (axis, kind.to_ascii_lowercase().as_str()) {
                (Some(axis), "position") => Ok(BvhChannel::Move(axis)),
                (Some(axis), "rotation") => Ok(BvhChannel::Turn(axis)),
                _ => Err(words.error(&format!("\"{word}\" is no channel"))),
            }
        })
        .collect()
}

impl BvhSkeleton {
    fn place(&self, frame: &[f64], points: &mut [Vec3]) {
        let mut turns: Vec<Matrix> = Vec::with_capacity(self.joints.len());
        let mut values = frame.iter();
        for (index, joint) in self.joints.iter().enumerate() {
            let mut shift = [0.0; 3];
            let mut moved = false;
            let mut turn = IDENTITY;
            for channel in &self.channels[index] {
                let value = values.next().copied().unwrap_or(0.0);
                match *channel {
                    BvhChannel::Move(axis) => {
                        shift[axis] = value;
                        moved = true;
                    }
                    BvhChannel::Turn(axis) => {
                        let mut vector = [0.0; 3];
                        vector[axis] = value.to_radians();
                        turn = multiply(&turn, &about(vector));
                    }
                }
            }
            // Positions stand for the offset.
            let local = if moved { shift } else { joint.offset };
            match joint.parent {
                Some(parent) => {
                    points[index] = add(points[parent], apply(&turns[parent], local));
                    turns.push(multiply(&turns[parent], &turn));
                }
                None => {
                    points[index] = local;
                    turns.push(turn);
                }
            }
        }
    }
}

/// Words of a text with the line that each stands in.
struct BvhWords<'a> {
    lines: std::iter::Enumerate<std::str::Lines<'a>>,
    line: std::str::SplitWhitespace<'a>,
    number: usize,
}

impl<'a> BvhWords<'a> {
    fn new(text: &'a str) -> Self {
        Self {
            lines: text.trim_start_matches('\u{feff}').lines().enumerate(),
            line: "".split_whitespace(),
            number: 0,
        }
    }

    fn error(&self, reason: &str) -> String {
        format!("line {}: {reason}", self.number)
    }

    fn next(&mut self) -> Result<&'a str, String> {
        loop {
            if let Some(word) = self.line.next() {
                return Ok(word);
            }
            let Some((index, line)) = self.lines.next() else {
                return Err(self.error("the file ends here"));
            };
            self.number = index + 1;
            self.line = line.split_whitespace();
        }
    }

    fn expect(&mut self, wanted: &str) -> Result<(), String> {
        let word = self.next()?;
        if word.eq_ignore_ascii_case(wanted) {
            return Ok(());
        }
        let shown: String = word.chars().take(40).collect();
        Err(self.error(&format!("\"{shown}\", expected {wanted}")))
    }

    /// The rest of the line: names may hold blanks.
    fn line_rest(&mut self) -> Result<String, String> {
        let rest: Vec<&str> = self.line.by_ref().collect();
        match rest[..] {
            [] => Err(self.error("a joint without a name")),
            _ => Ok(rest.join(" ").trim_end_matches('{').trim().to_owned()),
        }
    }

    fn number(&mut self) -> Result<f64, String> {
        let word = self.next()?;
        match word.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => {
                let shown: String = word.chars().take(40).collect();
                Err(self.error(&format!("\"{shown}\" is not a number")))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_types::BodyJoint;

    /// A figure with the joint names of one family of files, 10 units a leg bone.
    fn figure(names: [&str; 8]) -> String {
        let [hip, knee, ankle, spine, neck, shoulder, elbow, wrist] = names;
        let limb = |side: &str, parts: [&str; 3], offsets: [&str; 3], tip: &str| {
            let part = |name: &str| name.replace('%', side);
            format!(
                "JOINT {}\n{{\nOFFSET {}\nCHANNELS 3 Zrotation Xrotation Yrotation\n\
                 JOINT {}\n{{\nOFFSET {}\nCHANNELS 3 Zrotation Xrotation Yrotation\n\
                 JOINT {}\n{{\nOFFSET {}\nCHANNELS 3 Zrotation Xrotation Yrotation\n\
                 End Site\n{{\nOFFSET {tip}\n}}\n}}\n}}\n}}\n",
                part(parts[0]),
                offsets[0],
                part(parts[1]),
                offsets[1],
                part(parts[2]),
                offsets[2]
            )
        };
        let arm = [shoulder, elbow, wrist];
        let leg = [hip, knee, ankle];
        let legs = limb("Left", leg, ["2 0 0", "0 -10 0", "0 -10 0"], "0 -1 3")
            + &limb("Right", leg, ["-2 0 0", "0 -10 0", "0 -10 0"], "0 -1 3");
        let arms = limb("Left", arm, ["4 3 0", "7 0 0", "7 0 0"], "2 0 0")
            + &limb("Right", arm, ["-4 3 0", "-7 0 0", "-7 0 0"], "-2 0 0");
        let zeros = "0 ".repeat(6 + 3 * (12 + 3));
        format!(
            "HIERARCHY\nROOT Hips\n{{\nOFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition \
             Zrotation Xrotation Yrotation\n{legs}JOINT {spine}\n{{\nOFFSET 0 5 0\n\
             CHANNELS 3 Zrotation Xrotation Yrotation\n{arms}JOINT {neck}\n{{\nOFFSET 0 7 0\n\
             CHANNELS 3 Zrotation Xrotation Yrotation\nJOINT Head\n{{\nOFFSET 0 2 0\n\
             CHANNELS 3 Zrotation Xrotation Yrotation\nEnd Site\n{{\nOFFSET 0 2 0\n}}\n}}\n}}\n\
             }}\n}}\nMOTION\nFrames: 2\nFrame Time: 0.05\n{zeros}\n{zeros}\n"
        )
    }

    fn read(text: &str) -> Result<NamedMotion, MotionError> {
        parse_bvh(text, Path::new("dance.bvh"), &GivenNames::new())
    }

    const MIXAMO: [&str; 8] = [
        "mixamorig:%UpLeg",
        "mixamorig:%Leg",
        "mixamorig:%Foot",
        "mixamorig:Spine",
        "mixamorig:Neck",
        "mixamorig:%Arm",
        "mixamorig:%ForeArm",
        "mixamorig:%Hand",
    ];

    #[test]
    fn every_usual_family_of_names_is_understood() {
        let families = [
            MIXAMO,
            ["%UpLeg", "%Leg", "%Foot", "Spine", "Neck", "%Arm", "%ForeArm", "%Hand"],
            ["%Hip", "%Knee", "%Ankle", "Chest", "Neck", "%Shoulder", "%Elbow", "%Wrist"],
            ["%Thigh", "%Shin", "%Foot", "spine", "neck", "%UpperArm", "%LowerArm", "%Hand"],
        ];
        for family in families {
            let named = read(&figure(family)).unwrap();
            let pose = &named.clip.poses[0];
            let at = |joint: BodyJoint| pose[joint as usize];
            assert!((named.clip.fps - 20.0).abs() < 1e-9);
            let thigh = at(BodyJoint::LeftHip)[1] - at(BodyJoint::LeftKnee)[1];
            assert!((0.35..0.5).contains(&thigh), "{family:?}: thigh of {thigh} m");
            assert!(at(BodyJoint::LeftWrist)[0] > at(BodyJoint::LeftElbow)[0]);
            assert!(at(BodyJoint::RightWrist)[0] < 0.0);
            assert!(at(BodyJoint::Head)[1] > at(BodyJoint::Neck)[1]);
            assert!(at(BodyJoint::LeftFoot)[2] > at(BodyJoint::LeftAnkle)[2]);
        }
    }

    #[test]
    fn rotations_are_applied_in_the_order_of_the_channels() {
        let mut text = figure(MIXAMO);
        // The root turned by 90 degrees about y: left (x) becomes -z.
        let at = text.rfind("0.05\n").unwrap() + 5;
        text.replace_range(at..at + 12, "0 0 0 0 0 90 ");
        let pose = read(&text).unwrap().clip.poses[0];
        let wrist = pose[BodyJoint::LeftWrist as usize];
        assert!(wrist[2] < -0.5 && wrist[0].abs() < 1e-5, "{wrist:?}");
    }

    #[test]
    fn mistakes_name_file_and_line() {
        let good = figure(MIXAMO);
        for (from, to, says) in [
            ("HIERARCHY", "HIERARCHIE", "dance.bvh: line 1: \"HIERARCHIE\""),
            ("OFFSET 0 5 0", "OFFSET 0 x 0", "\"x\" is not a number"),
            ("CHANNELS 6", "CHANNELS 7", "7 channels"),
            ("Yposition", "Yposture", "\"Yposture\" is no channel"),
            ("Frames: 2", "Frames: 3", "the file ends here (frame 2 of 3"),
            ("Frames: 2", "Frames: 1e18", "frames, expected 1 to"),
            ("Frame Time: 0.05", "Frame Time: 0", "frame time 0"),
            ("mixamorig:LeftLeg", "nobody", "left_knee"),
        ] {
            let text = good.replacen(from, to, 1);
            assert_ne!(text, good, "{from}");
            let message = read(&text).unwrap_err().to_string();
            assert!(message.contains(says), "{to}: {message}");
        }
    }
}
