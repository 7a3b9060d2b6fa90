//! The registers of single servos: read, written, backed up and restored, reset, watched.
//!
//! Torque is never turned on here, and goals are never given. Permanent memory is written
//! while torque is off, one register after the other, each read back.

mod backup;
mod backup_file;
mod place;
mod read;
mod reset;
mod restore;
mod watch;
mod write;

pub use backup::back_up;
pub use place::{ServoPlace, ServoPlaces};
pub use read::read;
pub use reset::factory_reset;
pub use restore::restore;
pub use watch::{Watch, watch};
pub use write::write;
