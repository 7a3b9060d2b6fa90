//! A film of a dance with its song: pictures drawn here, encoded by the program `ffmpeg` of
//! this machine.
//!
//! An encoder of our own, or one built in, would be larger than all else together; ffmpeg is
//! on most machines on which films are cut. Pictures go to it through a pipe, the song as a
//! WAV file beside it.

use super::pending_file::PendingFile;
use super::picture::animation::{AnimationFrame, FRAMES_HZ, HEIGHT, WIDTH, draw};
use super::recorder::Recording;
use anyhow::{Context, bail};
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use tempfile::TempDir;

const PROGRAM: &str = "ffmpeg";
/// Pictures are so many times as large as those of a GIF.
const SCALE: u32 = 2;

/// What a kind of film is made with: encoders in order of preference, and their options.
struct FilmKind {
    ending: &'static str,
    pictures: &'static [(&'static str, &'static [&'static str])],
    sound: &'static [&'static str],
    /// For the whole file.
    options: &'static [&'static str],
}

const KINDS: [FilmKind; 2] = [
    FilmKind {
        ending: "mp4",
        pictures: &[
            ("libx264", &["-crf", "20", "-preset", "veryfast"]),
            ("libopenh264", &["-b:v", "2M"]),
            ("mpeg4", &["-q:v", "3"]),
        ],
        sound: &["aac"],
        // Playable from its first bytes on, in a browser say.
        options: &["-movflags", "+faststart"],
    },
    FilmKind {
        ending: "webm",
        pictures: &[
            ("libvpx-vp9", &["-crf", "32", "-b:v", "0", "-deadline", "realtime", "-cpu-used", "6"]),
            ("libvpx", &["-crf", "12", "-b:v", "2M", "-deadline", "realtime"]),
        ],
        sound: &["libopus", "libvorbis"],
        options: &[],
    },
];

/// Draws and encodes the moments; the song is that of the recording. What encoded it, in
/// words. Fails where the ending is no film's, or the machine has no ffmpeg that can.
pub fn write_film(
    recording: &Recording,
    moments: &[AnimationFrame],
    path: &Path,
) -> anyhow::Result<String> {
    let kind = kind(path)?;
    let known = encoders()?;
    let has = |name: &str| known.iter().any(|known| known == name);
    let pictures = kind.pictures.iter().find(|(name, _)| has(name));
    let sound = kind.sound.iter().find(|name| has(name));
    let (Some((pictures, options)), Some(sound)) = (pictures, sound) else {
        bail!("{PROGRAM} of this machine has no encoder for .{}", kind.ending);
    };
    let pending = PendingFile::create(path)?;
    let folder = tempfile::tempdir().context("no room for the film")?;
    let out = folder.path().join(format!("film.{}", kind.ending));
    let song = song(recording, moments, &folder)?;
    let mut command = Command::new(PROGRAM);
    let size = format!("{}x{}", WIDTH * SCALE, HEIGHT * SCALE);
    let rate = FRAMES_HZ.to_string();
    command.args(["-hide_banner", "-loglevel", "error", "-nostdin"]);
    command.args(["-f", "rawvideo", "-pix_fmt", "rgba", "-s", &size, "-r", &rate, "-i", "pipe:0"]);
    if song {
        command.arg("-i").arg(folder.path().join(SONG)).args(["-c:a", sound]);
    }
    command.args(["-c:v", pictures]).args(*options).args(["-pix_fmt", "yuv420p"]);
    command.args(kind.options).arg(&out);
    encode(command, &recording.robot, moments)?;
    let mut film = File::open(&out).context("the film")?;
    std::io::copy(&mut film, &mut pending.writer()?).context("the film")?;
    pending.finish()?;
    let heard = if song { format!(" and {sound}") } else { ", without sound".to_owned() };
    Ok(format!("encoded by {PROGRAM}: {pictures}{heard}"))
}

const SONG: &str = "song.wav";

fn kind(path: &Path) -> anyhow::Result<&'static FilmKind> {
    let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
    let found = KINDS.iter().find(|kind| ending == kind.ending);
    found.with_context(|| format!("{}: a film ends in .mp4 or .webm", path.display()))
}

/// The encoders that ffmpeg has.
fn encoders() -> anyhow::Result<Vec<String>> {
    let asked = Command::new(PROGRAM).args(["-hide_banner", "-encoders"]).output();
    let asked = asked.with_context(|| {
        format!("--film needs the program {PROGRAM}, which this machine lacks (Debian: apt install ffmpeg)")
    })?;
    let text = String::from_utf8_lossy(&asked.stdout);
    let names = text.lines().filter_map(|line| line.split_whitespace().nth(1));
    Ok(names.map(str::to_owned).collect())
}

/// The part of the song that belongs to the moments as a WAV file; `false` if there is none.
fn song(
    recording: &Recording,
    moments: &[AnimationFrame],
    folder: &TempDir,
) -> anyhow::Result<bool> {
    let (Some(audio), Some(first)) = (&recording.audio, moments.first()) else {
        return Ok(false);
    };
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: audio.rate_hz,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut writer = hound::WavWriter::create(folder.path().join(SONG), spec)?;
    let rate_hz = f64::from(audio.rate_hz);
    let from = ((first.time_s - audio.from_s) * rate_hz).round() as i64;
    let count = (moments.len() as f64 / FRAMES_HZ * rate_hz).round() as i64;
    for place in from..from + count {
        let sample = usize::try_from(place).ok().and_then(|place| audio.samples.get(place));
        writer.write_sample(sample.copied().unwrap_or(0))?;
    }
    writer.finalize()?;
    Ok(true)
}

/// Runs the encoder and gives it the pictures.
fn encode(mut command: Command, title: &str, moments: &[AnimationFrame]) -> anyhow::Result<()> {
    command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
    let mut encoder = command.spawn().with_context(|| format!("cannot run {PROGRAM}"))?;
    let drawn = feed(&mut encoder, title, moments);
    let ended = encoder.wait_with_output().with_context(|| format!("cannot run {PROGRAM}"))?;
    if !ended.status.success() {
        let said = String::from_utf8_lossy(&ended.stderr);
        bail!("{PROGRAM}: {}", said.lines().next().unwrap_or("it failed and did not say why"));
    }
    drawn
}

/// Closes the pipe at the end, so that the encoder knows.
fn feed(encoder: &mut Child, title: &str, moments: &[AnimationFrame]) -> anyhow::Result<()> {
    let mut pipe = encoder.stdin.take().context("no pipe")?;
    for moment in moments {
        pipe.write_all(&draw(title, moment, SCALE)?).with_context(|| format!("{PROGRAM} ended"))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ending_says_what_kind_of_film_it_is() {
        assert_eq!(kind(Path::new("a.MP4")).unwrap().ending, "mp4");
        assert_eq!(kind(Path::new("a.webm")).unwrap().ending, "webm");
        for other in ["a.avi", "a", "mp4"] {
            let told = kind(Path::new(other)).err().map(|error| error.to_string());
            assert!(told.unwrap().contains(".mp4 or .webm"), "{other}");
        }
    }
}
