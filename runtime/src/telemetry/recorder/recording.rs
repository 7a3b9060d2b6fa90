//! A recording read back, for the player, pictures and exports.
//!
//! The file is read once from beginning to end; joints are kept about
//! [`KEPT_HZ`] times a second, so that an hour of twenty joints takes 60 MB.
//! Errors name the file; no content of a file makes the reader panic.

use super::topic::SAFETY;
use anyhow::{Context, bail};
use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use serde::Deserialize;
use servodance_audio::playback::Sound;
use servodance_stage::ros2::CdrReader;
use servodance_types::{JOINT_COUNT, JointLimits};
use std::collections::HashMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

/// Joint samples that are kept a second.
const KEPT_HZ: f64 = 50.0;
/// A longer gap in the song of a damaged file is not filled, seconds.
const LONGEST_GAP_S: usize = 60;
/// No record of a recording is longer, bytes.
const LONGEST: usize = 64 << 20;

/// Values over time: seconds of music, ascending.
#[derive(Clone, Debug)]
pub struct Series<T> {
    times_s: Vec<f64>,
    values: Vec<T>,
}

impl<T> Default for Series<T> {
    fn default() -> Self {
        Self { times_s: Vec::new(), values: Vec::new() }
    }
}

impl<T> Series<T> {
    /// Adds a value; one that is older than the last is left out.
    pub fn push(&mut self, time_s: f64, value: T) {
        if self.times_s.last().is_none_or(|last| time_s >= *last) {
            self.times_s.push(time_s);
            self.values.push(value);
        }
    }

    /// All values with their times, seconds of music.
    pub fn iter(&self) -> impl Iterator<Item = (f64, &T)> {
        self.times_s.iter().copied().zip(&self.values)
    }

    /// The last value at or before a time; the first before all.
    pub fn at(&self, time_s: f64) -> Option<&T> {
        let after = self.times_s.partition_point(|t| *t <= time_s);
        self.values.get(after.saturating_sub(1))
    }

    /// The last value at or before a time, and its own time.
    pub fn last_before(&self, time_s: f64) -> Option<(f64, &T)> {
        let after = self.times_s.partition_point(|t| *t <= time_s);
        let last = after.checked_sub(1)?;
        Some((self.times_s[last], &self.values[last]))
    }

    fn shift(&mut self, by_s: f64) {
        self.times_s.iter_mut().for_each(|t| *t += by_s);
    }
}

#[derive(Clone, Debug, Deserialize)]
struct JointFact {
    name: String,
    #[serde(flatten, with = "LimitFacts")]
    limits: JointLimits,
}

#[derive(Deserialize)]
#[serde(remote = "JointLimits")]
struct LimitFacts {
    lower_rad: f64,
    upper_rad: f64,
    velocity_rad_s: f64,
    acceleration_rad_s2: f64,
}

#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)] // the names say it
pub struct RecordedEvent {
    pub state: String,
    pub cause: String,
}

/// The song of a recording, from its first recorded sample on.
#[derive(Clone, Debug, Default, PartialEq)]
#[allow(missing_docs)] // the names say it
pub struct RecordedAudio {
    /// When the first sample is heard, seconds of music.
    pub from_s: f64,
    pub rate_hz: u32,
    /// Mono.
    pub samples: Vec<i16>,
}

impl RecordedAudio {
    /// The song from its own beginning on, for whoever plays it.
    pub fn sound(&self) -> Sound {
        let before = (self.from_s * f64::from(self.rate_hz)).round();
        let samples = match before >= 0.0 {
            true => {
                let most = LONGEST_GAP_S * self.rate_hz as usize;
                let silence = std::iter::repeat_n(0, (before as usize).min(most));
                silence.chain(self.samples.iter().copied()).collect()
            }
            false => self.samples.iter().skip(-before as usize).copied().collect(),
        };
        Sound { samples, rate_hz: self.rate_hz }
    }

    /// A piece of the song; silence stands for pieces that were left out.
    fn push(&mut self, time_s: f64, bytes: &[u8]) {
        let place = ((time_s - self.from_s) * f64::from(self.rate_hz)).round().max(0.0) as usize;
        let most = self.samples.len() + LONGEST_GAP_S * self.rate_hz as usize;
        self.samples.resize(place.min(most), 0);
        let pairs = bytes.chunks_exact(2).map(|pair| i16::from_le_bytes([pair[0], pair[1]]));
        self.samples.extend(pairs);
    }
}

