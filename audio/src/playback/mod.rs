//! The music of a dance out of a loudspeaker, in step with the robot.
//!
//! ```text
//! control loop --[`MusicStart`: one number]--> sound callback --> device
//!                                               [`SongPlayer`] steers its own rate
//! ```
//!
//! The control loop says when, by the clock on the wall, the music begins; a stall of the
//! robot moves that moment. A device plays at a rate of its own and later than it is given
//! samples: the player takes a little more or less than a sample a sample, too little to be
//! heard, until what comes out of the device is the moment that the robot shows. Neither side
//! waits for the other, and the callback allocates nothing.

mod music_start;
mod simulated_device;
mod song_player;
#[cfg(feature = "speaker")]
mod speaker;

pub use music_start::MusicStart;
pub use simulated_device::{Heard, SimulatedDevice, SimulatedSpeaker};
pub use song_player::{SongPlayer, Sound};
#[cfg(feature = "speaker")]
pub use speaker::{Speaker, SpeakerError};
