//! A first `[retarget]` table for a robot that nobody has described yet.
//!
//! Everything that a robot file needs and a description can tell: body parts,
//! axes, stance, capsules, the joints with their limits, and what is missing.
//! What was seen, and how, comes with it in words.

use servodance_types::JointLimits;

use crate::config::{
    BodyKind, BodyLinks, Limb, RetargetConfig, RetargetError, Stance, WheelConfig,
};
use crate::description::guess::{Anatomy, BodyAxes, DrivenWheel, MeshReader, anatomy, capsules};
use crate::description::{Description, guess::words::NameWords, joints::mimic_numbers};
use crate::kinematics::{BodyMap, RobotModel};
use crate::retargeter::Retargeter;

/// Length of a human arm and leg, shoulder to wrist and hip to ankle,
/// metres (the dancer's skeleton).
const HUMAN_ARM_M: f64 = 0.53;
const HUMAN_LEG_M: f64 = 0.82;

/// What a joint does in a dance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointUse {
    /// It shows a limb's movement.
    Dances(Limb),
    /// It turns a wheel, and with it the base.
    TurnsBase,
    /// It has nothing to show: held at rest.
    Held,
    /// It turns a wheel, which is to rest: left out.
    Wheel {
        /// Whether the base could turn by it.
        could_turn_base: bool,
    },
    /// It slides: left out, held where it is.
    Slides,
}

/// One driven joint of the description: radians (metres where it slides),
/// seconds, newton metres; `None` where the description gives nothing usable.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)] // the names say it
pub struct JointDraft {
    pub name: String,
    pub role: JointUse,
    /// Lower and upper position, narrowed for joints that follow it.
    pub range_rad: Option<[f64; 2]>,
    pub velocity_rad_s: Option<f64>,
    pub acceleration_rad_s2: Option<f64>,
    pub jerk_rad_s3: Option<f64>,
    pub effort_nm: Option<f64>,
}

/// What can be told of a robot from its description.
#[derive(Clone, Debug)]
pub struct ConfigDraft {
    /// How sure the kind of body is, and why: a line.
    pub kind_reason: String,
    /// The robot's name in the description.
    pub name: String,
    /// A complete `[retarget]` table.
    pub config: RetargetConfig,
    /// The driven joints, in the order of the description.
    pub joints: Vec<JointDraft>,
    /// The evidence for each guess, a line each.
    pub reasons: Vec<String>,
    /// Movements that a dancer shows and this robot cannot, a line each.
    pub missing: Vec<String>,
    /// Limb and its length against the dancer's.
    pub scales: Vec<(String, f64)>,
}

/// What a draft is told beside the description.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DraftOptions {
    /// The kind of body; guessed where it is not given.
    pub kind: Option<BodyKind>,
    /// Whether the base turns on its wheels. One that is nothing but wheels always does.
    pub wheels: bool,
}

/// Drafts the `[retarget]` table and the joints of a robot from its URDF. `meshes` are asked
/// where a foot, hand or wheel has no other shape.
/// Fails where [`Retargeter::new`] would, and where nothing can show a dance.
pub fn draft_config(
    urdf_xml: &str,
    options: DraftOptions,
    meshes: &MeshReader,
) -> Result<ConfigDraft, RetargetError> {
    let kind = options.kind;
    let description = Description::from_urdf(urdf_xml)?;
    let names: Vec<&str> = description.drives().map(|j| j.name.as_str()).collect();
    if names.is_empty() {
        return Err(RetargetError::Body("no joint moves".into()));
    }
    let mut model = RobotModel::of_description(&description, &names)?;
    let positions = description.zero_positions(model.joint_names());
    let anatomy = anatomy(&model, &positions, kind, meshes);
    let Some(guess) = anatomy.kind.clone() else {
        return Err(RetargetError::Body(no_such_body(kind)));
    };
    let kind = kind.unwrap_or(guess.kind);
    model.add_tips(&anatomy.tips)?;
    let wheel = match options.wheels || kind == BodyKind::Wheeled {
        true => wheel_configs(&anatomy.wheels)?,
        false => Vec::new(),
    };
    let stand = kind == BodyKind::Quadruped || anatomy.can_stand(&model);
    let mut config = RetargetConfig {
        kind,
        stance: if stand { Stance::Planted } else { Stance::Hung },
        forward: BodyAxes::name(&anatomy.axes.forward).into(),
        up: BodyAxes::name(&anatomy.axes.up).into(),
        body: body_links(&model, &anatomy),
        tip: anatomy.tips.clone(),
        capsule: capsules(&model, &positions, &anatomy),
        wheel,
        ..RetargetConfig::default()
    };
    let leg_m: f64 = anatomy.legs[0].lengths_m.iter().sum();
    config.sole_m = match anatomy.sole_m {
        Some(size_m) => size_m.map(|size| (size * 1e3).round() / 1e3),
        None if leg_m > 0.0 => [0.3, 0.13].map(|share| (share * leg_m * 1e3).round() / 1e3),
        None => config.sole_m,
    };
    let joints = joint_drafts(&model, &config, &anatomy.wheels, &description)?;
    let mut reasons = anatomy.reasons.clone();
    let passive: Vec<&str> = description.passive().map(|joint| joint.name.as_str()).collect();
    if !passive.is_empty() {
        reasons.push(format!("passive by name, so they rest: {}", passive.join(", ")));
    }
    for wheel in &config.wheel {
        reasons.push(format!(
            "{} turns the base: radius {} m by its shape",
            wheel.link, wheel.radius_m
        ));
    }
    for tip in &anatomy.tips {
        reasons.push(format!(
            "{} is a new point on {}: the limb's last link ends there, by its shape or mass",
            tip.name, tip.link
        ));
    }
    Ok(ConfigDraft {
        kind_reason: format!("{} (confidence {}): {}", kind.name(), guess.confidence, guess.reason),
        missing: match kind.is_human_like() {
            true => missing(&model, &anatomy, &joints),
            false => Vec::new(),
        },
        scales: match kind.is_human_like() {
            true => scales(&anatomy),
            false => Vec::new(),
        },
        name: description.robot.name,
        config,
        joints,
        reasons,
    })
}

