//! A robot file: one TOML that names the URDF, the bus, the retargeting and
//! every servo. Degrees and ticks live there; inside, all is radians.

use crate::dance::IdleStyle;
use anyhow::{anyhow, bail};
use serde::Deserialize;
use servodance_drivers::{
    BusConfig, BusLayout, SafetyConfig, SafetySettings, Servo, ServoConfig, check_rate, layouts,
    one_or_several,
};
use servodance_retarget::{Code, RetargetConfig, Retargeter};
use servodance_types::JointLimits;
use std::path::Path;

/// A robot that comes with servodance.
#[derive(Clone, Copy, Debug)]
pub struct BuiltIn {
    /// The name for `--robot`.
    pub name: &'static str,
    /// Where the file lies in the source tree.
    pub file: &'static str,
    toml: &'static str,
    urdf: &'static str,
}

macro_rules! built_in {
    ($name:literal) => {
        BuiltIn {
            name: $name,
            file: concat!("configs/", $name, ".toml"),
            toml: include_str!(concat!("../configs/", $name, ".toml")),
            urdf: include_str!(concat!("../configs/", $name, ".urdf")),
        }
    };
}

/// All built-in robots.
pub const BUILT_IN: &[BuiltIn] = &[
    built_in!("op3"),
    built_in!("torso13"),
    built_in!("neck"),
    built_in!("lite22"),
];

/// Why a robot file cannot be used.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{message}")]
pub struct RobotError {
    /// What kind of mistake it is.
    pub code: Code,
    /// What is wrong; names the file.
    pub message: String,
    /// The description, where that is at fault.
    pub urdf_xml: Option<String>,
}

impl RobotError {
    fn of(code: Code, message: String) -> anyhow::Error {
        let urdf_xml = None;
        anyhow::Error::new(Self {
            code,
            message,
            urdf_xml,
        })
    }
}

/// The robot file as written.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RobotFile {
    name: String,
    description: String,
    urdf: String,
    control_hz: f64,
    #[serde(default)]
    servo_lag_s: f64,
    #[serde(default)]
    idle: IdleStyle,
    #[serde(rename = "bus", deserialize_with = "one_or_several")]
    buses: Vec<BusConfig>,
    #[serde(default)]
    safety: SafetySettings,
    retarget: RetargetConfig,
    #[serde(rename = "joint")]
    joints: Vec<ServoConfig>,
}

/// A robot, checked and ready to be driven.
#[derive(Clone, Debug)]
pub struct Robot {
    /// Its name.
    pub name: String,
    /// One line about it.
    pub description: String,
    /// The URDF text.
    pub urdf_xml: String,
    /// Control cycles a second.
    pub control_hz: f64,
    /// How long the servos take to get where they are told, seconds.
    pub servo_lag_s: f64,
    /// What it does while there is no music.
    pub idle: IdleStyle,
    /// The buses, and which joints are on each.
    pub buses: Vec<BusLayout>,
    /// How the safety layer behaves.
    pub safety: SafetyConfig,
    /// How human motion becomes this robot's.
    pub retarget: RetargetConfig,
    /// The servos, in joint order.
    pub servos: Vec<Servo>,
}

impl Robot {
    /// A built-in robot by name, or a robot file by path.
    pub fn load(name_or_file: &str) -> anyhow::Result<Self> {
        if let Some(built_in) = BUILT_IN.iter().find(|r| r.name == name_or_file) {
            return Self::from_toml(built_in.toml, built_in.file, |_| {
                Ok(built_in.urdf.to_owned())
            });
        }
        let path = Path::new(name_or_file);
        if path.extension().is_none() && !path.exists() {
            let known: Vec<&str> = BUILT_IN.iter().map(|r| r.name).collect();
            bail!(
                "unknown robot \"{name_or_file}\"; built in: {}; or give a robot file (.toml)",
                known.join(", ")
            );
        }
        let unreadable = |message: String| RobotError::of(Code::FileUnreadable, message);
        let text = std::fs::read_to_string(path)
            .map_err(|e| unreadable(format!("cannot read robot file {}: {e}", path.display())))?;
        Self::from_text(&text, path)
    }

