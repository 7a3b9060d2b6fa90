//! Configuration and errors of a session.

use crate::messages::MAX_BYTES;
use std::path::{Path, PathBuf};
use zenoh::Config;

/// Default endpoint of leaders and followers. Not Zenoh's own port, so that a ROS 2
/// router may run beside it.
pub const LOOPBACK: &str = "tcp/127.0.0.1:7448";
/// Silence after which a link is closed, milliseconds.
const LEASE_MS: u32 = 2500;
/// Interval between attempts to connect, at first and at most, milliseconds.
const RETRY_MS: [u32; 2] = [200, 1000];

/// Errors of the network.
#[derive(Clone, Debug, thiserror::Error)]
pub enum NetError {
    /// The Zenoh configuration file cannot be used.
    #[error("--zenoh-config {file}: {why}")]
    File {
        /// Path of the file.
        file: String,
        /// The error of Zenoh in one line.
        why: String,
    },
    /// Zenoh refuses a setting.
    #[error("{option} {value}: {why}")]
    Setting {
        /// The option of the command line.
        option: &'static str,
        /// The value as given by the user.
        value: String,
        /// The error of Zenoh in one line.
        why: String,
    },
    /// The session cannot be opened.
    #[error("cannot open the network ({what}): {why}")]
    Open {
        /// The endpoints of the session.
        what: String,
        /// The error of Zenoh in one line.
        why: String,
    },
    /// Another program listens at these endpoints.
    #[error(
        "cannot listen at {0}: it is in use already, perhaps by another leader; end that, or give --listen another port"
    )]
    InUse(String),
    /// An operation on an open session failed.
    #[error("the network failed at {what}: {why}")]
    Use {
        /// The key of the operation.
        what: String,
        /// The error of Zenoh in one line.
        why: String,
    },
}

/// Endpoints of this program, or its Zenoh configuration file.
#[derive(Clone, Debug, Default)]
pub struct NetConfig {
    /// Whether this program leads: others connect to it.
    pub leads: bool,
    /// Endpoints to listen at, such as `tcp/0.0.0.0:7448`.
    pub listen: Vec<String>,
    /// Endpoints to connect to.
    pub connect: Vec<String>,
    /// Path of a Zenoh configuration file that replaces the defaults.
    pub file: Option<PathBuf>,
}

/// The endpoints that are connected to, as a user would give them.
impl std::fmt::Display for NetConfig {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.connect.as_slice() {
            [] => f.write_str(LOOPBACK),
            endpoints => f.write_str(&endpoints.join(", ")),
        }
    }
}

impl NetConfig {
    /// The Zenoh configuration of the session.
    /// Errors: a file that cannot be read, an endpoint that Zenoh does not understand.
    pub fn config(&self) -> Result<Config, NetError> {
        let mut config = match &self.file {
            Some(file) => read(file)?,
            None => self.defaults()?,
        };
        for (option, key, endpoints) in [
            ("--listen", "listen/endpoints", &self.listen),
            ("--connect", "connect/endpoints", &self.connect),
        ] {
            if !endpoints.is_empty() {
                set(&mut config, option, key, &json_list(endpoints))?;
            }
        }
        Ok(config)
    }

    fn defaults(&self) -> Result<Config, NetError> {
        let mut config = Config::default();
        let (loopback, nowhere) = (json_list(&[LOOPBACK.to_owned()]), "[]".to_owned());
        let (mode, listen, connect) = match self.leads {
            true => ("\"router\"", loopback, nowhere),
            false => ("\"peer\"", nowhere, loopback),
        };
        let [first, most] = RETRY_MS;
        let retry = format!(
            "{{ period_init_ms: {first}, period_max_ms: {most}, period_increase_factor: 2 }}"
        );
        let max_message = (4 * MAX_BYTES).to_string();
        for (key, value) in [
            ("mode", mode.to_owned()),
            ("listen/endpoints", listen),
            ("connect/endpoints", connect),
            ("connect/retry", retry),
            ("connect/exit_on_failure", "false".to_owned()),
            ("scouting/multicast/enabled", "false".to_owned()),
            ("scouting/gossip/enabled", "false".to_owned()),
            ("transport/link/tx/lease", LEASE_MS.to_string()),
            ("transport/link/rx/max_message_size", max_message),
        ] {
            set(&mut config, "the default of", key, &value)?;
        }
        Ok(config)
    }
}

fn read(file: &Path) -> Result<Config, NetError> {
    Config::from_file(file).map_err(|error| NetError::File {
        file: file.display().to_string(),
        why: in_a_line(&error),
    })
}

pub(super) fn set(
    config: &mut Config,
    option: &'static str,
    key: &str,
    value: &str,
) -> Result<(), NetError> {
    config.insert_json5(key, value).map_err(|error| NetError::Setting {
        option,
        value: value.to_owned(),
        why: in_a_line(&error),
    })
}

fn json_list(words: &[String]) -> String {
    serde_json::Value::from(words).to_string()
}

/// The text of an error of Zenoh without the places in its source.
pub(super) fn in_a_line(error: &impl ToString) -> String {
    let text = error.to_string().replace('\n', " ");
    let mut parts = text.split(" at ");
    let mut line = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (place, rest) = part.split_at(part.find(' ').unwrap_or(part.len()));
        if place.contains(".rs:") {
            line += if place.ends_with(']') { "]" } else { "" };
            line += rest;
        } else {
            line += " at ";
            line += part;
        }
    }
    line
}

#[cfg(test)]
mod tests {
    #[test]
    fn what_zenoh_says_is_told_without_where_in_its_source() {
        let said =
            "no listener at tcp/[::1]:1: [in use (os error 98) at /a/tcp.rs:61.] at /b/c.rs:338.";
        let told = super::in_a_line(&said);
        assert_eq!(told, "no listener at tcp/[::1]:1: [in use (os error 98)]");
    }
}
