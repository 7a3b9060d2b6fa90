//! Weights, and one dance after another: what the page calls.

use crate::error::WebError;
use crate::robot_track::RobotTrack;
use crate::robots::WebRobot;
use crate::scene::scene;
use serde::Deserialize;
use serde_json::{Value, json};
use servodance_audio::MusicAnalyzer;
use servodance_audio::song::Song;
use servodance_model::{Dance, Generator, GeneratorOptions};
use servodance_types::{Beat, BeatLock, FRAME_RATE_HZ, JOINT_COUNT, MusicFrame, SPECTRAL_DIM};

/// Numbers of what is heard, as `heard_row` orders them.
pub const HEARD_ROW: usize = 8 + SPECTRAL_DIM;

/// Numbers of a music row: what is heard, then the 22 points of the dancer, metres: x left,
/// y up, z forward.
pub const MUSIC_ROW: usize = HEARD_ROW + 3 * JOINT_COUNT;

const NO_WEIGHTS: WebError = WebError::Order("the weights are not loaded yet");
const NO_DANCE: WebError = WebError::Order("no dance has begun");

/// How a dance is to be.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DanceOptions {
    /// A name out of [`servodance_robots::BUILT_IN`].
    pub robot: String,
    /// A name out of the generator's styles; its default if left out.
    pub style: Option<String>,
    /// Seed of everything random.
    pub seed: u64,
    /// Samples a second of the sound that will come.
    pub rate_hz: u32,
}

struct DanceInProgress {
    analyzer: MusicAnalyzer,
    dance: Dance,
    robot: RobotTrack,
}

impl DanceInProgress {
    fn step(&mut self, heard: &MusicFrame, rows: &mut Rows) -> Result<(), WebError> {
        let motion = self.dance.step(heard)?;
        rows.music.extend(heard_row(heard));
        rows.music.extend(motion.positions.as_flattened());
        self.robot.push(&motion, &mut rows.robot)
    }
}

/// What has been danced since the last call that heard something.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rows {
    /// Of [`MUSIC_ROW`] numbers, 20 a second.
    pub music: Vec<f32>,
    /// Of the robot, as [`RobotTrack`] says.
    pub robot: Vec<f32>,
}

impl Rows {
    fn clear(&mut self) {
        self.music.clear();
        self.robot.clear();
    }
}

/// What a page needs of servodance.
#[derive(Default)]
pub struct Studio {
    generator: Option<Generator>,
    current: Option<DanceInProgress>,
    rows: Rows,
}

impl Studio {
    /// Takes the bytes of a weights file, and tells the choices that there are: robots with
    /// name and description, styles, the style that is danced by default.
    pub fn open(&mut self, weights: &[u8]) -> Result<Value, WebError> {
        let generator = Generator::from_bytes(weights, "the weights of this page")?;
        let robots = servodance_robots::names().into_iter().map(|name| {
            let robot = WebRobot::built_in(name)?;
            Ok(json!({ "name": robot.name, "description": robot.description }))
        });
        let choices = json!({
            "version": env!("CARGO_PKG_VERSION"),
            "robots": robots.collect::<Result<Vec<_>, WebError>>()?,
            "styles": generator.styles(),
            "default_style": generator.default_style(),
            "music_row": MUSIC_ROW,
            "heard_row": HEARD_ROW,
        });
        self.generator = Some(generator);
        Ok(choices)
    }

    /// Begins a dance, in place of the one before; gives its [`scene`].
    pub fn start(&mut self, options: DanceOptions) -> Result<Value, WebError> {
        let generator = self.generator.as_ref().ok_or(NO_WEIGHTS)?;
        let robot = WebRobot::built_in(&options.robot)?;
        let track = RobotTrack::new(&robot)?;
        let scene = scene(&robot, &track);
        let DanceOptions { seed, style, rate_hz, .. } = options;
        let dance = generator.start(GeneratorOptions { seed, style, ..Default::default() })?;
        let analyzer = MusicAnalyzer::new(rate_hz)?;
        self.current = Some(DanceInProgress { analyzer, dance, robot: track });
        Ok(scene)
    }

    /// Dances to the next samples, any number of them.
    pub fn hear(&mut self, samples: &[f32]) -> Result<&Rows, WebError> {
        let current = self.current.as_mut().ok_or(NO_DANCE)?;
        self.rows.clear();
        current.analyzer.push(samples);
        while let Some(heard) = current.analyzer.pop() {
            current.step(&heard, &mut self.rows)?;
        }
        Ok(&self.rows)
    }

