//! Feeds damaged input to every CAN parser: `fuzz_can [INPUTS]`.

#[path = "../tests/common/can_fuzz.rs"]
mod can_fuzz;

use can_fuzz::{Dice, MODELS, Tally, commands, datagrams, replies, scans, slcan_lines};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let inputs: u64 = std::env::args()
        .nth(1)
        .unwrap_or("1000000".into())
        .parse()?;
    let mut dice = Dice(1);
    let say = |what: &str, tally: Tally| {
        let Tally {
            inputs,
            sound,
            refused,
        } = tally;
        println!("{what}: {inputs} inputs, {sound} sound, {refused} refused");
    };
    say("slcan lines", slcan_lines(&mut dice, inputs));
    say("multicast datagrams", datagrams(&mut dice, inputs));
    for (kind, model) in MODELS {
        let tally = replies(&mut dice, inputs, kind, model);
        say(&format!("{model}: replies to the driver"), tally);
        let tally = scans(&mut dice, inputs, model);
        say(&format!("{model}: replies to a scan"), tally);
        let tally = commands(&mut dice, inputs, model);
        say(&format!("{model}: commands to the motors"), tally);
    }
    Ok(())
}
