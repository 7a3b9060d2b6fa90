//! One simulated Feetech STS servo: memory table, position loop and motor.
//!
//! Position mode only (mode 0; others are stored, without effect). Signs are a
//! bit (15; 11 for the offset; 10 for the load), and the present position is
//! the encoder less the offset. There is no bus watchdog. A condition (voltage,
//! heat, overload) shows in the status register and in every answer, and cuts
//! torque until it is turned on again.

use std::f64::consts::TAU;

use crate::fault::ServoFault;
use crate::judge::Judge;
use crate::motor::{FULL_PWM_ERROR_RAD, Motor};
use crate::servo::SimServoState;
use crate::spec::{ServoModel, SimServoSpec};

const RAD_PER_TICK: f64 = TAU / 4096.0;
const AMPERES_PER_UNIT: f64 = 6.5e-3;
const REBOOT_S: f64 = 0.8;
const OVERLOAD_S: f64 = 2.0;
const OVERLOAD_SHARE: f64 = 0.8;
/// Bytes of memory.
const SIZE: usize = 86;
/// First address that a restart clears.
const RAM: usize = 40;

/// Status bits.
const VOLTAGE: u8 = 1;
const OVERHEAT: u8 = 1 << 2;
const OVERLOAD: u8 = 1 << 5;

mod at {
    pub const ID: usize = 5;
    pub const RETURN_DELAY: usize = 7;
    pub const STATUS_LEVEL: usize = 8;
    pub const LOWEST: usize = 9;
    pub const HIGHEST: usize = 11;
    pub const HOTTEST: usize = 13;
    pub const MAX_VOLTAGE: usize = 14;
    pub const MIN_VOLTAGE: usize = 15;
    pub const P_GAIN: usize = 21;
    pub const OFFSET: usize = 31;
    pub const TORQUE: usize = 40;
    pub const GOAL: usize = 42;
    pub const GOAL_SPEED: usize = 46;
    pub const TORQUE_LIMIT: usize = 48;
    pub const POSITION: usize = 56;
    pub const SPEED: usize = 58;
    pub const LOAD: usize = 60;
    pub const VOLTAGE: usize = 62;
    pub const TEMPERATURE: usize = 63;
    pub const STATUS: usize = 65;
    pub const MOVING: usize = 66;
    pub const CURRENT: usize = 69;
}

/// One servo.
#[derive(Clone, Debug)]
pub struct StsServo {
    spec: SimServoSpec,
    model: &'static ServoModel,
    memory: [u8; SIZE],
    motor: Motor,
    judge: Judge,
    supply_v: f64,
    duty: f64,
    /// Where the speed-limited trajectory is, ticks.
    trajectory_ticks: f64,
    registered: Option<(u8, Vec<u8>)>,
    overload_s: f64,
    deaf_until_s: f64,
    time_s: f64,
    dead: bool,
}

impl StsServo {
    /// A servo fresh from the factory but for its id.
    pub fn new(
        spec: &SimServoSpec,
        model: &'static ServoModel,
        supply_v: f64,
        period_s: f64,
    ) -> Self {
        let angle_rad = spec.zero_rad + spec.direction * spec.initial_rad;
        let mut servo = Self {
            memory: [0; SIZE],
            motor: Motor::new(model, spec.load_inertia_kg_m2, angle_rad),
            judge: Judge::new(&spec.name, spec.limits, period_s),
            spec: spec.clone(),
            model,
            supply_v,
            duty: 0.0,
            trajectory_ticks: 0.0,
            registered: None,
            overload_s: 0.0,
            deaf_until_s: 0.0,
            time_s: 0.0,
            dead: false,
        };
        servo.memory[..2].copy_from_slice(&[3, 10]);
        servo.put(3, model.number);
        servo.memory[at::ID] = spec.id;
        servo.memory[at::RETURN_DELAY] = 250;
        servo.memory[at::STATUS_LEVEL] = 1;
        servo.put(at::HIGHEST, 4095);
        servo.memory[at::HOTTEST] = 70;
        servo.memory[at::MAX_VOLTAGE] = 140;
        servo.memory[at::MIN_VOLTAGE] = 40;
        servo.put(16, 1000);
        servo.memory[at::P_GAIN] = 32;
        servo.memory[22] = 32;
        servo.put(28, 310);
        servo.boot();
        servo
    }

    fn boot(&mut self) {
        self.memory[RAM..].fill(0);
        self.put(at::TORQUE_LIMIT, 1000);
        self.memory[55] = 1;
        self.registered = None;
        self.overload_s = 0.0;
        self.judge.end();
        self.refresh();
        self.put(at::GOAL, self.word(at::POSITION));
    }

    fn word(&self, address: usize) -> u16 {
        u16::from_le_bytes([self.memory[address], self.memory[address + 1]])
    }

