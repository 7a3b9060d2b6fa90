//! How a joint follows a position that is driven.

/// Position of a link's joint: `scale * positions[joint] + offset`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointDrive {
    pub joint: usize,
    pub scale: f64,
    pub offset: f64,
}
