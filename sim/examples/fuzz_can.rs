//! Feeds damaged input to every CAN parser, or to those of one motor:
//! `fuzz_can [INPUTS] [MODEL]`.

#[path = "../tests/common/can_fuzz.rs"]
mod can_fuzz;

use can_fuzz::{Dice, MODELS, Tally, commands, datagrams, replies, scans, slcan_lines};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let inputs: u64 = args.next().unwrap_or("1000000".into()).parse()?;
    let only = args.next();
    let mut dice = Dice(1);
    let say = |what: &str, tally: Tally| {
        let Tally { inputs, sound, refused } = tally;
        println!("{what}: {inputs} inputs, {sound} sound, {refused} refused");
    };
    if only.is_none() {
        say("slcan lines", slcan_lines(&mut dice, inputs));
        say("multicast datagrams", datagrams(&mut dice, inputs));
    }
    let chosen = |(_, model): &(_, &str)| only.as_deref().is_none_or(|only| only == *model);
    let models: Vec<_> = MODELS.into_iter().filter(chosen).collect();
    if models.is_empty() {
        let known = MODELS.map(|(_, model)| model).join(", ");
        return Err(format!("unknown motor; choose one of: {known}").into());
    }
    for (kind, model) in models {
        let tally = replies(&mut dice, inputs, kind, model);
        say(&format!("{model}: replies to the driver"), tally);
        let tally = scans(&mut dice, inputs, model);
        say(&format!("{model}: replies to a scan"), tally);
        let tally = commands(&mut dice, inputs, model);
        say(&format!("{model}: commands to the motors"), tally);
    }
    Ok(())
}
