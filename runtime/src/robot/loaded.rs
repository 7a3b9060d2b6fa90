//! A robot that was loaded from its file and checked. Radians, metres, seconds.

use super::config_source::ConfigSource;
use super::getup_plan::GetupPlan;
use super::overrides::Overrides;
use super::robot_file::{RobotError, config_path, parse, retarget_path};
use super::robot_folders::{FileRefused, RobotFolders};
use crate::control::idle::IdleStyle;
use anyhow::{anyhow, bail};
use servodance_drivers::{
    BusLayout, ImuConfig, SafetyConfig, SafetyError, Servo, assign_imu, check_rate, layouts,
};
use servodance_retarget::{DiagnosticCode, RetargetConfig, Retargeter};
use servodance_types::JointLimits;
use std::path::{Path, PathBuf};

#[derive(Clone, Debug)]
#[allow(missing_docs)] // the names say it
pub struct Robot {
    pub name: String,
    pub description: String,
    /// The folder of its file; none if it is built in.
    pub folder: Option<PathBuf>,
    pub urdf: PathBuf,
    pub urdf_xml: String,
    /// Control cycles a second.
    pub control_hz: f64,
    /// Delay from command to position, seconds.
    pub servo_lag_s: f64,
    /// Seconds of its velocity that a moving joint is sent ahead by.
    pub feed_forward_s: f64,
    /// Whether the servos are placeholders: simulated ones are as strong as the robot's
    /// masses ask for, real ones are not moved.
    pub placeholder_servos: bool,
    pub idle: IdleStyle,
    pub buses: Vec<BusLayout>,
    /// What measures its motion.
    pub imu: Option<ImuConfig>,
    /// Ways from the floor to its feet.
    pub getup: Option<GetupPlan>,
    pub safety: SafetyConfig,
    pub retarget: RetargetConfig,
    pub servos: Vec<Servo>,
}

/// Endings of what `robot new` reads.
const DESCRIPTIONS: [&str; 4] = ["urdf", "xacro", "xml", "mjcf"];

impl Robot {
    /// A built-in robot by name, or a robot file by path.
    pub fn load(name_or_file: &str) -> anyhow::Result<Self> {
        Self::load_with(name_or_file, &Overrides::default())
    }

    /// The same with keys that are set beside the file.
    pub fn load_with(name_or_file: &str, overrides: &Overrides) -> anyhow::Result<Self> {
        if let Some(built_in) = servodance_robots::built_in(name_or_file) {
            let source = ConfigSource { file: built_in.file, text: built_in.toml, overrides };
            return Self::from_source(&source, |urdf| match source.sets_urdf() {
                true => description(&source, Path::new(""), urdf),
                false => Ok(built_in.urdf.to_owned()),
            });
        }
        let path = Path::new(name_or_file);
        if path.extension().is_none() && !path.exists() {
            bail!(
                "unknown robot \"{name_or_file}\"; built in: {}; or give a robot file (.toml)",
                servodance_robots::names().join(", ")
            );
        }
        if path.extension().is_some_and(|ending| DESCRIPTIONS.iter().any(|own| ending == *own)) {
            let file = path.display();
            let message = format!(
                "{file} is a description, not a robot file: `servodance robot new {file}` makes one"
            );
            return Err(RobotError::of(DiagnosticCode::RobotFile, message));
        }
        let text = std::fs::read_to_string(path).map_err(|e| {
            let message = format!("cannot read robot file {}: {e}", path.display());
            RobotError::of(DiagnosticCode::FileUnreadable, message)
        })?;
        Self::from_text_with(&text, path, overrides)
    }

    /// The robot that the file at `path` describes when it holds `text`.
    pub fn from_text(text: &str, path: &Path) -> anyhow::Result<Self> {
        Self::from_text_with(text, path, &Overrides::default())
    }

    fn from_text_with(text: &str, path: &Path, overrides: &Overrides) -> anyhow::Result<Self> {
        let file = &path.display().to_string();
        let source = ConfigSource { file, text, overrides };
        let folder = path.parent().unwrap_or(Path::new("."));
        let robot = Self::from_source(&source, |urdf| description(&source, folder, urdf))?;
        let folder = Some(folder.to_owned());
        Ok(Self { folder, ..robot })
    }

