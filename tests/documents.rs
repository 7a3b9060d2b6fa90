//! The documents say what is true.

use std::path::Path;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(name: &str) -> String {
    std::fs::read_to_string(root().join(name)).expect(name)
}

/// Words in backquotes that look like paths of this repository.
fn named_paths(text: &str) -> Vec<&str> {
    text.split('`')
        .skip(1)
        .step_by(2)
        .filter(|word| !word.contains([' ', '*', '<', '$', ':']) && !word.starts_with('/'))
        .filter(|word| word.ends_with('/') || word.ends_with(".rs") || word.ends_with(".toml"))
        .collect()
}

#[test]
fn every_path_of_the_architecture_exists() {
    for document in ["ARCHITECTURE.md", "README.md"] {
        let text = read(document);
        for path in named_paths(&text) {
            let user_file = ["my-robot.toml", "FILE.toml"].contains(&path);
            assert!(
                user_file || root().join(path).exists(),
                "{document} names {path}, which does not exist"
            );
        }
    }
}

#[test]
fn every_key_of_a_report_is_documented() {
    let text = read("docs/report.md");
    let source = read("runtime/src/telemetry/report.rs");
    let report = source
        .split("pub struct DanceReport {")
        .nth(1)
        .and_then(|rest| rest.split("\n}").next())
        .expect("the struct");
    for line in report.lines() {
        if let Some(key) = line.trim().strip_prefix("pub ") {
            let key = key.split(':').next().unwrap_or_default();
            assert!(text.contains(&format!("`{key}")), "{key} is not documented");
        }
    }
}

#[test]
fn every_code_of_a_finding_is_documented() {
    let text = read("docs/robots.md");
    for code in servodance_retarget::DiagnosticCode::ALL {
        let row = format!(
            "| `{code}` | {} | {} |",
            code.severity().as_str(),
            code.meaning()
        );
        assert!(text.contains(&row), "docs/robots.md lacks: {row}");
    }
}

#[test]
fn the_readme_shows_commands_that_parse() {
    use clap::Parser;
    for line in read("README.md").lines() {
        let line = line.trim();
        let line = line.replacen(" --features mic --", " --", 1);
        let line = line.replacen(" --features view --", " --", 1);
        let Some(command) = line.strip_prefix("cargo run --release -- ") else {
            continue;
        };
        let words = command
            .split('#')
            .next()
            .unwrap_or_default()
            .split_whitespace();
        let arguments = std::iter::once("servodance").chain(words);
        if let Err(error) = servodance::cli::Cli::try_parse_from(arguments) {
            let shows_help = error.kind() == clap::error::ErrorKind::DisplayHelp;
            assert!(shows_help, "README: {command}: {error}");
        }
    }
}
