//! Two sessions as one, so that a stalled connection delays nothing.
//!
//! TCP delivers bytes in order: while a lost segment is sent again (a fifth of a
//! second at least, three times as long if it is lost twice), all bytes behind it
//! wait. Two connections seldom wait at the same time. So every message goes by
//! both, and the first copy that arrives counts.
//!
//! The second session connects as the first does, by the same configuration and
//! with the same certificate, and listens nowhere.

use super::config::{NetError, set};
use super::deduplicate::{PATHS, deduplicated};
use super::session::{NetPublisher, NetSession, Subscription};
use std::panic::resume_unwind;
use std::sync::Arc;
use zenoh::Config;

/// Two open sessions that carry the same messages.
pub struct RedundantSession([NetSession; PATHS]);

impl RedundantSession {
    /// Opens both sessions, which connect in the background and reconnect.
    /// Errors: those of [`NetSession::open`].
    pub fn open(config: Config) -> Result<Self, NetError> {
        let second = second(config.clone())?;
        // Side by side: each waits half a second for its first connection.
        let [first, second] = std::thread::scope(|scope| {
            let second = scope.spawn(|| NetSession::open(second));
            let first = NetSession::open(config);
            let second = second.join();
            [first, second.unwrap_or_else(|panic| resume_unwind(panic))]
        });
        Ok(Self([first?, second?]))
    }

    /// The first of the two sessions.
    pub fn first(&self) -> &NetSession {
        &self.0[0]
    }

    /// Subscribes to `key`; each message is passed on once.
    /// Errors: those of [`NetSession::subscribe`].
    pub fn subscribe(
        &self,
        key: &str,
        each: impl Fn(&[u8]) + Send + Sync + 'static,
    ) -> Result<[Subscription; PATHS], NetError> {
        let each = Arc::new(deduplicated(each));
        self.both(|net| {
            let each = Arc::clone(&each);
            net.subscribe(key, move |bytes| each(bytes))
        })
    }

    /// A publisher for `key` on both sessions.
    /// Errors: those of [`NetSession::publisher`].
    pub fn publisher(&self, key: &str) -> Result<RedundantPublisher, NetError> {
        self.both(|net| net.publisher(key)).map(RedundantPublisher)
    }

    /// Watches the liveliness tokens that match on each of the two sessions.
    /// Errors: those of [`NetSession::watch_liveliness`].
    pub fn watch_liveliness(
        &self,
        pattern: &str,
        each: impl Fn(&str, bool) + Send + Sync + 'static,
    ) -> Result<[Subscription; PATHS], NetError> {
        let each = Arc::new(each);
        self.both(|net| {
            let each = Arc::clone(&each);
            net.watch_liveliness(pattern, move |key, lives| each(key, lives))
        })
    }

    fn both<T>(
        &self,
        of: impl Fn(&NetSession) -> Result<T, NetError>,
    ) -> Result<[T; PATHS], NetError> {
        let [first, second] = &self.0;
        Ok([of(first)?, of(second)?])
    }
}

/// The configuration of the second session, by that of the first.
fn second(mut config: Config) -> Result<Config, NetError> {
    for (key, value) in [("id", "null"), ("listen/endpoints", "[]")] {
        set(&mut config, "the second connection's", key, value)?;
    }
    Ok(config)
}

/// A publisher for one key on both sessions.
pub struct RedundantPublisher([NetPublisher; PATHS]);

impl RedundantPublisher {
    /// Publishes a message on both sessions.
    /// Errors: a session is over.
    pub fn put(&self, bytes: Vec<u8>) -> Result<(), NetError> {
        let [first, second] = &self.0;
        first.put(bytes.clone())?;
        second.put(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_second_connects_as_the_first_and_has_no_name_or_port_of_it() {
        let first = Config::from_json5(
            r#"{ id: "ab12", mode: "peer", listen: { endpoints: ["tcp/127.0.0.1:7777"] },
                 connect: { endpoints: ["tls/a:1", "tls/b:2"] },
                 transport: { link: { tls: { connect_certificate: "robot.pem" } } } }"#,
        )
        .unwrap();
        let second = second(first.clone()).unwrap();
        for key in ["mode", "connect/endpoints", "transport/link/tls"] {
            let same = [&first, &second].map(|config| config.get_json(key).unwrap());
            assert_eq!(same[0], same[1], "{key}");
        }
        assert_eq!(second.get_json("id").unwrap(), "null");
        assert_eq!(second.get_json("listen/endpoints").unwrap(), "[]");
    }
}
