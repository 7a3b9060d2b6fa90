//! How the tracked beat is read: as it is, every second one, twice as many, or
//! the off-beat.
//!
//! The belief may follow eighths, half notes or off-beats as surely as beats.
//! What tells them apart is how strong kicks, the middle voices and the
//! network's beats are at the eight half-beats of four tracked beats, whether
//! they alternate from beat to beat (kick, snare, kick, snare), and how usual the
//! tempi are: a linear score for each of five readings, its weights
//! fitted by softmax regression, a sample a second, to rendered songs and the
//! four tracks that may be tuned on (`audio/reference/fit_level.py`). The scores
//! are evidence for a belief over the readings, which seldom change, so that a
//! verse without drums is danced like the one before.

/// How loud each of these is heard, hop by hop: onsets below 160 Hz, onsets
/// from there to 800 Hz, the network's beats.
pub(crate) const VOICES: usize = 3;
/// How much later than the onsets the network's beats come, seconds.
const NETWORK_LATE_S: f64 = 0.021;
/// Tracked beats that are told apart, and their half-beats.
const BEATS: u8 = 4;
const PLACES: usize = 2 * BEATS as usize;
/// Share of a half-beat around each place in which a voice counts.
const REACH: f64 = 0.24;
/// Weight of the newest in the running strengths.
const NEWEST: f32 = 0.06;

/// Nobody dances beats slower or faster than this.
const SLOWEST_BPM: f64 = 60.0;
const FASTEST_BPM: f64 = 195.0;
/// Where usual tempi are counted from.
const USUAL_BPM: f64 = 122.0;
/// Scores are evidence of this weight, log-likelihood a second, while the music
/// is new and then.
const EVIDENCE_WHEN_NEW_PER_S: f64 = 0.1;
const EVIDENCE_PER_S: f64 = 0.05;
/// Chance that another reading becomes right, a second.
const CHANGE_PER_S: f64 = 0.005;
/// How much likelier than the present one another reading must be; while the
/// music is new there is less to lose.
const SURER: f64 = 10.0;
const SURER_WHEN_NEW: f64 = 2.0;
const NEW_S: f64 = 15.0;
/// A reading this near to what was danced goes on with it: beats and octaves
/// apart, together.
const NEAR: f64 = 0.15;
/// Belief in a reading that goes on with what was danced; while the music is new
/// that may well have been the off-beat, and the tracker has just found the beat.
const KEPT: f64 = 0.9;
const KEPT_WHEN_NEW: f64 = 0.3;

/// What is told of a reading.
const VALUES: usize = 6 + 4 * VOICES;
/// Weights of: the square of the octaves from the usual tempo, the octaves,
/// being double, half, off-beat; how far kicks and middle voices take turns;
/// then for each voice its strength on the beats of the reading, between them,
/// and at their quarters, and how much it differs from beat to beat.
const WEIGHTS: [f64; VALUES] = [
    2.444, -1.453, -0.750, 0.704, 0.404, -0.522, 0.571, -0.286, -2.978, 1.619, 1.010, 0.541,
    -4.114, 1.069, 4.849, -2.315, -2.587, 0.477,
];

/// A reading of the tracked beat.
struct Reading {
    /// Danced beats in a tracked one.
    rate: f64,
    /// Phase of the danced beat at the first tracked one.
    offset: f64,
    /// Which of the half-beats are every first beat, every second beat, lie
    /// between them, lie at quarters.
    first: &'static [usize],
    second: &'static [usize],
    between: &'static [usize],
    quarters: &'static [usize],
    /// Double, half, off-beat.
    kind: [f64; 3],
}

