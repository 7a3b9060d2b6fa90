//! The metrical level: whether the tracked period is the beat as it is, every
//! second one, twice as many, or the off-beat.
//!
//! The tempo filter may follow eighths, half notes or off-beats as surely as
//! beats. The strengths of three parts (kicks, middle voices, the network's
//! beats) at the eight half-beats of four tracked beats tell them apart, with
//! their alternation from beat to beat (kick, snare, kick, snare) and the usual
//! tempi: a linear score for each of five readings, its weights fitted by
//! softmax regression, a sample a second, to rendered songs and the four tracks
//! of the tuning set (`audio/reference/fit_level.py`). The scores are evidence
//! for a probability of each reading, which changes slowly, so that a verse
//! without drums keeps the level of the one before.

/// Parts whose strength counts: onsets below 160 Hz, onsets from there to
/// 800 Hz, the small network's beats.
pub(super) const PARTS: usize = 3;
/// Delay of the small network's beats against the onsets, seconds.
const NETWORK_LATE_S: f64 = 0.021;
/// Tracked beats that are told apart, and their half-beats.
const BEATS: u8 = 4;
const PLACES: usize = 2 * BEATS as usize;
/// Share of a half-beat around each place in which a part counts.
const REACH: f64 = 0.24;
/// Weight of the newest value in the running strengths.
const NEWEST: f32 = 0.06;

/// Range of tempi that can be danced to.
const SLOWEST_BPM: f64 = 60.0;
const FASTEST_BPM: f64 = 195.0;
/// Tempo from which octaves are counted.
const USUAL_BPM: f64 = 122.0;
/// Weight of the scores, log-likelihood a second: in new music, and later.
const EVIDENCE_WHEN_NEW_PER_S: f64 = 0.1;
const EVIDENCE_PER_S: f64 = 0.05;
/// Probability that another reading becomes right, a second.
const CHANGE_PER_S: f64 = 0.005;
/// Ratio of probabilities at which another reading replaces the present one;
/// lower in new music, where a change disturbs less.
const SURER: f64 = 10.0;
const SURER_WHEN_NEW: f64 = 2.0;
const NEW_S: f64 = 15.0;
/// Distance (beats plus octaves) within which a reading continues the output.
const NEAR: f64 = 0.15;
/// Probability of a reading that continues the output; lower in new music, where
/// the output may have been the off-beat and the filter has just found the beat.
const KEPT: f64 = 0.9;
const KEPT_WHEN_NEW: f64 = 0.3;

/// Values of a reading that are weighed.
const VALUES: usize = 6 + 4 * PARTS;
/// Weights of: the square of the octaves from the usual tempo, the octaves,
/// being double, half, off-beat; how far kicks and middle voices alternate; then
/// for each part its strength on the beats of the reading, between them, and at
/// their quarters, and its difference from beat to beat.
const WEIGHTS: [f64; VALUES] = [
    2.444, -1.453, -0.750, 0.704, 0.404, -0.522, 0.571, -0.286, -2.978, 1.619, 1.010, 0.541,
    -4.114, 1.069, 4.849, -2.315, -2.587, 0.477,
];

#[derive(Clone, Copy)]
struct Level {
    rate: f64,
    /// Phase of the output beat at the first tracked one.
    offset: f64,
}

const COUNT: usize = 5;
const LEVELS: [Level; COUNT] = [
    Level::new(1.0, 0.0),
    Level::new(0.5, 0.0),
    Level::new(0.5, 0.5),
    Level::new(1.0, 0.5),
    Level::new(2.0, 0.0),
];

impl Level {
    const fn new(rate: f64, offset: f64) -> Self {
        Self { rate, offset }
    }

    /// The role of a half-beat in this reading: 0 on the even output beats, 1 on
    /// the odd ones, 2 between beats, 3 at their quarters.
    fn role(self, place: usize) -> usize {
        let beats = place as f64 / 2.0 * self.rate + self.offset;
        match (beats.fract() * 4.0) as usize {
            0 => beats as usize % 2,
            2 => 2,
            _ => 3,
        }
    }

    /// Whether the reading is the double, the half, the off-beat.
    fn kind(self) -> [f64; 3] {
        let off_beat = self.rate == 1.0 && self.offset > 0.0;
        [self.rate == 2.0, self.rate == 0.5, off_beat].map(|is| f64::from(u8::from(is)))
    }
}

/// One reading of the tracked beat and the values of its score.
#[derive(Clone, Debug, PartialEq)]
pub struct MetricalReading {
    /// Phase of the beat in this reading, in beats; may be beyond 1.
    pub phase: f64,
    /// Tempo of this reading, beats a minute.
    pub tempo_bpm: f64,
    /// The values that are weighed; `None` for a tempo outside the danceable range.
    pub values: Option<Vec<f64>>,
}

