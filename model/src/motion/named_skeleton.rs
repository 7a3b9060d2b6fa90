//! Which joint of a named skeleton is which of the 22.
//!
//! Names are those of the usual families of motion files; what lies between
//! two known joints (spine, collars) is taken from the line between them.

use servodance_types::{BodyJoint, JOINT_COUNT};

use super::Pose;
use super::vec3::{Vec3, add, lerp, norm, scale, sub};

/// A joint of a file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Joint {
    pub name: String,
    pub parent: Option<usize>,
    pub offset: Vec3,
}

/// Where a body joint comes from.
#[derive(Clone, Debug, PartialEq)]
enum Source {
    /// A joint of the file.
    Joint(usize),
    /// Along the way between two joints of the file.
    Between(Vec<usize>, f64),
}

/// Which joint of the file each body joint is.
#[derive(Clone, Debug, PartialEq)]
pub struct Mapping {
    sources: Vec<Source>,
    names: Vec<String>,
}

const HIP: &[&str] = &["upleg", "upperleg", "thigh", "hip", "upleg1"];
const KNEE: &[&str] = &["knee", "leg", "lowerleg", "lowleg", "shin", "calf"];
const ANKLE: &[&str] = &["ankle", "foot"];
const TOE: &[&str] = &["toebase", "toe", "toes", "ball", "toebase1"];
const COLLAR: &[&str] = &["collar", "clavicle", "collarbone"];
const SHOULDER: &[&str] = &["arm", "upperarm", "uparm", "shldr"];
const ELBOW: &[&str] = &["forearm", "elbow", "lowerarm", "lowarm"];
const WRIST: &[&str] = &["hand", "wrist"];

/// Shares of the way from pelvis to neck at which the three spine joints are.
const SPINE_SHARES: [f64; 3] = [0.239, 0.498, 0.602];

impl Mapping {
    /// `body joint: joint of the file`, a line each.
    pub fn lines(&self) -> Vec<String> {
        let named = BodyJoint::ALL.iter().zip(&self.sources);
        named
            .map(|(joint, source)| {
                let from = match source {
                    Source::Joint(at) => self.names[*at].clone(),
                    Source::Between(way, share) => {
                        let end = |at: Option<&usize>| at.map_or("", |at| &self.names[*at]);
                        let (first, last) = (end(way.first()), end(way.last()));
                        format!("{:.0} % of the way from {first} to {last}", share * 100.0)
                    }
                };
                format!("{}: {from}", joint.name())
            })
            .collect()
    }

    /// The 22 points of a frame.
    pub(super) fn pose(&self, points: &[Vec3]) -> [Vec3; JOINT_COUNT] {
        let at = |source: &Source| match source {
            Source::Joint(at) => points[*at],
            Source::Between(way, share) => along(way, *share, points),
        };
        std::array::from_fn(|joint| at(&self.sources[joint]))
    }
}

/// The point at a share of the length of a way through points.
fn along(way: &[usize], share: f64, points: &[Vec3]) -> Vec3 {
    let step = |pair: &[usize]| norm(sub(points[pair[1]], points[pair[0]]));
    let length: f64 = way.windows(2).map(step).sum();
    let mut left = share * length;
    for pair in way.windows(2) {
        let part = step(pair);
        if left <= part && part > 0.0 {
            return lerp(points[pair[0]], points[pair[1]], left / part);
        }
        left -= part;
    }
    way.last().map_or([0.0; 3], |last| points[*last])
}

/// Side and plain name: `mixamorig:LeftUpLeg` is left, `upleg`.
fn plain(name: &str) -> (Option<usize>, String) {
    let name = name.rsplit(':').next().unwrap_or(name);
    let raw: String = name
        .chars()
        .filter(|c| c.is_alphanumeric() || *c == '_')
        .collect();
    let lower = raw.to_ascii_lowercase();
    let joined = |text: &str| text.replace('_', "");
    for (side, word) in ["left", "right"].into_iter().enumerate() {
        if let Some((before, after)) = lower.split_once(word) {
            return (Some(side), joined(&format!("{before}{after}")));
        }
    }
    for (side, letter) in ['l', 'r'].into_iter().enumerate() {
        let rest = lower
            .strip_suffix(&format!("_{letter}"))
            .or_else(|| lower.strip_prefix(&format!("{letter}_")));
        if let Some(rest) = rest {
            return (Some(side), joined(rest));
        }
        // lShin, LHip: the letter stands before a capital.
        let mut letters = raw.chars();
        let first = letters.next().map(|c| c.to_ascii_lowercase());
        if first == Some(letter) && letters.next().is_some_and(char::is_uppercase) {
            return (Some(side), joined(&lower[1..]));
        }
    }
    (None, joined(&lower))
}

