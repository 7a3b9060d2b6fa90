//! The arrangement: from a specification and its grid to notes on three buses.

use rand::Rng;
use rand::SeedableRng;
use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;

use super::drums::{Drum, DrumKit};
use super::grid::BeatGrid;
use super::mixer::Buses;
use super::spec::{Layers, MusicalKey, Section, SongSpec};
use super::style::DrumPattern;
use super::synth::{Instrument, Note, Timbre, play as play_note};

const STEPS: usize = 16;
const MAJOR: [i32; 7] = [0, 2, 4, 5, 7, 9, 11];
const MINOR: [i32; 7] = [0, 2, 3, 5, 7, 8, 10];
/// Scale degrees of the chords, one a bar.
const MAJOR_PROGRESSIONS: [[i32; 4]; 5] =
    [[0, 4, 5, 3], [0, 5, 3, 4], [0, 3, 0, 4], [1, 4, 0, 0], [0, 0, 3, 4]];
const MINOR_PROGRESSIONS: [[i32; 4]; 5] =
    [[0, 5, 2, 6], [0, 3, 6, 2], [0, 6, 5, 4], [0, 0, 3, 4], [0, 5, 3, 4]];

pub(super) fn play(spec: &SongSpec, grid: &BeatGrid, length: usize) -> Buses {
    let mut band = Band::new(spec, grid, length);
    for bar in grid.bars() {
        band.play_bar(bar);
    }
    band.buses
}

struct Band<'a> {
    spec: &'a SongSpec,
    grid: &'a BeatGrid,
    buses: Buses,
    rng: ChaCha8Rng,
    kit: DrumKit,
    drums: DrumPattern,
    bass: (&'static [u8], Timbre),
    chords: (&'static [u8], Timbre),
    lead: (&'static [u8], Timbre),
    progression: [i32; 4],
    motif: [i32; 2 * STEPS],
    swing: f32,
    /// Spread of the timing of notes off the beat, seconds.
    looseness_s: f64,
    arpeggio: bool,
}

fn pick(rng: &mut ChaCha8Rng, list: &'static [&'static str]) -> &'static [u8] {
    list.choose(rng).map_or(b"................", |p| p.as_bytes())
}

