//! The mixer: balance, ducking, room, equaliser, compressor, noise, level.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::synth::white;

/// Settings of the mixer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mix {
    /// Linear gain of the drums.
    pub drums: f32,
    /// Linear gain of the bass.
    pub bass: f32,
    /// Linear gain of chords and lead.
    pub music: f32,
    /// Share by which the kick lowers bass and music, 0 to 1.
    pub ducking: f32,
    /// Linear gain of the reverberation.
    pub room: f32,
    /// Reverberation time of the room in seconds.
    pub room_s: f32,
    /// Bass boost or cut below about 200 Hz, decibels.
    pub low_db: f32,
    /// Treble boost or cut above about 3 kHz, decibels.
    pub high_db: f32,
    /// Compression of loud moments, 0 (none) to 1 (flat).
    pub compression: f32,
    /// Peak level in decibels of full scale.
    pub level_db: f32,
    /// Level of the noise floor in decibels of full scale.
    pub noise_db: f32,
}

impl Mix {
    /// Dry and without noise: for tests that look for onsets.
    pub fn clean() -> Mix {
        Mix {
            drums: 1.0,
            bass: 0.8,
            music: 0.8,
            ducking: 0.0,
            room: 0.0,
            room_s: 0.3,
            low_db: 0.0,
            high_db: 0.0,
            compression: 0.0,
            level_db: -1.0,
            noise_db: -120.0,
        }
    }

    pub(super) fn demo() -> Mix {
        Mix {
            drums: 0.9,
            music: 0.9,
            ducking: 0.35,
            room: 0.16,
            room_s: 0.7,
            compression: 0.25,
            ..Mix::clean()
        }
    }

    /// A random mix, from a studio recording to a telephone line.
    pub(super) fn random(rng: &mut ChaCha8Rng) -> Mix {
        let mut r = |low: f32, high: f32| rng.random_range(low..high);
        Mix {
            drums: r(0.5, 1.3),
            bass: r(0.4, 1.2),
            music: r(0.4, 1.2),
            ducking: r(-0.5, 0.7).max(0.0),
            room: r(0.0, 0.35),
            room_s: r(0.2, 1.2),
            low_db: r(-9.0, 6.0),
            high_db: r(-9.0, 6.0),
            compression: r(0.0, 0.8),
            level_db: r(-24.0, -0.5),
            noise_db: r(-90.0, -45.0),
        }
    }
}

pub(super) struct Buses {
    pub(super) drums: Vec<f32>,
    pub(super) bass: Vec<f32>,
    pub(super) music: Vec<f32>,
    pub(super) kicks: Vec<usize>,
}

impl Buses {
    pub(super) fn new(length: usize) -> Self {
        Self {
            drums: vec![0.0; length],
            bass: vec![0.0; length],
            music: vec![0.0; length],
            kicks: Vec::new(),
        }
    }
}

pub(super) fn master(mix: &Mix, rate_hz: f32, buses: Buses, seed: u64) -> Vec<f32> {
    let duck = ducking(&buses, rate_hz, mix.ducking);
    // In place: small computers hold three buses of a song and no more.
    let Buses { drums: mut out, bass, music, .. } = buses;
    for (((out, bass), music), duck) in out.iter_mut().zip(bass).zip(music).zip(duck) {
        let tuned = mix.bass * bass + mix.music * music;
        *out = mix.drums * *out + tuned * duck;
    }
    if mix.room > 0.0 {
        add_room(&mut out, rate_hz, mix.room, mix.room_s);
    }
    equalise(&mut out, rate_hz, mix.low_db, mix.high_db);
    compress(&mut out, rate_hz, mix.compression);
    set_level(&mut out, mix.level_db);
    add_noise(&mut out, decibels(mix.noise_db), seed);
    out
}

fn decibels(db: f32) -> f32 {
    10f32.powf(db / 20.0)
}

/// Gain of the other instruments under the kicks.
fn ducking(buses: &Buses, rate_hz: f32, depth: f32) -> impl Iterator<Item = f32> + use<> {
    let recover = (-1.0 / (0.1 * rate_hz)).exp();
    let mut kicks = buses.kicks.clone();
    kicks.sort_unstable();
    let mut next = kicks.into_iter().peekable();
    let mut pressed = 0.0f32;
    (0..).map(move |i| {
        while next.next_if(|&kick| kick <= i).is_some() {
            pressed = depth;
        }
        pressed *= recover;
        1.0 - pressed
    })
}

