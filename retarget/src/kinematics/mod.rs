//! Where the links are, and how they move with the joints.

pub(crate) mod body_map;
pub(crate) mod chain;
pub(crate) mod jacobian;
pub(crate) mod shapes;