impl<'a> Band<'a> {
    fn new(spec: &'a SongSpec, grid: &'a BeatGrid, length: usize) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(spec.seed ^ 0x5eed_50d6);
        let sheet = spec.style.sheet();
        let progressions = if spec.key.minor { MINOR_PROGRESSIONS } else { MAJOR_PROGRESSIONS };
        let mut timbre = |kinds: &[Instrument]| {
            let kind = kinds[rng.random_range(0..kinds.len())];
            Timbre::random(kind, &mut rng)
        };
        let (bass, chords, lead) =
            (timbre(sheet.bass_kind), timbre(sheet.chord_kind), timbre(sheet.lead_kind));
        let swing = rng.random_range(sheet.swing.0..=sheet.swing.1);
        Self {
            spec,
            grid,
            buses: Buses::new(length),
            kit: DrumKit::random(spec.sample_rate_hz as f32, &mut rng),
            drums: sheet.drums[rng.random_range(0..sheet.drums.len())],
            bass: (pick(&mut rng, sheet.bass), bass),
            chords: (pick(&mut rng, sheet.chords), chords),
            lead: (pick(&mut rng, sheet.lead), lead),
            progression: progressions[rng.random_range(0..progressions.len())],
            motif: walk(&mut rng),
            swing,
            looseness_s: rng.random_range(0.0..0.004),
            arpeggio: rng.random_bool(0.3),
            rng,
        }
    }

    fn play_bar(&mut self, bar: i64) {
        let section = self.spec.section(bar);
        let first = section.first_bar == bar;
        let last = self.spec.section(bar + 1).first_bar == bar + 1;
        if section.layers.drums {
            self.play_drums(bar, section, first, last);
        }
        if section.layers.bass {
            self.play_bass(bar);
        }
        if section.layers.chords {
            self.play_chords(bar);
        }
        if section.layers.lead {
            self.play_lead(bar, section);
        }
        if section.layers == Layers::NONE && first {
            self.final_chord(bar);
        }
    }

    /// The sample at which a step of a bar begins.
    fn sample(&mut self, bar: i64, step: usize) -> i64 {
        let late = if step % 2 == 1 { self.swing } else { 0.0 };
        let beat = bar as f64 * 4.0 + (step as f64 + f64::from(late)) / 4.0;
        let mut time_s = self.grid.time_s(beat);
        if !step.is_multiple_of(4) {
            time_s += self.rng.random_range(-1.0..1.0) * self.looseness_s;
        }
        (time_s * f64::from(self.spec.sample_rate_hz)).round() as i64
    }

    fn play_drums(&mut self, bar: i64, section: Section, first: bool, last: bool) {
        let fill = last && self.rng.random_bool(0.5);
        if first && section.intensity > 0.5 {
            let at = self.sample(bar, 0);
            self.kit.strike(&mut self.buses.drums, at, Drum::Crash, 0.5);
        }
        for (lane, &(drum, pattern)) in self.drums.iter().enumerate() {
            // A sparse section keeps the first lanes only.
            if lane >= 2 && (lane as f32 - 1.0) / 3.0 > section.intensity {
                continue;
            }
            let steps = pattern.as_bytes();
            let offset = (bar.rem_euclid(2) as usize * STEPS) % steps.len();
            for step in 0..STEPS {
                if fill && step >= 12 && drum != Drum::Kick {
                    continue;
                }
                let gain = match steps[offset + step] {
                    b'X' => 1.0,
                    b'x' => 0.7,
                    b'o' => 0.3,
                    _ => continue,
                };
                let at = self.sample(bar, step);
                let gain = gain * self.rng.random_range(0.9..1.0);
                self.kit.strike(&mut self.buses.drums, at, drum, gain);
                if drum == Drum::Kick && at >= 0 {
                    self.buses.kicks.push(at as usize);
                }
            }
        }
        if fill {
            for step in 12..STEPS {
                let drum = if step < 14 { Drum::Snare } else { Drum::Tom };
                let at = self.sample(bar, step);
                self.kit.strike(&mut self.buses.drums, at, drum, 0.7);
            }
        }
    }

    fn degree(&self, bar: i64) -> i32 {
        self.progression[bar.rem_euclid(4) as usize]
    }

    fn play_bass(&mut self, bar: i64) {
        let (pattern, timbre) = self.bass;
        let (now, next) = (self.degree(bar), self.degree(bar + 1));
        for step in 0..STEPS {
            let degree_shift = match pattern[step % pattern.len()] {
                b'r' => (now, 0),
                b'f' => (now + 4, 0),
                b'o' => (now, 12),
                b'n' => (next - 1, 0),
                _ => continue,
            };
            let pitch = pitch_of(self.spec.key, degree_shift.0) + degree_shift.1;
            // Basses live between E1 and E3.
            let midi = fold(pitch, 28, 40) + if degree_shift.1 > 0 { 12 } else { 0 };
            let span = (bar, step, hold(pattern, step));
            self.note(Part::Bass, span, midi, 0.5, timbre);
        }
    }

    fn play_chords(&mut self, bar: i64) {
        let (pattern, timbre) = self.chords;
        let degree = self.degree(bar);
        let sevenths = self.spec.style.sheet().sevenths;
        let count = if sevenths { 4 } else { 3 };
        let mut stroke = 0;
        for step in 0..STEPS {
            if pattern[step % pattern.len()] != b'x' {
                continue;
            }
            let span = (bar, step, hold(pattern, step));
            let voices = if self.arpeggio { stroke % count..stroke % count + 1 } else { 0..count };
            for voice in voices {
                let midi = fold(pitch_of(self.spec.key, degree + 2 * voice), 55, 67);
                self.note(Part::Music, span, midi, 0.2, timbre);
            }
            stroke += 1;
        }
    }

    fn play_lead(&mut self, bar: i64, section: Section) {
        // Phrases: motif, motif, motif, answer.
        let (pattern, timbre) = self.lead;
        let half = bar.rem_euclid(2) as usize;
        if section.intensity < 0.4 && half == 1 {
            return;
        }
        let answer = if bar.rem_euclid(4) == 3 { 2 } else { 0 };
        for step in 0..STEPS {
            if pattern[step % pattern.len()] != b'x' {
                continue;
            }
            // On strong steps the melody lands on a note of the chord.
            let wander = self.motif[half * STEPS + step] - answer;
            let degree =
                if step % 8 == 0 { self.degree(bar) + 2 * (wander.rem_euclid(3)) } else { wander };
            let midi = fold(pitch_of(self.spec.key, degree), 67, 79);
            let span = (bar, step, hold(pattern, step));
            self.note(Part::Music, span, midi, 0.25, timbre);
        }
    }

    /// One long tonic chord over kick and crash ends a song.
    fn final_chord(&mut self, bar: i64) {
        let at = self.sample(bar, 0);
        self.kit.strike(&mut self.buses.drums, at, Drum::Kick, 1.0);
        self.kit.strike(&mut self.buses.drums, at, Drum::Crash, 0.6);
        let (chords, bass) = (self.chords.1, self.bass.1);
        for voice in 0..3 {
            let midi = fold(pitch_of(self.spec.key, 2 * voice), 55, 67);
            self.note(Part::Music, (bar, 0, 8), midi, 0.25, chords);
        }
        let root = fold(pitch_of(self.spec.key, 0), 28, 40);
        self.note(Part::Bass, (bar, 0, 8), root, 0.5, bass);
    }

    /// Plays a note that begins at a step of a bar and lasts a number of steps.
    fn note(
        &mut self,
        part: Part,
        span: (i64, usize, usize),
        midi: i32,
        gain: f32,
        timbre: Timbre,
    ) {
        let (bar, step, steps) = span;
        let start = self.sample(bar, step);
        let beat = bar as f64 * 4.0 + step as f64 / 4.0;
        let length_s = self.grid.time_s(beat + steps as f64 / 4.0) - self.grid.time_s(beat);
        let rate_hz = self.spec.sample_rate_hz as f32;
        let note = Note {
            start,
            hold: (0.9 * length_s * f64::from(rate_hz)) as usize,
            frequency_hz: 440.0 * ((midi - 69) as f32 / 12.0).exp2(),
            gain: gain * self.rng.random_range(0.85..1.0),
        };
        let bus = match part {
            Part::Bass => &mut self.buses.bass,
            Part::Music => &mut self.buses.music,
        };
        play_note(bus, rate_hz, note, &timbre);
    }
}

