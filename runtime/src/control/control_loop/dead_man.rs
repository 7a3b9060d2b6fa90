//! Dead-man mode: a robot whose operator is gone holds, then goes to rest.
//!
//! ```text
//! Attended -- silent for N s --> Held -- silent for 2 N s --> Resting
//!    ^                             |
//!    +------ heard again ----------+   (the hold stays until somebody says resume)
//! ```

/// What is to be done now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeadManAction {
    Hold,
    /// To rest, then torque off.
    Rest,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Attended,
    Held,
    Resting,
}

/// Watches how long no operator has been heard.
#[derive(Debug)]
pub struct DeadMan {
    allowed_s: f64,
    stage: Stage,
}

impl DeadMan {
    /// Allows so many seconds without an operator.
    pub fn new(allowed_s: f64) -> Self {
        Self { allowed_s, stage: Stage::Attended }
    }

    /// What a silence of `silent_s` asks for; each action is said once.
    pub fn watch(&mut self, silent_s: f64) -> Option<DeadManAction> {
        match self.stage {
            Stage::Attended if silent_s > self.allowed_s => {
                self.stage = Stage::Held;
                Some(DeadManAction::Hold)
            }
            Stage::Held if silent_s > 2.0 * self.allowed_s => {
                self.stage = Stage::Resting;
                Some(DeadManAction::Rest)
            }
            Stage::Held if silent_s <= self.allowed_s => {
                self.stage = Stage::Attended;
                None
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_holds_then_rests_and_an_operator_who_is_back_starts_it_anew() {
        let mut dead_man = DeadMan::new(2.0);
        let mut at = |silent_s| dead_man.watch(silent_s);
        assert_eq!([at(0.0), at(2.0)], [None, None]);
        assert_eq!([at(2.1), at(2.2)], [Some(DeadManAction::Hold), None]);
        assert_eq!([at(0.1), at(2.1)], [None, Some(DeadManAction::Hold)]);
        assert_eq!([at(4.1), at(4.2)], [Some(DeadManAction::Rest), None]);
        assert_eq!([at(0.0), at(9.0)], [None, None], "it is over");
    }
}
