//! The dance in a browser: music in, a robot's links out, in one WebAssembly module.
//!
//! [`Studio`] is what a page needs of servodance: it opens weights, knows the built-in
//! robots, and runs analyzer, generator and retargeter over sound that comes in blocks.
//! The `abi` module hands it out as plain functions over numbers and memory, which
//! `page/studio.js` calls. The robot is kinematic: it is where the retargeter wants it.
//!
//! Units: seconds, metres, radians; sound is mono samples. Not here: servos, buses and the
//! safety layer (`drivers`), robots from files (`runtime`), threads, clocks and files,
//! which the page has no use for.

mod abi;
mod error;
mod robot_track;
mod robots;
mod scene;
mod studio;

pub use error::WebError;
pub use robot_track::RobotTrack;
pub use robots::WebRobot;
pub use scene::scene;
pub use studio::{DanceOptions, HEARD_ROW, MUSIC_ROW, Rows, Studio, heard_of_row, heard_row};