const COUNT: usize = 5;
const READINGS: [Reading; COUNT] = [
    Reading {
        rate: 1.0,
        offset: 0.0,
        first: &[0, 4],
        second: &[2, 6],
        between: &[1, 3, 5, 7],
        quarters: &[],
        kind: [0.0, 0.0, 0.0],
    },
    Reading {
        rate: 0.5,
        offset: 0.0,
        first: &[0],
        second: &[4],
        between: &[2, 6],
        quarters: &[1, 3, 5, 7],
        kind: [0.0, 1.0, 0.0],
    },
    Reading {
        rate: 0.5,
        offset: 0.5,
        first: &[2],
        second: &[6],
        between: &[0, 4],
        quarters: &[1, 3, 5, 7],
        kind: [0.0, 1.0, 0.0],
    },
    Reading {
        rate: 1.0,
        offset: 0.5,
        first: &[1, 5],
        second: &[3, 7],
        between: &[0, 2, 4, 6],
        quarters: &[],
        kind: [0.0, 0.0, 1.0],
    },
    Reading {
        rate: 2.0,
        offset: 0.0,
        first: &[0, 2, 4, 6],
        second: &[1, 3, 5, 7],
        between: &[],
        quarters: &[],
        kind: [1.0, 0.0, 0.0],
    },
];

/// One way to read the tracked beat, and what tells for and against it.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelReading {
    /// Phase of the beat so read, in beats; may be beyond 1.
    pub phase: f64,
    /// Its tempo.
    pub tempo_bpm: f64,
    /// The values that are weighed; none for a tempo that nobody dances to.
    pub values: Option<Vec<f64>>,
}

/// Running strengths of one voice at the four half-beats.
#[derive(Clone, Copy, Debug, Default)]
struct Strengths {
    running: [f32; PLACES],
    place: usize,
    /// The strongest at the present place.
    peak: f32,
}

impl Strengths {
    /// Takes one hop at a time in half-beats.
    fn hear(&mut self, half_beats: f64, strength: f32) {
        let nearest = half_beats.round();
        let place = nearest as usize % PLACES;
        if place != self.place {
            let running = &mut self.running[self.place];
            *running += NEWEST * (self.peak - *running);
            self.peak = 0.0;
            self.place = place;
        }
        if (half_beats - nearest).abs() < REACH {
            self.peak = self.peak.max(strength);
        }
    }

    /// Mean strength at these places, relative to the strongest place.
    fn mean(&self, places: &[usize]) -> f64 {
        let most = self.running.iter().fold(1e-3f32, |m, &v| m.max(v));
        let sum: f32 = places.iter().map(|&place| self.running[place]).sum();
        f64::from(sum / most) / places.len().max(1) as f64
    }
}

/// What is heard of four beats, what is believed, and the choice.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Level {
    voices: [Strengths; VOICES],
    /// Which of the four beats the tracker is in.
    beat: u8,
    belief: [f64; COUNT],
    reading: usize,
    /// For how long this music's beat has been read, seconds.
    age_s: f64,
}

impl Default for Level {
    fn default() -> Self {
        Self {
            voices: Default::default(),
            beat: 0,
            belief: [1.0 / COUNT as f64; COUNT],
            reading: 0,
            age_s: 0.0,
        }
    }
}

impl Level {
    /// So many beats have begun; below zero where the phase was pulled back.
    pub(crate) fn count(&mut self, beats: i64) {
        self.beat = (i64::from(self.beat) + beats).rem_euclid(i64::from(BEATS)) as u8;
    }

    /// Takes one hop of the voices at the tracked phase and tempo.
    pub(crate) fn hear(&mut self, phase: f64, bpm: f64, voices: [f32; VOICES]) {
        let beats = self.beats(phase);
        let late_beats = [0.0, 0.0, NETWORK_LATE_S * bpm / 60.0];
        for ((voice, strength), late) in self.voices.iter_mut().zip(voices).zip(late_beats) {
            voice.hear(2.0 * (beats - late).rem_euclid(f64::from(BEATS)), strength);
        }
    }

    /// Begins anew with what has been heard so far.
    pub(crate) fn begin(&mut self) {
        *self = Self {
            voices: self.voices,
            beat: self.beat,
            ..Self::default()
        };
    }

