//! Writes what the beat network is trained on: rendered music, other sounds
//! and their mixtures as the network hears them, with beats and bars.
//! `beat_corpus FOLDER COUNT FIRST_SEED FONTS [TALKERS]`: `FONTS` is a folder of
//! soundfonts (.sf2, .sf3), through which most of the scores are played by
//! fluidsynth; the others are played by our own voices. `TALKERS` is a folder of
//! wav files of speech, of a speech synthesiser say.
//!
//! `FOLDER/inputs.f32` holds all steps of all pieces one after the other, 80 a
//! second; `FOLDER/pieces.jsonl` one line a piece: its number of steps, beat
//! times, those that open a bar, and the spans of music, in seconds.
//! `beat_corpus midi FOLDER COUNT FIRST_SEED` writes scores alone, to listen to;
//! `beat_corpus songs FOLDER COUNT FIRST_SEED FONTS [TALKERS]` the sound itself with
//! its beats, as `servodance bench beats` takes them.

mod band;
mod form;
#[allow(clippy::needless_range_loop)] // the steps of a bar are counted
mod grooves;
mod harmony;
mod melody;
mod render;
mod score;
mod sounds;
mod spoil;
mod style;
mod timeline;

use std::error::Error;
use std::io::Write;
use std::path::PathBuf;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use servodance_audio::beats::inputs_of;
use servodance_audio::song::noise;
use servodance_audio::song::{Mix, SongSpec, Style};

const RATE_HZ: u32 = 22_050;
const PIECE_S: f64 = 50.0;

/// A piece of sound and its truth.
#[derive(Default)]
struct Piece {
    samples: Vec<f32>,
    beats_s: Vec<f64>,
    downbeats_s: Vec<f64>,
    music_s: Vec<(f64, f64)>,
}

impl Piece {
    /// What the network hears of the piece, and a line of its truth.
    fn write(&self, inputs: &mut impl Write, pieces: &mut impl Write) -> std::io::Result<()> {
        let steps = inputs_of(&self.samples, RATE_HZ);
        for value in steps.iter().flatten() {
            inputs.write_all(&value.to_le_bytes())?;
        }
        let spans: Vec<[f64; 2]> = self.music_s.iter().map(|s| [s.0, s.1]).collect();
        let (beats, downbeats) = (&self.beats_s, &self.downbeats_s);
        writeln!(
            pieces,
            r#"{{"steps":{},"beats_s":{beats:?},"downbeats_s":{downbeats:?},"music_s":{spans:?}}}"#,
            steps.len(),
        )
    }
}

/// What the pieces are made of.
struct Workshop {
    styles: Vec<style::Style>,
    fonts: Vec<PathBuf>,
    talkers: Vec<Vec<f32>>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
        ["midi", folder, count, first] => write_scores(folder, count.parse()?, first.parse()?),
        ["songs", folder, count, first, fonts, rest @ ..] => {
            Workshop::open(fonts, rest)?.write_songs(folder, count.parse()?, first.parse()?)
        }
        [folder, count, first, fonts, rest @ ..] => {
            Workshop::open(fonts, rest)?.write(folder, count.parse()?, first.parse()?)
        }
        _ => Err("usage: beat_corpus FOLDER COUNT FIRST_SEED FONTS [TALKERS]".into()),
    }
}

fn fonts_of(folder: &str) -> Result<Vec<PathBuf>, Box<dyn Error>> {
    let entries: Result<Vec<_>, _> = std::fs::read_dir(folder)?.collect();
    let mut fonts: Vec<PathBuf> = entries?.iter().map(std::fs::DirEntry::path).collect();
    fonts.sort();
    Ok(fonts)
}

fn write_scores(folder: &str, count: u64, first: u64) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(folder)?;
    let styles = style::Style::all();
    for seed in first..first + count {
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        let style = style::Style::draw(&styles, rng);
        let composition = band::compose(style, PIECE_S, rng);
        let name = style.name.replace(' ', "_");
        std::fs::write(format!("{folder}/{seed}_{name}.mid"), composition.score.midi())?;
    }
    Ok(())
}

