//! The band: plays a style through its form as a score with known beats.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::form::{self, Scene, Section};
use super::harmony::Harmony;
use super::melody::Phrase;
use super::score::{Note, Score};
use super::sounds::{drum_key, lead_floor, program};
use super::style::{DrumLine, Style, raster};
use super::timeline::Timeline;

const BASS: u8 = 0;
const FIRST_COMP: u8 = 1;
const LEAD: u8 = 6;
const SECOND: u8 = 7;
const DRUMS: u8 = 9;

/// A score and its truth.
pub struct Composition {
    pub score: Score,
    pub beats_s: Vec<f64>,
    pub downbeats_s: Vec<f64>,
}

struct Band<'a> {
    style: &'a Style,
    timeline: Timeline,
    /// Beats before the first whole bar.
    pickup: usize,
    /// Seconds of the first beat that are cut off.
    cut_s: f64,
    duration_s: f64,
    loose_s: f64,
    harmonies: [Harmony; 2],
    phrases: [Phrase; 2],
    lead_floor: i32,
    tonic: i32,
    /// How often a chord comes half a beat early.
    push: f64,
    staccato: f64,
    second: Option<i32>,
    drum_variant: usize,
    /// How hard kick, snare and cymbals are struck, of what the pattern says.
    force: [f64; 3],
    score: Score,
}

/// Plays a style for `duration_s`, from somewhere in its bar on.
pub fn compose(style: &Style, duration_s: f64, rng: &mut ChaCha8Rng) -> Composition {
    let mut band = Band::draw(style, duration_s, rng);
    let period_s = band.timeline.beats_s[1] - band.timeline.beats_s[0];
    let bars = band.timeline.beats_s.len() / style.beats;
    for section in form::draw(style, bars, period_s * style.beats as f64, rng) {
        for bar in section.bars.clone() {
            band.play_bar(&section, bar, rng);
        }
    }
    band.finish()
}

impl<'a> Band<'a> {
    fn draw(style: &'a Style, duration_s: f64, rng: &mut ChaCha8Rng) -> Self {
        let (low, high) = style.bpm;
        let bpm = low * (high / low).powf(rng.random_range(-0.1..1.1));
        let swing = rng.random_range(style.swing.0..=style.swing.1);
        let timeline =
            Timeline::draw(bpm.clamp(44.0, 216.0), duration_s, swing, style.sixteenths, rng);
        let tonic = rng.random_range(0..12);
        let minor = rng.random_bool(0.45);
        let harmonies = [(); 2].map(|()| Harmony::draw(0, minor, rng));
        let phrases = [(); 2].map(|()| {
            let rhythm = &style.rhythms[rng.random_range(0..style.rhythms.len())];
            Phrase::draw(style.beats, rhythm, rng)
        });
        let lead = style.leads[rng.random_range(0..style.leads.len())].clone();
        let mut band = Self {
            style,
            pickup: if rng.random_bool(0.5) { 0 } else { rng.random_range(0..style.beats) },
            cut_s: if rng.random_bool(0.5) { 0.0 } else { rng.random_range(0.0..60.0 / bpm) },
            timeline,
            duration_s,
            loose_s: if rng.random_bool(0.4) { 0.0 } else { rng.random_range(0.0..0.014) },
            harmonies,
            phrases,
            lead_floor: lead_floor(&lead),
            tonic,
            push: if rng.random_bool(0.2) { rng.random_range(0.1..0.7) } else { 0.0 },
            staccato: rng.random_range(0.4..1.0),
            second: rng.random_bool(0.3).then(|| [-12, 2, -3, 12][rng.random_range(0..4)]),
            drum_variant: rng.random_range(0..2),
            force: force(style, rng),
            score: Score::default(),
        };
        band.cast(&lead, rng);
        band
    }

    /// Gives every channel its sound and its volume.
    fn cast(&mut self, lead: &str, rng: &mut ChaCha8Rng) {
        let mut give = |channel: u8, program: u8, low: u8, rng: &mut ChaCha8Rng| {
            self.score.programs.push((channel, program, rng.random_range(low..=127)));
        };
        if let Some(part) = self.style.bass.first() {
            give(BASS, program(&part.sound, rng), 70, rng);
        }
        for (i, part) in self.style.comps.iter().enumerate() {
            give(FIRST_COMP + i as u8, program(&part.sound, rng), 45, rng);
        }
        give(LEAD, program(lead, rng), 60, rng);
        give(SECOND, program(lead, rng), 40, rng);
        let kit = [0, 0, 0, 8, 16, 24, 25, 32, 40, 48][rng.random_range(0..10)];
        give(DRUMS, kit, 70, rng);
    }

