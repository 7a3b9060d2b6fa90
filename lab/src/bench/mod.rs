//! Measurements of the product's parts, each with the figure that limits it: a
//! bus against its wire, the model against memory bandwidth, robots on a stage
//! against each other, the beat tracker against songs with known beats, a click against the motion that answers it.

pub mod accents;
pub mod beats;
pub mod bus;
pub mod bus_cycles;
pub mod click_test;
pub mod model;
pub mod retarget;
#[cfg(feature = "stage")]
pub mod stage;
pub mod start_frame;
pub mod sync;
pub mod world;
pub mod world_dump;