impl Workshop {
    fn open(fonts: &str, talkers: &[&str]) -> Result<Self, Box<dyn Error>> {
        Ok(Self {
            styles: style::Style::all(),
            fonts: fonts_of(fonts)?,
            talkers: talkers.first().map_or(Ok(Vec::new()), |folder| read_all(folder))?,
        })
    }

    /// Each piece as a wav file, with a line a beat: seconds, 1 if it opens a bar, else 2.
    fn write_songs(&self, folder: &str, count: u64, first: u64) -> Result<(), Box<dyn Error>> {
        std::fs::create_dir_all(folder)?;
        for seed in first..first + count {
            let piece = self.compose(&mut ChaCha8Rng::seed_from_u64(seed))?;
            let form = hound::WavSpec {
                channels: 1,
                sample_rate: RATE_HZ,
                bits_per_sample: 32,
                sample_format: hound::SampleFormat::Float,
            };
            let mut wav = hound::WavWriter::create(format!("{folder}/{seed}.wav"), form)?;
            piece.samples.iter().try_for_each(|&s| wav.write_sample(s))?;
            wav.finalize()?;
            let mut beats = std::fs::File::create(format!("{folder}/{seed}.beats"))?;
            for beat in &piece.beats_s {
                let opens = piece.downbeats_s.iter().any(|d| (d - beat).abs() < 1e-6);
                writeln!(beats, "{beat:.4} {}", if opens { 1 } else { 2 })?;
            }
        }
        Ok(())
    }

    fn write(&self, folder: &str, count: u64, first: u64) -> Result<(), Box<dyn Error>> {
        std::fs::create_dir_all(folder)?;
        let file = |name: &str| {
            std::fs::File::create(format!("{folder}/{name}")).map(std::io::BufWriter::new)
        };
        let (mut inputs, mut pieces) = (file("inputs.f32")?, file("pieces.jsonl")?);
        for seed in first..first + count {
            let rng = &mut ChaCha8Rng::seed_from_u64(seed);
            let mut piece = self.compose(rng)?;
            piece.write(&mut inputs, &mut pieces)?;
            // The same where a robot dances to it: music is dear, noise is cheap.
            if rng.random_bool(0.6) {
                spoil::loud_room(&mut piece.samples, &turns(PIECE_S, &piece.beats_s, rng), rng);
                piece.write(&mut inputs, &mut pieces)?;
            }
            if seed % 20 == 0 {
                inputs.flush()?;
                pieces.flush()?;
                eprintln!("{seed}");
            }
        }
        Ok(())
    }

    /// Stretches of music and of other things, one after the other, then what
    /// disturbs all of them, then the level.
    fn compose(&self, rng: &mut ChaCha8Rng) -> Result<Piece, Box<dyn Error>> {
        let mut piece = Piece::default();
        while length_s(&piece) < PIECE_S {
            let left = PIECE_S - length_s(&piece);
            let duration_s = rng.random_range(14.0f64..70.0).min(left).max(1.0);
            match rng.random_range(0..100) {
                0..80 => self.add_music(&mut piece, duration_s, rng)?,
                80..84 => {
                    let silence = vec![0.0; (0.3 * duration_s * f64::from(RATE_HZ)) as usize];
                    piece.samples.extend(silence);
                }
                _ => {
                    let level = 10f32.powf(rng.random_range(-40.0..-8.0) / 20.0);
                    let sound = disturbance(&self.talkers, 0.5 * duration_s, &[], rng);
                    piece.samples.extend(sound.iter().map(|s| level * s));
                }
            }
        }
        // Now and then one more: a robot that moves in a loud room.
        let mut chance = 0.45;
        while rng.random_bool(chance) {
            let sound = disturbance(&self.talkers, length_s(&piece) + 1.0, &piece.beats_s, rng);
            let snr_db = rng.random_range(2.0..24.0);
            piece.samples = noise::mix(&piece.samples, &sound, snr_db);
            chance *= 0.7;
        }
        let level = 10f32.powf(rng.random_range(-40.0..0.0) / 20.0);
        piece.samples.iter_mut().for_each(|s| *s *= level);
        if rng.random_bool(0.1) {
            let limit = rng.random_range(0.2..0.8) * level;
            piece.samples.iter_mut().for_each(|s| *s = s.clamp(-limit, limit));
        }
        Ok(piece)
    }

