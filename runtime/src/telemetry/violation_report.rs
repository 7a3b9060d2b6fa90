//! How often limits were broken.

use serde::{Deserialize, Serialize};

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[allow(missing_docs)] // docs/report.md
pub struct ViolationReport {
    pub position: u64,
    pub velocity: u64,
    pub acceleration: u64,
}
