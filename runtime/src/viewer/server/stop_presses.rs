//! Presses of STOP whose pages wait to see them confirmed.
//!
//! A page names each press and repeats it until a frame confirms that name. Confirmed is what
//! was pressed in the same stay of the button in which the control loop verified torque off:
//! the button cannot have been released in between, so torque is off since the press.

use std::collections::VecDeque;

/// Presses that are kept; the oldest are forgotten.
const KEPT: usize = 16;

#[derive(Debug)]
struct StopPress {
    name: String,
    /// How often the button had been released by then.
    releases: u64,
    seen: bool,
}

/// The newest presses.
#[derive(Debug, Default)]
pub struct StopPresses(VecDeque<StopPress>);

impl StopPresses {
    /// A press by this name, again perhaps; the button is down by now.
    pub fn push(&mut self, name: String, releases: u64) {
        self.0.retain(|press| press.name != name);
        if self.0.len() == KEPT {
            self.0.pop_front();
        }
        self.0.push_back(StopPress { name, releases, seen: false });
    }

    /// The page of this press shows that the robot has stopped.
    pub fn see(&mut self, name: &str) {
        for press in self.0.iter_mut().filter(|press| press.name == name) {
            press.seen = true;
        }
    }

    /// Names of the presses that have stopped the robot; `stopped` is what the control loop
    /// says (`RobotStatus::stopped`).
    pub fn confirmed(&self, stopped: Option<u64>) -> impl Iterator<Item = &str> {
        let confirmed = self.0.iter().filter(move |press| Some(press.releases) == stopped);
        confirmed.map(|press| press.name.as_str())
    }

    /// Whether a page still waits to see its press confirmed.
    pub fn is_awaited(&self) -> bool {
        self.0.iter().any(|press| !press.seen)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_press_is_confirmed_by_the_same_stay_of_the_button_alone() {
        let mut presses = StopPresses::default();
        presses.push("a".into(), 3);
        let confirmed = |presses: &StopPresses, stopped| {
            presses.confirmed(stopped).map(str::to_owned).collect::<Vec<_>>()
        };
        assert!(confirmed(&presses, None).is_empty());
        assert!(confirmed(&presses, Some(2)).is_empty(), "an earlier stop");
        assert_eq!(confirmed(&presses, Some(3)), ["a"]);
        assert!(presses.is_awaited());
        presses.see("a");
        assert!(!presses.is_awaited());
        presses.push("a".into(), 4);
        assert!(presses.is_awaited() && confirmed(&presses, Some(3)).is_empty());
        for i in 0..KEPT {
            presses.push(format!("b{i}"), 4);
        }
        assert_eq!(confirmed(&presses, Some(4)).len(), KEPT);
    }
}
