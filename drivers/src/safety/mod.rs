//! The safety layer around every bus: nothing reaches the wire around it.
//!
//! ```text
//!             arm                    ok
//! Disarmed --------> Arming ------------------> Running <-----+
//!    ^                  |                        |    |       | fresh targets, every
//!    |                  | error      bus error,  |    | stale | servo is back,
//!    |                  v      following error,  |    | lost  | hold is over
//!    |                Fault <- servo too hot ----+    v hold  | (ramp in again)
//!    |                  |  ^                        Holding --+
//!    |   arm, or adapter|  |      bus error, ...       |
//!    |   back and rearm |  +---------------------------+
//!    |                  v                              | still stale after hold_s,
//!    |               Arming                            | still lost after rejoin_s
//!    +------------------------ Stopping <--------------+
//!        torque is off                 (or disarm or emergency stop, from any state)
//! ```
//!
//! Every exit ends in torque off: an error, stale targets, `disarm`, and drop.
//!
//! - Targets that are not finite are refused whole and do not count as fresh.
//! - Each command holds position, velocity and acceleration limits relative to
//!   the **last command** ([`Limiter`], `limits.rs`).
//! - [`SafeBus::hold`] brakes and holds on request, for as long as targets stay fresh.
//! - After arming, and after a hold, targets are blended in over `ramp_s` from
//!   where the joints stand.
//! - An emergency stop ([`EStop`]) from any thread turns torque off at the next
//!   tick and stays latched until [`EStop::clear`].
//! - A joint that stays away from its command faults the bus (a blocked arm).
//! - A servo close to its own limits of heat, supply or current moves less
//!   (`derating.rs`); at the limit the bus faults before the servo goes limp.
//! - A **lost servo** (silent, or shut down by itself) stops everything, or is
//!   set aside by policy ([`ServoLost`]) while the others hold or dance on: it
//!   is rebooted where needed, checked, and blended in from where it stands.
//!   More than a quarter of the servos lost is a fault whatever the policy.
//! - A servo **stopped by its own watchdog**, because the host was kept from running, is
//!   known before the next goal is sent (or by standing still), told, and taken on again
//!   after at most `resume_s` of silence: it holds where it stands, and targets are
//!   blended in. After a longer silence torque goes off.
//! - A **wire that loses packets** is told; the bus rides single losses out. A goal that the
//!   bus did not send, because its servo did not answer, does not count as a last command.
//! - An **adapter pulled out** is a fault. With `rearm` it is waited for
//!   (`reconnect_s`); when it is back the bus is checked, armed and ramped in.
//!   Without, only the next `arm` opens the port again.
//!
//! [`SafeBus::transitions`] has every change of state with its cause, and as remarks
//! (`from` equals `to`) servos lost and back, and derating.
//!
//! Time is passed in, in seconds on any clock that only goes forward.
//! [`SafeBus::tick`] is to be called once a control period. The limits are per
//! period, so a late tick slows the motion; a tick that comes less than half a
//! period after the one before (a loop that catches up) does nothing. Neither
//! speeds the motion up.

mod condition;
mod config;
mod derating;
mod error;
mod estop;
mod followed;
mod joint;
mod limits;
mod lost_adapter;
mod lost_servo;
mod rough_wire;
mod safe_bus;
mod state;
mod stillness;
mod stopped_servo;
mod wire_watch;

pub use config::{SafetyConfig, ServoLost};
pub use error::SafetyError;
pub use estop::EStop;
pub use limits::{Limited, Limiter};
pub use safe_bus::SafeBus;
pub use state::{Interventions, State, Transition};