    fn play_bar(&mut self, section: &Section, bar: usize, rng: &mut ChaCha8Rng) {
        let scene = &section.scene;
        let last = bar + 1 == section.bars.end;
        let fill_from = (last && section.fill)
            .then(|| self.style.beats as f64 - [1.0, 1.0, 2.0][rng.random_range(0..3)]);
        for line in &scene.drums {
            self.drum_line(scene, line, bar, fill_from, rng);
        }
        if let (Some(from), false) = (fill_from, scene.drums.is_empty()) {
            self.fill(bar, from, rng);
        }
        if bar == section.bars.start && section.crash && !scene.drums.is_empty() {
            self.drum(bar, 0.0, 49, 110, rng);
        }
        self.bass(scene, bar, rng);
        for (i, pattern) in scene.comps.iter().enumerate() {
            if let Some(pattern) = pattern {
                self.comp(scene, i, *pattern, bar, rng);
            }
        }
        if scene.lead {
            self.lead(scene, bar, rng);
        }
    }

    /// The beat of the timeline at which a bar begins; before the pickup none.
    fn beat(&self, bar: usize, at: f64) -> Option<f64> {
        let beat = (bar * self.style.beats) as f64 + at - (self.style.beats - self.pickup) as f64;
        let beat = if self.pickup == 0 { beat + self.style.beats as f64 } else { beat };
        (beat >= 0.0).then_some(beat)
    }

    fn drum(&mut self, bar: usize, at: f64, key: u8, velocity: u8, rng: &mut ChaCha8Rng) {
        if let Some(beat) = self.beat(bar, at) {
            let start_s = self.timeline.at(beat);
            let force = match key {
                35 | 36 => self.force[0],
                37..=40 => self.force[1],
                _ => self.force[2],
            };
            let velocity = (f64::from(velocity) * force).clamp(1.0, 127.0) as u8;
            self.add(start_s, 0.1, DRUMS, i32::from(key), velocity, rng);
        }
    }

    fn drum_line(
        &mut self,
        scene: &Scene,
        (voice, pattern): &DrumLine,
        bar: usize,
        fill_from: Option<f64>,
        rng: &mut ChaCha8Rng,
    ) {
        let key = drum_key(*voice, self.drum_variant);
        for (at, symbol, _) in strokes(pattern, self.style.beats, bar, scene.feel) {
            if fill_from.is_some_and(|from| at >= from) && *voice != 'K' {
                continue;
            }
            let velocity = match symbol {
                b'X' => 115,
                b'x' => 90,
                b'o' => 42,
                b'?' if rng.random_bool(0.5) => 70,
                _ => continue,
            };
            if !rng.random_bool(0.015) {
                self.drum(bar, at, key, velocity, rng);
            }
        }
    }

    /// Toms and snare to the end of the bar.
    fn fill(&mut self, bar: usize, from: f64, rng: &mut ChaCha8Rng) {
        let step = [0.25, 0.25, 0.5, 1.0 / 3.0][rng.random_range(0..4)];
        let keys = [38, 38, 50, 47, 45, 41];
        let mut at = from.max(0.0);
        let mut place: usize = rng.random_range(0..3);
        while at < self.style.beats as f64 - 1e-6 {
            if rng.random_bool(0.85) {
                self.drum(bar, at, keys[place.min(5)], rng.random_range(75..120), rng);
            }
            place += usize::from(rng.random_bool(0.4));
            at += step;
        }
    }

    fn bass(&mut self, scene: &Scene, bar: usize, rng: &mut ChaCha8Rng) {
        let Some((part, pattern)) = scene.bass else {
            return;
        };
        let pattern = &self.style.bass[part].patterns[pattern];
        for (at, symbol, length) in strokes(pattern, self.style.beats, bar, 1.0) {
            let place = self.place(bar, at);
            let harmony = &self.harmonies[scene.harmony];
            let key = match symbol {
                b'r' => harmony.tone(place, 0),
                b'5' => harmony.tone(place, 4),
                b'8' => harmony.tone(place, 0) + 12,
                b'3' => harmony.tone(place, 2),
                b'6' => harmony.tone(place, 5),
                b'w' if at == 0.0 => harmony.tone(place, 0),
                b'w' => harmony.tone(place, [0, 1, 2, 3, 4, 5][rng.random_range(0..6)]),
                b'p' => harmony.tone(place + 0.5, 0) + [-1, 1, -2][rng.random_range(0..3)],
                _ => continue,
            };
            let low =
                28 + (self.tonic + key - 28).rem_euclid(12) + if symbol == b'8' { 12 } else { 0 };
            let strong = if at == 0.0 { 12 } else { 0 };
            if let Some(beat) = self.beat(bar, at) {
                let start_s = self.timeline.at(beat);
                self.add(start_s, self.seconds(beat, length), BASS, low, 84 + strong, rng);
            }
        }
    }

