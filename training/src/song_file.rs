//! Recordings with their beats beside them: NAME.wav (ogg, mp3, flac) and NAME.beats, a line
//! a beat: seconds and its place in the bar from 1 (0 or none where it is not known). If
//! there is a NAME.sections, its lines are the seconds at which sections begin.

use anyhow::Context;
use servodance_audio::AudioSource;
use std::path::{Path, PathBuf};

const SOUNDS: [&str; 4] = ["wav", "ogg", "mp3", "flac"];

/// The songs of a folder that have a .beats file beside them, by name.
/// Fails where there is none.
pub fn songs_in(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut paths = Vec::new();
    let entries = std::fs::read_dir(folder).with_context(|| format!("{}", folder.display()))?;
    for entry in entries {
        let path = entry?.path();
        let sound = path.extension().is_some_and(|e| SOUNDS.iter().any(|s| e == *s));
        if sound && path.with_extension("beats").exists() {
            paths.push(path);
        }
    }
    anyhow::ensure!(
        !paths.is_empty(),
        "{} holds no song with a .beats file beside it",
        folder.display()
    );
    paths.sort();
    Ok(paths)
}

/// Mono samples of a recording and their rate, hertz.
pub fn read_sound(path: &Path) -> anyhow::Result<(Vec<f32>, u32)> {
    let mut source = AudioSource::open(path)?;
    let (mut block, mut samples) = (Vec::new(), Vec::new());
    while source.next_block(&mut block)? {
        samples.extend_from_slice(&block);
    }
    Ok((samples, source.sample_rate_hz()))
}

/// Times and places of the .beats file beside a recording.
pub fn read_beats(song: &Path) -> anyhow::Result<(Vec<f64>, Vec<u32>)> {
    let read = |line: &str| -> anyhow::Result<(f64, u32)> {
        let mut words = line.split_whitespace();
        let time_s = words.next().context("no time")?.parse()?;
        Ok((time_s, words.next().map_or(Ok(0), str::parse)?))
    };
    let path = song.with_extension("beats");
    let lines = read_lines(&path, read, "a line is seconds and place in the bar")?;
    Ok(lines.into_iter().unzip())
}

/// When sections begin, seconds, by the .sections file beside a recording; `None` without one.
pub fn read_sections(song: &Path) -> anyhow::Result<Option<Vec<f64>>> {
    let path = song.with_extension("sections");
    let read = |line: &str| Ok(line.trim().parse()?);
    path.exists().then(|| read_lines(&path, read, "a line is the seconds of a section")).transpose()
}

fn read_lines<T>(
    path: &Path,
    read: impl Fn(&str) -> anyhow::Result<T>,
    expected: &str,
) -> anyhow::Result<Vec<T>> {
    let text = std::fs::read_to_string(path).with_context(|| format!("{}", path.display()))?;
    let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let read_line = |(at, line): (usize, &str)| {
        let place = || format!("{}, line {}: {expected}", path.display(), at + 1);
        read(line).with_context(place)
    };
    lines.map(read_line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beats_and_sections_are_read_and_bad_lines_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let song = folder.path().join("tune.wav");
        assert!(songs_in(folder.path()).unwrap_err().to_string().contains("holds no song"));
        std::fs::write(&song, "").unwrap();
        std::fs::write(song.with_extension("beats"), "0.5 1\n1.0 2\n\n1.5\n").unwrap();
        assert_eq!(songs_in(folder.path()).unwrap(), std::slice::from_ref(&song));
        assert_eq!(read_beats(&song).unwrap(), (vec![0.5, 1.0, 1.5], vec![1, 2, 0]));
        assert_eq!(read_sections(&song).unwrap(), None);
        std::fs::write(song.with_extension("sections"), "8.25\nsoon\n").unwrap();
        let error = format!("{:#}", read_sections(&song).unwrap_err());
        assert!(error.contains("tune.sections, line 2"), "{error}");
    }
}
