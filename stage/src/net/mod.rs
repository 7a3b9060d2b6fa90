//! The stage on Zenoh: one session a program, two a follower.
//!
//! A leader is a Zenoh router that listens, everybody else a peer that connects to
//! the leader. Nothing is searched by multicast, and by default all stays on this
//! machine. A Zenoh configuration file replaces these defaults: TLS, access
//! control, other topologies.
//!
//! The keys and the removal of duplicates need no network; all else is behind the
//! feature `zenoh`.

#[cfg(feature = "zenoh")]
mod config;
mod deduplicate;
#[cfg(feature = "zenoh")]
mod exposure;
mod keys;
#[cfg(feature = "zenoh")]
mod redundant;
#[cfg(feature = "zenoh")]
mod session;

pub use deduplicate::deduplicated;
pub use keys::StageKeys;

#[cfg(feature = "zenoh")]
pub use config::{LOOPBACK, NetConfig, NetError};
#[cfg(feature = "zenoh")]
pub use exposure::exposure_warning;
#[cfg(feature = "zenoh")]
pub use redundant::{RedundantPublisher, RedundantSession};
#[cfg(feature = "zenoh")]
pub use session::{LivelinessGuard, NetPublisher, NetSession, Subscription};

#[cfg(test)]
pub(crate) use deduplicate::Deduplicator;