    /// Dances to what was heard elsewhere: the next frame of music.
    pub fn hear_frame(&mut self, heard: &MusicFrame) -> Result<&Rows, WebError> {
        let current = self.current.as_mut().ok_or(NO_DANCE)?;
        self.rows.clear();
        current.step(heard, &mut self.rows)?;
        Ok(&self.rows)
    }

    /// The music is over: the robot's last rows, up to the end of the last frame.
    pub fn finish(&mut self) -> Result<&Rows, WebError> {
        let current = self.current.as_mut().ok_or(NO_DANCE)?;
        self.rows.clear();
        current.robot.finish(&mut self.rows.robot)?;
        Ok(&self.rows)
    }

    /// What the last call that heard something has danced.
    pub fn rows(&self) -> &Rows {
        &self.rows
    }

    /// Dances on in another style; the error lists those there are.
    pub fn set_style(&mut self, style: &str) -> Result<(), WebError> {
        Ok(self.current.as_mut().ok_or(NO_DANCE)?.dance.set_style(style)?)
    }

    /// The built-in song, rendered anew: mono samples and their rate in hertz.
    pub fn song() -> (Vec<f32>, u32) {
        let song = Song::demo();
        (song.samples, song.sample_rate_hz)
    }
}

/// What is heard as numbers: beat phase, tempo, confidence, lock (0 lost, 1 holding, 2
/// locked), presence of music, place in the bar from 1 (0 unknown), beats of a bar (0
/// unknown), confidence of both; then the 35 features.
pub fn heard_row(heard: &MusicFrame) -> [f32; HEARD_ROW] {
    let beat = heard.beat;
    let lock = LOCKS.iter().position(|lock| *lock == beat.lock).unwrap_or(0) as f32;
    let place = beat.beat_in_bar.map_or(0.0, |place| f32::from(place) + 1.0);
    let meter = beat.beats_in_bar.map_or(0.0, f32::from);
    let mut row = [0.0; HEARD_ROW];
    row[..5].copy_from_slice(&[beat.phase, beat.tempo_bpm, beat.confidence, lock, heard.presence]);
    row[5..8].copy_from_slice(&[place, meter, beat.bar_confidence]);
    row[8..].copy_from_slice(&heard.spectral);
    row
}

/// The inverse of [`heard_row`], for the frame of this number.
pub fn heard_of_row(row: &[f32; HEARD_ROW], frame: u64) -> MusicFrame {
    let whole = |number: f32| (number > 0.0).then_some(number as u8);
    MusicFrame {
        time_s: frame as f64 / FRAME_RATE_HZ,
        spectral: std::array::from_fn(|i| row[8 + i]),
        beat: Beat {
            phase: row[0],
            tempo_bpm: row[1],
            confidence: row[2],
            lock: LOCKS.get(row[3] as usize).copied().unwrap_or_default(),
            beat_in_bar: whole(row[5]).map(|place| place - 1),
            beats_in_bar: whole(row[6]),
            bar_confidence: row[7],
        },
        presence: row[4],
    }
}

const LOCKS: [BeatLock; 4] =
    [BeatLock::Lost, BeatLock::Holding, BeatLock::Locked, BeatLock::Changing];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_heard_survives_as_numbers() {
        let beat = Beat {
            phase: 0.3,
            tempo_bpm: 121.0,
            confidence: 0.9,
            lock: BeatLock::Holding,
            beat_in_bar: Some(0),
            beats_in_bar: Some(4),
            bar_confidence: 0.7,
        };
        let spectral = std::array::from_fn(|i| i as f32);
        let heard = MusicFrame { time_s: 0.35, spectral, beat, presence: 0.6 };
        assert_eq!(heard_of_row(&heard_row(&heard), 7), heard);
        let nothing = MusicFrame { time_s: 0.0, ..MusicFrame::default() };
        assert_eq!(heard_of_row(&heard_row(&nothing), 0), nothing);
    }

    #[test]
    fn calls_in_the_wrong_order_are_told_so() {
        let mut studio = Studio::default();
        let told = |error: WebError| error.to_string();
        assert_eq!(told(studio.hear(&[0.0]).unwrap_err()), "no dance has begun");
        let options = DanceOptions { robot: "op3".into(), style: None, seed: 1, rate_hz: 44_100 };
        assert_eq!(told(studio.start(options).unwrap_err()), "the weights are not loaded yet");
        assert!(told(studio.open(b"no weights").unwrap_err()).contains("the weights of this page"));
    }
}