    fn add_music(
        &self,
        piece: &mut Piece,
        duration_s: f64,
        rng: &mut ChaCha8Rng,
    ) -> Result<(), Box<dyn Error>> {
        let mut loud = false;
        let (mut sound, beats_s, downbeats_s) = if rng.random_bool(0.68) {
            let style = style::Style::draw(&self.styles, rng);
            loud = style.is_loud();
            let composition = band::compose(style, duration_s, rng);
            let font = &self.fonts[rng.random_range(0..self.fonts.len())];
            let sound = render::play(&composition.score, font, duration_s, rng.random_bool(0.4))?;
            (sound, composition.beats_s, composition.downbeats_s)
        } else {
            our_voices(duration_s, rng)?
        };
        spoil::spoil(&mut sound, loud, rng)?;
        let start_s = length_s(piece);
        piece.beats_s.extend(beats_s.iter().map(|s| start_s + s));
        piece.downbeats_s.extend(downbeats_s.iter().map(|s| start_s + s));
        piece.music_s.push((start_s, start_s + duration_s));
        let level = 10f32.powf(rng.random_range(-10.0..0.0) / 20.0);
        let gain = 0.2 * level / noise::rms(&sound).max(1e-3);
        piece.samples.extend(sound.iter().map(|s| gain * s));
        Ok(())
    }
}

fn length_s(piece: &Piece) -> f64 {
    piece.samples.len() as f64 / f64::from(RATE_HZ)
}

/// Something that is not music; motors move to the beats if there are any.
fn disturbance(
    talkers: &[Vec<f32>],
    duration_s: f64,
    beats_s: &[f64],
    rng: &mut ChaCha8Rng,
) -> Vec<f32> {
    let seed = rng.random();
    match rng.random_range(0..11) {
        0..3 if !talkers.is_empty() && rng.random_bool(0.75) => excerpt(talkers, duration_s, rng),
        0..3 => noise::speech(duration_s, RATE_HZ, seed),
        3..5 => noise::crowd(duration_s, RATE_HZ, seed),
        5 => noise::hiss(duration_s, RATE_HZ, rng.random_range(0.0..1.0), seed),
        6 => noise::pink(duration_s, RATE_HZ, seed),
        7 => noise::knocks(duration_s, RATE_HZ, rng.random_range(1.0..9.0), seed),
        _ => noise::motors(&turns(duration_s, beats_s, rng), duration_s, RATE_HZ, seed),
    }
}

/// Some of what one of the talkers says, again from the start if need be; now and then
/// single words, since words one by one are nearly a rhythm.
fn excerpt(talkers: &[Vec<f32>], duration_s: f64, rng: &mut ChaCha8Rng) -> Vec<f32> {
    let talker = &talkers[rng.random_range(0..talkers.len())];
    let count = (duration_s * f64::from(RATE_HZ)).round() as usize;
    let samples = |s: f64| (s * f64::from(RATE_HZ)) as usize;
    let (word_s, pause_s) = match rng.random_bool(0.4) {
        true => (rng.random_range(0.3..1.2), rng.random_range(0.05..0.8)),
        false => (duration_s, 0.0),
    };
    let mut said = Vec::with_capacity(count);
    while said.len() < count {
        let start = rng.random_range(0..talker.len());
        let word = samples(word_s * rng.random_range(0.6..1.2)).min(count - said.len());
        said.extend(talker.iter().cycle().skip(start).take(word));
        said.resize(count.min(said.len() + samples(pause_s * rng.random_range(0.4..1.6))), 0.0);
    }
    let gain = 1.0 / noise::rms(&said).max(1e-6);
    said.iter().map(|s| gain * s).collect()
}

