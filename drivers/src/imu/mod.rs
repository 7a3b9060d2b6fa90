//! Motion sensors on a robot: the `[imu]` table of a robot file, and the boards that
//! a bus reads beside its servos.
//!
//! A reading reaches the control loop in the axes of the root link
//! ([`servodance_types::ImuState`]). A board that does not answer is no error of the
//! bus: its last reading counts for 100 ms, then there is none.

mod config;
mod mounting;
pub mod opencr;
mod reader;

pub use config::{ImuConfig, ImuKind};
pub use mounting::Mounting;
pub(crate) use reader::ImuReader;
