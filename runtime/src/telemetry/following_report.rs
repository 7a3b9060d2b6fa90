//! Whether the servos followed, and what went wrong with each on the wire, for the report.

use super::joint_share::JointShare;
use serde::{Deserialize, Serialize};
use servodance_drivers::ServoErrors;

/// A joint that follows less than this share of the cycles has not danced.
const ENOUGH: f64 = 0.9;

/// The share of cycles in which each joint was where its command had been a moment before.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FollowingReport {
    /// Over all joints.
    pub share: f64,
    /// The joint that followed least.
    pub least: Option<JointShare>,
}

impl FollowingReport {
    /// From the shares of the joints, in their order.
    pub fn new<'a>(joints: impl Iterator<Item = &'a str>, shares: &[f64]) -> Self {
        let least = joints.zip(shares).min_by(|a, b| a.1.total_cmp(b.1));
        Self {
            share: shares.iter().sum::<f64>() / shares.len().max(1) as f64,
            least: least.map(|(joint, &share)| JointShare { joint: joint.into(), share }),
        }
    }

    /// Refuses to call a dance one in which a joint did not follow.
    pub fn refuse_frozen(&self) -> anyhow::Result<()> {
        match &self.least {
            Some(JointShare { joint, share }) if *share < ENOUGH => anyhow::bail!(
                "{joint} followed its commands in {:.0} % of the cycles only, {:.0} % are expected: \
                 was it held, overloaded or stopped by its own watchdog?",
                share * 100.0,
                ENOUGH * 100.0
            ),
            _ => Ok(()),
        }
    }

    /// A line for people; `None` where every joint followed all the time.
    pub fn line(&self) -> Option<String> {
        let least = self.least.as_ref().filter(|least| least.share < 0.995)?;
        Some(format!(
            "{:.1} % of the cycles, least {} with {:.1} %",
            self.share * 100.0,
            least.joint,
            least.share * 100.0
        ))
    }
}

/// What went wrong with one servo on the wire.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ServoErrorReport {
    /// Its joint.
    pub joint: String,
    /// Answers that did not come.
    pub timeouts: u64,
    /// Damaged answers, or instructions that it heard damaged.
    pub crc_errors: u64,
    /// Questions that it was asked again.
    pub retries: u64,
    /// Cycles for which its state was reckoned.
    pub reckoned: u64,
}

impl ServoErrorReport {
    /// The counts of the servo of a joint.
    pub fn new(joint: &str, errors: ServoErrors) -> Self {
        let ServoErrors { timeouts, crc_errors, retries, reckoned } = errors;
        Self { joint: joint.into(), timeouts, crc_errors, retries, reckoned }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_frozen_joint_among_many_is_refused_by_name() {
        let report = FollowingReport::new(["a", "b"].into_iter(), &[1.0, 0.4]);
        let error = report.refuse_frozen().unwrap_err().to_string();
        assert!(error.contains("b followed") && error.contains("40 %"), "{error}");
        assert_eq!(report.line().unwrap(), "70.0 % of the cycles, least b with 40.0 %");
        let report = FollowingReport::new(["a", "b"].into_iter(), &[1.0, 0.999]);
        assert!(report.refuse_frozen().is_ok() && report.line().is_none());
    }
}
