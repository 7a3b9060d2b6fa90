//! One Zenoh session: subscriptions, publishers, liveliness tokens.
//!
//! Callbacks run on threads of Zenoh: they hand bytes over and return.

use super::config::{NetError, in_a_line};
use crate::messages::MAX_BYTES;
use std::time::Duration;
use zenoh::bytes::ZBytes;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::{CongestionControl, Priority};
use zenoh::sample::SampleKind;
use zenoh::{Config, Session, Wait};

/// Stands for a message that is too long to be decoded.
static HUGE: [u8; MAX_BYTES + 1] = [0; MAX_BYTES + 1];

/// An open Zenoh session.
pub struct NetSession {
    session: Session,
}

/// The error of a session that cannot listen at `endpoints`.
fn open_error(endpoints: &str, why: String) -> NetError {
    if !why.contains("already in use") {
        let what = endpoints.to_owned();
        return NetError::Open { what, why };
    }
    let list = serde_json::from_str::<Vec<String>>(endpoints);
    NetError::InUse(list.map_or_else(|_| endpoints.to_owned(), |list| list.join(", ")))
}

/// A subscription that lasts until it is dropped.
pub struct Subscription(#[expect(dead_code, reason = "kept to stay subscribed")] Subscriber<()>);

/// A liveliness token that lasts until it is dropped.
pub struct LivelinessGuard(#[expect(dead_code, reason = "kept to stay alive")] LivelinessToken);

impl NetSession {
    /// Opens a session, which connects in the background and reconnects.
    /// Errors: an endpoint that cannot be listened at, such as that of another leader.
    pub fn open(config: Config) -> Result<Self, NetError> {
        let what = config.get_json("listen/endpoints").unwrap_or_default();
        let opened = zenoh::open(config).wait();
        opened.map(|session| Self { session }).map_err(|error| open_error(&what, in_a_line(&error)))
    }

    /// The hexadecimal id of the session.
    pub fn id(&self) -> String {
        self.session.zid().to_string()
    }

    /// Subscribes to `key`; a message that is too long is passed on as
    /// `MAX_BYTES` and one bytes.
    /// Errors: the session is over.
    pub fn subscribe(
        &self,
        key: &str,
        each: impl Fn(&[u8]) + Send + Sync + 'static,
    ) -> Result<Subscription, NetError> {
        self.subscribe_to(key, move |payload| match payload.len() {
            0..=MAX_BYTES => each(&payload.to_bytes()),
            _ => each(&HUGE),
        })
    }

    /// Subscribes to `key` for what may be longer than a message, up to `most` bytes; what is
    /// longer than that is dropped.
    /// Errors: the session is over.
    pub fn subscribe_up_to(
        &self,
        key: &str,
        most: usize,
        each: impl Fn(&[u8]) + Send + Sync + 'static,
    ) -> Result<Subscription, NetError> {
        self.subscribe_to(key, move |payload| {
            if payload.len() <= most {
                each(&payload.to_bytes());
            }
        })
    }

    fn subscribe_to(
        &self,
        key: &str,
        each: impl Fn(&ZBytes) + Send + Sync + 'static,
    ) -> Result<Subscription, NetError> {
        let subscriber = self.session.declare_subscriber(key.to_owned());
        let subscriber = subscriber.callback(move |sample| each(sample.payload()));
        let subscriber = subscriber.wait().map(Subscription);
        subscriber.map_err(|error| failed(key, &error))
    }

    /// A publisher for `key`. Messages that the network has no room for are
    /// dropped; no call waits.
    /// Errors: the session is over.
    pub fn publisher(&self, key: &str) -> Result<NetPublisher, NetError> {
        self.session
            .declare_publisher(key.to_owned())
            .congestion_control(CongestionControl::Drop)
            .priority(Priority::RealTime)
            .express(true)
            .wait()
            .map(NetPublisher)
            .map_err(|error| failed(key, &error))
    }

    /// A publisher for `key` of what only people look at: after all that the dance needs.
    /// Errors: the session is over.
    pub fn publisher_for_people(&self, key: &str) -> Result<NetPublisher, NetError> {
        self.session
            .declare_publisher(key.to_owned())
            .congestion_control(CongestionControl::Drop)
            .priority(Priority::DataLow)
            .wait()
            .map(NetPublisher)
            .map_err(|error| failed(key, &error))
    }

    /// Publishes one message under `key`.
    /// Errors: the session is over.
    pub fn put(&self, key: &str, bytes: Vec<u8>) -> Result<(), NetError> {
        self.session
            .put(key, bytes)
            .congestion_control(CongestionControl::Drop)
            .priority(Priority::RealTime)
            .express(true)
            .wait()
            .map_err(|error| failed(key, &error))
    }

    /// Declares a liveliness token under `key`.
    /// Errors: the session is over.
    pub fn declare_liveliness(&self, key: &str) -> Result<LivelinessGuard, NetError> {
        let token = self.session.liveliness().declare_token(key.to_owned());
        let token = token.wait().map(LivelinessGuard);
        token.map_err(|error| failed(key, &error))
    }

    /// The keys of the liveliness tokens that match, collected for up to `wait`.
    /// Errors: the session is over.
    pub fn live_keys(&self, pattern: &str, wait: Duration) -> Result<Vec<String>, NetError> {
        let replies = self.session.liveliness().get(pattern.to_owned());
        let replies = replies.timeout(wait).wait();
        let replies = replies.map_err(|error| failed(pattern, &error))?;
        let mut keys = Vec::new();
        while let Ok(reply) = replies.recv() {
            if let Ok(sample) = reply.result() {
                keys.push(sample.key_expr().to_string());
            }
        }
        Ok(keys)
    }

    /// Watches the liveliness tokens that match: calls `each` with the key, and
    /// whether the token appeared or went; present tokens are reported at once.
    /// Errors: the session is over.
    pub fn watch_liveliness(
        &self,
        pattern: &str,
        each: impl Fn(&str, bool) + Send + Sync + 'static,
    ) -> Result<Subscription, NetError> {
        let liveliness = self.session.liveliness();
        let subscriber = liveliness.declare_subscriber(pattern.to_owned());
        let subscriber = subscriber.history(true).callback(move |sample| {
            each(sample.key_expr().as_str(), sample.kind() == SampleKind::Put);
        });
        let subscriber = subscriber.wait().map(Subscription);
        subscriber.map_err(|error| failed(pattern, &error))
    }
}

/// A publisher for one key.
pub struct NetPublisher(Publisher<'static>);

impl NetPublisher {
    /// Publishes a message under the key.
    /// Errors: the session is over.
    pub fn put(&self, bytes: Vec<u8>) -> Result<(), NetError> {
        let put = self.0.put(bytes).wait();
        put.map_err(|error| failed(self.0.key_expr(), &error))
    }

    /// Publishes a message with an attachment.
    /// Errors: the session is over.
    pub fn put_with(&self, bytes: Vec<u8>, attachment: &[u8]) -> Result<(), NetError> {
        let attachment = ZBytes::from(attachment.to_vec());
        let put = self.0.put(bytes).attachment(attachment).wait();
        put.map_err(|error| failed(self.0.key_expr(), &error))
    }
}

fn failed(key: &str, error: &impl ToString) -> NetError {
    NetError::Use { what: key.to_owned(), why: in_a_line(error) }
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_port_that_is_in_use_is_said_in_one_clear_line() {
        let why = "no TCP listener: [127.0.0.1:1: Address already in use (os error 98)]";
        let told = super::open_error("[\"tcp/127.0.0.1:1\"]", why.into()).to_string();
        assert!(told.starts_with("cannot listen at tcp/127.0.0.1:1: it is in use"), "{told}");
    }
}
