//! Which joint of a file is which of the 22.
//!
//! Names are those of the usual families of motion files (CMU, LAFAN1, Mixamo,
//! Xsens, Acclaim), unless the user says which joint is which; what lies
//! between two known joints (spine, collars) is taken from the line between them.

use std::collections::BTreeMap;

use servodance_types::{BodyJoint, JOINT_COUNT};

use super::named_skeleton::{FileJoint, GivenNames, JointMapping, JointSource};

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

const PELVIS: &[&str] = &["hips", "pelvis", "hip", "root"];
const NECK: &[&str] = &["neck", "lowerneck", "neck1", "neck0"];
const HEAD: &[&str] = &["head", "head1"];

/// Shares of the way from pelvis to neck at which the three spine joints are.
const SPINE_SHARES: [f64; 3] = [0.239, 0.498, 0.602];

/// A collar that no joint is: this share of the way from neck to shoulder.
const COLLAR_SHARE: f64 = 0.4;
/// Names in an error message.
const LISTED: usize = 60;

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
    let search = JointSearch::new(joints, given)?;
    let pelvis = search.told_or_named(BodyJoint::Pelvis, None, PELVIS).unwrap_or(0);
    let mut found = BTreeMap::from([(BodyJoint::Pelvis, pelvis)]);
    for side in 0..2 {
        found.extend(search.limbs(side)?);
    }
    let [neck, head] = search.neck_and_head()?;
    found.extend([(BodyJoint::Neck, neck), (BodyJoint::Head, head)]);
    let spine = search.way(pelvis, neck);
    let source = |joint: &BodyJoint| match (found.get(joint).or(search.told.get(joint)), joint) {
        (Some(&at), _) => JointSource::Joint(at),
        (None, BodyJoint::Spine1) => JointSource::Between(spine.clone(), SPINE_SHARES[0]),
        (None, BodyJoint::Spine2) => JointSource::Between(spine.clone(), SPINE_SHARES[1]),
        (None, BodyJoint::Spine3) => JointSource::Between(spine.clone(), SPINE_SHARES[2]),
        (None, collar) => {
            let right = *collar == BodyJoint::RightCollar;
            let shoulder = of_side(BodyJoint::LeftShoulder, usize::from(right));
            JointSource::Between(vec![neck, found[&shoulder]], COLLAR_SHARE)
        }
    };
    Ok(JointMapping {
        sources: BodyJoint::ALL.iter().map(source).collect(),
        names: joints.iter().map(|joint| joint.name.clone()).collect(),
    })
}

/// A joint of the left side, or its counterpart.
fn of_side(left: BodyJoint, side: usize) -> BodyJoint {
    if side == 0 { left } else { left.mirrored() }
}

struct JointSearch<'a> {
    joints: &'a [FileJoint],
    /// Side and plain name of each.
    names: Vec<(Option<usize>, String)>,
    /// What needs no guess.
    told: BTreeMap<BodyJoint, usize>,
}

impl<'a> JointSearch<'a> {
    fn new(joints: &'a [FileJoint], given: &GivenNames) -> Result<Self, String> {
        let names = joints.iter().map(|joint| plain(&joint.name)).collect();
        let mut search = Self { joints, names, told: BTreeMap::new() };
        let at = |name: &str| joints.iter().position(|joint| joint.name == name);
        let ours = |joint: &BodyJoint| Some((*joint, at(joint.name())?));
        let told: BTreeMap<_, _> = BodyJoint::ALL.iter().filter_map(ours).collect();
        // A skeleton with the names of all 22 joints means them.
        if told.len() == JOINT_COUNT {
            search.told = told;
        }
        for (joint, name) in given {
            let unknown = || {
                let (joint, list) = (joint.name(), search.list());
                format!("there is no \"{name}\" to be the {joint}; the skeleton has: {list}")
            };
            let at = at(name).ok_or_else(unknown)?;
            search.told.insert(*joint, at);
        }
        Ok(search)
    }

