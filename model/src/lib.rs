//! Music features to motion tokens to 22-joint motion.

pub mod metrics;
pub mod motion;
