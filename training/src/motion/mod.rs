//! Motion of other programs: six file formats onto the 22-joint skeleton,
//! checks of what was read, and the tempo of a motion.

mod acclaim;
pub(crate) mod aist;
mod bvh;
pub mod format;
pub(crate) mod humanml;
pub(crate) mod named_skeleton;
mod pickle;
mod smpl;
pub(crate) mod soundness;
pub(crate) mod tempo;
