//! Motion of other programs: six file formats onto the 22-joint skeleton,
//! checks of what was read, and the tempo of a motion.

mod acclaim;
#[cfg_attr(not(feature = "candle"), allow(dead_code, reason = "data sets need its genres"))]
pub(crate) mod aist;
mod bvh;
pub mod format;
#[cfg_attr(not(feature = "candle"), allow(dead_code, reason = "figures of text need the rest"))]
pub(crate) mod humanml;
mod joint_search;
pub(crate) mod named_skeleton;
mod pickle;
mod smpl;
#[cfg(feature = "candle")]
pub(crate) mod soundness;
#[cfg(feature = "candle")]
pub(crate) mod tempo;
