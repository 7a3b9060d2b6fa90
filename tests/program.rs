//! Runs the real program in a folder of its own.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use tempfile::TempDir;

/// A folder for one test, and the program run in it.
pub struct Program {
    folder: TempDir,
}

impl Program {
    pub fn new() -> Self {
        Self { folder: tempfile::tempdir().expect("a temporary folder") }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_servodance"));
        command.args(arguments).current_dir(self.folder.path()).stdin(Stdio::null());
        command
    }

    pub fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().expect("the program runs")
    }

    /// Runs it and expects success.
    pub fn succeed(&self, arguments: &[&str]) -> Output {
        let output = self.run(arguments);
        assert!(
            output.status.success(),
            "{arguments:?} failed: {}",
            String::from_utf8_lossy(&output.stderr)
        );
        output
    }

    /// Runs it and expects exit status 1 and one line on standard error that
    /// holds every one of `words`; nothing new may lie in the folder.
    pub fn refused(&self, arguments: &[&str], words: &[&str]) {
        self.ends_with(1, arguments, words);
    }

    /// The same, for wrong usage.
    pub fn misused(&self, arguments: &[&str], words: &[&str]) {
        self.ends_with(2, arguments, words);
    }

    fn ends_with(&self, code: i32, arguments: &[&str], words: &[&str]) {
        let before = self.files();
        let output = self.run(arguments);
        let error = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {error}");
        assert_eq!(error.lines().count(), 1, "{arguments:?}: {error}");
        for word in words {
            assert!(error.contains(word), "{arguments:?}: no {word:?} in: {error}");
        }
        assert_eq!(before, self.files(), "{arguments:?} left files behind");
    }

    pub fn files(&self) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(self.folder.path()).expect("the folder is there");
        let mut files: Vec<PathBuf> = entries.map(|e| e.expect("an entry").path()).collect();
        files.sort();
        files
    }

    /// A built-in robot as a file, patient with replies: other tests may keep
    /// the processor from the simulated servos for a while.
    pub fn patient_robot(&self, name: &str) -> String {
        self.robot_with(name, "reply_timeout_ms = 500.0\n")
    }

    /// A patient robot whose servos' own watchdogs are patient as well: a
    /// cycle that waits for starved servos would trip them, and what they hold
    /// then looks like a blocked joint. For tests of something else.
    pub fn unhurried_robot(&self, name: &str) -> String {
        self.robot_with(name, "reply_timeout_ms = 500.0\nwatchdog_ms = 2000\n")
    }

    fn robot_with(&self, name: &str, bus_lines: &str) -> String {
        let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
        let read = |file: String| std::fs::read_to_string(configs.join(file)).expect("a config");
        let text = read(format!("{name}.toml"));
        let patient = text.replacen("[bus]\n", &format!("[bus]\n{bus_lines}"), 1);
        assert_ne!(text, patient);
        let file = format!("patient-{name}.toml");
        std::fs::write(self.path(&file), patient).expect("the robot file");
        let urdf = format!("{name}.urdf");
        std::fs::write(self.path(&urdf), read(urdf.clone())).expect("the URDF");
        file
    }

    /// Writes a mono WAV file of `seconds`, 16 bit, from a function of time.
    pub fn wav(&self, name: &str, seconds: f64, sample: impl Fn(f64) -> f64) {
        let rate_hz = 16_000;
        let spec = hound::WavSpec {
            channels: 1,
            sample_rate: rate_hz,
            bits_per_sample: 16,
            sample_format: hound::SampleFormat::Int,
        };
        let mut writer = hound::WavWriter::create(self.path(name), spec).expect("a WAV file");
        for i in 0..(seconds * f64::from(rate_hz)) as u32 {
            let value = sample(f64::from(i) / f64::from(rate_hz)) * f64::from(i16::MAX);
            writer.write_sample(value as i16).expect("a sample");
        }
        writer.finalize().expect("a whole WAV file");
    }

    /// Clicks at a tempo: the simplest music with a beat.
    pub fn click_track(&self, name: &str, seconds: f64, bpm: f64) {
        let period_s = 60.0 / bpm;
        self.wav(name, seconds, |t| {
            let since = t % period_s;
            (-since * 60.0).exp() * (since * 2.0 * std::f64::consts::PI * 880.0).sin() * 0.8
        });
    }
}