    fn put(&mut self, address: usize, value: u16) {
        self.memory[address..address + 2].copy_from_slice(&value.to_le_bytes());
    }

    /// Its id.
    pub fn id(&self) -> u8 {
        self.memory[at::ID]
    }

    /// Whether it hears and answers.
    pub fn listens(&self) -> bool {
        !self.dead && self.time_s >= self.deaf_until_s
    }

    /// The judge of its motion.
    pub fn judge(&self) -> &Judge {
        &self.judge
    }

    /// Seconds between an instruction and its reply.
    pub fn return_delay_s(&self) -> f64 {
        f64::from(self.memory[at::RETURN_DELAY]) * 2e-6
    }

    /// Whether it answers writes.
    pub fn answers_writes(&self) -> bool {
        self.memory[at::STATUS_LEVEL] != 0
    }

    /// The condition that every answer carries.
    pub fn status(&self) -> u8 {
        self.memory[at::STATUS]
    }

    fn torque_on(&self) -> bool {
        self.memory[at::TORQUE] == 1
    }

    fn offset_ticks(&self) -> f64 {
        sign_magnitude(self.word(at::OFFSET), 11)
    }

    fn joint_rad(&self, angle_rad: f64) -> f64 {
        (angle_rad - self.spec.zero_rad) * self.spec.direction
    }

    /// The encoder less the offset, turns counted.
    fn encoder_ticks(&self) -> f64 {
        (self.motor.angle_rad / RAD_PER_TICK).round() - self.offset_ticks()
    }

    fn goal_rad(&self) -> f64 {
        let ticks = sign_magnitude(self.word(at::GOAL), 15) + self.offset_ticks();
        self.joint_rad(ticks * RAD_PER_TICK)
    }

    /// The truth.
    pub fn state(&self) -> SimServoState {
        SimServoState {
            time_s: self.time_s,
            position_rad: self.joint_rad(self.motor.angle_rad),
            velocity_rad_s: self.spec.direction * self.motor.speed_rad_s,
            goal_rad: self.goal_rad(),
            current_a: self.spec.direction * self.motor.current_a,
            temperature_c: self.motor.temperature_c,
            torque_enabled: self.torque_on(),
            watchdog_tripped: false,
            hardware_error: self.status(),
        }
    }

    /// `size` bytes from `address` on; none where there is no memory.
    pub fn read(&mut self, address: u8, size: u8) -> Vec<u8> {
        self.refresh();
        let start = usize::from(address);
        let end = start + usize::from(size);
        self.memory.get(start..end).unwrap_or_default().to_vec()
    }

    /// Stores bytes; what is read-only stays.
    pub fn write(&mut self, address: u8, bytes: &[u8]) {
        let start = usize::from(address);
        let was_on = self.torque_on();
        for (at, byte) in (start..).zip(bytes) {
            if (5..at::POSITION).contains(&at) {
                self.memory[at] = *byte;
            }
        }
        let touched = start..start + bytes.len();
        if touched.contains(&at::TORQUE) {
            self.set_torque(was_on);
        }
        if touched.contains(&at::GOAL) {
            let (lowest, highest) = (self.word(at::LOWEST), self.word(at::HIGHEST));
            if highest > lowest {
                self.put(at::GOAL, self.word(at::GOAL).clamp(lowest, highest));
            }
            self.judge.told(self.time_s, self.goal_rad());
        }
    }

    fn set_torque(&mut self, was_on: bool) {
        if self.torque_on() && !was_on {
            self.memory[at::STATUS] = 0;
            self.trajectory_ticks = self.encoder_ticks();
            let state = self.state();
            self.judge.begin(state.goal_rad, state.position_rad);
            self.judge.told(self.time_s, state.goal_rad);
        } else if !self.torque_on() {
            self.judge.end();
        }
    }

    /// A write that waits for an action.
    pub fn register(&mut self, address: u8, bytes: &[u8]) {
        self.registered = Some((address, bytes.to_vec()));
    }

    /// Carries out the registered write.
    pub fn act(&mut self) {
        if let Some((address, bytes)) = self.registered.take() {
            self.write(address, &bytes);
        }
    }

    /// Restarts: memory from the torque switch on lost; deaf for a while.
    pub fn reboot(&mut self) {
        self.boot();
        self.deaf_until_s = self.time_s + REBOOT_S;
    }

    fn raise(&mut self, bits: u8) {
        self.memory[at::STATUS] |= bits;
        self.memory[at::TORQUE] = 0;
        self.judge.end();
    }

