//! Keeps the robot on the beat: the pace of the motion is bent so that kinematic
//! beats fall on the beats of the music at the servo horn.

pub(crate) mod beat_clock;
pub(crate) mod steering;
pub(crate) mod trajectory_preview;
