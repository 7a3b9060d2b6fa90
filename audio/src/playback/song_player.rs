//! Samples for a device whose clock is its own.
//!
//! Each block says when its first sample will be heard. The player goes there: by its rate,
//! at most [`MOST_RATE`] off, or, where the music is elsewhere altogether, by fading out and
//! in again.

use super::music_start::MusicStart;
use std::sync::Arc;
use std::time::Instant;

/// The rate is off by at most this share: half of a hundredth of a semitone is 0.03 %,
/// a tenth of a semitone 0.6 %.
const MOST_RATE: f64 = 0.004;
/// An error is made up for within about this time, seconds.
const STEER_S: f64 = 1.0;
/// What is further off than this is begun anew, seconds.
const FAR_S: f64 = 0.08;
/// Fading in and out, seconds.
const FADE_S: f64 = 0.02;

/// A decoded song: mono, 16 bit.
#[derive(Clone, Debug)]
pub struct Sound {
    /// The samples.
    pub samples: Arc<[i16]>,
    /// Their rate, hertz.
    pub rate_hz: u32,
}

impl Sound {
    /// A sample between -1 and 1 as 16 bits.
    pub fn level(sample: f32) -> i16 {
        (sample.clamp(-1.0, 1.0) * f32::from(i16::MAX)) as i16
    }

    /// The samples from a moment on, seconds; less where the song begins or ends. Pieces that
    /// follow each other in time are whole together.
    pub fn piece(&self, from_s: f64, length_s: f64) -> &[i16] {
        let place = |time_s: f64| {
            let place = (time_s * f64::from(self.rate_hz)).round().max(0.0) as usize;
            place.min(self.samples.len())
        };
        &self.samples[place(from_s)..place(from_s + length_s)]
    }

    /// The sample at a moment, between two samples on a cubic through four; silence outside.
    fn at(&self, time_s: f64) -> f32 {
        let place = time_s * f64::from(self.rate_hz);
        let whole = place.floor();
        let between = (place - whole) as f32;
        let sample = |offset: i64| -> f32 {
            let place = usize::try_from(whole as i64 + offset).ok();
            place.and_then(|place| self.samples.get(place)).map_or(0.0, |s| f32::from(*s) / 32768.0)
        };
        let [a, b, c, d] = [-1, 0, 1, 2].map(sample);
        // Catmull-Rom.
        let slope = (c - a) * 0.5;
        let bend = a - 2.5 * b + 2.0 * c - 0.5 * d;
        let twist = 1.5 * (b - c) + 0.5 * (d - a);
        ((twist * between + bend) * between + slope) * between + b
    }
}

/// Plays one song to one device. Nothing here waits or allocates.
#[derive(Debug)]
pub struct SongPlayer {
    sound: Sound,
    start: MusicStart,
    /// How much later than the robot the music is played, seconds.
    delay_s: f64,
    /// The moment of the song that comes next, while it plays.
    position_s: Option<f64>,
    /// Loudness, 0 to 1, and whether it goes up.
    gain: f32,
    rises: bool,
}

impl SongPlayer {
    /// A player in silence; it is heard `delay_s` later than the robot shows.
    pub fn new(sound: Sound, start: MusicStart, delay_s: f64) -> Self {
        Self { sound, start, delay_s, position_s: None, gain: 0.0, rises: false }
    }

    /// The next samples, for a device that plays `rate_hz` of them a second and lets the first
    /// be heard at `heard`. Each is written to all of `channels`.
    pub fn fill<T>(
        &mut self,
        block: &mut [T],
        channels: usize,
        rate_hz: f64,
        heard: Instant,
        sample: impl Fn(f32) -> T,
    ) where
        T: Copy,
    {
        let wanted_s = self.start.music_s(heard).map(|music_s| music_s - self.delay_s);
        let rate = self.steer(wanted_s);
        let step_s = rate / rate_hz;
        let fade = (1.0 / (FADE_S * rate_hz)) as f32;
        for frame in block.chunks_mut(channels.max(1)) {
            let target = if self.rises { 1.0 } else { 0.0 };
            self.gain += (target - self.gain).clamp(-fade, fade);
            let value = match &mut self.position_s {
                Some(position_s) => {
                    *position_s += step_s;
                    self.sound.at(*position_s - step_s) * self.gain
                }
                None => 0.0,
            };
            frame.fill(sample(value));
            if !self.rises && self.gain <= 0.0 {
                self.position_s = None;
            }
        }
    }

