//! Weights files: what they hold, and what another number format costs.

mod compare;
mod info;

pub use compare::{FormatComparison, compare};
pub use info::WeightsInfo;
