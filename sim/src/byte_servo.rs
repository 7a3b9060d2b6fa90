//! One simulated servo of byte memory: Feetech STS, AX, or MX with Protocol 1.0.
//! Table ([`Layout`]), position loop and motor.
//!
//! Position mode only (other modes are stored, without effect). Signs are a
//! bit. An STS servo's present position is the encoder less its offset. There is
//! no bus watchdog. A condition (voltage, heat, overload) shows in every answer
//! and cuts torque: an STS servo's until torque is turned on again, an AX's or
//! MX's by a torque limit of zero until that is written.

use crate::body::{Body, SimServoState};
use crate::fault::ServoFault;
use crate::judge::Judge;
use crate::layout::Layout;
use crate::motor::{FULL_PWM_ERROR_RAD, Motor};
use crate::roster::Device;
use crate::spec::{ServoModel, SimServoSpec};

const AMPERES_PER_UNIT: f64 = 6.5e-3;
const REBOOT_S: f64 = 0.8;
const OVERLOAD_S: f64 = 2.0;
const OVERLOAD_SHARE: f64 = 0.8;
/// The error of an instruction whose value is beyond a limit.
const ANGLE_LIMIT: u8 = 1 << 1;

/// One servo.
#[derive(Clone, Debug)]
pub struct ByteServo {
    model: &'static ServoModel,
    layout: &'static Layout,
    memory: Vec<u8>,
    /// What it has against itself.
    flags: u8,
    body: Body,
    duty: f64,
    /// Where the speed-limited trajectory is, ticks.
    trajectory_ticks: f64,
    registered: Option<(u8, Vec<u8>)>,
    baud: u32,
}

impl ByteServo {
    /// A servo fresh from the factory but for its id.
    pub fn new(
        spec: &SimServoSpec,
        model: &'static ServoModel,
        baud: u32,
        supply_v: f64,
        period_s: f64,
    ) -> Self {
        let motor = Motor::new(model, spec.load_inertia_kg_m2).with_backlash(spec.backlash_rad);
        let layout = model.layout();
        let judge = Judge::new(&spec.name, spec.limits, period_s).with_tick(layout.tick_rad);
        let mut servo = Self {
            layout,
            memory: vec![0; layout.size],
            flags: 0,
            body: Body::new(spec, motor, judge, supply_v),
            model,
            duty: 0.0,
            trajectory_ticks: 0.0,
            registered: None,
            baud,
        };
        servo.restore(0);
        servo.put(layout.model, model.number);
        servo.memory[layout.id] = spec.id;
        servo.boot();
        servo
    }

    /// Factory settings from an address on.
    fn restore(&mut self, from: usize) {
        self.memory[from..].fill(0);
        for &(address, bytes, value) in self.layout.factory {
            if address >= from {
                let value = value.to_le_bytes();
                self.memory[address..address + bytes].copy_from_slice(&value[..bytes]);
            }
        }
    }

    fn boot(&mut self) {
        self.restore(self.layout.ram);
        self.flags = 0;
        self.registered = None;
        self.body.forget_stall();
        self.body.judge.end();
        self.refresh();
        self.put(self.layout.goal, self.word(self.layout.position));
    }

    fn word(&self, address: usize) -> u16 {
        u16::from_le_bytes([self.memory[address], self.memory[address + 1]])
    }

    fn put(&mut self, address: usize, value: u16) {
        self.memory[address..address + 2].copy_from_slice(&value.to_le_bytes());
    }

