//! A robot file as it is written: its tables, read with the keys that are set
//! beside it, and the key that an error is about. Units are degrees and ticks.

use super::config_source::{ConfigSource, line_at};
use super::getup_plan::GetupPlan;
use crate::control::idle::IdleStyle;
use crate::process::console::stderr_line;
use serde::Deserialize;
use servodance_drivers::{
    BusConfig, ConfigError, ImuConfig, SafetyConfig, ServoConfig, one_or_several,
};
use servodance_retarget::{DiagnosticCode, RetargetConfig, RetargetError};

/// Why a robot file cannot be used.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{message}")]
#[allow(missing_docs)] // the names say it
pub struct RobotError {
    pub code: DiagnosticCode,
    pub message: String,
    pub urdf_xml: Option<String>,
}

impl RobotError {
    pub(super) fn of(code: DiagnosticCode, message: String) -> anyhow::Error {
        let urdf_xml = None;
        anyhow::Error::new(Self { code, message, urdf_xml })
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RobotFile {
    pub name: String,
    pub description: String,
    pub urdf: String,
    pub control_hz: f64,
    #[serde(default)]
    pub servo_lag_s: f64,
    #[serde(default)]
    pub feed_forward_s: f64,
    #[serde(default)]
    pub placeholder_servos: bool,
    #[serde(default)]
    pub idle: IdleStyle,
    #[serde(rename = "bus", deserialize_with = "one_or_several")]
    pub buses: Vec<BusConfig>,
    #[serde(default)]
    pub imu: Option<ImuConfig>,
    #[serde(default)]
    pub getup: Option<GetupPlan>,
    #[serde(default)]
    pub safety: SafetyConfig,
    pub retarget: RetargetConfig,
    #[serde(rename = "joint")]
    pub joints: Vec<ServoConfig>,
}

/// Reads the file, then sets the keys beside it, each checked by itself.
pub(super) fn parse(source: &ConfigSource) -> anyhow::Result<RobotFile> {
    let read = |text: &str| toml::from_str::<RobotFile>(text);
    let refuse = |message| RobotError::of(DiagnosticCode::Toml, message);
    let parsed = read(source.text).map_err(|e| {
        let line = line_at(source.text, e.span().map_or(0, |span| span.start));
        refuse(format!("{}:{line}: {}", source.file, one_line(e.message())))
    })?;
    if source.overrides.is_empty() {
        return Ok(parsed);
    }
    let check = |text: &str| read(text).map(drop).map_err(|e| one_line(e.message()));
    let (text, ignored) = source.overrides.apply(source.text, check).map_err(refuse)?;
    for variable in ignored {
        stderr_line!("warning: {variable}");
    }
    read(&text).map_err(|e| refuse(one_line(e.message())))
}

pub(super) fn config_path(error: &ConfigError) -> Vec<&str> {
    match error {
        ConfigError::Joint { joint, key, .. } => vec!["joint", joint, key],
        ConfigError::Limits { joint, .. } | ConfigError::Twice { joint, .. } => {
            vec!["joint", joint]
        }
        ConfigError::Bus { key, .. } => vec!["bus", key],
        ConfigError::Imu { key, .. } => vec!["imu", key],
        _ => Vec::new(),
    }
}

pub(super) fn retarget_path(error: &anyhow::Error) -> Vec<&str> {
    match error.downcast_ref::<RetargetError>() {
        Some(RetargetError::Config { key, .. }) => {
            let parts = key.split('.').map(|part| part.split('[').next().unwrap_or(part));
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
