//! Which joint of a named skeleton is which of the 22.
//!
//! Names are those of the usual families of motion files (CMU, LAFAN1, Mixamo,
//! Xsens, Acclaim), unless the user says which joint is which; what lies
//! between two known joints (spine, collars) is taken from the line between them.

use std::collections::BTreeMap;

use servodance_types::{BodyJoint, JOINT_COUNT};

use servodance_model::motion::vec3::{Vec3, add, lerp, norm, scale, sub};
use servodance_model::motion::{Pose, skeleton};

/// Which joint of the file a body joint is, where the guess is to be corrected.
pub type GivenNames = BTreeMap<BodyJoint, String>;

#[derive(Clone, Debug, PartialEq)]
pub(super) struct FileJoint {
    pub name: String,
    pub parent: Option<usize>,
    pub offset: Vec3,
}

#[derive(Clone, Debug, PartialEq)]
enum JointSource {
    Joint(usize),
    /// Along the way between two joints of the file.
    Between(Vec<usize>, f64),
}

/// Which joint of the file each body joint is.
#[derive(Clone, Debug, PartialEq)]
pub struct JointMapping {
    sources: Vec<JointSource>,
    names: Vec<String>,
}

const HIP: &[&str] = &["upleg", "upperleg", "thigh", "femur", "hip", "upleg1"];
const KNEE: &[&str] = &["knee", "leg", "lowerleg", "lowleg", "shin", "calf", "tibia"];
const ANKLE: &[&str] = &["ankle", "foot"];
const TOE: &[&str] = &["toebase", "toe", "toes", "ball", "toebase1"];
const COLLAR: &[&str] = &["collar", "clavicle", "collarbone"];
const SHOULDER: &[&str] = &["arm", "upperarm", "uparm", "shldr", "humerus"];
const ELBOW: &[&str] = &["forearm", "elbow", "lowerarm", "lowarm", "radius"];
const WRIST: &[&str] = &["wrist", "hand"];
/// Acclaim's bones, whose side is one small letter: `lfemur`.
const ACCLAIM: &[&str] = &[
    "hipjoint", "femur", "tibia", "foot", "toes", "clavicle", "humerus", "radius", "wrist", "hand",
    "fingers", "thumb",
];

/// Shares of the way from pelvis to neck at which the three spine joints are.
const SPINE_SHARES: [f64; 3] = [0.239, 0.498, 0.602];

impl JointMapping {
    /// `body joint: joint of the file`, a line each.
    pub fn lines(&self) -> Vec<String> {
        let named = BodyJoint::ALL.iter().zip(&self.sources);
        named
            .map(|(joint, source)| {
                let from = match source {
                    JointSource::Joint(at) => self.names[*at].clone(),
                    JointSource::Between(way, share) => {
                        let end = |at: Option<&usize>| at.map_or("", |at| &self.names[*at]);
                        let (first, last) = (end(way.first()), end(way.last()));
                        format!("{:.0} % of the way from {first} to {last}", share * 100.0)
                    }
                };
                format!("{}: {from}", joint.name())
            })
            .collect()
    }