/// Running strengths of one part at the eight half-beats.
#[derive(Clone, Copy, Debug, Default)]
struct Strengths {
    running: [f32; PLACES],
    place: usize,
    peak: f32,
}

impl Strengths {
    /// Takes the strength of one hop; its time in half-beats.
    fn push(&mut self, half_beats: f64, strength: f32) {
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

    /// Mean strength of each [role](Level::role), relative to the strongest place.
    fn means(&self, level: Level) -> [f64; 4] {
        let most = self.running.iter().fold(1e-3f32, |m, &v| m.max(v));
        // Negative zero is the empty sum of floats.
        let (mut sums, mut counts) = ([-0.0f32; 4], [0u8; 4]);
        for (place, strength) in self.running.iter().enumerate() {
            sums[level.role(place)] += strength;
            counts[level.role(place)] += 1;
        }
        std::array::from_fn(|role| f64::from(sums[role] / most) / f64::from(counts[role].max(1)))
    }
}

/// The strengths of four beats, the probability of each reading, and the choice.
#[derive(Clone, Copy, Debug)]
pub(super) struct MetricalLevel {
    parts: [Strengths; PARTS],
    /// Index of the present beat, 0 to 3.
    beat: u8,
    probability: [f64; COUNT],
    chosen: usize,
    /// Time since this music was locked, seconds.
    age_s: f64,
}

impl Default for MetricalLevel {
    fn default() -> Self {
        Self {
            parts: Default::default(),
            beat: 0,
            probability: [1.0 / COUNT as f64; COUNT],
            chosen: 0,
            age_s: 0.0,
        }
    }
}

impl MetricalLevel {
    /// Counts beats that have begun; negative where the phase was pulled back.
    pub(super) fn count(&mut self, beats: i64) {
        self.beat = (i64::from(self.beat) + beats).rem_euclid(i64::from(BEATS)) as u8;
    }

    /// Takes the strengths of the parts in one hop at the tracked phase and tempo.
    pub(super) fn push(&mut self, phase: f64, bpm: f64, strengths: [f32; PARTS]) {
        let beats = self.beats(phase);
        let late_beats = [0.0, 0.0, NETWORK_LATE_S * bpm / 60.0];
        for ((part, strength), late) in self.parts.iter_mut().zip(strengths).zip(late_beats) {
            part.push(2.0 * (beats - late).rem_euclid(f64::from(BEATS)), strength);
        }
    }

    /// Restarts the choice with the strengths gathered so far.
    pub(super) fn restart(&mut self) {
        *self = Self { parts: self.parts, beat: self.beat, ..Self::default() };
    }

    /// Updates the choice for a tracked beat at `bpm`.
    pub(super) fn choose(&mut self, bpm: f64, elapsed_s: f64) {
        let scores: [f64; COUNT] = std::array::from_fn(|i| self.score(LEVELS[i], bpm));
        let best = scores.iter().fold(f64::NEG_INFINITY, |m, &v| m.max(v));
        self.age_s += elapsed_s;
        let (surer, weight_per_s) = match self.age_s < NEW_S {
            true => (SURER_WHEN_NEW, EVIDENCE_WHEN_NEW_PER_S),
            false => (SURER, EVIDENCE_PER_S),
        };
        let change = CHANGE_PER_S * elapsed_s;
        let all = &mut self.probability;
        for (probability, score) in all.iter_mut().zip(scores) {
            *probability += change * (1.0 / COUNT as f64 - *probability);
            *probability *= (weight_per_s * elapsed_s * (score - best)).exp();
        }
        let sum: f64 = all.iter().sum();
        all.iter_mut().for_each(|p| *p /= sum);
        let likeliest = (0..COUNT).max_by(|&a, &b| all[a].total_cmp(&all[b]));
        let likeliest = likeliest.unwrap_or(0);
        if all[likeliest] > surer * all[self.chosen] {
            self.chosen = likeliest;
        }
    }

    fn score(&self, level: Level, bpm: f64) -> f64 {
        let Some(values) = self.values(level, bpm) else {
            return f64::NEG_INFINITY;
        };
        values.iter().zip(WEIGHTS).map(|(v, w)| v * w).sum()
    }

    /// The values of a score; `None` outside the danceable range.
    fn values(&self, level: Level, bpm: f64) -> Option<[f64; VALUES]> {
        let bpm = bpm * level.rate;
        if !(SLOWEST_BPM..=FASTEST_BPM).contains(&bpm) {
            return None;
        }
        let octaves = (bpm / USUAL_BPM).log2();
        let tempo = [-0.5 * octaves * octaves, octaves];
        let means = self.parts.map(|part| part.means(level));
        let strengths = means.iter().flat_map(|[even, odd, between, quarters]| {
            let on = 0.5 * (even + odd);
            [on, *between, *quarters, (even - odd).abs()]
        });
        let [kicks, middle, _] = means.map(|[even, odd, ..]| even - odd);
        let alternation = [-kicks * middle];
        let tempo = tempo.into_iter().chain(level.kind());
        let mut all = tempo.chain(alternation).chain(strengths);
        Some(std::array::from_fn(|_| all.next().unwrap_or_default()))
    }

