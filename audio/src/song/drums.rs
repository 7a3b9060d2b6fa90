//! Drums: each is synthesised once a song with random parameters, then struck.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::synth::{sine, white};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Drum {
    Kick,
    Snare,
    Clap,
    ClosedHat,
    OpenHat,
    Rim,
    Clave,
    Cowbell,
    HighConga,
    LowConga,
    Shaker,
    Tom,
    Crash,
}

impl Drum {
    const ALL: [Drum; 13] = {
        use Drum::*;
        [
            Kick, Snare, Clap, ClosedHat, OpenHat, Rim, Clave, Cowbell, HighConga, LowConga,
            Shaker, Tom, Crash,
        ]
    };
}

pub(super) struct DrumKit {
    shots: Vec<Vec<f32>>,
}

impl DrumKit {
    pub(super) fn random(rate_hz: f32, rng: &mut ChaCha8Rng) -> Self {
        let shots = Drum::ALL.map(|drum| shot(drum, rate_hz, rng)).to_vec();
        Self { shots }
    }

    /// Adds a stroke to `out`; what would lie outside is not played.
    pub(super) fn strike(&self, out: &mut [f32], start: i64, drum: Drum, gain: f32) {
        let shot = &self.shots[drum as usize];
        let skip = (-start).max(0) as usize;
        let begin = start.max(0) as usize;
        if begin >= out.len() || skip >= shot.len() {
            return;
        }
        for (o, s) in out[begin..].iter_mut().zip(&shot[skip..]) {
            *o += gain * s;
        }
    }
}

fn shot(drum: Drum, rate_hz: f32, rng: &mut ChaCha8Rng) -> Vec<f32> {
    let mut r = |low: f32, high: f32| rng.random_range(low..high);
    match drum {
        Drum::Kick => {
            let body = Skin {
                low_hz: r(42.0, 62.0),
                high_hz: r(110.0, 260.0),
                bend_s: r(0.015, 0.04),
                decay_s: r(0.07, 0.22),
            };
            let click = r(0.05, 0.5);
            let mut out = body.strike(rate_hz, 1.0);
            add_noise(&mut out, rate_hz, click, 0.004, 0.5, rng);
            out
        }
        Drum::Snare => {
            let tone = r(150.0, 240.0);
            let (decay, bright) = (r(0.06, 0.16), r(0.0, 0.8));
            let mut out = skin(tone, 1.6, r(0.04, 0.1)).strike(rate_hz, 0.5);
            add_noise(&mut out, rate_hz, 0.8, decay, bright, rng);
            out
        }
        Drum::Clap => {
            let decay = r(0.05, 0.12);
            let mut out = vec![0.0; (rate_hz * 0.4) as usize];
            for burst in 0..3 {
                let at = (rate_hz * 0.009 * burst as f32) as usize;
                let last = if burst == 2 { decay } else { 0.004 };
                add_noise(&mut out[at..], rate_hz, 0.7, last, 0.5, rng);
            }
            out
        }
        Drum::ClosedHat => {
            let (decay, bright) = (r(0.012, 0.035), r(0.75, 0.97));
            noise(rate_hz, 0.6, decay, bright, rng)
        }
        Drum::OpenHat => {
            let (decay, bright) = (r(0.08, 0.2), r(0.75, 0.97));
            noise(rate_hz, 0.5, decay, bright, rng)
        }
        Drum::Rim => skin(r(400.0, 800.0), 1.5, 0.012).strike(rate_hz, 0.8),
        Drum::Clave => skin(r(1900.0, 2600.0), 1.0, 0.025).strike(rate_hz, 0.7),
        Drum::Cowbell => {
            let (hz, decay) = (r(500.0, 620.0), r(0.05, 0.12));
            let mut out = skin(hz, 1.0, decay).strike(rate_hz, 0.4);
            let second = skin(hz * 1.504, 1.0, decay).strike(rate_hz, 0.4);
            out.iter_mut().zip(second).for_each(|(o, s)| *o += s);
            out
        }
        Drum::HighConga => skin(r(300.0, 380.0), 1.2, r(0.05, 0.1)).strike(rate_hz, 0.7),
        Drum::LowConga => skin(r(180.0, 230.0), 1.2, r(0.08, 0.15)).strike(rate_hz, 0.8),
        Drum::Shaker => noise(rate_hz, 0.35, r(0.02, 0.05), 0.95, rng),
        Drum::Tom => skin(r(90.0, 160.0), 1.6, r(0.1, 0.2)).strike(rate_hz, 0.9),
        Drum::Crash => noise(rate_hz, 0.5, r(0.4, 0.8), 0.8, rng),
    }
}

fn skin(hz: f32, bend: f32, decay_s: f32) -> Skin {
    Skin { low_hz: hz, high_hz: hz * bend, bend_s: 0.02, decay_s }
}

/// A struck membrane: a sine that falls in pitch and dies away.
struct Skin {
    low_hz: f32,
    high_hz: f32,
    bend_s: f32,
    decay_s: f32,
}

impl Skin {
    fn strike(&self, rate_hz: f32, gain: f32) -> Vec<f32> {
        let length = (rate_hz * self.decay_s * 7.0) as usize;
        let fade = (-1.0 / (self.decay_s * rate_hz)).exp();
        let bend_fade = (-1.0 / (self.bend_s * rate_hz)).exp();
        let (mut amplitude, mut bend, mut turns) = (gain, self.high_hz - self.low_hz, 0.0f32);
        let mut out = Vec::with_capacity(length);
        for _ in 0..length {
            out.push(amplitude * sine(turns));
            turns += (self.low_hz + bend) / rate_hz;
            turns -= turns.floor();
            amplitude *= fade;
            bend *= bend_fade;
        }
        out
    }
}

fn noise(rate_hz: f32, gain: f32, decay_s: f32, bright: f32, rng: &mut ChaCha8Rng) -> Vec<f32> {
    let mut out = vec![0.0; (rate_hz * decay_s * 7.0) as usize];
    add_noise(&mut out, rate_hz, gain, decay_s, bright, rng);
    out
}

/// Dying noise; `bright` 0 is white, 1 keeps the highest treble only.
fn add_noise(
    out: &mut [f32],
    rate_hz: f32,
    gain: f32,
    decay_s: f32,
    bright: f32,
    rng: &mut ChaCha8Rng,
) {
    let fade = (-1.0 / (decay_s * rate_hz)).exp();
    let mut amplitude = gain / (1.0 + 0.5 * bright);
    let mut seed = rng.random::<u32>() | 1;
    let mut previous = 0.0;
    for o in out.iter_mut() {
        let now = white(&mut seed);
        *o += amplitude * (now - bright * previous);
        previous = now;
        amplitude *= fade;
    }
}
