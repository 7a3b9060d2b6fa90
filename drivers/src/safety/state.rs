//! States of the safety layer, their changes, and what it changed.

#[allow(missing_docs)] // see the diagram of the parent module
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    Disarmed,
    Arming,
    Running,
    Holding,
    Stopping,
    Fault,
}

/// One change of state; a remark where `from` equals `to`.
#[allow(missing_docs)] // the cause is in words for the user
#[derive(Clone, Debug, PartialEq)]
pub struct Transition {
    pub time_s: f64,
    pub from: State,
    pub to: State,
    pub cause: String,
}

/// How often the safety layer changed what was asked for.
/// Joints count one by one; the ramp after arming does not count.
#[allow(missing_docs)] // each counter says its name
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Interventions {
    pub nan: u64,
    pub position: u64,
    pub velocity: u64,
    pub acceleration: u64,
    pub stale: u64,
    pub early: u64,
    pub derated: u64,
}