    /// Its memory's layout.
    pub fn layout(&self) -> &'static Layout {
        self.layout
    }

    /// Seconds between an instruction and its reply.
    pub fn return_delay_s(&self) -> f64 {
        f64::from(self.memory[self.layout.return_delay]) * 2e-6
    }

    /// Whether it answers reads.
    pub fn answers_reads(&self) -> bool {
        self.memory[self.layout.status_level] >= self.writes_level() - 1
    }

    /// Whether it answers writes.
    pub fn answers_writes(&self) -> bool {
        self.memory[self.layout.status_level] >= self.writes_level()
    }

    /// The return level from which on writes are answered.
    fn writes_level(&self) -> u8 {
        if self.layout.sync_read { 1 } else { 2 }
    }

    /// The condition that every answer carries.
    pub fn status(&self) -> u8 {
        self.flags
    }

    fn torque_on(&self) -> bool {
        self.memory[self.layout.torque] == 1
    }

    fn offset_ticks(&self) -> f64 {
        let offset = self.layout.offset.map(|address| self.word(address));
        offset.map_or(0.0, |word| sign_magnitude(word, 11))
    }

    /// The encoder less the offset, turns counted.
    fn encoder_ticks(&self) -> f64 {
        (self.body.motor.angle_rad / self.layout.tick_rad).round() - self.offset_ticks()
    }

    fn goal_rad(&self) -> f64 {
        let ticks = sign_magnitude(self.word(self.layout.goal), 15) + self.offset_ticks();
        self.body.joint_rad(ticks * self.layout.tick_rad)
    }

    /// `size` bytes from `address` on; none where there is no memory.
    pub fn read(&mut self, address: u8, size: u8) -> Vec<u8> {
        self.refresh();
        let start = usize::from(address);
        let end = start + usize::from(size);
        self.memory.get(start..end).unwrap_or_default().to_vec()
    }

    /// Stores bytes; what is read-only stays. The error flags of the answer.
    pub fn write(&mut self, address: u8, bytes: &[u8]) -> u8 {
        let layout = self.layout;
        let start = usize::from(address);
        let was_on = self.torque_on();
        let touched = start..start + bytes.len();
        let old_goal = self.word(layout.goal);
        for (at, byte) in (start..).zip(bytes) {
            let writable = (layout.id..=layout.last_writable).contains(&at);
            if at < layout.size && (writable || layout.also_writable.contains(&at)) {
                self.memory[at] = *byte;
            }
        }
        let mut error = 0;
        if touched.contains(&layout.goal) {
            let (lowest, highest) = (self.word(layout.lowest), self.word(layout.highest));
            let goal = self.word(layout.goal);
            if layout.refuses_goals && !(lowest..=highest).contains(&goal) {
                self.put(layout.goal, old_goal);
                error = ANGLE_LIMIT;
            } else if highest > lowest {
                self.put(layout.goal, goal.clamp(lowest, highest));
            }
            // AX and MX turn torque on when they get a goal.
            if layout.refuses_goals && error == 0 {
                self.memory[layout.torque] = 1;
            }
        }
        if touched.contains(&layout.torque) || self.torque_on() != was_on {
            self.set_torque(was_on);
        }
        if touched.contains(&layout.goal) && error == 0 {
            let goal_rad = self.goal_rad();
            self.body.judge.told(self.body.time_s, goal_rad);
        }
        error
    }

    fn set_torque(&mut self, was_on: bool) {
        if self.torque_on() && !was_on {
            if self.layout.shutdown.is_none() || self.word(self.layout.torque_limit) > 0 {
                self.flags = 0;
            }
            self.trajectory_ticks = self.encoder_ticks();
            let (goal_rad, position_rad) = (self.goal_rad(), self.body.position_rad());
            self.body.judge.begin(goal_rad, position_rad);
            self.body.judge.told(self.body.time_s, goal_rad);
        } else if !self.torque_on() {
            self.body.judge.end();
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
        self.body.be_deaf_for(REBOOT_S);
    }

    /// Factory settings for everything but the model and, as asked, the id.
    pub fn factory_reset(&mut self) {
        self.restore(0);
        self.put(self.layout.model, self.model.number);
        self.memory[self.layout.id] = 1;
        self.reboot();
    }

    fn raise(&mut self, bits: u8) {
        self.flags |= bits;
        let shuts_down = match self.layout.shutdown {
            None => true,
            Some(address) => self.memory[address] & bits != 0,
        };
        if shuts_down {
            self.memory[self.layout.torque] = 0;
            if self.layout.shutdown.is_some() {
                self.put(self.layout.torque_limit, 0);
            }
            self.body.judge.end();
        }
    }

    /// Proportional, at most the torque limit; a goal speed limits the trajectory.
    fn control(&mut self, dt_s: f64) -> f64 {
        let layout = self.layout;
        let goal = sign_magnitude(self.word(layout.goal), 15);
        let units = sign_magnitude(self.word(layout.goal_speed), layout.sign_bit).abs();
        let speed = units * layout.speed_ticks_s;
        let left = goal - self.trajectory_ticks;
        self.trajectory_ticks = if speed == 0.0 || left.abs() <= speed * dt_s {
            goal
        } else {
            self.trajectory_ticks + left.signum() * speed * dt_s
        };
        let error_rad = (self.trajectory_ticks - self.encoder_ticks()) * layout.tick_rad;
        let gain = layout
            .p_gain
            .map_or(1.0, |address| f64::from(self.memory[address]) / 32.0);
        let most = (f64::from(self.word(layout.torque_limit)) * 1e-3).min(1.0);
        (gain * error_rad / FULL_PWM_ERROR_RAD).clamp(-most, most)
    }

    fn protect(&mut self, dt_s: f64) {
        let stall_a = self.model.stall_current_a * OVERLOAD_SHARE;
        let pushes_hard = self.body.motor.current_a.abs() > stall_a;
        if self.body.stalled_for(dt_s, pushes_hard) > OVERLOAD_S {
            self.raise(self.layout.conditions.2);
        }
        if self.body.motor.temperature_c > f64::from(self.memory[self.layout.hottest]) {
            self.raise(self.layout.conditions.1);
        }
        let tenths = self.body.volts() * 10.0;
        let lowest = f64::from(self.memory[self.layout.min_voltage]);
        if tenths < lowest || tenths > f64::from(self.memory[self.layout.max_voltage]) {
            self.raise(self.layout.conditions.0);
        }
    }

    /// Brings the present-value registers up to date.
    fn refresh(&mut self) {
        let layout = self.layout;
        let position = self.encoder_ticks();
        self.put(layout.position, as_sign_magnitude(position, 15));
        let speed = self.body.motor.speed_rad_s / layout.tick_rad / layout.speed_ticks_s;
        let speed = speed.round();
        self.put(layout.speed, as_sign_magnitude(speed, layout.sign_bit));
        self.put(
            layout.load,
            as_sign_magnitude((self.duty * 1e3).round(), 10),
        );
        self.memory[layout.voltage] = (self.body.volts() * 10.0).round() as u8;
        self.memory[layout.temperature] = self.body.motor.temperature_c.round() as u8;
        self.memory[layout.moving] = u8::from(speed.abs() > 5.0);
        if let Some(address) = layout.status {
            self.memory[address] = self.flags;
        }
        if let Some(address) = layout.current {
            let current = (self.body.motor.current_a / AMPERES_PER_UNIT).round();
            self.put(address, as_sign_magnitude(current, 15));
        }
    }
}

impl Device for ByteServo {
    fn body(&self) -> &Body {
        &self.body
    }

    fn body_mut(&mut self) -> &mut Body {
        &mut self.body
    }

    fn id(&self) -> u8 {
        self.memory[self.layout.id]
    }

    fn baud(&self) -> u32 {
        self.baud
    }

    fn state(&self) -> SimServoState {
        SimServoState {
            goal_rad: self.goal_rad(),
            torque_enabled: self.torque_on(),
            hardware_error: self.status(),
            ..self.body.state()
        }
    }

    fn suffer(&mut self, fault: ServoFault) {
        match self.body.suffer(fault) {
            Some(ServoFault::Reboot) => self.reboot(),
            Some(ServoFault::Overload) => self.raise(self.layout.conditions.2),
            Some(ServoFault::Id(id)) => self.memory[self.layout.id] = id,
            Some(ServoFault::Baud(baud)) => self.baud = baud,
            _ => {}
        }
    }

    fn step(&mut self, dt_s: f64) {
        let duty = self.torque_on().then(|| self.control(dt_s));
        self.duty = duty.unwrap_or(0.0);
        self.body.step(dt_s, duty);
        self.protect(dt_s);
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