    /// Reconsiders how a beat at `bpm` is read; whether that has changed.
    pub(crate) fn choose(&mut self, bpm: f64, elapsed_s: f64) -> bool {
        let scores: [f64; COUNT] = std::array::from_fn(|i| self.score(&READINGS[i], bpm));
        let best = scores.iter().fold(f64::NEG_INFINITY, |m, &v| m.max(v));
        self.age_s += elapsed_s;
        let (surer, weight_per_s) = match self.age_s < NEW_S {
            true => (SURER_WHEN_NEW, EVIDENCE_WHEN_NEW_PER_S),
            false => (SURER, EVIDENCE_PER_S),
        };
        let change = CHANGE_PER_S * elapsed_s;
        for (belief, score) in self.belief.iter_mut().zip(scores) {
            *belief += change * (1.0 / COUNT as f64 - *belief);
            *belief *= (weight_per_s * elapsed_s * (score - best)).exp();
        }
        let sum: f64 = self.belief.iter().sum();
        self.belief.iter_mut().for_each(|b| *b /= sum);
        let likeliest = (0..COUNT).max_by(|&a, &b| self.belief[a].total_cmp(&self.belief[b]));
        let likeliest = likeliest.unwrap_or(0);
        let changed = self.belief[likeliest] > surer * self.belief[self.reading];
        if changed {
            self.reading = likeliest;
        }
        changed
    }

    fn score(&self, reading: &Reading, bpm: f64) -> f64 {
        self.values(reading, bpm)
            .map_or(f64::NEG_INFINITY, |values| {
                values.iter().zip(WEIGHTS).map(|(v, w)| v * w).sum()
            })
    }

    /// What a score is made of; none for a reading that nobody dances.
    fn values(&self, reading: &Reading, bpm: f64) -> Option<[f64; VALUES]> {
        let bpm = bpm * reading.rate;
        if !(SLOWEST_BPM..=FASTEST_BPM).contains(&bpm) {
            return None;
        }
        let octaves = (bpm / USUAL_BPM).log2();
        let tempo = [-0.5 * octaves * octaves, octaves];
        let parts = [
            reading.first,
            reading.second,
            reading.between,
            reading.quarters,
        ];
        let means = self.voices.map(|voice| parts.map(|part| voice.mean(part)));
        let heard = means.iter().flat_map(|[first, second, between, quarters]| {
            let on = 0.5 * (first + second);
            [on, *between, *quarters, (first - second).abs()]
        });
        let [kicks, middle, ..] = means.map(|[first, second, ..]| first - second);
        let turns = [-kicks * middle];
        let mut all = tempo
            .into_iter()
            .chain(reading.kind)
            .chain(turns)
            .chain(heard);
        Some(std::array::from_fn(|_| all.next().unwrap_or_default()))
    }

    /// Every reading of the tracked phase and tempo, to fit the weights to.
    pub(crate) fn readings(&self, phase: f64, bpm: f64) -> Vec<LevelReading> {
        let reading = |i: usize| {
            let (phase, danced_bpm) = self.read(i, phase, bpm);
            LevelReading {
                phase,
                tempo_bpm: danced_bpm,
                values: self.values(&READINGS[i], bpm).map(Vec::from),
            }
        };
        (0..COUNT).map(reading).collect()
    }

    fn beats(&self, phase: f64) -> f64 {
        phase + f64::from(self.beat)
    }

    /// The danced phase and tempo of a tracked phase, which may run past one.
    pub(crate) fn apply(&self, phase: f64, bpm: f64) -> (f64, f64) {
        self.read(self.reading, phase, bpm)
    }

    fn read(&self, reading: usize, phase: f64, bpm: f64) -> (f64, f64) {
        let Reading { rate, offset, .. } = READINGS[reading];
        (self.beats(phase) * rate + offset, bpm * rate)
    }

