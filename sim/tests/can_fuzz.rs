//! A hundred thousand damaged inputs for every CAN parser; `examples/fuzz_can.rs`
//! takes as many as one likes.

#[path = "common/can_fuzz.rs"]
mod fuzz;

use fuzz::{Dice, MODELS, commands, datagrams, replies, scans, slcan_lines};

const INPUTS: u64 = 100_000;

#[test]
fn damaged_lines_and_datagrams_are_taken_without_a_panic() {
    for tally in [slcan_lines(&mut Dice(2), INPUTS), datagrams(&mut Dice(3), INPUTS)] {
        assert!(tally.sound > 1000 && tally.refused > 1000, "{tally:?}");
    }
}

#[test]
fn damaged_replies_end_in_cycles_or_errors_and_torque_off() {
    for (kind, model) in MODELS {
        let tally = replies(&mut Dice(4), INPUTS, kind, model);
        assert!(tally.sound > 100 && tally.refused > 100, "{model}: {tally:?}");
    }
}

#[test]
fn damaged_replies_to_a_scan_are_taken_without_a_panic() {
    for (_, model) in MODELS {
        let tally = scans(&mut Dice(6), INPUTS / 10, model);
        assert!(tally.inputs >= INPUTS / 10, "{model}: {tally:?}");
    }
}

#[test]
fn damaged_commands_are_taken_without_a_panic() {
    for (_, model) in MODELS {
        let tally = commands(&mut Dice(5), INPUTS, model);
        assert!(tally.sound > 100, "{model}: {tally:?}");
    }
}