#[derive(Clone, Copy)]
enum Part {
    Bass,
    Music,
}

/// Steps that the note at `step` lasts: one, and one more for each `-` after.
fn hold(pattern: &[u8], step: usize) -> usize {
    let held = pattern[step % pattern.len()..].iter().skip(1);
    1 + held.take_while(|&&c| c == b'-').count()
}

/// Semitones above C of a scale degree, which may lie outside one octave.
fn pitch_of(key: MusicalKey, degree: i32) -> i32 {
    let scale = if key.minor { MINOR } else { MAJOR };
    let octave = degree.div_euclid(7);
    i32::from(key.tonic) + scale[degree.rem_euclid(7) as usize] + 12 * octave
}

/// The pitch moved by octaves into `low..high` (MIDI numbers, an octave wide).
fn fold(pitch: i32, low: i32, high: i32) -> i32 {
    low + (pitch - low).rem_euclid(high - low)
}

/// A melody as a bounded random walk over scale degrees.
fn walk(rng: &mut ChaCha8Rng) -> [i32; 2 * STEPS] {
    let mut degree = rng.random_range(0..5);
    let mut motif = [0; 2 * STEPS];
    for note in &mut motif {
        degree = (degree + rng.random_range(-2..=2)).clamp(-3, 8);
        *note = degree;
    }
    motif
}