    /// The tracker has taken over another beat: stay at the danced tempo and
    /// phase if that beat can be read so. Whether it can.
    pub(crate) fn carry_over(&mut self, danced: (f64, f64), phase: f64, bpm: f64) -> bool {
        let (danced_phase, danced_bpm) = danced;
        let age_s = self.age_s;
        *self = Self::default();
        let now = *self;
        let off = |reading: usize| {
            let (now, now_bpm) = now.read(reading, phase, bpm);
            let off = now - danced_phase;
            let octaves = (now_bpm / danced_bpm).log2().abs();
            (off - off.round()).abs() + octaves
        };
        let nearest = (0..COUNT).min_by(|&a, &b| off(a).total_cmp(&off(b)));
        let Some(reading) = nearest.filter(|&reading| off(reading) < NEAR) else {
            return false;
        };
        self.reading = reading;
        self.age_s = age_s;
        let kept = match age_s < NEW_S {
            true => KEPT_WHEN_NEW,
            false => KEPT,
        };
        self.belief = [(1.0 - kept) / (COUNT - 1) as f64; COUNT];
        self.belief[reading] = kept;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOP_S: f64 = 1.0 / 160.0;

    /// Two beats at `bpm`, again and again for a minute, with these strengths of
    /// every voice at their four half-beats. The danced tempo, and how far the
    /// danced beat is from the first of the two, beats.
    fn danced(bpm: f64, strengths: [f32; 4]) -> (f64, f64) {
        let mut level = Level::default();
        hear(&mut level, bpm, strengths, 60.0)
    }

    /// The same for so many seconds more.
    fn hear(level: &mut Level, bpm: f64, strengths: [f32; 4], seconds: f64) -> (f64, f64) {
        let mut phase = 0.0;
        for hop in 0..(seconds / HOP_S) as usize {
            phase += bpm / 60.0 * HOP_S;
            level.count(phase.floor() as i64);
            phase = phase.fract();
            let beats = phase + f64::from(level.beat);
            let at = |late_s: f64| {
                let half_beats = 2.0 * (beats - late_s * bpm / 60.0).rem_euclid(2.0);
                let near = (half_beats - half_beats.round()).abs() < 0.1;
                strengths[half_beats.round() as usize % 4] * f32::from(u8::from(near))
            };
            level.hear(phase, bpm, [at(0.0), at(0.0), at(NETWORK_LATE_S)]);
            if hop % 8 == 0 {
                level.choose(bpm, 8.0 * HOP_S);
            }
        }
        let (_, tempo) = level.apply(phase, bpm);
        (tempo, READINGS[level.reading].offset)
    }

    #[test]
    fn plain_beats_are_danced_as_they_are() {
        for bpm in [100.0, 124.0, 150.0, 170.0] {
            assert_eq!(danced(bpm, [1.0, 0.2, 0.9, 0.2]), (bpm, 0.0));
        }
    }

    #[test]
    fn weak_every_second_beat_means_half_the_tempo() {
        assert_eq!(danced(186.0, [1.0, 0.1, 0.2, 0.1]), (93.0, 0.0));
        assert_eq!(danced(150.0, [0.15, 0.1, 1.0, 0.1]), (75.0, 0.5));
    }

    #[test]
    fn strong_offbeats_without_beats_are_the_beat() {
        assert_eq!(danced(124.0, [0.2, 1.0, 0.2, 1.0]), (124.0, 0.5));
    }

    #[test]
    fn an_early_leap_onto_the_beat_is_followed_soon_a_late_one_is_not() {
        const BEATS: [f32; 4] = [1.0, 0.3, 1.0, 0.3];
        for (age_s, offset) in [(5.0, 0.0), (60.0, 0.5)] {
            let mut level = Level::default();
            hear(&mut level, 124.0, BEATS, age_s);
            // What was danced is the off-beat of what is tracked from now on.
            assert!(level.carry_over((0.5, 124.0), 0.0, 124.0));
            assert_eq!(READINGS[level.reading].offset, 0.5);
            assert_eq!(hear(&mut level, 124.0, BEATS, 9.0), (124.0, offset));
        }
    }

    #[test]
    fn another_tracked_beat_is_read_as_what_was_danced() {
        // The tracker leaps from the beat to the off-beat, then to the double.
        let mut level = Level::default();
        let danced = level.apply(0.3, 120.0);
        assert!(level.carry_over(danced, 0.8, 120.0));
        let (phase, bpm) = level.apply(0.8, 120.0);
        assert!((phase.rem_euclid(1.0) - 0.3).abs() < 1e-9 && bpm == 120.0);
        let danced = (0.55, 93.0);
        assert!(level.carry_over(danced, 0.1, 186.0));
        let (phase, bpm) = level.apply(0.1, 186.0);
        assert!((phase.rem_euclid(1.0) - 0.55).abs() < 1e-9 && bpm == 93.0);
        assert!(!level.carry_over((0.2, 100.0), 0.2, 140.0));
        assert_eq!(level.apply(0.2, 140.0), (0.2, 140.0));
    }
}