    /// Parses and checks a robot file with what is set beside it.
    pub(super) fn from_source(
        source: &ConfigSource,
        read_urdf: impl FnOnce(&str) -> anyhow::Result<String>,
    ) -> anyhow::Result<Self> {
        let refuse = |code, path: &[&str], what: String| {
            RobotError::of(code, format!("{}: {what}", source.place(path)))
        };
        let parsed = parse(source)?;
        for (key, value, range) in [
            ("control_hz", parsed.control_hz, 20.0..=1000.0),
            ("servo_lag_s", parsed.servo_lag_s, 0.0..=0.5),
            ("feed_forward_s", parsed.feed_forward_s, 0.0..=0.2),
        ] {
            if !range.contains(&value) {
                let (low, high) = (range.start(), range.end());
                let what = format!("{key} = {value} is outside {low}..{high}");
                return Err(refuse(DiagnosticCode::RobotFile, &[key], what));
            }
        }
        let (servos, mut buses) = layouts(parsed.buses, &parsed.joints)
            .map_err(|e| refuse(DiagnosticCode::ServoMap, &config_path(&e), e.to_string()))?;
        if let Some(imu) = &parsed.imu {
            assign_imu(imu, &mut buses)
                .map_err(|e| refuse(DiagnosticCode::ServoMap, &config_path(&e), e.to_string()))?;
        }
        for bus in &mut buses {
            bus.config.control_hz = Some(parsed.control_hz);
            check_rate(&bus.config, &bus.servos, parsed.control_hz)
                .map_err(|e| refuse(DiagnosticCode::BusRate, &["control_hz"], e.to_string()))?;
        }
        if let Some(getup) = &parsed.getup {
            getup
                .check(&servos)
                .map_err(|e| refuse(DiagnosticCode::RobotFile, &["getup"], e.to_string()))?;
        }
        let safety = parsed.safety.at(parsed.control_hz).map_err(|e| {
            let path = match &e {
                SafetyError::Config { key, .. } => vec!["safety", *key],
                _ => vec!["safety"],
            };
            refuse(DiagnosticCode::RobotFile, &path, e.to_string())
        })?;
        let robot = Self {
            urdf_xml: read_urdf(&parsed.urdf)?,
            urdf: parsed.urdf.into(),
            folder: None,
            name: parsed.name,
            description: parsed.description,
            control_hz: parsed.control_hz,
            servo_lag_s: parsed.servo_lag_s,
            feed_forward_s: parsed.feed_forward_s,
            placeholder_servos: parsed.placeholder_servos,
            idle: parsed.idle,
            buses,
            imu: parsed.imu,
            getup: parsed.getup,
            safety,
            retarget: parsed.retarget,
            servos,
        };
        match robot.retargeter() {
            Ok(_) => Ok(robot),
            Err(error) => Err(anyhow::Error::new(RobotError {
                code: DiagnosticCode::Retarget,
                message: format!("{}: {error}", source.place(&retarget_path(&error))),
                urdf_xml: Some(robot.urdf_xml),
            })),
        }
    }

    /// Every driven joint and its limits, in joint order.
    pub fn joint_limits(&self) -> Vec<(String, JointLimits)> {
        let servos = self.servos.iter();
        servos.map(|servo| (servo.name.clone(), servo.limits)).collect()
    }

    /// The servo of a joint; the error lists the joints there are.
    pub fn servo(&self, joint: &str) -> anyhow::Result<&Servo> {
        let found = self.servos.iter().find(|servo| servo.name == joint);
        found.ok_or_else(|| {
            let names: Vec<&str> = self.servos.iter().map(|s| s.name.as_str()).collect();
            let (robot, known) = (&self.name, names.join(", "));
            anyhow!("robot {robot} has no joint \"{joint}\"; its joints: {known}")
        })
    }

    /// A fresh retargeter for this robot: its targets are where the joints are to be.
    pub fn retargeter(&self) -> anyhow::Result<Retargeter> {
        Ok(Retargeter::new(&self.urdf_xml, &self.retarget, &self.joint_limits(), self.control_hz)?)
    }

    /// The same for its servos, with feed-forward.
    pub fn servo_retargeter(&self) -> anyhow::Result<Retargeter> {
        let mut retargeter = self.retargeter()?;
        retargeter.set_feed_forward(self.feed_forward_s);
        Ok(retargeter)
    }

    /// Seconds between two control cycles.
    pub fn period_s(&self) -> f64 {
        1.0 / self.control_hz
    }
}

/// Reads the description that a robot file names: its own, unless the user named it himself.
fn description(source: &ConfigSource, folder: &Path, urdf: &str) -> anyhow::Result<String> {
    let path = folder.join(urdf);
    let found = match source.sets_urdf() {
        true => Ok(path.clone()),
        false => RobotFolders::of_file(folder).find(&path),
    };
    let at = source.place(&["urdf"]);
    let refuse = |code, what: String| RobotError::of(code, format!("{at}: {what}"));
    let unreadable = |why: &dyn std::fmt::Display| {
        let what = format!("cannot read urdf {}: {why}", path.display());
        refuse(DiagnosticCode::FileUnreadable, what)
    };
    match found {
        Ok(path) => std::fs::read_to_string(path).map_err(|e| unreadable(&e)),
        Err(FileRefused::Outside) => {
            let what = format!(
                "urdf {urdf:?} lies outside the robot file's folder: copy it into that folder, \
                 or name it yourself with --set urdf=FILE"
            );
            Err(refuse(DiagnosticCode::FileOutside, what))
        }
        Err(stray) => Err(unreadable(&stray)),
    }
}
