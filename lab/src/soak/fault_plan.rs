//! The fault plan of a soak: fault injection at random moments, of random kinds,
//! from a seed.
//!
//! Each fault that can pass does pass after a while. Left out: a goal that is
//! lost on the wire. The next one is then a double step by the judge's count,
//! although the host did nothing wrong (`sim/reference/faults.md`).

use rand::Rng;
use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;
use servodance_runtime::robot::Robot;
use servodance_sim::{Cue, Happening, ServoFault, WireFault};

/// Nothing goes wrong in the first seconds: the robot is on its way to the dance.
const FIRST_S: f64 = 1.0;

#[derive(Clone, Debug, PartialEq)]
pub struct PlannedFault {
    /// Name of the fault, one of [`FAULT_KINDS`].
    pub kind: &'static str,
    /// When it begins, seconds since torque on.
    pub at_s: f64,
    /// Its beginning, and its end if it has one.
    pub cues: Vec<Cue>,
}

/// Names of the faults that a plan is drawn from.
pub const FAULT_KINDS: [&str; 13] = [
    "replies lost",
    "replies corrupt",
    "replies cut short",
    "replies doubled",
    "replies preceded by noise",
    "replies late",
    "servo cut off",
    "servo rebooting",
    "servo jammed",
    "servo overloaded",
    "servo hot",
    "servo too hot",
    "adapter pulled out",
];

/// Faults in `seconds` of a dance, one every `every_s` on average.
pub fn faults(
    robot: &Robot,
    seconds: f64,
    every_s: f64,
    rng: &mut ChaCha8Rng,
) -> Vec<PlannedFault> {
    let mut faults = Vec::new();
    let mut at_s = FIRST_S;
    loop {
        at_s += -every_s * rng.random_range(1e-6f64..1.0).ln();
        if at_s >= seconds {
            return faults;
        }
        faults.push(fault(robot, at_s, rng));
    }
}

/// The cues of all faults in the order of time.
pub fn script(faults: &[PlannedFault]) -> Vec<Cue> {
    let mut cues: Vec<Cue> = faults.iter().flat_map(|fault| fault.cues.clone()).collect();
    cues.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    cues
}

fn fault(robot: &Robot, at_s: f64, rng: &mut ChaCha8Rng) -> PlannedFault {
    let kind = FAULT_KINDS.choose(rng).copied().unwrap_or(FAULT_KINDS[0]);
    let joint = rng.random_range(0..robot.servos.len());
    let share = rng.random_range(0.02..0.3);
    let wire = |fault| Happening::Wire(Some((fault, share)));
    let servo = |fault| Happening::Servo(joint, fault);
    let briefly_s = rng.random_range(0.05..0.4);
    let for_a_while_s = rng.random_range(0.2..4.0);
    let quiet = Happening::Wire(None);
    let (begins, ends) = match kind {
        "replies lost" => (wire(WireFault::Drop), Some((quiet, briefly_s))),
        "replies corrupt" => (wire(WireFault::Corrupt), Some((quiet, briefly_s))),
        "replies cut short" => (wire(WireFault::Truncate), Some((quiet, briefly_s))),
        "replies doubled" => (wire(WireFault::Duplicate), Some((quiet, briefly_s))),
        "replies preceded by noise" => (wire(WireFault::Noise), Some((quiet, briefly_s))),
        "replies late" => (wire(WireFault::Late(0.06)), Some((quiet, briefly_s))),
        "servo cut off" => {
            (servo(ServoFault::Dead), Some((servo(ServoFault::Revive), for_a_while_s)))
        }
        "servo rebooting" => (servo(ServoFault::Reboot), None),
        "servo jammed" => (servo(ServoFault::Jam), Some((servo(ServoFault::Free), for_a_while_s))),
        "servo overloaded" => (servo(ServoFault::Overload), None),
        "servo hot" => (servo(ServoFault::Overheat(rng.random_range(55.0..72.0))), None),
        "servo too hot" => (servo(ServoFault::Overheat(90.0)), None),
        _ => (Happening::Adapter(true), Some((Happening::Adapter(false), for_a_while_s))),
    };
    let cue = |time_s, what| Cue { time_s, what };
    let end = ends.map(|(what, after_s)| cue(at_s + after_s, what));
    PlannedFault { kind, at_s, cues: std::iter::once(cue(at_s, begins)).chain(end).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn the_seed_repeats_what_goes_wrong_and_every_kind_comes() {
        let robot = Robot::load("neck").unwrap();
        let day = |seed| faults(&robot, 3600.0, 10.0, &mut ChaCha8Rng::seed_from_u64(seed));
        let (one, other) = (day(1), day(2));
        assert_eq!(one, day(1));
        assert_ne!(one, other);
        assert!((250..500).contains(&one.len()), "{}", one.len());
        for kind in FAULT_KINDS {
            assert!(one.iter().any(|fault| fault.kind == kind), "{kind}");
        }
        let script = script(&one);
        assert!(script.windows(2).all(|w| w[0].time_s <= w[1].time_s));
        assert!(script.iter().all(|cue| cue.time_s >= FIRST_S));
    }
}