    /// Every reading of the tracked phase and tempo, to fit the weights to.
    pub(super) fn readings(&self, phase: f64, bpm: f64) -> Vec<MetricalReading> {
        let reading = |i: usize| {
            let (phase, tempo_bpm) = self.read(i, phase, bpm);
            let values = self.values(LEVELS[i], bpm).map(Vec::from);
            MetricalReading { phase, tempo_bpm, values }
        };
        (0..COUNT).map(reading).collect()
    }

    fn beats(&self, phase: f64) -> f64 {
        phase + f64::from(self.beat)
    }

    /// The output phase and tempo of a tracked phase, which may run past one.
    pub(super) fn apply(&self, phase: f64, bpm: f64) -> (f64, f64) {
        self.read(self.chosen, phase, bpm)
    }

    fn read(&self, reading: usize, phase: f64, bpm: f64) -> (f64, f64) {
        let Level { rate, offset } = LEVELS[reading];
        (self.beats(phase) * rate + offset, bpm * rate)
    }

    /// After a leap of the tracker to another beat: chooses the reading that
    /// continues the output, if there is one.
    pub(super) fn carry_over(&mut self, output: (f64, f64), phase: f64, bpm: f64) {
        let (output_phase, output_bpm) = output;
        let age_s = self.age_s;
        *self = Self::default();
        let now = *self;
        let off = |reading: usize| {
            let (now, now_bpm) = now.read(reading, phase, bpm);
            let off = now - output_phase;
            let octaves = (now_bpm / output_bpm).log2().abs();
            (off - off.round()).abs() + octaves
        };
        let nearest = (0..COUNT).min_by(|&a, &b| off(a).total_cmp(&off(b)));
        let Some(reading) = nearest.filter(|&reading| off(reading) < NEAR) else {
            return;
        };
        self.chosen = reading;
        self.age_s = age_s;
        let kept = match age_s < NEW_S {
            true => KEPT_WHEN_NEW,
            false => KEPT,
        };
        self.probability = [(1.0 - kept) / (COUNT - 1) as f64; COUNT];
        self.probability[reading] = kept;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOP_S: f64 = 1.0 / 160.0;

    /// Two beats at `bpm`, again and again for a minute, with these strengths of
    /// every part at their four half-beats. The danced tempo, and how far the
    /// danced beat is from the first of the two, beats.
    fn danced(bpm: f64, strengths: [f32; 4]) -> (f64, f64) {
        let mut level = MetricalLevel::default();
        hear(&mut level, bpm, strengths, 60.0)
    }

    /// The same for so many seconds more.
    fn hear(level: &mut MetricalLevel, bpm: f64, strengths: [f32; 4], seconds: f64) -> (f64, f64) {
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
            level.push(phase, bpm, [at(0.0), at(0.0), at(NETWORK_LATE_S)]);
            if hop % 8 == 0 {
                level.choose(bpm, 8.0 * HOP_S);
            }
        }
        let (_, tempo) = level.apply(phase, bpm);
        (tempo, LEVELS[level.chosen].offset)
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
            let mut level = MetricalLevel::default();
            hear(&mut level, 124.0, BEATS, age_s);
            // What was danced is the off-beat of what is tracked from now on.
            level.carry_over((0.5, 124.0), 0.0, 124.0);
            assert_eq!(LEVELS[level.chosen].offset, 0.5);
            assert_eq!(hear(&mut level, 124.0, BEATS, 9.0), (124.0, offset));
        }
    }

    #[test]
    fn another_tracked_beat_is_read_as_what_was_danced() {
        // The tracker leaps from the beat to the off-beat, then to the double.
        let mut level = MetricalLevel::default();
        let danced = level.apply(0.3, 120.0);
        level.carry_over(danced, 0.8, 120.0);
        let (phase, bpm) = level.apply(0.8, 120.0);
        assert!((phase.rem_euclid(1.0) - 0.3).abs() < 1e-9 && bpm == 120.0);
        let danced = (0.55, 93.0);
        level.carry_over(danced, 0.1, 186.0);
        let (phase, bpm) = level.apply(0.1, 186.0);
        assert!((phase.rem_euclid(1.0) - 0.55).abs() < 1e-9 && bpm == 93.0);
        level.carry_over((0.2, 100.0), 0.2, 140.0);
        assert_eq!(level.apply(0.2, 140.0), (0.2, 140.0));
    }
}