    /// The rate of this block: seconds of the song a second.
    fn steer(&mut self, wanted_s: Option<f64>) -> f64 {
        match (wanted_s, self.position_s) {
            (None, _) => self.rises = false,
            // Silence: from wherever the music is.
            (Some(wanted_s), None) => {
                (self.position_s, self.rises) = (Some(wanted_s), true);
            }
            (Some(wanted_s), Some(position_s)) => {
                let off_s = wanted_s - position_s;
                self.rises = off_s.abs() < FAR_S;
                if self.rises {
                    return 1.0 + (off_s / STEER_S).clamp(-MOST_RATE, MOST_RATE);
                }
            }
        }
        1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    const RATE_HZ: f64 = 48_000.0;
    const BLOCK: usize = 480;

    /// A song whose samples tell the moment: a slow sine, fine enough to be read back.
    fn sine(hz: f64) -> Sound {
        let sample = |n: usize| {
            let turn = n as f64 / 22_050.0 * hz * std::f64::consts::TAU;
            (turn.sin() * 20_000.0) as i16
        };
        Sound { samples: (0..220_500).map(sample).collect(), rate_hz: 22_050 }
    }

    /// Plays `blocks` blocks on a device that is fast by `drift`; the error of the position
    /// after each, seconds.
    fn errors(player: &mut SongPlayer, begins: Instant, blocks: usize, drift: f64) -> Vec<f64> {
        let mut block = [0.0; BLOCK];
        let each = |n: usize| {
            let heard_s = n as f64 * BLOCK as f64 / (RATE_HZ * (1.0 + drift));
            let heard = begins + Duration::from_secs_f64(heard_s);
            player.fill(&mut block, 1, RATE_HZ, heard, |value| value);
            let next_s = (n + 1) as f64 * BLOCK as f64 / (RATE_HZ * (1.0 + drift));
            player.position_s.unwrap_or(f64::NAN) - next_s
        };
        (0..blocks).map(each).collect()
    }

    #[test]
    fn a_device_with_a_clock_of_its_own_stays_on_the_music() {
        for drift in [-5e-4, 0.0, 5e-4] {
            let (start, begins) = (MusicStart::default(), Instant::now());
            start.set(begins);
            let mut player = SongPlayer::new(sine(440.0), start, 0.0);
            let late = errors(&mut player, begins, 900, drift);
            let worst = late[300..].iter().fold(0.0_f64, |most, error| most.max(error.abs()));
            assert!(worst < 0.002, "{drift}: {worst}");
        }
    }

    #[test]
    fn a_stall_of_the_robot_is_followed_without_a_click() {
        for (stall_s, settles) in [(0.02, 700), (0.5, 30)] {
            let (start, begins) = (MusicStart::default(), Instant::now());
            start.set(begins);
            let mut player = SongPlayer::new(sine(100.0), start.clone(), 0.0);
            errors(&mut player, begins, 100, 0.0);
            let moved = begins + Duration::from_secs_f64(stall_s);
            start.set(moved);
            let mut last: Option<f32> = None;
            let mut steepest = 0.0_f32;
            let mut block = [0.0; BLOCK];
            for n in 100..100 + settles {
                let heard_s = n as f64 * BLOCK as f64 / RATE_HZ;
                player.fill(
                    &mut block,
                    1,
                    RATE_HZ,
                    begins + Duration::from_secs_f64(heard_s),
                    |v| v,
                );
                for value in block {
                    steepest = steepest.max(last.map_or(0.0, |last| (value - last).abs()));
                    last = Some(value);
                }
            }
            let wanted_s = (100 + settles) as f64 * BLOCK as f64 / RATE_HZ - stall_s;
            let off_s = player.position_s.unwrap() - wanted_s;
            assert!(off_s.abs() < 0.005, "{stall_s}: {off_s}");
            // The sine's own steepest step is 0.008; a jump of the song would be up to 1.
            assert!(steepest < 0.012, "{stall_s}: {steepest}");
        }
    }

    #[test]
    fn before_the_music_and_after_it_there_is_silence_and_a_delay_is_kept() {
        let (start, begins) = (MusicStart::default(), Instant::now());
        let mut player = SongPlayer::new(sine(440.0), start.clone(), 0.1);
        let mut block = [1.0; 2 * BLOCK];
        let mut loud = |player: &mut SongPlayer, at_s: f64| {
            let heard = begins + Duration::from_secs_f64(at_s);
            player.fill(&mut block, 2, RATE_HZ, heard, |value| value);
            block.chunks(2).any(|pair| pair[0] != 0.0 && pair[0] == pair[1])
        };
        assert!(!loud(&mut player, 0.0), "no music");
        start.set(begins + Duration::from_secs(1));
        assert!(!loud(&mut player, 1.02), "before the delayed music");
        let mut player = SongPlayer::new(sine(440.0), start.clone(), 0.1);
        assert!(loud(&mut player, 1.11));
        let position_s = player.position_s.unwrap();
        assert!((position_s - 0.02).abs() < 0.005, "{position_s}");
        start.silence();
        for _ in 0..4 {
            loud(&mut player, 2.0);
        }
        assert!(!loud(&mut player, 2.1), "after the music");
    }
}
