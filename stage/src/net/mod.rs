//! The stage on Zenoh: one session a program, two a follower ([`Twin`]).
//!
//! A leader is a Zenoh router that listens, everybody else a peer that connects
//! to it; nobody is looked for by multicast, and without being told otherwise
//! all stays on this machine ([`LOOPBACK`]). A Zenoh configuration file takes the
//! place of these defaults: TLS, access control, other topologies.
//!
//! Callbacks run on threads of Zenoh: they hand bytes over and return.

mod exposure;
mod twin;

pub use exposure::exposure;
pub use twin::{Twin, TwinVoice};

use crate::wire::MOST_BYTES;
use std::path::{Path, PathBuf};
use std::time::Duration;
use zenoh::bytes::ZBytes;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::{CongestionControl, Priority};
use zenoh::sample::SampleKind;
use zenoh::{Config, Session, Wait};

/// Where a leader listens and a follower connects, if nothing else is said. Not
/// Zenoh's own port, so that a ROS 2 router may run beside it.
pub const LOOPBACK: &str = "tcp/127.0.0.1:7448";
/// A link that was silent for so long is gone, milliseconds.
const LEASE_MS: u32 = 2500;
/// Between attempts to connect, at first and at most, milliseconds.
const RETRY_MS: [u32; 2] = [200, 1000];
/// What stands for a message that is too long to be looked at.
static HUGE: [u8; MOST_BYTES + 1] = [0; MOST_BYTES + 1];

/// Why there is no network.
#[derive(Clone, Debug, thiserror::Error)]
pub enum NetError {
    /// The configuration file.
    #[error("--zenoh-config {file}: {why}")]
    File {
        /// Which.
        file: String,
        /// What is wrong with it.
        why: String,
    },
    /// A setting that Zenoh refuses.
    #[error("{option} {value}: {why}")]
    Setting {
        /// The option that it came from.
        option: &'static str,
        /// As it was given.
        value: String,
        /// What Zenoh says.
        why: String,
    },
    /// The session.
    #[error("cannot open the network ({what}): {why}")]
    Open {
        /// What was to be opened.
        what: String,
        /// What Zenoh says.
        why: String,
    },
    /// Somebody listens there.
    #[error(
        "cannot listen at {0}: it is in use already, perhaps by another leader; end that, or give --listen another port"
    )]
    InUse(String),
    /// Anything on an open session.
    #[error("the network failed at {what}: {why}")]
    Use {
        /// The key.
        what: String,
        /// What Zenoh says.
        why: String,
    },
}

/// Where this program is on the network.
#[derive(Clone, Debug, Default)]
pub struct Place {
    /// Whether it leads: others connect to it.
    pub leads: bool,
    /// Where it listens, such as `tcp/0.0.0.0:7448`.
    pub listen: Vec<String>,
    /// Whom it connects to.
    pub connect: Vec<String>,
    /// A Zenoh configuration file.
    pub file: Option<PathBuf>,
}

