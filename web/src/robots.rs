//! The robots that come with servodance, as far as a kinematic robot needs them: the
//! description, the joints with their limits, and how they are to move. A test holds them
//! against what the program reads out of the same files.

use crate::error::WebError;
use serde::Deserialize;
use servodance_retarget::{RetargetConfig, Retargeter};
use servodance_types::JointLimits;

/// A built-in robot that was read.
#[derive(Clone, Debug)]
pub struct WebRobot {
    /// Its name.
    pub name: String,
    /// One line about it.
    pub description: String,
    /// The text of its description.
    pub urdf_xml: &'static str,
    /// Control cycles a second.
    pub control_hz: f64,
    /// How it is to move.
    pub retarget: RetargetConfig,
    /// Every driven joint and its limits, in joint order.
    pub joints: Vec<(String, JointLimits)>,
}

/// The part of a robot file that is about motion; buses and servos are passed over.
#[derive(Deserialize)]
struct RobotFile {
    name: String,
    description: String,
    control_hz: f64,
    retarget: RetargetConfig,
    joint: Vec<Joint>,
}

/// Degrees, as files have them.
#[derive(Deserialize)]
struct Joint {
    name: String,
    lower_deg: f64,
    upper_deg: f64,
    velocity_deg_s: f64,
    acceleration_deg_s2: f64,
}

impl WebRobot {
    /// A robot by name; the error lists those there are.
    pub fn built_in(name: &str) -> Result<Self, WebError> {
        let robot = servodance_robots::built_in(name).ok_or_else(|| WebError::UnknownRobot {
            found: name.to_owned(),
            known: servodance_robots::names().join(", "),
        })?;
        Self::read(robot.toml, robot.urdf)
            .map_err(|reason| WebError::RobotFile { name: robot.name, reason })
    }

    fn read(file: &str, urdf_xml: &'static str) -> Result<Self, String> {
        let file: RobotFile = toml::from_str(file).map_err(|e| e.to_string())?;
        let joints = file.joint.into_iter().map(|joint| {
            let limits = JointLimits {
                lower_rad: joint.lower_deg.to_radians(),
                upper_rad: joint.upper_deg.to_radians(),
                velocity_rad_s: joint.velocity_deg_s.to_radians(),
                acceleration_rad_s2: joint.acceleration_deg_s2.to_radians(),
            };
            Ok((joint.name, limits.checked()?))
        });
        Ok(Self {
            name: file.name,
            description: file.description,
            urdf_xml,
            control_hz: file.control_hz,
            retarget: file.retarget,
            joints: joints.collect::<Result<_, String>>()?,
        })
    }

    /// A fresh retargeter for this robot.
    pub fn retargeter(&self) -> Result<Retargeter, WebError> {
        Ok(Retargeter::new(self.urdf_xml, &self.retarget, &self.joints, self.control_hz)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_runtime::robot;

    #[test]
    fn robots_are_those_of_the_program() {
        for name in servodance_robots::names() {
            let (here, there) = (WebRobot::built_in(name), robot::Robot::load(name));
            let (here, there) = (here.unwrap(), there.unwrap());
            assert_eq!(here.name, there.name);
            assert_eq!(here.urdf_xml, there.urdf_xml);
            assert_eq!(here.control_hz, there.control_hz);
            assert_eq!(here.retarget, there.retarget);
            assert_eq!(here.joints, there.joint_limits());
        }
    }

    #[test]
    fn unknown_robots_are_told_which_there_are() {
        let error = WebRobot::built_in("r2d2").unwrap_err().to_string();
        assert!(error.contains("r2d2") && error.contains("op3, torso13"), "{error}");
    }
}