    /// Something goes wrong with it.
    pub fn suffer(&mut self, fault: ServoFault) {
        match fault {
            ServoFault::Dead => self.dead = true,
            ServoFault::Revive => self.dead = false,
            ServoFault::Free => self.motor.jammed = false,
            ServoFault::Reboot => self.reboot(),
            ServoFault::Overheat(celsius) => self.motor.temperature_c = celsius,
            ServoFault::Jam => {
                self.motor.jammed = true;
                self.judge.excuse_motion();
            }
            ServoFault::Overload => self.raise(OVERLOAD),
            ServoFault::Supply(volts) => self.supply_v = volts,
            ServoFault::Id(id) => self.memory[at::ID] = id,
        }
    }

    /// One step of firmware and motor, ending at `time_s`.
    pub fn step(&mut self, time_s: f64, dt_s: f64) {
        self.time_s = time_s;
        let duty = self.torque_on().then(|| self.control(dt_s));
        self.duty = duty.unwrap_or(0.0);
        let joint_rad = self.joint_rad(self.motor.angle_rad);
        let gravity_nm = -self.spec.direction * self.spec.gravity_nm * joint_rad.sin();
        self.motor.step(dt_s, duty, self.supply_v, gravity_nm);
        self.protect(dt_s);
    }

    /// The end of a control period: the true position is judged.
    pub fn end_period(&mut self) {
        let position_rad = self.joint_rad(self.motor.angle_rad);
        self.judge.went(self.time_s, position_rad);
    }

    /// Proportional, at most the torque limit; a goal speed limits the trajectory.
    fn control(&mut self, dt_s: f64) -> f64 {
        let goal = sign_magnitude(self.word(at::GOAL), 15);
        let speed = sign_magnitude(self.word(at::GOAL_SPEED), 15).abs();
        let left = goal - self.trajectory_ticks;
        self.trajectory_ticks = if speed == 0.0 || left.abs() <= speed * dt_s {
            goal
        } else {
            self.trajectory_ticks + left.signum() * speed * dt_s
        };
        let error_rad = (self.trajectory_ticks - self.encoder_ticks()) * RAD_PER_TICK;
        let gain = f64::from(self.memory[at::P_GAIN]) / 32.0;
        let most = f64::from(self.word(at::TORQUE_LIMIT)) * 1e-3;
        (gain * error_rad / FULL_PWM_ERROR_RAD).clamp(-most, most)
    }

    fn protect(&mut self, dt_s: f64) {
        let stall_a = self.model.stall_current_a * OVERLOAD_SHARE;
        let stalled = self.motor.current_a.abs() > stall_a && self.motor.speed_rad_s.abs() < 0.1;
        self.overload_s = if stalled { self.overload_s + dt_s } else { 0.0 };
        if self.overload_s > OVERLOAD_S {
            self.raise(OVERLOAD);
        }
        if self.motor.temperature_c > f64::from(self.memory[at::HOTTEST]) {
            self.raise(OVERHEAT);
        }
        let tenths = self.supply_v * 10.0;
        let lowest = f64::from(self.memory[at::MIN_VOLTAGE]);
        if tenths < lowest || tenths > f64::from(self.memory[at::MAX_VOLTAGE]) {
            self.raise(VOLTAGE);
        }
    }

    /// Brings the present-value registers up to date.
    fn refresh(&mut self) {
        let position = self.encoder_ticks();
        self.put(at::POSITION, as_sign_magnitude(position, 15));
        let speed = (self.motor.speed_rad_s / RAD_PER_TICK).round();
        self.put(at::SPEED, as_sign_magnitude(speed, 15));
        self.put(at::LOAD, as_sign_magnitude((self.duty * 1e3).round(), 10));
        self.memory[at::VOLTAGE] = (self.supply_v * 10.0).round() as u8;
        self.memory[at::TEMPERATURE] = self.motor.temperature_c.round() as u8;
        self.memory[at::MOVING] = u8::from(speed.abs() > 5.0);
        let current = (self.motor.current_a / AMPERES_PER_UNIT).round();
        self.put(at::CURRENT, as_sign_magnitude(current, 15));
    }
}

/// The value of a word whose sign is `bit`.
fn sign_magnitude(word: u16, bit: u32) -> f64 {
    let magnitude = f64::from(word & ((1 << bit) - 1));
    if word >> bit & 1 == 1 {
        -magnitude
    } else {
        magnitude
    }
}

/// A whole number as magnitude and sign bit.
fn as_sign_magnitude(value: f64, bit: u32) -> u16 {
    let most = f64::from((1u16 << bit) - 1);
    let magnitude = value.abs().min(most) as u16;
    magnitude | u16::from(value < 0.0) << bit
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_are_a_bit() {
        for (value, bit, word) in [
            (5.0, 15, 5),
            (-5.0, 15, 0x8005),
            (-5.0, 10, 0x405),
            (-2.0, 11, 0x802),
        ] {
            assert_eq!(as_sign_magnitude(value, bit), word);
            assert_eq!(sign_magnitude(word, bit), value);
        }
    }
}
