//! What on this machine stands in the way of a dance, and what to do about it.
//!
//! Everything is looked at, nothing is changed: no setting is made, and no port is
//! written to unless [`servos`] is asked to ask them. Times are measured on the spot, so a busy machine is told
//! as busy.

mod budget;
mod ports;
mod servos;
mod sound;
mod system;

pub use servos::servos;

use crate::robot::Robot;
use serde::Serialize;
use servodance_model::Generator;
use servodance_model::conditioning::Encodec;

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// As it should be.
    Good,
    /// A dance is possible, but may come late or miss something.
    Warning,
    /// No dance in real time with this.
    Bad,
}

/// One thing that was looked at.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[allow(missing_docs)] // the other names say it
pub struct Finding {
    pub area: &'static str,
    pub verdict: Verdict,
    pub what: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remedy: Option<String>,
}

impl Finding {
    fn good(area: &'static str, what: impl Into<String>) -> Self {
        Self { area, verdict: Verdict::Good, what: what.into(), remedy: None }
    }

    fn warning(area: &'static str, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { verdict: Verdict::Warning, remedy: Some(remedy.into()), ..Self::good(area, what) }
    }

    fn bad(area: &'static str, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { verdict: Verdict::Bad, ..Self::warning(area, what, remedy) }
    }
}

/// Looks at everything that a dance of `robot` with `generator` needs.
pub fn examine(
    robot: &Robot,
    generator: &Generator,
    encodec: Option<&Encodec>,
) -> anyhow::Result<Vec<Finding>> {
    let mut findings = vec![system::priority(), system::timer(robot.period_s())];
    findings.extend(system::governor());
    findings.extend(budget::budget(robot, generator, encodec)?);
    findings.push(sound::inputs());
    findings.extend(ports::serial());
    findings.extend(ports::can());
    findings.extend(ports::rates(robot));
    findings.extend(ports::watchdogs(robot));
    Ok(findings)
}
