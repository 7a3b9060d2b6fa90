//! The `[getup]` table of a robot file: poses that take a robot from where it lies, on its
//! front or its back, to its feet. Whoever wrote the file planned and tried them.

use anyhow::{anyhow, bail};
use serde::Deserialize;
use servodance_drivers::Servo;
use std::collections::BTreeMap;

/// Seconds that a pose may take.
const SECONDS: std::ops::RangeInclusive<f64> = 0.1..=10.0;

/// How a robot lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Lying {
    /// Face down.
    Front,
    /// Face up.
    Back,
}

impl Lying {
    /// As the user writes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Front => "front",
            Self::Back => "back",
        }
    }
}

/// One pose on the way up.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct GetupPose {
    /// How long the way there takes at least, seconds, 0.1 to 10.
    pub seconds: f64,
    /// Where joints are then, degrees; the others stay where they were.
    pub deg: BTreeMap<String, f64>,
}

/// The `[getup]` table. The last pose is followed by the rest pose.
#[derive(Clone, Debug, Default, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct GetupPlan {
    /// From lying on the front; empty: there is no way.
    #[serde(default)]
    pub front: Vec<GetupPose>,
    /// From lying on the back.
    #[serde(default)]
    pub back: Vec<GetupPose>,
}

impl GetupPlan {
    /// Refuses joints that are unknown, and what is outside their limits.
    pub(super) fn check(&self, servos: &[Servo]) -> anyhow::Result<()> {
        for (name, poses) in [("front", &self.front), ("back", &self.back)] {
            for (index, pose) in poses.iter().enumerate() {
                let place = format!("getup.{name}[{index}]");
                if !SECONDS.contains(&pose.seconds) {
                    bail!("{place}: seconds = {} is outside 0.1 to 10", pose.seconds);
                }
                for (joint, deg) in &pose.deg {
                    let servo = servos.iter().find(|servo| servo.name == *joint);
                    let servo = servo.ok_or_else(|| {
                        let names: Vec<&str> = servos.iter().map(|s| s.name.as_str()).collect();
                        anyhow!("{place}: no joint \"{joint}\"; there are {}", names.join(", "))
                    })?;
                    let (lower, upper) = (servo.limits.lower_rad, servo.limits.upper_rad);
                    let (lower, upper) = (lower.to_degrees(), upper.to_degrees());
                    if !(lower - 1e-6..=upper + 1e-6).contains(deg) {
                        bail!("{place}: {joint} = {deg} is outside {lower:.1} to {upper:.1}");
                    }
                }
            }
        }
        Ok(())
    }

    /// The poses of a robot that lies so, joint by joint in radians, each with its seconds; the
    /// first one begins at `rest_rad`, the last one is that. Fails where there is no way.
    pub fn poses(
        plan: Option<&Self>,
        robot: &str,
        servos: &[Servo],
        lying: Lying,
        rest_rad: &[f64],
    ) -> anyhow::Result<Vec<(f64, Vec<f64>)>> {
        let planned = plan.map(|plan| match lying {
            Lying::Front => &plan.front,
            Lying::Back => &plan.back,
        });
        let Some(planned) = planned.filter(|poses| !poses.is_empty()) else {
            let side = lying.name();
            bail!(
                "{robot} has no way up from its {side} ([getup] in its file): put it on its feet"
            );
        };
        let mut now = rest_rad.to_vec();
        let mut poses = Vec::with_capacity(planned.len() + 1);
        for pose in planned {
            for (joint, servo) in servos.iter().enumerate() {
                if let Some(deg) = pose.deg.get(&servo.name) {
                    now[joint] = servo.limits.clamp_rad(deg.to_radians());
                }
            }
            poses.push((pose.seconds, now.clone()));
        }
        poses.push((LAST_S, rest_rad.to_vec()));
        Ok(poses)
    }
}

/// How long the way from the last pose to rest takes, seconds.
const LAST_S: f64 = 1.5;
