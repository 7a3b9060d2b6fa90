//! A robot file: one TOML that names the URDF, the bus, the retargeting and
//! every servo. Degrees and ticks live there; inside, all is radians.

use crate::dance::IdleStyle;
use crate::robot_file::{Homes, Origin, Overrides, Stray};
use anyhow::{anyhow, bail};
use serde::Deserialize;
use servodance_drivers::{
    BusConfig, BusLayout, ConfigError, SafetyConfig, SafetyError, Servo,
    ServoConfig, check_rate, layouts, one_or_several,
};
use servodance_retarget::{Code, RetargetConfig, RetargetError, Retargeter};
use servodance_types::JointLimits;
use std::path::{Path, PathBuf};

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
            toml: include_str!(concat!("../../configs/", $name, ".toml")),
            urdf: include_str!(concat!("../../configs/", $name, ".urdf")),
        }
    };
}

impl BuiltIn {
    /// Where its file lies on this machine: beside an installed program, else in
    /// the source tree.
    pub fn place(&self) -> PathBuf {
        let program = std::env::current_exe().unwrap_or_default();
        let prefix = program.ancestors().nth(2).unwrap_or(Path::new(""));
        let installed = prefix.join("share/servodance/robots");
        let installed = installed.join(format!("{}.toml", self.name));
        match installed.is_file() {
            true => installed,
            false => self.file.into(),
        }
    }
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
    safety: SafetyConfig,
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
    /// The folder of its file; none if it is built in.
    pub folder: Option<PathBuf>,
    /// Where its URDF is, seen from there.
    pub urdf: PathBuf,
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
        Self::load_with(name_or_file, &Overrides::default())
    }

    /// The same with keys that are set beside the file.
    pub fn load_with(name_or_file: &str, overrides: &Overrides) -> anyhow::Result<Self> {
        if let Some(built_in) = BUILT_IN.iter().find(|r| r.name == name_or_file) {
            let origin = Origin {
                file: built_in.file,
                text: built_in.toml,
                overrides,
            };
            return Self::from_origin(&origin, |urdf| match named_by_user(&origin) {
                true => description(&origin, Path::new(""), urdf),
                false => Ok(built_in.urdf.to_owned()),
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
        Self::from_text_with(&text, path, overrides)
    }

    /// The robot that the file at `path` describes when it holds `text`.
    pub fn from_text(text: &str, path: &Path) -> anyhow::Result<Self> {
        Self::from_text_with(text, path, &Overrides::default())
    }

    fn from_text_with(text: &str, path: &Path, overrides: &Overrides) -> anyhow::Result<Self> {
        let file = &path.display().to_string();
        let origin = Origin {
            file,
            text,
            overrides,
        };
        let folder = path.parent().unwrap_or(Path::new("."));
        let robot = Self::from_origin(&origin, |urdf| description(&origin, folder, urdf))?;
        let folder = Some(folder.to_owned());
        Ok(Self { folder, ..robot })
    }

    /// Parses and checks a robot file; `file` is its name in messages.
    pub(crate) fn from_toml(
        text: &str,
        file: &str,
        read_urdf: impl FnOnce(&str) -> anyhow::Result<String>,
    ) -> anyhow::Result<Self> {
        let overrides = &Overrides::default();
        let origin = Origin {
            file,
            text,
            overrides,
        };
        Self::from_origin(&origin, read_urdf)
    }

    /// Parses and checks a robot file with what is set beside it.
    fn from_origin(
        origin: &Origin,
        read_urdf: impl FnOnce(&str) -> anyhow::Result<String>,
    ) -> anyhow::Result<Self> {
        let refuse = |code, path: &[&str], what: String| {
            RobotError::of(code, format!("{}: {what}", origin.place(path)))
        };
        let parsed = parse(origin)?;
        for (key, value, range) in [
            ("control_hz", parsed.control_hz, 20.0..=1000.0),
            ("servo_lag_s", parsed.servo_lag_s, 0.0..=0.5),
        ] {
            if !range.contains(&value) {
                let (low, high) = (range.start(), range.end());
                let what = format!("{key} = {value} is outside {low}..{high}");
                return Err(refuse(Code::RobotFile, &[key], what));
            }
        }
        let (servos, mut buses) = layouts(parsed.buses, &parsed.joints)
            .map_err(|e| refuse(Code::ServoMap, &config_path(&e), e.to_string()))?;
        for bus in &mut buses {
            bus.config.control_hz = Some(parsed.control_hz);
            check_rate(&bus.config, &bus.servos, parsed.control_hz)
                .map_err(|e| refuse(Code::BusRate, &["control_hz"], e.to_string()))?;
        }
        let safety = parsed.safety.at(parsed.control_hz).map_err(|e| {
            let path = match &e {
                SafetyError::Config { key, .. } => vec!["safety", *key],
                _ => vec!["safety"],
            };
            refuse(Code::RobotFile, &path, e.to_string())
        })?;
        let robot = Self {
            urdf_xml: read_urdf(&parsed.urdf)?,
            urdf: parsed.urdf.into(),
            folder: None,
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
                message: format!("{}: {error}", origin.place(&retarget_path(&error))),
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

/// Whether the description is not the file's choice but the user's.
fn named_by_user(origin: &Origin) -> bool {
    origin.overrides.source_of(&["urdf"]).is_some()
}

/// Reads the description that a robot file in this folder names: one of the
/// robot's own files, unless the user named it himself.
fn description(origin: &Origin, folder: &Path, urdf: &str) -> anyhow::Result<String> {
    let path = folder.join(urdf);
    let found = match named_by_user(origin) {
        true => Ok(path.clone()),
        false => Homes::of_file(folder).find(&path),
    };
    let at = origin.place(&["urdf"]);
    let refuse = |code, what: String| RobotError::of(code, format!("{at}: {what}"));
    let unreadable = |why: &dyn std::fmt::Display| {
        let what = format!("cannot read urdf {}: {why}", path.display());
        refuse(Code::FileUnreadable, what)
    };
    match found {
        Ok(path) => std::fs::read_to_string(path).map_err(|e| unreadable(&e)),
        Err(Stray::Outside) => {
            let what = format!(
                "urdf {urdf:?} lies outside the robot file's folder: copy it into that folder, \
                 or name it yourself with --set urdf=FILE"
            );
            Err(refuse(Code::FileOutside, what))
        }
        Err(stray) => Err(unreadable(&stray)),
    }
}

/// Reads the file, then sets beside it what is to be set, each held against the
/// parser by itself.
fn parse(origin: &Origin) -> anyhow::Result<RobotFile> {
    let read = |text: &str| toml::from_str::<RobotFile>(text);
    let parsed = read(origin.text).map_err(|e| {
        let before = e.span().map_or(0, |span| span.start.min(origin.text.len()));
        let lines = origin.text.as_bytes()[..before].iter();
        let line = 1 + lines.filter(|b| **b == b'\n').count();
        let message = format!("{}:{line}: {}", origin.file, one_line(e.message()));
        RobotError::of(Code::Toml, message)
    })?;
    if origin.overrides.is_empty() {
        return Ok(parsed);
    }
    let check = |text: &str| read(text).map(drop).map_err(|e| one_line(e.message()));
    let text = origin.overrides.apply(origin.text, check);
    let text = text.map_err(|message| RobotError::of(Code::Toml, message))?;
    read(&text).map_err(|e| RobotError::of(Code::Toml, one_line(e.message())))
}

/// Which key of a robot file an error is about.
fn config_path(error: &ConfigError) -> Vec<&str> {
    match error {
        ConfigError::Joint { joint, key, .. } => vec!["joint", joint, key],
        ConfigError::Limits { joint, .. } | ConfigError::Twice { joint, .. } => {
            vec!["joint", joint]
        }
        ConfigError::Bus { key, .. } => vec!["bus", key],
        _ => Vec::new(),
    }
}

/// The same for the retargeter's errors.
fn retarget_path(error: &anyhow::Error) -> Vec<&str> {
    match error.downcast_ref::<RetargetError>() {
        Some(RetargetError::Config { key, .. }) => {
            let parts = key
                .split('.')
                .map(|part| part.split('[').next().unwrap_or(part));
            std::iter::once("retarget").chain(parts).collect()
        }
        Some(RetargetError::NoSuchLink { part, .. }) => vec!["retarget", "body", part],
        Some(RetargetError::NoSuchJoint { name, .. }) => vec!["joint", name],
        _ => Vec::new(),
    }
}

/// The text with its line breaks and runs of blanks made single blanks.
fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