/// Finds the body in a skeleton.
///
/// # Errors
/// Names the part that is not found and the joints there are.
pub(super) fn map_joints(joints: &[Joint]) -> Result<Mapping, String> {
    let names: Vec<(Option<usize>, String)> = joints.iter().map(|j| plain(&j.name)).collect();
    let find = |side: Option<usize>, any: &[&str]| {
        any.iter()
            .find_map(|wanted| names.iter().position(|(s, n)| *s == side && n == wanted))
    };
    let missing = |part: &str| {
        let list: Vec<&str> = joints
            .iter()
            .filter(|joint| !joint.name.ends_with(" end"))
            .map(|joint| joint.name.as_str())
            .take(60)
            .collect();
        format!(
            "no joint can be told to be the {part}; the skeleton has: {}",
            list.join(", ")
        )
    };
    let child = |at: usize| joints.iter().position(|joint| joint.parent == Some(at));
    let mut sources: Vec<Option<Source>> = vec![None; JOINT_COUNT];
    let mut set = |joint: BodyJoint, source: Source| sources[joint as usize] = Some(source);
    let pelvis = find(None, &["hips", "pelvis", "hip", "root"]).unwrap_or(0);
    set(BodyJoint::Pelvis, Source::Joint(pelvis));
    let mut shoulders = [0; 2];
    for side in 0..2 {
        let word = ["left", "right"][side];
        let body = |part: &str| {
            BodyJoint::from_name(&format!("{word}_{part}")).unwrap_or(BodyJoint::Pelvis)
        };
        let need = |part: &str, any: &[&str]| {
            find(Some(side), any).ok_or_else(|| missing(&format!("{word}_{part}")))
        };
        let hip = need("hip", HIP)?;
        let knee = need("knee", KNEE)?;
        let ankle = need("ankle", ANKLE)?;
        let elbow = need("elbow", ELBOW)?;
        // "Shoulder" is the collar where there is an upper arm besides.
        let plain_shoulder = find(Some(side), &["shoulder"]);
        let upper = find(Some(side), SHOULDER);
        let shoulder = upper
            .or(plain_shoulder)
            .ok_or_else(|| missing(&format!("{word}_shoulder")))?;
        let collar = find(Some(side), COLLAR).or(plain_shoulder.filter(|_| upper.is_some()));
        let wrist = find(Some(side), WRIST)
            .or_else(|| child(elbow))
            .ok_or_else(|| missing(&format!("{word}_wrist")))?;
        let toe = find(Some(side), TOE)
            .or_else(|| child(ankle))
            .unwrap_or(ankle);
        shoulders[side] = shoulder;
        for (part, at) in [
            ("hip", hip),
            ("knee", knee),
            ("ankle", ankle),
            ("foot", toe),
            ("shoulder", shoulder),
            ("elbow", elbow),
            ("wrist", wrist),
        ] {
            set(body(part), Source::Joint(at));
        }
        if let Some(collar) = collar {
            set(body("collar"), Source::Joint(collar));
        }
    }
    let neck = find(None, &["neck", "neck1", "neck0"]);
    let head = find(None, &["head", "head1"]).or_else(|| neck.and_then(child));
    let neck = neck.or_else(|| head.and_then(|head| joints[head].parent));
    let neck = neck.ok_or_else(|| missing("neck"))?;
    let head = head.unwrap_or(neck);
    set(BodyJoint::Neck, Source::Joint(neck));
    set(BodyJoint::Head, Source::Joint(head));
    let mut spine = vec![neck];
    while let Some(parent) = spine.last().and_then(|&at| joints[at].parent) {
        spine.push(parent);
        if parent == pelvis {
            break;
        }
    }
    spine.reverse();
    for (joint, share) in [BodyJoint::Spine1, BodyJoint::Spine2, BodyJoint::Spine3]
        .into_iter()
        .zip(SPINE_SHARES)
    {
        set(joint, Source::Between(spine.clone(), share));
    }
    for (side, joint) in [BodyJoint::LeftCollar, BodyJoint::RightCollar]
        .into_iter()
        .enumerate()
    {
        if sources[joint as usize].is_none() {
            sources[joint as usize] = Some(Source::Between(vec![neck, shoulders[side]], 0.4));
        }
    }
    Ok(Mapping {
        sources: sources
            .into_iter()
            .map(|source| source.unwrap_or(Source::Joint(pelvis)))
            .collect(),
        names: joints.iter().map(|joint| joint.name.clone()).collect(),
    })
}

/// Whether the bodies stand along z rather than y.
pub(super) fn lies_along_z(poses: &[Pose]) -> bool {
    let mut sum = [0.0; 3];
    for pose in poses {
        let at = |joint: BodyJoint| pose[joint as usize].map(f64::from);
        let feet = scale(
            add(at(BodyJoint::LeftAnkle), at(BodyJoint::RightAnkle)),
            0.5,
        );
        sum = add(sum, sub(at(BodyJoint::Head), feet));
    }
    sum[2].abs() > 2.0 * sum[1].abs() && sum[2] > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_and_parts_are_read_from_names() {
        for (name, side, part) in [
            ("mixamorig:LeftUpLeg", Some(0), "upleg"),
            ("lShin", Some(0), "shin"),
            ("RHip", Some(1), "hip"),
            ("thigh_l", Some(0), "thigh"),
            ("upper_arm_R", Some(1), "upperarm"),
            ("Left Toe", Some(0), "toe"),
            ("LowerBack", None, "lowerback"),
            ("Root", None, "root"),
        ] {
            assert_eq!(plain(name), (side, part.to_owned()), "{name}");
        }
    }
}
