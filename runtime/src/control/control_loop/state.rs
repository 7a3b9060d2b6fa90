//! The states of the control loop.

use crate::viewer::Activity;

/// ```text
/// Starting ---- live music ----> Listening ---- stop requested ----+
///    | recording, leader             | motion comes as it is made  |
///    v                               v                             |
/// LeadIn ---- music begins ----> Dancing                           |
///    | stop requested                | music over, stop requested  |
///    +-------------------------------+-----------> LeadOut <-------+
///                                                     | at rest
/// any state: fall ------> draws in, gives way -------->|
/// any state: error or Ctrl-C ------------------------->+--> torque off (the caller)
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoopState {
    Starting,
    Listening,
    LeadIn,
    Dancing,
    LeadOut,
}

impl LoopState {
    pub fn activity(self) -> Activity {
        match self {
            LoopState::Starting => Activity::Starting,
            LoopState::Listening => Activity::Listening,
            LoopState::LeadIn => Activity::Prelude,
            LoopState::Dancing => Activity::Dancing,
            LoopState::LeadOut => Activity::Finale,
        }
    }
}

/// How a run ended, unless by an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    Finished,
    Stopped,
    /// Dead-man mode: no operator was there any more.
    Unattended,
    /// The robot fell: it has given way, and torque is to go off.
    Fell,
    /// Ctrl-C, or the caller's `stop`.
    Interrupted,
}

/// Why torque goes off after a run; `finished` is said where the music was over.
pub fn disarm_cause(ending: &anyhow::Result<Ending>, finished: &'static str) -> &'static str {
    match ending {
        Ok(Ending::Finished) => finished,
        Ok(Ending::Stopped | Ending::Unattended) => "stopped on request",
        Ok(Ending::Fell) => "the robot fell",
        Ok(Ending::Interrupted) => "stopped by the user",
        Err(_) => "an error",
    }
}
