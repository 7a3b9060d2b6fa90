//! Two sessions as one, so that a connection that stalls holds nothing up.
//!
//! TCP hands bytes over in their order: while a lost segment is sent again,
//! which takes a fifth of a second at least and three times as long if it is
//! lost twice, all behind it waits. Two connections seldom wait at the same time.
//! So everything is said by both, and of what comes the first copy counts.
//!
//! The second session connects as the first does, by the same configuration and
//! with the same certificate, and listens nowhere.

use super::{Ear, Net, NetError, Voice, set};
use crate::copies::{WAYS, once};
use std::panic::resume_unwind;
use std::sync::Arc;
use zenoh::Config;

/// Two open sessions.
pub struct Twin([Net; WAYS]);

impl Twin {
    /// Opens both. They connect in the background, again and again.
    ///
    /// # Errors
    /// As [`Net::open`].
    pub fn open(config: Config) -> Result<Self, NetError> {
        let second = second(config.clone())?;
        // Side by side: each waits half a second for its first connection.
        let [first, second] = std::thread::scope(|scope| {
            let second = scope.spawn(|| Net::open(second));
            let first = Net::open(config);
            let second = second.join();
            [first, second.unwrap_or_else(|panic| resume_unwind(panic))]
        });
        Ok(Self([first?, second?]))
    }

    /// The first of them.
    pub fn first(&self) -> &Net {
        &self.0[0]
    }

    /// Hears what is said under `key`, each message once.
    ///
    /// # Errors
    /// As [`Net::hear`].
    pub fn hear(
        &self,
        key: &str,
        each: impl Fn(&[u8]) + Send + Sync + 'static,
    ) -> Result<[Ear; WAYS], NetError> {
        let each = Arc::new(once(each));
        self.both(|net| {
            let each = Arc::clone(&each);
            net.hear(key, move |bytes| each(bytes))
        })
    }

    /// Something to say now and then under `key`, by both.
    ///
    /// # Errors
    /// As [`Net::voice`].
    pub fn voice(&self, key: &str) -> Result<TwinVoice, NetError> {
        self.both(|net| net.voice(key)).map(TwinVoice)
    }

    /// Tells of every sign of life that matches, as each of the two sees it.
    ///
    /// # Errors
    /// As [`Net::watch`].
    pub fn watch(
        &self,
        pattern: &str,
        each: impl Fn(&str, bool) + Send + Sync + 'static,
    ) -> Result<[Ear; WAYS], NetError> {
        let each = Arc::new(each);
        self.both(|net| {
            let each = Arc::clone(&each);
            net.watch(pattern, move |key, lives| each(key, lives))
        })
    }

    fn both<T>(&self, of: impl Fn(&Net) -> Result<T, NetError>) -> Result<[T; WAYS], NetError> {
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

/// Says things under one key, by both sessions.
pub struct TwinVoice([Voice; WAYS]);

impl TwinVoice {
    /// Says something.
    ///
    /// # Errors
    /// A session is over.
    pub fn say(&self, bytes: Vec<u8>) -> Result<(), NetError> {
        let [first, second] = &self.0;
        first.say(bytes.clone())?;
        second.say(bytes)
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