/// A small room: four damped combs and two all-passes (Schroeder 1962).
fn add_room(out: &mut [f32], rate_hz: f32, gain: f32, time_s: f32) {
    let mut combs = [0.0297f32, 0.0371, 0.0411, 0.0437].map(|delay_s| {
        let feedback = 10f32.powf(-3.0 * delay_s / time_s);
        DelayLine::new(delay_s * rate_hz, feedback)
    });
    let mut passes = [0.005f32, 0.0017].map(|delay_s| DelayLine::new(delay_s * rate_hz, 0.7));
    for sample in out {
        let mut wet: f32 = combs.iter_mut().map(|c| c.comb(*sample)).sum();
        for pass in &mut passes {
            wet = pass.all_pass(wet);
        }
        *sample += 0.25 * gain * wet;
    }
}

struct DelayLine {
    line: Vec<f32>,
    at: usize,
    feedback: f32,
    damped: f32,
}

impl DelayLine {
    fn new(length: f32, feedback: f32) -> Self {
        Self { line: vec![0.0; (length as usize).max(1)], at: 0, feedback, damped: 0.0 }
    }

    fn swap(&mut self, value: f32) {
        self.line[self.at] = value;
        self.at += 1;
        if self.at == self.line.len() {
            self.at = 0;
        }
    }

    fn comb(&mut self, x: f32) -> f32 {
        let old = self.line[self.at];
        self.damped += 0.7 * (old - self.damped);
        self.swap(x + self.feedback * self.damped);
        old
    }

    fn all_pass(&mut self, x: f32) -> f32 {
        let old = self.line[self.at];
        let y = old - self.feedback * x;
        self.swap(x + self.feedback * y);
        y
    }
}

fn equalise(out: &mut [f32], rate_hz: f32, low_db: f32, high_db: f32) {
    let pole = |hz: f32| 1.0 - (-std::f32::consts::TAU * hz / rate_hz).exp();
    let (low_pole, high_pole) = (pole(200.0), pole(3000.0));
    let (low_gain, high_gain) = (decibels(low_db), decibels(high_db));
    let (mut low, mut middle) = (0.0f32, 0.0f32);
    for sample in out {
        low += low_pole * (*sample - low);
        middle += high_pole * (*sample - middle);
        *sample = low_gain * low + (middle - low) + high_gain * (*sample - middle);
    }
}

/// A compressor on the running level: 3 ms up, 150 ms down.
fn compress(out: &mut [f32], rate_hz: f32, amount: f32) {
    if amount <= 0.0 {
        return;
    }
    let up = 1.0 - (-1.0 / (0.003 * rate_hz)).exp();
    let down = 1.0 - (-1.0 / (0.15 * rate_hz)).exp();
    let mut level = 0.0f32;
    for block in out.chunks_mut(16) {
        let peak = block.iter().fold(0.0f32, |peak, s| peak.max(s.abs()));
        let pole = if peak > level { up } else { down };
        level += (16.0 * pole).min(1.0) * (peak - level);
        let gain = 1.0 / (1.0 - amount + amount * (level + 0.05) * 3.0);
        block.iter_mut().for_each(|s| *s *= gain);
    }
}

fn set_level(out: &mut [f32], level_db: f32) {
    let peak = out.iter().fold(0.0f32, |peak, s| peak.max(s.abs()));
    if peak > 0.0 {
        let gain = decibels(level_db) / peak;
        out.iter_mut().for_each(|s| *s *= gain);
    }
}

fn add_noise(out: &mut [f32], gain: f32, seed: u64) {
    if gain < 1e-5 {
        return;
    }
    let mut state = (seed as u32) ^ 0x9e37_79b9 | 1;
    let mut low = 0.0f32;
    for sample in out {
        let now = white(&mut state);
        low += 0.2 * (now - low);
        *sample = (*sample + gain * (low + 0.3 * now)).clamp(-1.0, 1.0);
    }
}