/// What a recording holds. Older ones have no spectrum, temperatures and events.
#[derive(Clone, Debug, Default)]
#[allow(missing_docs)] // the names say it
pub struct Recording {
    pub robot: String,
    pub urdf_xml: String,
    /// Control cycles a second.
    pub control_hz: f64,
    pub joints: Vec<(String, JointLimits)>,
    /// Commands to the servos, radians.
    pub commands: Series<Vec<f32>>,
    /// What they reported, radians.
    pub states: Series<Vec<f32>>,
    /// The human motion: x forward, y left, z up, metres.
    pub motion: Series<[[f32; 3]; JOINT_COUNT]>,
    /// Where the root link was: x, y, z, then the quaternion x, y, z, w.
    pub root: Series<[f64; 7]>,
    pub phase: Series<f64>,
    /// By how much the motion was ahead of the music, seconds.
    pub lead: Series<f64>,
    pub idle: Series<f64>,
    pub beats: Series<f64>,
    pub spectrum: Series<Vec<f32>>,
    pub temperatures: Vec<Series<f32>>,
    pub events: Series<RecordedEvent>,
    /// The song; none of live music.
    pub audio: Option<RecordedAudio>,
}

impl Recording {
    /// Reads a recording of a dance; joints about 50 times a second.
    /// Fails if the file is damaged or no recording of a dance.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        Self::read_every(path, 0.999 / KEPT_HZ)
    }

    /// Reads a recording of a dance with every control cycle.
    pub fn read_all(path: &Path) -> anyhow::Result<Self> {
        Self::read_every(path, 0.0)
    }

    fn read_every(path: &Path, every_s: f64) -> anyhow::Result<Self> {
        let place = || format!("cannot read the recording {}", path.display());
        let file = File::open(path).with_context(place)?;
        let mut reading = RecordingReader { every_s, ..RecordingReader::default() };
        reading.read(BufReader::new(file)).with_context(place)?;
        reading.finish().with_context(place)
    }

    /// Where the root link is at a time; at the origin if the recording lacks it.
    pub fn root_at(&self, time_s: f64) -> [f64; 7] {
        let origin = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        self.root.at(time_s).copied().unwrap_or(origin)
    }

    /// First and last moment, seconds of music.
    pub fn span_s(&self) -> [f64; 2] {
        let times = &self.states.times_s;
        let first = times.first().copied().unwrap_or(0.0);
        [first, times.last().copied().unwrap_or(first)]
    }
}

#[derive(Default)]
struct RecordingReader {
    recording: Recording,
    /// Least seconds between joint samples that are kept.
    every_s: f64,
    topics: HashMap<u16, String>,
    facts: std::collections::BTreeMap<String, String>,
    temperatures: HashMap<String, Series<f32>>,
    joint_names: Vec<String>,
}

impl RecordingReader {
    fn read(&mut self, mut file: impl Read) -> anyhow::Result<()> {
        let options = LinearReaderOptions::default().with_record_length_limit(LONGEST);
        let mut reader = LinearReader::new_with_options(options);
        while let Some(event) = reader.next_event() {
            match event? {
                LinearReadEvent::ReadRequest(need) => {
                    let got = file.read(reader.insert(need))?;
                    reader.notify_read(got);
                }
                LinearReadEvent::Record { opcode, data } => {
                    self.take(mcap::parse_record(opcode, data)?)?;
                }
            }
        }
        Ok(())
    }

    fn take(&mut self, record: Record<'_>) -> anyhow::Result<()> {
        match record {
            Record::Channel(channel) => {
                self.topics.insert(channel.id, channel.topic);
            }
            Record::Metadata(found) if found.name == "dance" => self.facts.extend(found.metadata),
            Record::Message { header, data } => {
                let topic = self.topics.get(&header.channel_id).cloned();
                let topic = topic.unwrap_or_default();
                let time_s = header.log_time as f64 * 1e-9;
                let message = CdrReader::new(&data);
                let taken = message.and_then(|m| self.message(&topic, time_s, m));
                taken.with_context(|| format!("a message of {topic} at {time_s} s is damaged"))?;
            }
            _ => {}
        }
        Ok(())
    }

