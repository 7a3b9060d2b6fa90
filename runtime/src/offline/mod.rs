//! Work without a robot that moves: motion files, beats of a recording, the built-in song.

pub mod beats;
pub mod generate;
pub mod motion_tracking;
pub mod retarget_motion;
pub mod song_file;
