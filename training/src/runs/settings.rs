//! The settings file: TOML. What is not known there is refused with its line.

use super::request::TrainingRequest;
use crate::train::SettingsFile;
use anyhow::{Context, anyhow, ensure};
use std::path::{Path, PathBuf};

const MOST_THREADS: usize = 256;

/// The request takes precedence. Paths in the file are seen from its folder.
pub fn read(path: &Path, request: &TrainingRequest) -> anyhow::Result<SettingsFile> {
    let name = path.display();
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {name}"))?;
    let mut file: SettingsFile = toml::from_str(&text).map_err(|error| {
        let line = error.span().map_or(1, |span| {
            let before = &text.as_bytes()[..span.start.min(text.len())];
            1 + before.iter().filter(|byte| **byte == b'\n').count()
        });
        anyhow!("{name}:{line}: {}", error.message().replace('\n', " "))
    })?;
    let folder = path.parent().unwrap_or(Path::new("."));
    let from_here = |path: &Option<PathBuf>| path.as_ref().map(|path| folder.join(path));
    let given =
        |here: &Option<PathBuf>, there: &Option<PathBuf>| here.clone().or_else(|| from_here(there));
    file.data = given(&request.data, &file.data);
    file.out = given(&request.out, &file.out);
    file.vqvae_weights = given(&request.vqvae_weights, &file.vqvae_weights);
    file.seed = request.seed.or(file.seed);
    file.threads = request.threads.or(file.threads);
    let threads = file.threads.unwrap_or(1);
    ensure!(
        (1..=MOST_THREADS).contains(&threads),
        "{name}: threads is {threads}, expected 1 to {MOST_THREADS}"
    );
    Ok(file)
}
