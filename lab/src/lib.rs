//! What judges the product: benches, soak, fault runs, the click test. No crate
//! of the product depends on this one.

pub mod bus_bench;
pub mod click_test;
pub mod model_bench;
pub mod retarget_bench;
pub mod soak;
#[cfg(feature = "stage")]
pub mod stage_bench;
