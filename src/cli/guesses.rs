//! What newcomers guess, and what it is called here.
//!
//! The parser's own tips go by spelling alone: `--port` would be `--report`.

use clap::error::{ContextKind, ContextValue, ErrorKind};
use std::path::Path;

const COMMANDS: [(&str, &str); 16] = [
    ("calib", "calibrate"),
    ("check", "robot check FILE"),
    ("import", "robot new FILE --out my-robot.toml, or dataset import"),
    ("init", "robots op3 --out my-robot.toml, or robot new"),
    ("list", "robots"),
    ("live", "dance --mic"),
    ("metrics", "evaluate"),
    ("new", "robot new FILE --out my-robot.toml"),
    ("ports", "scan"),
    ("replay", "play FILE.mcap"),
    ("serve", "dance --view"),
    ("show", "dance --view, or lead for several robots"),
    ("sim", "dance: servos are simulated unless --bus says otherwise"),
    ("simulate", "dance: servos are simulated unless --bus says otherwise"),
    ("validate", "robot check FILE"),
    ("web", "dance --view --view-bind 127.0.0.1:8080"),
];

const OPTIONS: [(&str, &str); 9] = [
    ("--device", "--bus serial:/dev/ttyUSB0"),
    ("--dry-run", "no option: servos are simulated unless --bus says otherwise"),
    ("--gentle", "--amplitude 0.5"),
    ("--headless", "no option: nothing is shown without --view or --tui"),
    ("--json", "--report FILE.json"),
    ("--out", "--record FILE.mcap, --report FILE.json or --picture FILE.png"),
    ("--port", "--bus serial:/dev/ttyUSB0; some commands take the port without a name"),
    ("--ros2", "--bus ros2:HOST:9090"),
    ("--video", "--gif FILE.gif, --record FILE.mcap or --view"),
];

/// One line for a command or an option that there is not, if it is a usual guess.
pub fn hint(error: &clap::Error) -> Option<String> {
    let (what, kind, known): (_, _, &[_]) = match error.kind() {
        ErrorKind::InvalidSubcommand => ("command", ContextKind::InvalidSubcommand, &COMMANDS),
        ErrorKind::UnknownArgument => ("option", ContextKind::InvalidArg, &OPTIONS),
        _ => return None,
    };
    let Some(ContextValue::String(word)) = error.get(kind) else { return None };
    let meant = known.iter().find(|(guess, _)| guess == word).map(|(_, meant)| *meant);
    let meant = match (what, meant) {
        ("command", Some(meant)) => format!("servodance {meant}"),
        ("command", None) if Path::new(word).is_file() => format!("servodance dance {word}"),
        (_, Some(meant)) => meant.into(),
        (_, None) => return None,
    };
    Some(format!("error: there is no {what} '{word}'; did you mean: {meant}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::Cli;
    use clap::Parser;

    #[test]
    fn usual_guesses_lead_to_what_there_is() {
        let told = |line: &[&str]| {
            let error = Cli::try_parse_from([&["servodance"], line].concat()).unwrap_err();
            hint(&error).unwrap_or_default()
        };
        assert!(told(&["check", "x.urdf"]).contains("servodance robot check FILE"));
        assert!(told(&["dance", "--port", "x"]).contains("--bus serial:"));
        assert!(told(&["Cargo.toml"]).ends_with("servodance dance Cargo.toml"));
        assert_eq!(told(&["dance", "--nonsense"]), "");
    }

    #[test]
    fn no_guess_is_a_command() {
        for (guess, _) in COMMANDS {
            assert!(Cli::try_parse_from(["servodance", guess]).is_err(), "{guess}");
        }
    }
}
