//! What a researcher needs beside the robot: motion data in, weights out.
//!
//! [`motion`] imports motion capture, [`choreography`] writes motion by rule,
//! [`dataset`] joins motion and music, [`train`] learns the weights of both
//! networks, [`metrics`] scores motion, [`evaluate`] and [`ablate`] score the
//! generator. No crate of the product depends on this one.

pub mod ablate;
pub mod choreography;
pub mod dataset;
pub mod evaluate;
#[cfg(test)]
#[path = "../../model/src/conditioning/golden.rs"]
mod golden;
pub mod metrics;
pub mod motion;
pub mod runs;
pub mod train;
pub mod weights_file;
