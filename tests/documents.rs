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

/// README, ARCHITECTURE, the changelog and everything below docs/, by their paths.
fn documents() -> Vec<String> {
    let mut found = ["README.md", "ARCHITECTURE.md", "CHANGELOG.md"].map(String::from).to_vec();
    let mut folders = vec!["docs".to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(root().join(&folder)).expect("a folder") {
            let entry = entry.expect("an entry");
            let path = format!("{folder}/{}", entry.file_name().to_string_lossy());
            if entry.path().is_dir() {
                folders.push(path);
            } else if path.ends_with(".md") {
                found.push(path);
            }
        }
    }
    found
}

#[test]
fn every_path_that_a_document_names_exists() {
    let of_users = ["my-robot.toml", "FILE.toml", "my.toml", "train.toml", "mit20.toml"];
    let crates = ["types", "audio", "model", "training", "retarget", "drivers", "stage", "sim"];
    let ours = [&crates[..], &["runtime", "lab", "src", "tests", "docs", "configs"]].concat();
    for document in documents().iter().filter(|name| *name != "CHANGELOG.md") {
        let text = read(document);
        for path in named_paths(&text) {
            let ours = ours.iter().any(|folder| path.starts_with(&format!("{folder}/")));
            assert!(
                of_users.contains(&path) || !ours || root().join(path).exists(),
                "{document} names {path}, which does not exist"
            );
        }
    }
}

#[test]
fn every_link_between_documents_leads_somewhere() {
    for document in documents() {
        let text = read(&document);
        let folder = root().join(&document).parent().expect("a folder").to_owned();
        for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let path = link.split('#').next().unwrap_or_default();
            let elsewhere = path.is_empty() || path.contains("://");
            assert!(elsewhere || folder.join(path).exists(), "{document}: {link}");
        }
    }
}

#[test]
fn no_line_of_a_document_is_too_long_to_read() {
    for document in documents() {
        for (at, line) in read(&document).lines().enumerate() {
            let wide = line.chars().count() > 160 && !line.starts_with('|');
            assert!(!wide, "{document}:{}: over 160 characters", at + 1);
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
        let row = format!("| `{code}` | {} | {} |", code.severity().as_str(), code.meaning());
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
        let words = command.split('#').next().unwrap_or_default().split_whitespace();
        let arguments = std::iter::once("servodance").chain(words);
        if let Err(error) = servodance::cli::Cli::try_parse_from(arguments) {
            let shows_help = error.kind() == clap::error::ErrorKind::DisplayHelp;
            assert!(shows_help, "README: {command}: {error}");
        }
    }
}
