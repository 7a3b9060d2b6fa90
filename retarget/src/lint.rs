//! Looks a robot description over before a robot is built on it.
//!
//! What [`Retargeter::new`](crate::Retargeter::new) would refuse is an error
//! there; what is usable but suspicious is a [`Finding`] here, with a code that
//! stays the same between versions.

use std::fmt;

use servodance_types::JointLimits;

use crate::urdf::{self, is_driven};
use crate::{RetargetError, RobotModel};

/// Faster than servos turn, rad/s: a placeholder.
const PLACEHOLDER_RAD_S: f64 = 50.0;
/// Ranges wider than this are suspicious for a servo, radians.
const WIDE_RAD: f64 = 315.0 * std::f64::consts::PI / 180.0;
/// A link heavier than this share of the robot, when there are many.
const HEAVY_SHARE: f64 = 0.8;

/// Something suspicious in a description that can be used all the same.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// Stable code, e.g. `velocity-unset`.
    pub code: &'static str,
    /// Name of the joint or link.
    pub subject: String,
    /// What was found, with its value, and what is done about it.
    pub message: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} `{}`: {}", self.code, self.subject, self.message)
    }
}

/// Suspicious things in a URDF, joints first.
///
/// # Errors
/// What makes the description unusable, as [`Retargeter::new`](crate::Retargeter::new)
/// would say it.
pub fn lint(urdf_xml: &str) -> Result<Vec<Finding>, RetargetError> {
    let robot = urdf::read(urdf_xml)?.robot;
    // Builds as well, so that nothing is approved here and refused later.
    RobotModel::new(urdf_xml, &[])?;
    let mut findings = Vec::new();
    for joint in robot.joints.iter().filter(|joint| is_driven(joint)) {
        lint_joint(joint, &mut findings);
        lint_mirror(joint, &robot, &mut findings);
    }
    lint_masses(&robot, &mut findings);
    Ok(findings)
}

fn lint_joint(joint: &urdf_rs::Joint, findings: &mut Vec<Finding>) {
    let mut say = |code, message: String| {
        findings.push(Finding {
            code,
            subject: joint.name.clone(),
            message,
        });
    };
    let limit = &joint.limit;
    if limit.velocity <= 0.0 {
        say(
            "velocity-unset",
            format!(
                "velocity limit {} means unset; the servo map's is used",
                limit.velocity
            ),
        );
    } else if limit.velocity > PLACEHOLDER_RAD_S {
        say(
            "velocity-placeholder",
            format!(
                "velocity limit {} rad/s is a placeholder; the servo map's is used",
                limit.velocity
            ),
        );
    }
    if joint.joint_type == urdf_rs::JointType::Continuous {
        return;
    }
    let (lower, upper) = (limit.lower, limit.upper);
    if lower == upper {
        say(
            "range-unset",
            format!("both position limits are {lower}; the servo map's are used"),
        );
    } else if !(lower..=upper).contains(&0.0) {
        say(
            "zero-outside",
            format!("zero is outside {lower} to {upper}; the nearest limit stands for it"),
        );
    }
    let turns = joint.joint_type == urdf_rs::JointType::Revolute;
    if turns && upper - lower > WIDE_RAD {
        say(
            "range-wide",
            format!(
                "range of {:.0} degrees: a servo may not turn so far",
                (upper - lower).to_degrees()
            ),
        );
    }
}

/// Left and right should allow the same, counted either way round.
fn lint_mirror(joint: &urdf_rs::Joint, robot: &urdf_rs::Robot, findings: &mut Vec<Finding>) {
    let Some(other_name) = right_of(&joint.name) else {
        return;
    };
    let Some(other) = robot.joints.iter().find(|other| other.name == other_name) else {
        findings.push(Finding {
            code: "side-missing",
            subject: joint.name.clone(),
            message: format!("there is no `{other_name}`"),
        });
        return;
    };
    let (a, b) = (&joint.limit, &other.limit);
    let near = |x: f64, y: f64| (x - y).abs() < 0.02;
    let same = near(a.lower, b.lower) && near(a.upper, b.upper);
    let opposite = near(a.lower, -b.upper) && near(a.upper, -b.lower);
    if !same && !opposite {
        findings.push(Finding {
            code: "sides-differ",
            subject: joint.name.clone(),
            message: format!(
                "{} to {}, but `{other_name}` {} to {}: is a sign wrong?",
                a.lower, a.upper, b.lower, b.upper
            ),
        });
    }
}

