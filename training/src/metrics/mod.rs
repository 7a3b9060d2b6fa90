//! Figures that say how good motion is, defined as the literature defines them.
//!
//! Offline: nothing here is made for the control loop.

pub mod distribution;
pub mod features;
pub mod quality;
pub mod repetition;
pub mod retrieval;
pub mod t2m;

pub use repetition::{distance_of_dances_m, nearest_figure_m};
pub use retrieval::{Retrieval, retrieval};
