//! All that goes into a new robot file.

use super::servo_draft::ServoDraft;
use servodance_model::motion::Clip;
use servodance_retarget::{ConfigDraft, Diagnostic};

pub(super) struct FilePlan<'a> {
    pub name: String,
    pub source: &'a str,
    /// The dance that the robot is tried with.
    pub trial: &'a Clip,
    pub urdf: String,
    pub draft: &'a mut ConfigDraft,
    pub servos: Vec<ServoDraft>,
    pub left_out: Vec<String>,
    pub findings: Vec<Diagnostic>,
    pub rates: (u32, f64),
    pub rest: Vec<(String, f64)>,
    pub tried: Vec<String>,
}