/// The name of the same joint on the right side.
fn right_of(name: &str) -> Option<String> {
    for (left, right) in [("left", "right"), ("Left", "Right")] {
        if name.contains(left) {
            return Some(name.replacen(left, right, 1));
        }
    }
    match name.strip_prefix("l_") {
        Some(rest) => Some(format!("r_{rest}")),
        None => name.strip_suffix("_l").map(|rest| format!("{rest}_r")),
    }
}

fn lint_masses(robot: &urdf_rs::Robot, findings: &mut Vec<Finding>) {
    let total: f64 = robot.links.iter().map(|l| l.inertial.mass.value).sum();
    if total <= 0.0 {
        findings.push(Finding {
            code: "mass-missing",
            subject: robot.name.clone(),
            message: "no link weighs anything: balance cannot be kept".into(),
        });
        return;
    }
    for link in &robot.links {
        let mass = link.inertial.mass.value;
        if robot.links.len() > 4 && mass > HEAVY_SHARE * total {
            findings.push(Finding {
                code: "mass-absurd",
                subject: link.name.clone(),
                message: format!("{mass} kg of {total} kg in all"),
            });
        }
    }
}

/// Whether a servo map's limits agree with the description's: a wider map is
/// a finding.
pub fn lint_limits(
    urdf_xml: &str,
    joints: &[(String, JointLimits)],
) -> Result<Vec<Finding>, RetargetError> {
    let robot = urdf::read(urdf_xml)?.robot;
    let mut findings = Vec::new();
    for (name, limits) in joints {
        let Some(joint) = robot.joints.iter().find(|joint| joint.name == *name) else {
            continue;
        };
        let limit = &joint.limit;
        let known = limit.lower < limit.upper;
        if known && (limits.lower_rad < limit.lower - 1e-3 || limits.upper_rad > limit.upper + 1e-3)
        {
            findings.push(Finding {
                code: "map-wider",
                subject: name.clone(),
                message: format!(
                    "the servo map allows {:.3} to {:.3} rad, the description {:.3} to {:.3}",
                    limits.lower_rad, limits.upper_rad, limit.lower, limit.upper
                ),
            });
        }
    }
    Ok(findings)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn codes(joint: &str) -> Vec<&'static str> {
        let urdf = format!(
            r#"<robot name="r"><link name="a"><inertial><mass value="1"/>
            <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
            <link name="b"/><joint name="turn" type="revolute"><parent link="a"/>
            <child link="b"/><axis xyz="0 0 1"/>{joint}</joint></robot>"#
        );
        let findings = lint(&urdf).unwrap();
        findings.iter().map(|finding| finding.code).collect()
    }

    #[test]
    fn suspicious_limits_have_codes() {
        let limit = |lower: &str, upper: &str, velocity: &str| {
            format!(r#"<limit lower="{lower}" upper="{upper}" effort="1" velocity="{velocity}"/>"#)
        };
        assert!(codes(&limit("-1", "1", "3")).is_empty());
        assert_eq!(codes(&limit("-1", "1", "0")), ["velocity-unset"]);
        assert_eq!(codes(&limit("-1", "1", "100")), ["velocity-placeholder"]);
        assert_eq!(codes(&limit("0", "0", "3")), ["range-unset"]);
        assert_eq!(codes(&limit("0.5", "1", "3")), ["zero-outside"]);
        assert_eq!(codes(&limit("-3", "3", "3")), ["range-wide"]);
    }

    #[test]
    fn a_knee_that_bends_the_wrong_way_is_found() {
        let op3 = include_str!("../../configs/op3.urdf");
        assert_eq!(lint(op3).unwrap(), []);
        let limits = r#"lower="-0.31416" upper="2.19911""#;
        assert_eq!(op3.matches(limits).count(), 1);
        let wrong = op3.replace(limits, r#"lower="-1.0" upper="2.19911""#);
        let findings = lint(&wrong).unwrap();
        assert_eq!(findings.len(), 1);
        assert_eq!(
            (findings[0].code, findings[0].subject.as_str()),
            ("sides-differ", "l_knee")
        );
    }

    #[test]
    fn built_in_maps_stay_inside_their_descriptions() {
        let limits = |lower_rad, upper_rad| JointLimits {
            lower_rad,
            upper_rad,
            velocity_rad_s: 1.0,
            acceleration_rad_s2: 1.0,
        };
        let op3 = include_str!("../../configs/op3.urdf");
        let map = |upper| vec![("l_el".to_string(), limits(-1.0, upper))];
        assert_eq!(lint_limits(op3, &map(1.0)).unwrap(), []);
        assert_eq!(lint_limits(op3, &map(2.0)).unwrap()[0].code, "map-wider");
    }
}