    fn list(&self) -> String {
        let named = self.joints.iter().filter(|joint| !joint.name.ends_with(" end"));
        let names: Vec<&str> = named.map(|joint| joint.name.as_str()).take(LISTED).collect();
        names.join(", ")
    }

    fn missing(&self, part: BodyJoint) -> String {
        let (part, list) = (part.name(), self.list());
        format!("no joint can be told to be the {part}; the skeleton has: {list}")
    }

    fn named(&self, side: Option<usize>, any: &[&str]) -> Option<usize> {
        let at = |wanted: &&str| self.names.iter().position(|(s, n)| *s == side && n == wanted);
        any.iter().find_map(at)
    }

    fn told_or_named(&self, part: BodyJoint, side: Option<usize>, any: &[&str]) -> Option<usize> {
        self.told.get(&part).copied().or_else(|| self.named(side, any))
    }

    fn child(&self, at: usize) -> Option<usize> {
        self.joints.iter().position(|joint| joint.parent == Some(at))
    }

    /// The joints of a leg and an arm.
    fn limbs(&self, side: usize) -> Result<Vec<(BodyJoint, usize)>, String> {
        let part = |left: BodyJoint| of_side(left, side);
        let find = |left, any| self.told_or_named(part(left), Some(side), any);
        let need = |left, any| find(left, any).ok_or_else(|| self.missing(part(left)));
        let hip = need(BodyJoint::LeftHip, HIP)?;
        let knee = need(BodyJoint::LeftKnee, KNEE)?;
        let ankle = need(BodyJoint::LeftAnkle, ANKLE)?;
        let elbow = need(BodyJoint::LeftElbow, ELBOW)?;
        // "Shoulder" is the collar where there is an upper arm besides.
        let plain_shoulder = self.named(Some(side), &["shoulder"]);
        let collar_too = self.named(Some(side), SHOULDER).is_some();
        let shoulder = find(BodyJoint::LeftShoulder, SHOULDER).or(plain_shoulder);
        let collar = find(BodyJoint::LeftCollar, COLLAR);
        let wrist = find(BodyJoint::LeftWrist, WRIST).or_else(|| self.child(elbow));
        let toe = find(BodyJoint::LeftFoot, TOE).or_else(|| self.child(ankle));
        let mut limbs = vec![
            (part(BodyJoint::LeftHip), hip),
            (part(BodyJoint::LeftKnee), knee),
            (part(BodyJoint::LeftAnkle), ankle),
            (part(BodyJoint::LeftElbow), elbow),
        ];
        for (left, at) in [(BodyJoint::LeftShoulder, shoulder), (BodyJoint::LeftWrist, wrist)] {
            limbs.push((part(left), at.ok_or_else(|| self.missing(part(left)))?));
        }
        limbs.push((part(BodyJoint::LeftFoot), toe.unwrap_or(ankle)));
        if let Some(at) = collar.or(plain_shoulder.filter(|_| collar_too)) {
            limbs.push((part(BodyJoint::LeftCollar), at));
        }
        Ok(limbs)
    }

    /// Either is taken from the other where it has no name of its own.
    fn neck_and_head(&self) -> Result<[usize; 2], String> {
        let neck = self.told_or_named(BodyJoint::Neck, None, NECK);
        let head = self.told_or_named(BodyJoint::Head, None, HEAD);
        let head = head.or_else(|| self.child(neck?));
        let neck = neck.or_else(|| self.joints[head?].parent);
        let neck = neck.ok_or_else(|| self.missing(BodyJoint::Neck))?;
        Ok([neck, head.unwrap_or(neck)])
    }

    /// From the pelvis up to the neck, both included.
    fn way(&self, pelvis: usize, neck: usize) -> Vec<usize> {
        let mut way = vec![neck];
        while let Some(parent) = way.last().and_then(|&at| self.joints[at].parent) {
            way.push(parent);
            if parent == pelvis {
                break;
            }
        }
        way.reverse();
        way
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