    fn message(&mut self, topic: &str, time_s: f64, mut cdr: CdrReader<'_>) -> Option<()> {
        let recording = &mut self.recording;
        let due = |series: &Series<Vec<f32>>| {
            let last = series.times_s.last();
            last.is_none_or(|last| time_s - last >= self.every_s)
        };
        match topic {
            "/joint_commands" if due(&recording.commands) => {
                let (_, positions) = joints(cdr)?;
                recording.commands.push(time_s, positions);
            }
            "/joint_states" if due(&recording.states) => {
                let (names, positions) = joints(cdr)?;
                self.joint_names = names;
                recording.states.push(time_s, positions);
            }
            "/motion" => recording.motion.push(time_s, points(cdr)?),
            "/root" => {
                cdr.header()?;
                let mut pose = [0.0; 7];
                for value in &mut pose {
                    *value = cdr.f64()?;
                }
                recording.root.push(time_s, pose);
            }
            "/beat_phase" => recording.phase.push(time_s, cdr.f64()?),
            "/lead" => recording.lead.push(time_s, cdr.f64()?),
            "/idle" => recording.idle.push(time_s, cdr.f64()?),
            "/beat" => recording.beats.push(time_s, cdr.f64()?),
            "/spectrum" => recording.spectrum.push(time_s, bands(cdr)?),
            "/temperatures" => {
                let joint = cdr.header()?.to_owned();
                let series = self.temperatures.entry(joint).or_default();
                series.push(time_s, cdr.f64()? as f32);
            }
            "/audio" => {
                cdr.time()?;
                let bytes = cdr.bytes()?;
                cdr.string()?;
                let rate_hz = cdr.u32().filter(|rate| (1..=384_000).contains(rate))?;
                let first = RecordedAudio { from_s: time_s, rate_hz, samples: Vec::new() };
                recording.audio.get_or_insert(first).push(time_s, bytes);
            }
            "/safety" => recording.events.push(time_s, past(cdr)?),
            "/robot_description" => recording.urdf_xml = cdr.string()?.to_owned(),
            _ => {}
        }
        Some(())
    }

    /// Times become those of the music, once it is known when it began.
    fn finish(self) -> anyhow::Result<Recording> {
        let mut recording = self.recording;
        let number = |key: &str| self.facts.get(key).and_then(|text| text.parse::<f64>().ok());
        let (Some(start_s), Some(control_hz)) = (number("music_start_s"), number("control_hz"))
        else {
            bail!("it is no recording of a dance (made by `dance --record`), or not a whole one");
        };
        let facts = self.facts.get("joints").map_or("[]", String::as_str);
        let facts: Vec<JointFact> = serde_json::from_str(facts)?;
        let joints = self.joint_names.len();
        let same = facts.iter().map(|fact| &fact.name).eq(&self.joint_names);
        let all = [&recording.states, &recording.commands];
        let whole = |s: &&Series<Vec<f32>>| s.values.iter().all(|v| v.len() == joints);
        if !same || joints == 0 || !all.iter().all(whole) {
            bail!("its joint states and the joints that it describes differ");
        }
        let joints = facts.into_iter();
        recording.joints = joints.map(|joint| (joint.name, joint.limits)).collect();
        recording.robot = self.facts.get("robot").cloned().unwrap_or_default();
        recording.control_hz = control_hz;
        recording.states.shift(-start_s);
        recording.commands.shift(-start_s);
        recording.motion.shift(-start_s);
        recording.root.shift(-start_s);
        recording.spectrum.shift(-start_s);
        recording.events.shift(-start_s);
        let mut temperatures = self.temperatures;
        for (name, _) in &recording.joints {
            let mut series = temperatures.remove(name).unwrap_or_default();
            series.shift(-start_s);
            recording.temperatures.push(series);
        }
        recording.phase.shift(-start_s);
        recording.lead.shift(-start_s);
        recording.idle.shift(-start_s);
        recording.beats.shift(-start_s);
        if let Some(audio) = &mut recording.audio {
            audio.from_s -= start_s;
        }
        Ok(recording)
    }
}

fn joints(mut cdr: CdrReader<'_>) -> Option<(Vec<String>, Vec<f32>)> {
    cdr.header()?;
    let count = cdr.u32()?;
    let mut names = Vec::new();
    for _ in 0..count {
        names.push(cdr.string()?.to_owned());
    }
    let positions = cdr.f64s()?;
    Some((names, positions.into_iter().map(|p| p as f32).collect()))
}

fn bands(mut cdr: CdrReader<'_>) -> Option<Vec<f32>> {
    for _ in 0..cdr.u32()? {
        cdr.string()?;
        cdr.u32()?;
        cdr.u32()?;
    }
    cdr.u32()?; // data_offset
    cdr.f32s()
}

fn past(mut cdr: CdrReader<'_>) -> Option<RecordedEvent> {
    cdr.time()?;
    cdr.u8()?;
    let name = cdr.string()?;
    let state = name.strip_prefix(SAFETY).and_then(|s| s.strip_prefix('.'));
    Some(RecordedEvent { state: state.unwrap_or(name).to_owned(), cause: cdr.string()?.to_owned() })
}

fn points(mut cdr: CdrReader<'_>) -> Option<[[f32; 3]; JOINT_COUNT]> {
    cdr.header()?;
    let count = cdr.u32()?;
    let mut points = [[0.0; 3]; JOINT_COUNT];
    for point in points.iter_mut().take(count as usize) {
        for value in point.iter_mut() {
            *value = cdr.f64()? as f32;
        }
        for _ in 0..4 {
            cdr.f64()?;
        }
    }
    (count as usize == JOINT_COUNT).then_some(points)
}
