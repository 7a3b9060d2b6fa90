//! The stage: one leader that hears and invents, any number of followers that
//! dance, each by its own robot, limits and safety layer.
//!
//! ```text
//! lead:   music -> generator -> frames with their time ----> network
//! follow: network -> Follower -> stage line -> control loop -> servos
//! ```
//!
//! What goes over the network and how time is told is the crate
//! `servodance-stage`; here it meets the dance. Built with the feature `stage`.

mod cue;
mod follow;
mod lead;
mod robot_teller;
mod ros;
mod shared;
mod stage_show;
mod timeline;

pub use cue::cue;
pub use follow::{FollowReport, StageFollow, follow};
pub use lead::{LeadReport, StageLead, lead};
pub use shared::{cpu_s, shared_s};

use anyhow::Context;
use servodance_stage::net::{NetConfig, NetSession, RedundantSession, StageKeys, exposure_warning};

/// The keys of a stage.
fn keys(stage: &str) -> anyhow::Result<StageKeys> {
    StageKeys::new(stage).with_context(|| {
        format!("--stage \"{stage}\" cannot be a name: letters, digits, `_`, `-` and `.` can")
    })
}

/// Opens the network, and says loudly who else can reach it.
fn open(place: &NetConfig) -> anyhow::Result<NetSession> {
    let config = place.config()?;
    warn(exposure_warning(&config));
    Ok(NetSession::open(config)?)
}

/// The same by two connections.
fn open_twin(place: &NetConfig) -> anyhow::Result<RedundantSession> {
    let config = place.config()?;
    warn(exposure_warning(&config));
    Ok(RedundantSession::open(config)?)
}

fn warn(exposure: Option<String>) {
    if let Some(warning) = exposure {
        crate::process::console::stderr_line!("{warning}");
    }
}
