//! Motion capture comes in: importers of the usual formats onto the 22-joint
//! skeleton, checks, splits, and the corpus file that training reads.

pub mod aist;
pub mod asf;
pub mod bvh;
pub mod corpus;
pub mod humanml;
pub mod import;
pub mod index;
pub mod named_skeleton;
mod pickle;
pub mod smpl;
pub mod soundness;
pub mod splits;
pub mod tempo;