/// Fails where there are no wheels, or nothing tells how large they are.
fn wheel_configs(wheels: &[DrivenWheel]) -> Result<Vec<WheelConfig>, RetargetError> {
    if wheels.is_empty() {
        return Err(RetargetError::Body(
            "no wheels were found that could turn the base: two or more, named so, on level \
             axles on the base itself"
                .into(),
        ));
    }
    let config = |wheel: &DrivenWheel| {
        let radius_m = wheel.radius_m.ok_or_else(|| RetargetError::Link {
            link: wheel.link.clone(),
            reason: "no shape tells the radius of this wheel".into(),
        })?;
        Ok(WheelConfig { link: wheel.link.clone(), radius_m })
    };
    wheels.iter().map(config).collect()
}

fn no_such_body(kind: Option<BodyKind>) -> String {
    let wanted = kind.map_or("no kind of body fits".into(), |kind| {
        format!("it is no {} body: what makes one was not found", kind.name())
    });
    let kinds = BodyKind::ALL.map(BodyKind::name).join(", ");
    format!("nothing of it can show a dance: {wanted} (kinds: {kinds}; --kind says which it is)")
}

pub(super) fn body_links(model: &RobotModel, anatomy: &Anatomy) -> BodyLinks {
    let link = |index: usize| Some(model.link_names()[index].clone());
    let [left_arm, right_arm] = anatomy.arms.clone();
    let [left_leg, right_leg] = anatomy.legs.clone();
    BodyLinks {
        pelvis: link(anatomy.pelvis),
        chest: link(anatomy.chest),
        head: anatomy.head.and_then(link),
        left_shoulder: left_arm.top,
        left_elbow: left_arm.middle,
        left_hand: left_arm.end,
        right_shoulder: right_arm.top,
        right_elbow: right_arm.middle,
        right_hand: right_arm.end,
        left_hip: left_leg.top,
        left_knee: left_leg.middle,
        left_ankle: left_leg.end,
        left_sole: left_leg.sole,
        right_hip: right_leg.top,
        right_knee: right_leg.middle,
        right_ankle: right_leg.end,
        right_sole: right_leg.sole,
    }
}

fn joint_drafts(
    model: &RobotModel,
    config: &RetargetConfig,
    wheels: &[DrivenWheel],
    description: &Description,
) -> Result<Vec<JointDraft>, RetargetError> {
    let map = BodyMap::new(model, config)?;
    let limbs = map.limbs(model);
    let shows = map.shows(model);
    let role = |index: usize, joint: &urdf_rs::Joint| {
        let mut above = model.parent_joints.iter();
        let link = above.position(|name| *name == joint.name);
        let is_wheel = link.is_some_and(|link| NameWords::of(model, link).is_wheel());
        let name = link.map(|link| &model.link_names()[link]);
        let turns_base = config.wheel.iter().any(|wheel| Some(&wheel.link) == name);
        let could_turn_base = wheels.iter().any(|wheel| Some(&wheel.link) == name);
        match joint.joint_type {
            urdf_rs::JointType::Prismatic => JointUse::Slides,
            _ if turns_base => JointUse::TurnsBase,
            urdf_rs::JointType::Continuous if is_wheel => JointUse::Wheel { could_turn_base },
            _ if shows[index] => JointUse::Dances(limbs[index]),
            _ => JointUse::Held,
        }
    };
    let given = |value: f64, most: f64| (value > 0.0 && value < most).then_some(value);
    let drafted = description.drives().enumerate().map(|(index, joint)| {
        let limit = &joint.limit;
        let limited =
            joint.joint_type != urdf_rs::JointType::Continuous && limit.lower < limit.upper;
        let rates = description.rates.get(&joint.name);
        let rates = rates.copied().unwrap_or_default();
        let acceleration = [rates.acceleration, rates.deceleration];
        JointDraft {
            name: joint.name.clone(),
            role: role(index, joint),
            range_rad: limited.then(|| narrowed(joint, &description.robot)),
            velocity_rad_s: given(limit.velocity, 50.0),
            acceleration_rad_s2: acceleration.into_iter().flatten().reduce(f64::min),
            jerk_rad_s3: rates.jerk,
            effort_nm: given(limit.effort, 1000.0),
        }
    });
    Ok(drafted.collect())
}