    /// The robot that the file at `path` describes when it holds `text`.
    pub fn from_text(text: &str, path: &Path) -> anyhow::Result<Self> {
        let file = path.display().to_string();
        Self::from_toml(text, &file, |urdf| {
            let urdf_path = path.parent().unwrap_or(Path::new(".")).join(urdf);
            std::fs::read_to_string(&urdf_path).map_err(|e| {
                let urdf = urdf_path.display();
                let message = format!("{file}: cannot read urdf {urdf}: {e}");
                RobotError::of(Code::FileUnreadable, message)
            })
        })
    }

    /// Parses and checks a robot file; `file` is its name in messages.
    pub(crate) fn from_toml(
        text: &str,
        file: &str,
        read_urdf: impl FnOnce(&str) -> anyhow::Result<String>,
    ) -> anyhow::Result<Self> {
        let parsed: RobotFile = toml::from_str(text).map_err(|e| {
            let line = e.span().map_or(1, |span| {
                1 + text.as_bytes()[..span.start.min(text.len())]
                    .iter()
                    .filter(|b| **b == b'\n')
                    .count()
            });
            let message = format!("{file}:{line}: {}", one_line(e.message()));
            RobotError::of(Code::Toml, message)
        })?;
        for (key, value, range) in [
            ("control_hz", parsed.control_hz, 20.0..=1000.0),
            ("servo_lag_s", parsed.servo_lag_s, 0.0..=0.5),
        ] {
            if !range.contains(&value) {
                let (low, high) = (range.start(), range.end());
                let message = format!("{file}: {key} = {value} is outside {low}..{high}");
                return Err(RobotError::of(Code::RobotFile, message));
            }
        }
        let (servos, mut buses) = layouts(parsed.buses, &parsed.joints)
            .map_err(|e| RobotError::of(Code::ServoMap, format!("{file}: {e}")))?;
        for bus in &mut buses {
            bus.config.control_hz = Some(parsed.control_hz);
            check_rate(&bus.config, &bus.servos, parsed.control_hz)
                .map_err(|e| RobotError::of(Code::BusRate, format!("{file}: {e}")))?;
        }
        let safety = parsed
            .safety
            .at_hz(parsed.control_hz)
            .map_err(|e| RobotError::of(Code::RobotFile, format!("{file}: {e}")))?;
        let robot = Self {
            urdf_xml: read_urdf(&parsed.urdf)?,
            name: parsed.name,
            description: parsed.description,
            control_hz: parsed.control_hz,
            servo_lag_s: parsed.servo_lag_s,
            idle: parsed.idle,
            buses,
            safety,
            retarget: parsed.retarget,
            servos,
        };
        match robot.retargeter() {
            Ok(_) => Ok(robot),
            Err(error) => Err(anyhow::Error::new(RobotError {
                code: Code::Retarget,
                message: format!("{file}: {error}"),
                urdf_xml: Some(robot.urdf_xml),
            })),
        }
    }

    /// Every driven joint and its limits, in joint order.
    pub fn joint_limits(&self) -> Vec<(String, JointLimits)> {
        let servos = self.servos.iter();
        servos
            .map(|servo| (servo.name.clone(), servo.limits))
            .collect()
    }

    /// The servo of a joint.
    ///
    /// # Errors
    /// There is no such joint; the message lists those there are.
    pub fn servo(&self, joint: &str) -> anyhow::Result<&Servo> {
        let known = || {
            let names: Vec<&str> = self.servos.iter().map(|s| s.name.as_str()).collect();
            names.join(", ")
        };
        let found = self.servos.iter().find(|servo| servo.name == joint);
        found.ok_or_else(|| {
            anyhow!(
                "robot {} has no joint \"{joint}\"; its joints: {}",
                self.name,
                known()
            )
        })
    }

    /// A fresh retargeter for this robot.
    pub fn retargeter(&self) -> anyhow::Result<Retargeter> {
        Ok(Retargeter::new(
            &self.urdf_xml,
            &self.retarget,
            &self.joint_limits(),
            self.control_hz,
        )?)
    }

    /// Seconds between two control cycles.
    pub fn period_s(&self) -> f64 {
        1.0 / self.control_hz
    }
}

/// The text with its line breaks and runs of blanks made single blanks.
fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