    pub(super) fn pose(&self, points: &[Vec3]) -> [Vec3; JOINT_COUNT] {
        let at = |source: &JointSource| match source {
            JointSource::Joint(at) => points[*at],
            JointSource::Between(way, share) => along(way, *share, points),
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
    let raw: String = name.chars().filter(|c| c.is_alphanumeric() || *c == '_').collect();
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
        if let Some(rest) = lower.strip_prefix(letter).filter(|rest| ACCLAIM.contains(rest)) {
            return (Some(side), rest.to_owned());
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

/// Fails with the part that is not found and the joints there are.
pub(super) fn map_joints(joints: &[FileJoint], given: &GivenNames) -> Result<JointMapping, String> {
    let names: Vec<(Option<usize>, String)> = joints.iter().map(|j| plain(&j.name)).collect();
    let find = |side: Option<usize>, any: &[&str]| {
        any.iter().find_map(|wanted| names.iter().position(|(s, n)| *s == side && n == wanted))
    };
    let list = || {
        let named = joints.iter().filter(|joint| !joint.name.ends_with(" end"));
        let names: Vec<&str> = named.map(|joint| joint.name.as_str()).take(60).collect();
        names.join(", ")
    };
    let missing = |part: &str| {
        let list = list();
        format!("no joint can be told to be the {part}; the skeleton has: {list}")
    };
    // A skeleton with the names of all 22 joints means them.
    let ours =
        |joint: &BodyJoint| Some((*joint, joints.iter().position(|j| j.name == joint.name())?));
    let mut told: BTreeMap<BodyJoint, usize> = BodyJoint::ALL.iter().filter_map(ours).collect();
    if told.len() < JOINT_COUNT {
        told.clear();
    }
    for (joint, name) in given {
        let at = joints.iter().position(|other| other.name == *name);
        let unknown = || {
            let (joint, list) = (joint.name(), list());
            format!("there is no \"{name}\" to be the {joint}; the skeleton has: {list}")
        };
        told.insert(*joint, at.ok_or_else(unknown)?);
    }
    let is = |joint: BodyJoint| told.get(&joint).copied();
    let child = |at: usize| joints.iter().position(|joint| joint.parent == Some(at));
    let mut sources: Vec<Option<JointSource>> = vec![None; JOINT_COUNT];
    let mut set = |joint: BodyJoint, source: JointSource| sources[joint as usize] = Some(source);
    let pelvis = is(BodyJoint::Pelvis).or_else(|| find(None, &["hips", "pelvis", "hip", "root"]));
    let pelvis = pelvis.unwrap_or(0);
    set(BodyJoint::Pelvis, JointSource::Joint(pelvis));
    let mut shoulders = [0; 2];
    for side in 0..2 {
        let word = ["left", "right"][side];
        let body = |part: &str| {
            BodyJoint::from_name(&format!("{word}_{part}")).unwrap_or(BodyJoint::Pelvis)
        };
        let told = |part: &str| is(body(part));
        let need = |part: &str, any: &[&str]| {
            told(part)
                .or_else(|| find(Some(side), any))
                .ok_or_else(|| missing(&format!("{word}_{part}")))
        };
        let hip = need("hip", HIP)?;
        let knee = need("knee", KNEE)?;
        let ankle = need("ankle", ANKLE)?;
        let elbow = need("elbow", ELBOW)?;
        // "Shoulder" is the collar where there is an upper arm besides.
        let plain_shoulder = find(Some(side), &["shoulder"]);
        let upper = find(Some(side), SHOULDER);
        let shoulder = told("shoulder")
            .or(upper)
            .or(plain_shoulder)
            .ok_or_else(|| missing(&format!("{word}_shoulder")))?;
        let collar = told("collar")
            .or_else(|| find(Some(side), COLLAR))
            .or(plain_shoulder.filter(|_| upper.is_some()));
        let wrist = told("wrist")
            .or_else(|| find(Some(side), WRIST))
            .or_else(|| child(elbow))
            .ok_or_else(|| missing(&format!("{word}_wrist")))?;
        let toe = told("foot")
            .or_else(|| find(Some(side), TOE))
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
            set(body(part), JointSource::Joint(at));
        }
        if let Some(collar) = collar {
            set(body("collar"), JointSource::Joint(collar));
        }
    }
    let neck = is(BodyJoint::Neck).or_else(|| find(None, &["neck", "lowerneck", "neck1", "neck0"]));
    let head = is(BodyJoint::Head)
        .or_else(|| find(None, &["head", "head1"]))
        .or_else(|| neck.and_then(child));
    let neck = neck.or_else(|| head.and_then(|head| joints[head].parent));
    let neck = neck.ok_or_else(|| missing("neck"))?;
    let head = head.unwrap_or(neck);
    set(BodyJoint::Neck, JointSource::Joint(neck));
    set(BodyJoint::Head, JointSource::Joint(head));
    let mut spine = vec![neck];
    while let Some(parent) = spine.last().and_then(|&at| joints[at].parent) {
        spine.push(parent);
        if parent == pelvis {
            break;
        }
    }
    spine.reverse();
    for (joint, share) in
        [BodyJoint::Spine1, BodyJoint::Spine2, BodyJoint::Spine3].into_iter().zip(SPINE_SHARES)
    {
        let told = is(joint).map(JointSource::Joint);
        set(joint, told.unwrap_or_else(|| JointSource::Between(spine.clone(), share)));
    }
    for (side, joint) in [BodyJoint::LeftCollar, BodyJoint::RightCollar].into_iter().enumerate() {
        if sources[joint as usize].is_none() {
            sources[joint as usize] = Some(JointSource::Between(vec![neck, shoulders[side]], 0.4));
        }
    }
    Ok(JointMapping {
        sources: sources
            .into_iter()
            .map(|source| source.unwrap_or(JointSource::Joint(pelvis)))
            .collect(),
        names: joints.iter().map(|joint| joint.name.clone()).collect(),
    })
}

pub(super) fn lies_along_z(poses: &[Pose]) -> bool {
    let mut sum = [0.0; 3];
    for pose in poses {
        let at = |joint: BodyJoint| pose[joint as usize].map(f64::from);
        let feet = scale(add(at(BodyJoint::LeftAnkle), at(BodyJoint::RightAnkle)), 0.5);
        sum = add(sum, sub(at(BodyJoint::Head), feet));
    }
    sum[2].abs() > 2.0 * sum[1].abs() && sum[2] > 0.0
}

/// Bodies that stand along z, turned to stand along y.
pub(super) fn stand_up(poses: &mut [Pose]) {
    for point in poses.iter_mut().flatten() {
        let [x, y, z] = *point;
        *point = [x, z, -y];
    }
}

/// Y up and the usual leg length. Fails with the frame whose position is not finite.
pub(super) fn settle(poses: &mut [Pose]) -> Result<(), String> {
    if lies_along_z(poses) {
        stand_up(poses);
    }
    let size = skeleton::leg_scale(poses) as f32;
    for value in poses.iter_mut().flatten().flatten() {
        *value *= size;
    }
    let finite = |pose: &Pose| pose.iter().flatten().all(|v| v.is_finite());
    match poses.iter().position(|pose| !finite(pose)) {
        Some(frame) => Err(format!("frame {frame}: a position is not finite")),
        None => Ok(()),
    }
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
            ("lfemur", Some(0), "femur"),
            ("lowerneck", None, "lowerneck"),
            ("rightfoot", Some(1), "foot"),
        ] {
            assert_eq!(plain(name), (side, part.to_owned()), "{name}");
        }
    }

    /// A skeleton whose parents are told by indentation.
    fn skeleton(text: &str) -> Vec<FileJoint> {
        let mut open: Vec<(usize, usize)> = Vec::new();
        let mut joints = Vec::new();
        for line in text.lines().filter(|line| !line.trim().is_empty()) {
            let depth = line.len() - line.trim_start().len();
            open.retain(|(other, _)| *other < depth);
            for (k, name) in line.split_whitespace().enumerate() {
                joints.push(FileJoint {
                    name: name.into(),
                    parent: open.last().map(|(_, at)| *at),
                    offset: [0.0; 3],
                });
                open.push((depth + k, joints.len() - 1));
            }
        }
        joints
    }

    /// The names of CMU's BVH files, LAFAN1, Mixamo, Xsens, and CMU's Acclaim files.
    const FAMILIES: [(&str, [&str; 12]); 5] = [
        (
            "Hips\n LHipJoint LeftUpLeg LeftLeg LeftFoot LeftToeBase\n RHipJoint RightUpLeg RightLeg RightFoot \
             RightToeBase\n LowerBack Spine Spine1\n    Neck Neck1 Head\n    LeftShoulder LeftArm LeftForeArm LeftHand \
             LeftFingerBase\n    RightShoulder RightArm RightForeArm RightHand RThumb",
            [
                "Hips",
                "LeftUpLeg",
                "LeftLeg",
                "LeftFoot",
                "LeftToeBase",
                "LeftShoulder",
                "LeftArm",
                "LeftForeArm",
                "LeftHand",
                "Neck",
                "Head",
                "RightHand",
            ],
        ),
        (
            "Hips\n LeftUpLeg LeftLeg LeftFoot LeftToe\n RightUpLeg RightLeg RightFoot RightToe\n Spine Spine1 \
             Spine2\n    Neck Head\n    LeftShoulder LeftArm LeftForeArm LeftHand\n    RightShoulder RightArm \
             RightForeArm RightHand",
            [
                "Hips",
                "LeftUpLeg",
                "LeftLeg",
                "LeftFoot",
                "LeftToe",
                "LeftShoulder",
                "LeftArm",
                "LeftForeArm",
                "LeftHand",
                "Neck",
                "Head",
                "RightHand",
            ],
        ),
        (
            "mixamorig:Hips\n mixamorig:Spine mixamorig:Spine1 mixamorig:Spine2\n    mixamorig:Neck mixamorig:Head \
             mixamorig:HeadTop_End\n    mixamorig:LeftShoulder mixamorig:LeftArm mixamorig:LeftForeArm \
             mixamorig:LeftHand mixamorig:LeftHandThumb1\n    mixamorig:RightShoulder mixamorig:RightArm \
             mixamorig:RightForeArm mixamorig:RightHand\n mixamorig:LeftUpLeg mixamorig:LeftLeg mixamorig:LeftFoot \
             mixamorig:LeftToeBase mixamorig:LeftToe_End\n mixamorig:RightUpLeg mixamorig:RightLeg \
             mixamorig:RightFoot mixamorig:RightToeBase",
            [
                "mixamorig:Hips",
                "mixamorig:LeftUpLeg",
                "mixamorig:LeftLeg",
                "mixamorig:LeftFoot",
                "mixamorig:LeftToeBase",
                "mixamorig:LeftShoulder",
                "mixamorig:LeftArm",
                "mixamorig:LeftForeArm",
                "mixamorig:LeftHand",
                "mixamorig:Neck",
                "mixamorig:Head",
                "mixamorig:RightHand",
            ],
        ),
        (
            "Pelvis\n L5 L3 T12 T8\n     Neck Head\n     RightShoulder RightUpperArm RightForeArm RightHand\n     \
             LeftShoulder LeftUpperArm LeftForeArm LeftHand\n RightUpperLeg RightLowerLeg RightFoot RightToe\n \
             LeftUpperLeg LeftLowerLeg LeftFoot LeftToe",
            [
                "Pelvis",
                "LeftUpperLeg",
                "LeftLowerLeg",
                "LeftFoot",
                "LeftToe",
                "LeftShoulder",
                "LeftUpperArm",
                "LeftForeArm",
                "LeftHand",
                "Neck",
                "Head",
                "RightHand",
            ],
        ),
        (
            "root\n lhipjoint lfemur ltibia lfoot ltoes\n rhipjoint rfemur rtibia rfoot rtoes\n lowerback upperback \
             thorax\n    lowerneck upperneck head\n    lclavicle lhumerus lradius lwrist lhand lfingers\n    \
             rclavicle rhumerus rradius rwrist rhand rthumb",
            [
                "root",
                "lfemur",
                "ltibia",
                "lfoot",
                "ltoes",
                "lclavicle",
                "lhumerus",
                "lradius",
                "lwrist",
                "lowerneck",
                "head",
                "rwrist",
            ],
        ),
    ];

    #[test]
    fn whole_skeletons_of_every_family_are_understood() {
        use BodyJoint::*;
        let parts = [
            Pelvis,
            LeftHip,
            LeftKnee,
            LeftAnkle,
            LeftFoot,
            LeftCollar,
            LeftShoulder,
            LeftElbow,
            LeftWrist,
            Neck,
            Head,
            RightWrist,
        ];
        for (text, wanted) in FAMILIES {
            let mapping = map_joints(&skeleton(text), &GivenNames::new()).unwrap();
            let lines = mapping.lines();
            for (part, wanted) in parts.iter().zip(wanted) {
                assert_eq!(lines[*part as usize], format!("{}: {wanted}", part.name()));
            }
            assert!(lines[Spine2 as usize].contains("50 % of the way"), "{lines:?}");
        }
    }

    #[test]
    fn a_given_name_comes_before_the_guess() {
        let (text, _) = FAMILIES[0];
        let given = |name: &str| GivenNames::from([(BodyJoint::LeftWrist, name.to_owned())]);
        let mapping = map_joints(&skeleton(text), &given("LeftFingerBase")).unwrap();
        assert!(mapping.lines().contains(&"left_wrist: LeftFingerBase".to_owned()));
        let error = map_joints(&skeleton(text), &given("Palm")).unwrap_err();
        assert!(error.contains("there is no \"Palm\" to be the left_wrist"), "{error}");
    }
}