/// The range in which the joints that follow this one keep theirs, too.
fn narrowed(joint: &urdf_rs::Joint, robot: &urdf_rs::Robot) -> [f64; 2] {
    let (mut lower, mut upper) = (joint.limit.lower, joint.limit.upper);
    for follower in &robot.joints {
        let mimic = follower.mimic.as_ref();
        let Some(mimic) = mimic.filter(|mimic| mimic.joint == joint.name) else {
            continue;
        };
        let (scale, offset) = mimic_numbers(mimic);
        let limit = &follower.limit;
        if scale.abs() < 1e-9 || limit.lower >= limit.upper {
            continue;
        }
        let ends = [limit.lower, limit.upper].map(|end| (end - offset) / scale);
        let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        // A follower whose range does not meet its leader's says nothing.
        if low.max(lower) < high.min(upper) {
            (lower, upper) = (low.max(lower), high.min(upper));
        }
    }
    [lower, upper]
}

fn missing(model: &RobotModel, anatomy: &Anatomy, joints: &[JointDraft]) -> Vec<String> {
    let mut out = Vec::new();
    let between = |from: usize, to: &Option<String>| {
        let to = to.as_deref().and_then(|name| model.link(name))?;
        Some(model.drives_above(to).saturating_sub(model.drives_above(from)))
    };
    for (side, limbs) in ["left", "right"].iter().zip([0, 1]) {
        let (arm, leg) = (&anatomy.arms[limbs], &anatomy.legs[limbs]);
        if !arm.is_there() {
            out.push(format!("no {side} arm"));
        } else {
            let joints = between(anatomy.chest, &arm.middle).unwrap_or(0);
            if arm.end.is_none() {
                out.push(format!("{side} arm: no elbow; it shows the upper arm's direction"));
            } else if joints < 4 {
                // The elbow's own joint is among them.
                let shoulder = joints.saturating_sub(1);
                out.push(format!(
                    "{side} shoulder has {shoulder} of 3 joints: some directions cannot be shown"
                ));
            }
        }
        if !leg.is_there() {
            out.push(format!("no {side} leg"));
        }
    }
    match anatomy.head.map(|head| model.drives_above(head)) {
        None => out.push("no head or neck".into()),
        Some(all) => {
            let neck = all - model.drives_above(anatomy.chest).min(all);
            if neck < 2 {
                out.push(format!("neck has {neck} of 2 joints: it turns or nods, not both"));
            }
        }
    }
    let waist = joints.iter().filter(|joint| joint.role == JointUse::Dances(Limb::Torso)).count();
    if waist < 3 {
        out.push(format!("waist has {waist} of 3 joints"));
    }
    out
}

fn scales(anatomy: &Anatomy) -> Vec<(String, f64)> {
    let limbs = [
        ("left_arm", &anatomy.arms[0], HUMAN_ARM_M),
        ("right_arm", &anatomy.arms[1], HUMAN_ARM_M),
        ("left_leg", &anatomy.legs[0], HUMAN_LEG_M),
        ("right_leg", &anatomy.legs[1], HUMAN_LEG_M),
    ];
    limbs
        .into_iter()
        .filter(|(_, limb, _)| limb.is_there())
        .map(|(name, limb, human_m)| {
            let length_m: f64 = limb.lengths_m.iter().sum();
            (name.to_owned(), length_m / human_m)
        })
        .collect()
}

/// The rest pose that the solver finds for a table, by joint, degrees.
/// Fails where [`Retargeter::new`] does.
pub fn rest_deg(
    urdf_xml: &str,
    config: &RetargetConfig,
    joints: &[(String, JointLimits)],
    control_hz: f64,
) -> Result<Vec<(String, f64)>, RetargetError> {
    let retargeter = Retargeter::new(urdf_xml, config, joints, control_hz)?;
    let rest = retargeter.rest().iter();
    let named = joints.iter().zip(rest);
    Ok(named
        .map(|((name, _), rest)| (name.clone(), (rest.to_degrees() * 100.0).round() / 100.0))
        .collect())
}