    fn comp(
        &mut self,
        scene: &Scene,
        part: usize,
        pattern: usize,
        bar: usize,
        rng: &mut ChaCha8Rng,
    ) {
        let pattern = &self.style.comps[part].patterns[pattern];
        let pushed = rng.random_bool(self.push);
        for (i, (at, symbol, length)) in
            strokes(pattern, self.style.beats, bar, 1.0).into_iter().enumerate()
        {
            let chord = self.harmonies[scene.harmony].chord(self.place(bar, at));
            let early = if pushed && at == 0.0 && bar > 0 { 0.5 } else { 0.0 };
            let keys: &[i32] = match symbol {
                b'X' | b'x' => &chord,
                b'a' => &[chord[i % chord.len()] + if i / chord.len() % 2 == 1 { 12 } else { 0 }],
                b'b' => &[chord[0] - 12],
                _ => continue,
            };
            let strong = if symbol == b'X' { 12 } else { 0 };
            let Some(beat) = self.beat(bar, at - early) else {
                continue;
            };
            let start_s = self.timeline.at(beat);
            for key in keys {
                let key = 50 + (self.tonic - 50).rem_euclid(12) + key;
                let channel = FIRST_COMP + part as u8;
                self.add(
                    start_s,
                    self.seconds(beat, length + early),
                    channel,
                    key,
                    76 + strong,
                    rng,
                );
            }
        }
    }

    fn lead(&mut self, scene: &Scene, bar: usize, rng: &mut ChaCha8Rng) {
        let harmony = &self.harmonies[scene.harmony];
        let notes = self.phrases[scene.phrase].bar(bar, self.style.beats, harmony);
        for (cell, key) in notes {
            let Some(beat) = self.beat(bar, cell.at) else {
                continue;
            };
            let start_s = match cell.swung {
                true => self.timeline.at(beat),
                false => self.timeline.straight(beat),
            };
            let key = self.lead_floor + (self.tonic - self.lead_floor).rem_euclid(12) + key;
            let strong = if cell.at.fract() < 1e-6 { 10 } else { 0 };
            let length_s = 0.95 * self.seconds(beat, cell.length);
            self.add(start_s, length_s, LEAD, key, 84 + strong, rng);
            if let Some(above) = self.second {
                self.add(start_s, length_s, SECOND, key + above, 76, rng);
            }
        }
    }

    fn place(&self, bar: usize, at: f64) -> f64 {
        bar as f64 + at / self.style.beats as f64
    }

    fn seconds(&self, beat: f64, length: f64) -> f64 {
        let short = if length < 0.6 { self.staccato } else { 0.95 };
        (self.timeline.straight(beat + length) - self.timeline.straight(beat)) * short
    }

    fn add(
        &mut self,
        start_s: f64,
        length_s: f64,
        channel: u8,
        key: i32,
        velocity: u8,
        rng: &mut ChaCha8Rng,
    ) {
        let start_s = start_s - self.cut_s + self.loose_s * rng.random_range(-1.0..1.0);
        let velocity = (f64::from(velocity) * rng.random_range(0.88..1.08)).min(127.0) as u8;
        if start_s >= 0.0 && start_s < self.duration_s {
            let key = key.clamp(24, 104) as u8;
            self.score.notes.push(Note { start_s, length_s, channel, key, velocity });
        }
    }

    fn finish(self) -> Composition {
        let inside = |s: &f64| (0.0..self.duration_s).contains(s);
        let all: Vec<f64> = self.timeline.beats_s.iter().map(|s| s - self.cut_s).collect();
        let bars = all.iter().skip(self.pickup).step_by(self.style.beats);
        Composition {
            downbeats_s: bars.copied().filter(inside).collect(),
            beats_s: all.iter().copied().filter(inside).collect(),
            score: self.score,
        }
    }
}

/// A kick that drowns under snare and guitars is usual where both are loud.
fn force(style: &Style, rng: &mut ChaCha8Rng) -> [f64; 3] {
    let drowned = if style.is_loud() { 0.6 } else { 0.3 };
    let kick = if rng.random_bool(drowned) { rng.random_range(0.3..0.9) } else { 1.0 };
    [kick, rng.random_range(0.7..1.1), rng.random_range(0.4..1.1)]
}

/// The strokes of a pattern in one bar: beats from the bar's beginning, symbol,
/// length in beats. `feel` 2 plays it at half its speed.
fn strokes(pattern: &[u8], beats: usize, bar: usize, feel: f64) -> Vec<(f64, u8, f64)> {
    let (bars, step) = raster(pattern, beats);
    let (bars, step) = (bars as f64 * feel, step * feel);
    // A pattern at double speed comes twice in a bar.
    let turns = if bars < 1.0 { 2 } else { 1 };
    let first = if bars > 1.0 { (bar as f64).rem_euclid(bars) * beats as f64 } else { 0.0 };
    let mut out = Vec::new();
    for turn in 0..turns {
        for (i, &symbol) in pattern.iter().enumerate() {
            let at = (turn * pattern.len() + i) as f64 * step - first;
            if symbol == b'.' || symbol == b'-' || at < -1e-6 || at > beats as f64 - 1e-6 {
                continue;
            }
            let held = pattern[i + 1..].iter().take_while(|&&s| s == b'-').count();
            out.push((at, symbol, step * (1 + held) as f64));
        }
    }
    out
}
