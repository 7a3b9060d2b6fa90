//! How well a robot shows a dance.

pub(crate) mod limb_direction_error;
