//! Many robots on one beat: the network of robots, one leader and its followers.
//!
//! ```text
//! leader:   frames -> Leader -> bytes ==================> network
//! follower: bytes -> Follower (clock, jitter buffer) -> frames in order, and the
//!           motion time that is due -> PlaybackClock -> retargeter
//! ```
//!
//! | module | part |
//! |---|---|
//! | [`messages`] | the messages, byte by byte |
//! | [`clock`] | estimate of the leader's clock, pace of the shown motion |
//! | [`leader`], [`follower`] | the two sides, without network |
//! | [`net`] | keys; sessions on Zenoh (feature `zenoh`) |
//! | [`ros2`] | topics and CDR as ROS 2 has them on Zenoh |
//!
//! All but the sessions is values and arithmetic: time comes in as nanoseconds of
//! the caller's monotonic clock, bytes come in and go out; nothing here waits,
//! prints or opens a socket. No input causes a panic or memory without bound.
//!
//! ```
//! use servodance_stage::messages::{Role, StageFrame};
//! use servodance_stage::{Follower, Leader, Outgoing};
//! use servodance_types::{MotionFrame, MusicFrame, Posture};
//!
//! let mut leader = Leader::new(0, [1; 32]);
//! let mut follower = Follower::new("neck", Role::default(), 0.4, [2; 32]);
//! for now_ns in (0..2_000_000_000).step_by(50_000_000) {
//!     let motion = MotionFrame { time_s: now_ns as f64 * 1e-9 + 0.8, ..Default::default() };
//!     let present_ns = now_ns + 800_000_000;
//!     let music = MusicFrame::default();
//!     let frame = StageFrame::new(present_ns, &music, &motion, Posture::default());
//!     follower.receive(now_ns, &leader.frames(now_ns, 0, "hype", frame))?;
//!     for request in follower.time_requests(now_ns) {
//!         if let Outgoing::Reply(_, replies) = leader.receive(now_ns, &request, || now_ns)? {
//!             replies.iter().try_for_each(|reply| follower.receive(now_ns, reply))?;
//!         }
//!     }
//!     follower.next_frame(now_ns, None, true);
//! }
//! assert_eq!(follower.leader(), Some(leader.instance()));
//! # Ok::<(), servodance_stage::messages::MessageError>(())
//! ```

pub mod clock;
pub mod follower;
pub mod leader;
pub mod messages;
pub mod net;
pub mod ros2;

pub use follower::Follower;
pub use leader::{Leader, Outgoing};
