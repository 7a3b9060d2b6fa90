//! Where on the network a program of a stage is: the same options for all.

use std::path::PathBuf;

/// Which stage, and how it is reached.
#[derive(Clone, Debug, clap::Args)]
pub struct StageNetworkArgs {
    /// Name of the stage; several can share a network.
    #[arg(long, default_value = "main", value_name = "NAME")]
    pub stage: String,
    /// Whom to connect to, such as tcp/192.168.1.5:7448 or tls/HOST:7448; may be
    /// given again. The leader on this machine if left out.
    #[arg(long, value_name = "PROTOCOL/HOST:PORT")]
    pub connect: Vec<String>,
    /// Zenoh's own configuration (JSON5), for TLS, access control and
    /// other networks; see docs/stage.md.
    #[arg(long, value_name = "FILE.json5")]
    pub zenoh_config: Option<PathBuf>,
}

#[cfg(feature = "stage")]
impl StageNetworkArgs {
    /// The same for the network.
    pub fn place(&self, leads: bool, listen: Vec<String>) -> servodance_stage::net::NetConfig {
        servodance_stage::net::NetConfig {
            leads,
            listen,
            connect: self.connect.clone(),
            file: self.zenoh_config.clone(),
        }
    }
}

/// Says how to build what is not there.
#[cfg(not(feature = "stage"))]
pub fn not_built_in(command: &str) -> anyhow::Result<std::process::ExitCode> {
    anyhow::bail!(
        "{command}: this program was built without its network; build with --features stage"
    )
}

/// Which followers dance how.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct RoleArgs {
    /// Dance as the mirror image, or not.
    #[arg(long, value_name = "true|false", num_args = 0..=1, default_missing_value = "true")]
    pub mirror: Option<bool>,
    /// Share of the movement around rest, 0 to 1.
    #[arg(long, value_name = "SHARE")]
    pub amplitude: Option<f32>,
    /// Dance so many beats after the leader, 0 to 64.
    #[arg(long, value_name = "BEATS")]
    pub canon: Option<f32>,
    /// Dance in this style, which the leader invents beside its own.
    #[arg(long, value_name = "NAME")]
    pub style: Option<String>,
}

impl RoleArgs {
    /// The same as a role, its values not looked at.
    pub fn role(&self) -> servodance_stage::messages::Role {
        servodance_stage::messages::Role {
            mirror: self.mirror,
            amplitude: self.amplitude,
            canon_beats: self.canon,
            style: self.style.clone(),
        }
    }
}
