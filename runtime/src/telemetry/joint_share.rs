//! A joint and a share of something, for the report.

use serde::{Deserialize, Serialize};

/// A joint, and its share of what the key of the report says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)] // each field says its name
pub struct JointShare {
    pub joint: String,
    pub share: f64,
}
