//! A robot that hears its own motors: what the microphone hears makes the dance, the dance
//! moves the motors, and the microphone hears those too.

use super::known_song::KnownSong;
use anyhow::Context;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use servodance_audio::MusicAnalyzer;
use servodance_audio::song::noise;
use servodance_model::conditioning::HeardFrame;
use servodance_model::{Generator, GeneratorOptions};
use servodance_retarget::Retargeter;
use servodance_runtime::robot::Robot;
use servodance_types::FRAME_RATE_HZ;
use std::f32::consts::TAU;

/// Speed at which a motor is loudest, rad/s.
const FULL_SPEED_RAD_S: f64 = 4.0;

/// What is heard of a song beside the motors of the robot that dances to it.
pub(super) struct HeardBesideMotors {
    pub(super) found_s: Vec<f64>,
    pub(super) downbeats_s: Vec<f64>,
    /// Mean power of the music over that of the motors, decibels.
    pub(super) motors_below_db: f64,
}

/// Dances to a song whose sound the robot's motors are added to, `below_db` below it on
/// average.
pub(super) fn hear_beside_motors(
    song: &KnownSong,
    robot: &Robot,
    generator: &Generator,
    below_db: f32,
) -> anyhow::Result<HeardBesideMotors> {
    // The first dance tells how loud the motors are, the second hears them.
    let first = dance(song, robot, generator, 0.0)?;
    let gain = noise::rms(&song.samples) * 10f32.powf(-below_db / 20.0) / first.motors_rms;
    let second = dance(song, robot, generator, gain)?;
    let history = second.analyzer.history().context("the analyzer keeps its history")?;
    let ratio = noise::rms(&song.samples) / (gain * second.motors_rms);
    Ok(HeardBesideMotors {
        found_s: history.live_track().times_s,
        downbeats_s: history.live_downbeats_s(),
        motors_below_db: 20.0 * f64::from(ratio).log10(),
    })
}

struct Danced {
    analyzer: MusicAnalyzer,
    motors_rms: f32,
}

fn dance(
    song: &KnownSong,
    robot: &Robot,
    generator: &Generator,
    gain: f32,
) -> anyhow::Result<Danced> {
    let mut analyzer = MusicAnalyzer::keeping_history(song.rate_hz)?;
    let mut dance = generator.start(GeneratorOptions::default())?;
    let mut joints = MovingJoints::new(robot)?;
    let mut motors = Motors::new(joints.speeds_rad_s.len(), song.rate_hz);
    let (mut power, block) = (0.0f64, (f64::from(song.rate_hz) / FRAME_RATE_HZ) as usize);
    for (index, music) in song.samples.chunks(block).enumerate() {
        let noise = motors.sound(&joints.speeds_rad_s, music.len());
        power += noise.iter().map(|s| f64::from(s * s)).sum::<f64>();
        let heard: Vec<f32> = music.iter().zip(&noise).map(|(s, n)| s + gain * n).collect();
        analyzer.push(&heard);
        while let Some(frame) = analyzer.pop() {
            joints.retargeter.push(&dance.step_heard(&HeardFrame::from(frame))?);
        }
        joints.advance((index + 1) as f64 / FRAME_RATE_HZ)?;
    }
    let motors_rms = (power / song.samples.len().max(1) as f64).sqrt().max(1e-9) as f32;
    Ok(Danced { analyzer, motors_rms })
}

/// The commands of a robot, cycle by cycle.
struct MovingJoints {
    retargeter: Retargeter,
    period_s: f64,
    cycles: u64,
    positions_rad: Vec<f64>,
    speeds_rad_s: Vec<f64>,
}

impl MovingJoints {
    fn new(robot: &Robot) -> anyhow::Result<Self> {
        let retargeter = robot.servo_retargeter()?;
        let positions_rad = retargeter.rest().to_vec();
        let speeds_rad_s = vec![0.0; positions_rad.len()];
        Ok(Self { retargeter, period_s: robot.period_s(), cycles: 0, positions_rad, speeds_rad_s })
    }

    /// Plays the cycles before a time; the speeds are those of the last one.
    fn advance(&mut self, until_s: f64) -> anyhow::Result<()> {
        let mut next = self.positions_rad.clone();
        while self.cycles as f64 * self.period_s < until_s {
            // Frames are seen as far ahead as they are known.
            let time_s = self.cycles as f64 * self.period_s - self.retargeter.lookahead_s();
            self.retargeter.next(time_s.max(0.0), &mut next)?;
            let moved = next.iter().zip(&self.positions_rad);
            for (speed, (new, old)) in self.speeds_rad_s.iter_mut().zip(moved) {
                *speed = (new - old) / self.period_s;
            }
            self.positions_rad.copy_from_slice(&next);
            self.cycles += 1;
        }
        Ok(())
    }
}

/// One motor a joint: a whine with overtones and a hum, both with its speed.
struct Motors {
    each: Vec<Motor>,
    rng: ChaCha8Rng,
    rate_hz: f32,
}

struct Motor {
    low_hz: f32,
    full_hz: f32,
    turns: f32,
    speed: f32,
    hum: f32,
}

impl Motors {
    fn new(count: usize, rate_hz: u32) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut motor = || Motor {
            low_hz: rng.random_range(80.0..300.0),
            full_hz: rng.random_range(300.0..1200.0),
            turns: 0.0,
            speed: 0.0,
            hum: 0.0,
        };
        let each = (0..count).map(|_| motor()).collect();
        Self { each, rng, rate_hz: rate_hz as f32 }
    }

    /// So many samples, in which each motor comes to its joint's speed.
    fn sound(&mut self, speeds_rad_s: &[f64], count: usize) -> Vec<f32> {
        let mut sound = vec![0.0; count];
        for (motor, speed) in self.each.iter_mut().zip(speeds_rad_s) {
            let goal = (speed.abs() / FULL_SPEED_RAD_S).min(1.0) as f32;
            let step = (goal - motor.speed) / count.max(1) as f32;
            for sample in &mut sound {
                motor.speed += step;
                let hz = motor.low_hz + motor.full_hz * motor.speed;
                motor.turns = (motor.turns + hz / self.rate_hz).fract();
                let turns = TAU * motor.turns;
                let whine = turns.sin() + 0.5 * (2.0 * turns).sin() + 0.4 * (5.0 * turns).sin();
                motor.hum += 0.3 * (self.rng.random_range(-1.0..1.0) - motor.hum);
                *sample += motor.speed * (whine + 0.7 * motor.hum);
            }
        }
        sound
    }
}
