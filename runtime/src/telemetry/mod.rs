//! What a run leaves behind: recording, report, pictures and other files.

pub mod export;
pub mod joint_csv;
pub mod pending_file;
pub mod picture;
pub mod recorder;
pub mod report;
