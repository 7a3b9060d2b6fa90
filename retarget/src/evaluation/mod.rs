//! How well a robot shows a dance.

mod limb_direction_error;

pub use limb_direction_error::{LimbDirectionError, LimbSegment};