impl Place {
    /// The configuration of the session.
    ///
    /// # Errors
    /// A file that is none, an endpoint that Zenoh does not understand.
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
        let (mode, listen, connect) = match self.leads {
            true => (
                "\"router\"",
                json_list(&[LOOPBACK.to_owned()]),
                "[]".to_owned(),
            ),
            false => (
                "\"peer\"",
                "[]".to_owned(),
                json_list(&[LOOPBACK.to_owned()]),
            ),
        };
        let [first, most] = RETRY_MS;
        let retry = format!(
            "{{ period_init_ms: {first}, period_max_ms: {most}, period_increase_factor: 2 }}"
        );
        for (key, value) in [
            ("mode", mode.to_owned()),
            ("listen/endpoints", listen),
            ("connect/endpoints", connect),
            ("connect/retry", retry),
            ("connect/exit_on_failure", "false".to_owned()),
            ("scouting/multicast/enabled", "false".to_owned()),
            ("scouting/gossip/enabled", "false".to_owned()),
            ("transport/link/tx/lease", LEASE_MS.to_string()),
            (
                "transport/link/rx/max_message_size",
                (4 * MOST_BYTES).to_string(),
            ),
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

fn set(config: &mut Config, option: &'static str, key: &str, value: &str) -> Result<(), NetError> {
    config
        .insert_json5(key, value)
        .map_err(|error| NetError::Setting {
            option,
            value: value.to_owned(),
            why: in_a_line(&error),
        })
}

fn json_list(words: &[String]) -> String {
    serde_json::Value::from(words).to_string()
}

/// What Zenoh says, without the places in its source where it says it.
fn in_a_line(error: &impl ToString) -> String {
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

/// An open session.
pub struct Net {
    session: Session,
}

/// Why a session that listens at `endpoints` was not opened.
fn refused(endpoints: &str, why: String) -> NetError {
    if !why.contains("already in use") {
        let what = endpoints.to_owned();
        return NetError::Open { what, why };
    }
    let list = serde_json::from_str::<Vec<String>>(endpoints);
    NetError::InUse(list.map_or_else(|_| endpoints.to_owned(), |list| list.join(", ")))
}

/// Hears until it is dropped.
pub struct Ear(#[expect(dead_code, reason = "it hears as long as it is kept")] Subscriber<()>);

/// A sign of life until it is dropped.
pub struct Token(#[expect(dead_code, reason = "it lives as long as it is kept")] LivelinessToken);

impl Net {
    /// Opens a session. It connects in the background, again and again.
    ///
    /// # Errors
    /// An endpoint that cannot be listened at, for example because another
    /// leader does.
    pub fn open(config: Config) -> Result<Self, NetError> {
        let what = config.get_json("listen/endpoints").unwrap_or_default();
        let opened = zenoh::open(config).wait();
        opened
            .map(|session| Self { session })
            .map_err(|error| refused(&what, in_a_line(&error)))
    }

    /// The id of the session, hexadecimal.
    pub fn id(&self) -> String {
        self.session.zid().to_string()
    }

    /// Hears what is said under `key`; a message too long to be one comes as
    /// one of [`MOST_BYTES`] and one.
    ///
    /// # Errors
    /// The session is over.
    pub fn hear(
        &self,
        key: &str,
        each: impl Fn(&[u8]) + Send + Sync + 'static,
    ) -> Result<Ear, NetError> {
        let ear = self.session.declare_subscriber(key.to_owned());
        let ear = ear.callback(move |sample| {
            let payload = sample.payload();
            match payload.len() {
                0..=MOST_BYTES => each(&payload.to_bytes()),
                _ => each(&HUGE),
            }
        });
        ear.wait().map(Ear).map_err(|error| used(key, &error))
    }

    /// Something to say now and then under `key`. What the network has no room
    /// for is dropped; nobody waits.
    ///
    /// # Errors
    /// The session is over.
    pub fn voice(&self, key: &str) -> Result<Voice, NetError> {
        self.session
            .declare_publisher(key.to_owned())
            .congestion_control(CongestionControl::Drop)
            .priority(Priority::RealTime)
            .express(true)
            .wait()
            .map(Voice)
            .map_err(|error| used(key, &error))
    }

    /// Says something once.
    ///
    /// # Errors
    /// The session is over.
    pub fn say(&self, key: &str, bytes: Vec<u8>) -> Result<(), NetError> {
        self.session
            .put(key, bytes)
            .congestion_control(CongestionControl::Drop)
            .priority(Priority::RealTime)
            .express(true)
            .wait()
            .map_err(|error| used(key, &error))
    }

    /// A sign of life under `key`.
    ///
    /// # Errors
    /// The session is over.
    pub fn token(&self, key: &str) -> Result<Token, NetError> {
        let token = self.session.liveliness().declare_token(key.to_owned());
        token.wait().map(Token).map_err(|error| used(key, &error))
    }

    /// The keys of the signs of life that match, asked for up to `wait`.
    ///
    /// # Errors
    /// The session is over.
    pub fn tokens(&self, pattern: &str, wait: Duration) -> Result<Vec<String>, NetError> {
        let replies = self.session.liveliness().get(pattern.to_owned());
        let replies = replies
            .timeout(wait)
            .wait()
            .map_err(|e| used(pattern, &e))?;
        let mut keys = Vec::new();
        while let Ok(reply) = replies.recv() {
            if let Ok(sample) = reply.result() {
                keys.push(sample.key_expr().to_string());
            }
        }
        Ok(keys)
    }

    /// Tells of every sign of life that matches: its key, and whether it came or
    /// went; those that are there come at once.
    ///
    /// # Errors
    /// The session is over.
    pub fn watch(
        &self,
        pattern: &str,
        each: impl Fn(&str, bool) + Send + Sync + 'static,
    ) -> Result<Ear, NetError> {
        let ear = self
            .session
            .liveliness()
            .declare_subscriber(pattern.to_owned());
        let ear = ear.history(true).callback(move |sample| {
            each(sample.key_expr().as_str(), sample.kind() == SampleKind::Put);
        });
        ear.wait().map(Ear).map_err(|error| used(pattern, &error))
    }
}

/// Says things under one key.
pub struct Voice(Publisher<'static>);

impl Voice {
    /// Says something.
    ///
    /// # Errors
    /// The session is over.
    pub fn say(&self, bytes: Vec<u8>) -> Result<(), NetError> {
        let said = self.0.put(bytes).wait();
        said.map_err(|error| used(self.0.key_expr(), &error))
    }

    /// Says something with something attached.
    ///
    /// # Errors
    /// The session is over.
    pub fn say_with(&self, bytes: Vec<u8>, attachment: &[u8]) -> Result<(), NetError> {
        let attachment = ZBytes::from(attachment.to_vec());
        let said = self.0.put(bytes).attachment(attachment).wait();
        said.map_err(|error| used(self.0.key_expr(), &error))
    }
}

fn used(key: &str, error: &impl ToString) -> NetError {
    NetError::Use {
        what: key.to_owned(),
        why: in_a_line(error),
    }
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

    #[test]
    fn a_port_that_is_in_use_is_said_in_one_clear_line() {
        let why = "no TCP listener: [127.0.0.1:1: Address already in use (os error 98)]";
        let told = super::refused("[\"tcp/127.0.0.1:1\"]", why.into()).to_string();
        assert!(
            told.starts_with("cannot listen at tcp/127.0.0.1:1: it is in use"),
            "{told}"
        );
    }
}
