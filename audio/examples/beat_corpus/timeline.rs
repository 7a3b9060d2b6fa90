//! From beats to seconds: tempo, drift, rubato and swing.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

pub struct Timeline {
    pub beats_s: Vec<f64>,
    swing: f64,
    /// Beats in which one pair of swung notes fits: 1 for eighths.
    pair: f64,
}

impl Timeline {
    /// Beats of `duration_s` and two bars more, in a human or a machine's time.
    pub fn draw(
        bpm: f64,
        duration_s: f64,
        swing: f64,
        sixteenths: bool,
        rng: &mut ChaCha8Rng,
    ) -> Self {
        let drift_per_s = if rng.random_bool(0.2) { rng.random_range(-0.004..0.004) } else { 0.0 };
        let loose = if rng.random_bool(0.3) { rng.random_range(0.0..0.012) } else { 0.0 };
        // Mild rubato: the tempo breathes over some bars.
        let breath = if rng.random_bool(0.12) { rng.random_range(0.01..0.06) } else { 0.0 };
        let breath_beats = rng.random_range(8.0..24.0);
        let mut now_s = 0.0;
        let mut beats_s = Vec::new();
        while now_s < duration_s + 8.0 * 60.0 / bpm {
            beats_s.push(now_s);
            let turn = std::f64::consts::TAU * beats_s.len() as f64 / breath_beats;
            let period_s = 60.0 / bpm * (1.0 - drift_per_s * now_s) * (1.0 + breath * turn.sin());
            now_s += (period_s * (1.0 + loose * rng.random_range(-1.0..1.0))).clamp(0.2, 2.2);
        }
        Self { beats_s, swing, pair: if sixteenths { 0.5 } else { 1.0 } }
    }

    /// The time of a place in beats; places between the notes of a pair are swung.
    pub fn at(&self, beat: f64) -> f64 {
        let pairs = beat / self.pair;
        let within = pairs - pairs.floor();
        let warped = match within < 0.5 {
            true => 2.0 * within * self.swing,
            false => self.swing + (2.0 * within - 1.0) * (1.0 - self.swing),
        };
        self.straight((pairs.floor() + warped) * self.pair)
    }

    /// The time of a place in beats without swing: triplets.
    pub fn straight(&self, beat: f64) -> f64 {
        let last = self.beats_s.len() - 2;
        let index = (beat.max(0.0) as usize).min(last);
        let (a, b) = (self.beats_s[index], self.beats_s[index + 1]);
        a + (beat - index as f64) * (b - a)
    }
}
