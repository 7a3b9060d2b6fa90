//! Which level of the beat is danced: the tracked one, its half or its double.
//!
//! The belief may follow eighths or half notes as surely as beats. What tells
//! them apart: the strength of every second beat, and of the off-beat, against
//! the strongest, weighed against how usual the tempi are. Hysteresis keeps the
//! level once chosen.

/// Middle and width in octaves of the bell of tempi that people dance to.
const USUAL_BPM: f64 = 122.0;
const USUAL_OCTAVES: f64 = 0.6;
/// Nobody dances beats faster than this, or slower than that.
const FASTEST_BPM: f64 = 193.0;
const SLOWEST_BPM: f64 = 62.0;
/// Strength ratio that speaks for neither level, and the weight of the rest.
const EVEN_RATIO: f64 = 0.52;
const RATIO_WEIGHT: f64 = 4.0;
/// How much better another level must be, and for how long.
const MARGIN: f64 = 0.4;
const PATIENCE_S: f64 = 2.5;
/// Share of a beat around each position in which onsets count.
const REACH: f64 = 0.09;
/// Weight of the newest beat in the running strengths.
const NEWEST: f32 = 0.08;

/// A power of two between the tracked beat and the danced one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Factor {
    Half,
    #[default]
    One,
    Double,
}

/// Running strengths of two beats and the off-beats between, and the choice.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Level {
    /// Strengths at positions 0, 1/2, 1 and 3/2 of two beats.
    strengths: [f32; 4],
    /// The strongest onset in each position so far in this round.
    peaks: [f32; 4],
    /// Which of the two beats the tracker is in: 0 or 1.
    second: bool,
    factor: Factor,
    /// With `Factor::Half`, whether the danced beat is the second of the two.
    on_second: bool,
    better_s: f64,
}

impl Level {
    /// Takes one hop of onsets at the tracked phase; `passed` when the phase
    /// has just gone through zero.
    pub(crate) fn hear(&mut self, phase: f64, passed: bool, strength: f32) {
        if passed {
            self.second = !self.second;
        }
        let round = phase + f64::from(u8::from(self.second));
        let position = (2.0 * round).round();
        let index = position as usize % 4;
        if (2.0 * round - position).abs() < 2.0 * REACH {
            self.peaks[index] = self.peaks[index].max(strength);
            return;
        }
        // Between the positions: what was heard at the last one counts.
        if self.peaks[index] >= 0.0 {
            let running = &mut self.strengths[index];
            *running += NEWEST * (self.peaks[index] - *running);
            self.peaks[index] = -1.0;
        }
        let next = (index + 1) % 4;
        self.peaks[next] = self.peaks[next].max(0.0);
    }

    /// Reconsiders the level of a beat at `bpm`.
    pub(crate) fn choose(&mut self, bpm: f64, elapsed_s: f64) {
        let [first, off_first, second, off_second] = self.strengths.map(f64::from);
        let strong = first.max(second).max(1e-3);
        let alternation = first.min(second) / strong;
        let offbeat = (off_first + off_second) / (first + second).max(1e-3);
        let one = usual(bpm);
        let too_slow = if bpm / 2.0 < SLOWEST_BPM { -10.0 } else { 0.0 };
        let half = too_slow + usual(bpm / 2.0) + RATIO_WEIGHT * (EVEN_RATIO - alternation);
        let too_fast = if bpm * 2.0 > FASTEST_BPM { -10.0 } else { 0.0 };
        let double = too_fast + usual(bpm * 2.0) + RATIO_WEIGHT * (offbeat.min(1.0) - EVEN_RATIO);
        let scores = [
            (Factor::Half, half),
            (Factor::One, one),
            (Factor::Double, double),
        ];
        let of = |factor| scores.iter().find(|s| s.0 == factor).map_or(0.0, |s| s.1);
        let best = scores.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((best, score)) = best else { return };
        if best == self.factor || score < of(self.factor) + MARGIN {
            self.better_s = 0.0;
            return;
        }
        self.better_s += elapsed_s;
        if self.better_s > PATIENCE_S {
            self.factor = best;
            self.on_second = second > first;
            self.better_s = 0.0;
        }
    }

    /// The danced phase and tempo of a tracked phase, which may run past one.
    pub(crate) fn apply(&self, phase: f64, bpm: f64) -> (f64, f64) {
        match self.factor {
            Factor::One => (phase, bpm),
            Factor::Double => (2.0 * phase, 2.0 * bpm),
            Factor::Half => {
                let later = self.second != self.on_second;
                ((phase + f64::from(u8::from(later))) / 2.0, bpm / 2.0)
            }
        }
    }

    /// The tracker has taken over another beat: stay at the danced tempo and
    /// phase if that beat is at another level of them.
    pub(crate) fn carry_over(&mut self, danced: (f64, f64), phase: f64, bpm: f64) {
        let (danced_phase, danced_bpm) = danced;
        *self = Self::default();
        if danced_bpm <= 0.0 {
            return;
        }
        self.factor = match (danced_bpm / bpm).log2() {
            octaves if (octaves + 1.0).abs() < 0.15 => Factor::Half,
            octaves if (octaves - 1.0).abs() < 0.15 => Factor::Double,
            _ => Factor::One,
        };
        if self.factor == Factor::Half {
            let off = |on_second: bool| {
                let (now, _) = Level { on_second, ..*self }.apply(phase, bpm);
                let off = now - danced_phase;
                (off - off.round()).abs()
            };
            self.on_second = off(true) < off(false);
        }
    }
}

/// How usual a tempo is, as a logarithm.
fn usual(bpm: f64) -> f64 {
    let octaves = (bpm / USUAL_BPM).log2() / USUAL_OCTAVES;
    -0.5 * octaves * octaves
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The danced tempo after 20 s of beats at `bpm` with these strengths at
    /// the positions 0, 1/2, 1, 3/2.
    fn danced_bpm(bpm: f64, strengths: [f32; 4]) -> f64 {
        let mut level = Level::default();
        let mut phase = 0.0;
        for hop in 0..3200 {
            phase += bpm / 60.0 / 160.0;
            let passed = phase >= 1.0;
            if passed {
                phase -= 1.0;
            }
            let round = phase + f64::from(u8::from(level.second != passed));
            let index = (2.0 * round).round() as usize % 4;
            let off = 2.0 * round - (2.0 * round).round();
            let strength = if off.abs() < 0.05 {
                strengths[index]
            } else {
                0.0
            };
            level.hear(phase, passed, strength);
            if hop % 8 == 0 {
                level.choose(bpm, 0.05);
            }
        }
        level.apply(phase, bpm).1
    }

    #[test]
    fn weak_every_second_beat_means_half_the_tempo() {
        assert_eq!(danced_bpm(196.0, [1.0, 0.1, 0.35, 0.1]), 98.0);
        assert_eq!(danced_bpm(190.0, [1.0, 0.3, 0.9, 0.3]), 190.0);
        assert_eq!(danced_bpm(124.0, [1.0, 0.5, 0.8, 0.5]), 124.0);
    }

    #[test]
    fn strong_offbeats_of_a_slow_beat_mean_double_the_tempo() {
        assert_eq!(danced_bpm(85.0, [1.0, 0.9, 1.0, 0.9]), 170.0);
        assert_eq!(danced_bpm(85.0, [1.0, 0.4, 1.0, 0.4]), 85.0);
    }
}
