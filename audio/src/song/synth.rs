//! Pitched instruments: two oscillators or FM, a filter, an envelope, drive.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// Samples between two updates of the filter.
const CONTROL_BLOCK: usize = 32;

/// A sine of `turns` (0 to 1) without libm: fast, and the same everywhere.
pub(super) fn sine(turns: f32) -> f32 {
    let x = turns - turns.floor() - 0.5;
    // Bhaskara-like parabola, refined once; error below 0.1 %.
    let parabola = 16.0 * x * (0.5 - x.abs());
    let refined = 0.225 * (parabola * parabola.abs() - parabola) + parabola;
    -refined
}

/// White noise, -1 to 1 (xorshift; `state` must not be 0).
pub(super) fn white(state: &mut u32) -> f32 {
    *state ^= *state << 13;
    *state ^= *state >> 17;
    *state ^= *state << 5;
    *state as i32 as f32 / 2_147_483_648.0
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Wave {
    Saw,
    Square,
    Triangle,
    Organ,
    /// Two-operator FM: ratio and depth of the modulator.
    Fm(f32, f32),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Instrument {
    SubBass,
    SynthBass,
    PluckBass,
    Pad,
    Stab,
    ElectricPiano,
    Organ,
    Pluck,
    Guitar,
    Bell,
    Lead,
    Flute,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Timbre {
    wave: Wave,
    detune: f32,
    attack_s: f32,
    decay_s: f32,
    sustain: f32,
    release_s: f32,
    cutoff_hz: f32,
    cutoff_rise_hz: f32,
    drive: f32,
    gain: f32,
}

impl Timbre {
    pub(super) fn random(kind: Instrument, rng: &mut ChaCha8Rng) -> Self {
        let mut r = |low: f32, high: f32| rng.random_range(low..high);
        let base = Timbre {
            wave: Wave::Saw,
            detune: 0.0,
            attack_s: 0.003,
            decay_s: 0.3,
            sustain: 0.5,
            release_s: 0.05,
            cutoff_hz: r(1200.0, 5000.0),
            cutoff_rise_hz: r(0.0, 2500.0),
            drive: 0.0,
            gain: 1.0,
        };
        match kind {
            Instrument::SubBass => {
                Timbre { wave: Wave::Fm(1.0, r(0.0, 0.25)), sustain: 0.8, gain: 1.2, ..base }
            }
            Instrument::SynthBass => Timbre {
                wave: if r(0.0, 1.0) < 0.5 { Wave::Saw } else { Wave::Square },
                cutoff_hz: r(250.0, 900.0),
                cutoff_rise_hz: r(200.0, 2500.0),
                decay_s: r(0.1, 0.4),
                gain: 0.9,
                ..base
            },
            Instrument::PluckBass => Timbre {
                wave: Wave::Triangle,
                decay_s: r(0.2, 0.5),
                sustain: 0.2,
                drive: r(0.0, 1.5),
                gain: 1.1,
                ..base
            },
            Instrument::Pad => Timbre {
                detune: r(0.003, 0.008),
                attack_s: r(0.05, 0.3),
                sustain: 0.9,
                release_s: r(0.2, 0.5),
                cutoff_hz: r(600.0, 2500.0),
                gain: 0.45,
                ..base
            },
            Instrument::Stab => Timbre {
                detune: r(0.002, 0.008),
                decay_s: r(0.08, 0.25),
                sustain: 0.15,
                gain: 0.6,
                ..base
            },
            Instrument::ElectricPiano => Timbre {
                wave: Wave::Fm([1.0, 2.0, 3.0][r(0.0, 3.0) as usize], r(0.1, 0.5)),
                decay_s: r(0.4, 1.2),
                sustain: 0.1,
                release_s: 0.15,
                gain: 0.6,
                ..base
            },
            Instrument::Organ => Timbre { wave: Wave::Organ, sustain: 0.95, gain: 0.45, ..base },
            Instrument::Pluck => Timbre {
                wave: Wave::Triangle,
                decay_s: r(0.1, 0.5),
                sustain: 0.0,
                gain: 0.8,
                ..base
            },
            Instrument::Guitar => Timbre {
                detune: r(0.001, 0.003),
                decay_s: r(0.5, 1.5),
                sustain: 0.3,
                drive: r(2.0, 8.0),
                cutoff_hz: r(1500.0, 4000.0),
                gain: 0.5,
                ..base
            },
            Instrument::Bell => Timbre {
                wave: Wave::Fm(r(1.5, 4.5), r(0.2, 0.7)),
                decay_s: r(0.3, 1.0),
                sustain: 0.0,
                release_s: 0.3,
                gain: 0.5,
                ..base
            },
            Instrument::Lead => Timbre {
                wave: if r(0.0, 1.0) < 0.5 { Wave::Square } else { Wave::Saw },
                detune: r(0.0, 0.004),
                sustain: 0.7,
                gain: 0.45,
                ..base
            },
            Instrument::Flute => Timbre {
                wave: Wave::Fm(1.0, r(0.02, 0.15)),
                attack_s: r(0.02, 0.07),
                sustain: 0.9,
                release_s: 0.1,
                gain: 0.6,
                ..base
            },
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Note {
    pub(super) start: i64,
    pub(super) hold: usize,
    pub(super) frequency_hz: f32,
    pub(super) gain: f32,
}

/// Adds one note to `out`; the part outside is not played.
pub(super) fn play(out: &mut [f32], rate_hz: f32, note: Note, timbre: &Timbre) {
    if note.start < 0 || note.start as usize >= out.len() || note.frequency_hz > 0.45 * rate_hz {
        return;
    }
    let release = (timbre.release_s * rate_hz * 5.0) as usize;
    let out = &mut out[note.start as usize..];
    let length = (note.hold + release).min(out.len());
    let mut oscillator = Oscillator::new(timbre, note.frequency_hz / rate_hz);
    let mut envelope = NoteEnvelope::new(timbre, rate_hz, note.hold);
    let mut filter = LowPass::default();
    let mut brightness = 1.0f32;
    let dim = (-(CONTROL_BLOCK as f32) / (timbre.decay_s * rate_hz)).exp();
    let gain = note.gain * timbre.gain;
    for (block, samples) in out[..length].chunks_mut(CONTROL_BLOCK).enumerate() {
        filter.tune((timbre.cutoff_hz + timbre.cutoff_rise_hz * brightness) / rate_hz);
        brightness *= dim;
        for (i, sample) in samples.iter_mut().enumerate() {
            let raw = filter.pass(oscillator.next());
            let level = envelope.next(block * CONTROL_BLOCK + i);
            *sample += gain * shape(raw * level, timbre.drive);
        }
    }
}

fn shape(x: f32, drive: f32) -> f32 {
    let y = x * (1.0 + drive);
    y / (1.0 + drive * y.abs())
}

struct Oscillator {
    wave: Wave,
    phases: [f32; 2],
    steps: [f32; 2],
}

impl Oscillator {
    fn new(timbre: &Timbre, step: f32) -> Self {
        let second = match timbre.wave {
            Wave::Fm(ratio, _) => step * ratio,
            _ => step * (1.0 + timbre.detune),
        };
        Self { wave: timbre.wave, phases: [0.0, 0.0], steps: [step, second] }
    }

    fn next(&mut self) -> f32 {
        let [a, b] = self.phases;
        let [da, db] = self.steps;
        let value = match self.wave {
            Wave::Saw => 0.5 * (saw(a, da) + saw(b, db)),
            Wave::Square => 0.5 * (square(a, da) + square(b, db)),
            Wave::Triangle => 2.0 - 4.0 * (a - (a + 0.25).floor() + 0.25 - 0.5).abs() - 1.0,
            Wave::Organ => 0.5 * sine(a) + 0.3 * sine(2.0 * a) + 0.2 * sine(3.0 * a),
            Wave::Fm(_, depth) => sine(a + depth * sine(b)),
        };
        for (phase, step) in self.phases.iter_mut().zip(self.steps) {
            *phase += step;
            *phase -= phase.floor();
        }
        value
    }
}

fn blep(phase: f32, step: f32) -> f32 {
    if phase < step {
        let t = phase / step;
        t + t - t * t - 1.0
    } else if phase > 1.0 - step {
        let t = (phase - 1.0) / step;
        t * t + t + t + 1.0
    } else {
        0.0
    }
}

fn saw(phase: f32, step: f32) -> f32 {
    2.0 * phase - 1.0 - blep(phase, step)
}

fn square(phase: f32, step: f32) -> f32 {
    let half = if phase < 0.5 { phase + 0.5 } else { phase - 0.5 };
    (if phase < 0.5 { 1.0 } else { -1.0 }) + blep(phase, step) - blep(half, step)
}

struct NoteEnvelope {
    level: f32,
    attack_step: f32,
    decay: f32,
    sustain: f32,
    release: f32,
    hold: usize,
    rising: bool,
}

impl NoteEnvelope {
    fn new(timbre: &Timbre, rate_hz: f32, hold: usize) -> Self {
        Self {
            level: 0.0,
            attack_step: 1.0 / (timbre.attack_s * rate_hz).max(1.0),
            decay: (-1.0 / (timbre.decay_s * rate_hz)).exp(),
            sustain: timbre.sustain,
            release: (-1.0 / (timbre.release_s * rate_hz)).exp(),
            hold,
            rising: true,
        }
    }

    fn next(&mut self, age: usize) -> f32 {
        if age >= self.hold {
            self.level *= self.release;
        } else if self.rising {
            self.level += self.attack_step;
            self.rising = self.level < 1.0;
        } else {
            self.level = self.sustain + (self.level - self.sustain) * self.decay;
        }
        self.level
    }
}

#[derive(Default)]
struct LowPass {
    coefficient: f32,
    state: [f32; 2],
}

impl LowPass {
    fn tune(&mut self, cutoff: f32) {
        self.coefficient = 1.0 - (-std::f32::consts::TAU * cutoff.min(0.45)).exp();
    }

    fn pass(&mut self, x: f32) -> f32 {
        self.state[0] += self.coefficient * (x - self.state[0]);
        self.state[1] += self.coefficient * (self.state[0] - self.state[1]);
        self.state[1]
    }
}
