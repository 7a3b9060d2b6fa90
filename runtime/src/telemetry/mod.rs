//! What a run leaves behind: the recording, the report, pictures and other files.
//!
//! | to | see |
//! |---|---|
//! | write MCAP | `recorder/mcap_file.rs`; what goes into it: [`recorder`] |
//! | read MCAP | [`recorder::Recording`] |
//! | add a key to the report | `report.rs` and `docs/report.md` |
//! | draw a picture | [`picture`] |
//! | write BVH, CSV or GIF | [`export`] |

pub mod export;
mod film;
pub mod following_report;
pub(crate) mod joint_csv;
pub mod joint_share;
mod joint_spans;
pub mod pending_file;
pub mod picture;
pub(crate) mod pose_array;
pub mod recorder;
pub(crate) mod report;
mod violation_report;

pub use joint_spans::JointSpans;
pub use violation_report::ViolationReport;