/// The wav files of a folder.
fn read_all(folder: &str) -> Result<Vec<Vec<f32>>, Box<dyn Error>> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let mut wav = hound::WavReader::open(entry?.path())?;
        let samples: Result<Vec<i16>, _> = wav.samples::<i16>().collect();
        all.push(samples?.iter().map(|&s| f32::from(s) / 32_768.0).collect());
    }
    Ok(all)
}

/// When a robot turns round: late after the beats, or at its own whim.
fn turns(duration_s: f64, beats_s: &[f64], rng: &mut ChaCha8Rng) -> Vec<f64> {
    if beats_s.len() > 4 && rng.random_bool(0.7) {
        let late_s = rng.random_range(-0.1..0.4);
        return beats_s.iter().map(|b| b + late_s).collect();
    }
    let mut now_s = 0.0;
    let (usual_s, spread) = (rng.random_range(0.25..1.2), rng.random_range(0.1..0.8));
    let mut turns = Vec::new();
    while now_s < duration_s {
        turns.push(now_s);
        now_s += usual_s * (1.0 + spread * rng.random_range(-1.0f64..1.0));
    }
    turns
}

/// Samples, beats, downbeats.
type Sound = (Vec<f32>, Vec<f64>, Vec<f64>);

/// Music in four of the song renderer and of grooves by chance.
fn our_voices(duration_s: f64, rng: &mut ChaCha8Rng) -> Result<Sound, Box<dyn Error>> {
    // Evenly over the octaves of tempi that are danced, or as usual for the style.
    let style = Style::ALL[rng.random_range(0..Style::ALL.len())];
    let usual = rng.random_bool(0.6);
    let (slowest, fastest) = if usual { style.tempo_range_bpm() } else { (64.0, 190.0) };
    let bpm = slowest * (fastest / slowest).powf(rng.random_range(-0.1..1.1));
    let beats_s = beat_times(bpm, duration_s, rng);
    let first_downbeat = rng.random_range(0..4);
    let mut sound = vec![0.0f32; (duration_s * f64::from(RATE_HZ)).round() as usize];
    let songs = if rng.random_bool(0.8) { 1 } else { 0 };
    for _ in 0..songs {
        let mut spec = SongSpec::on_beats(&beats_s, duration_s, rng.random())?;
        spec.first_downbeat = first_downbeat;
        spec.style = style;
        if rng.random_bool(0.3) {
            spec.mix = Mix::clean();
        }
        add(&mut sound, &spec.render()?.samples, rng.random_range(0.3..1.0));
    }
    if songs == 0 || rng.random_bool(0.25) {
        let groove = grooves::play(&beats_s, first_downbeat, duration_s, RATE_HZ, rng);
        add(&mut sound, &groove, rng.random_range(0.3..1.0));
    }
    let inside = |s: &f64| (0.0..duration_s).contains(s);
    let bars = beats_s.iter().skip(first_downbeat).step_by(4).copied().filter(inside).collect();
    Ok((sound, beats_s.iter().copied().filter(inside).collect(), bars))
}

fn add(out: &mut [f32], sound: &[f32], gain: f32) {
    let gain = 0.2 * gain / noise::rms(sound).max(1e-3);
    out.iter_mut().zip(sound).for_each(|(o, s)| *o += gain * s);
}

/// Beats that are steady, drift or breathe like a human player's.
fn beat_times(bpm: f64, duration_s: f64, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let drift_per_s = if rng.random_bool(0.3) { rng.random_range(-0.004..0.004) } else { 0.0 };
    let loose = if rng.random_bool(0.3) { rng.random_range(0.0..0.015) } else { 0.0 };
    let mut now_s = -rng.random_range(0.0..60.0 / bpm);
    let mut beats = Vec::new();
    while now_s < duration_s + 1.0 {
        beats.push(now_s);
        let period_s = 60.0 / bpm * (1.0 - drift_per_s * now_s);
        now_s += (period_s * (1.0 + loose * rng.random_range(-1.0..1.0))).clamp(0.21, 1.9);
    }
    beats
}
