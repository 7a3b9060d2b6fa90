//! One simulated servo of byte memory: Feetech STS, AX, or MX with Protocol 1.0.
//! Memory (a [`ByteMemory`] of its family), position loop and motor.
//!
//! Signs are a
//! bit. What is written to permanent memory while an STS servo's lock is on is gone after
//! a restart. An STS servo's present position is the encoder less its offset. There is
//! no bus watchdog. A condition (voltage, heat, overload) shows in every answer
//! and cuts torque: an STS servo's until torque is turned on again, an AX's or
//! MX's by a torque limit of zero until that is written.

use servodance_drivers::ServoModel;
use servodance_drivers::serial::{
    ByteMemory, Register, ServiceRegisters, family_of, sign_magnitude,
};

use crate::fault::ServoFault;
use crate::serial::serial_line::LineServo;
use crate::servo::body::{ServoBody, SimServoState};
use crate::servo::spec::SimServoSpec;

const REBOOT_S: f64 = 0.8;
const OVERLOAD_S: f64 = 2.0;
const OVERLOAD_SHARE: f64 = 0.8;
/// The error of an instruction whose value is beyond a limit.
const ANGLE_LIMIT: u8 = 1 << 1;

/// One servo whose firmware keeps plain bytes.
#[derive(Clone, Debug)]
pub struct ByteServo {
    pub(super) model: &'static ServoModel,
    pub(crate) layout: &'static ByteMemory,
    memory: Vec<u8>,
    /// As the memory holds it, where the memory has it.
    id: u8,
    /// The condition that every answer carries.
    pub(crate) flags: u8,
    /// As it was written last: reading that register may give something else.
    goal: u16,
    pub(super) body: ServoBody,
    duty: f64,
    /// Where the loops are on their way: ticks, ticks a second, duty.
    pub(super) trajectory_ticks: f64,
    pub(super) trajectory_speed: f64,
    pub(super) speed_integral: f64,
    registered: Option<(u8, Vec<u8>)>,
    baud: u32,
    /// What a power cycle brings back: permanent memory without what was written while locked.
    permanent: Vec<u8>,
}

impl ByteServo {
    /// A servo fresh from the factory but for its id.
    pub fn new(
        spec: &SimServoSpec,
        model: &'static ServoModel,
        layout: &'static ByteMemory,
        baud: u32,
        supply_v: f64,
        period_s: f64,
    ) -> Self {
        let motor = spec.servo_motor(model);
        let mut servo = Self {
            id: spec.id,
            layout,
            memory: vec![0; layout.size],
            flags: 0,
            goal: 0,
            body: ServoBody::new(spec, motor, period_s, supply_v),
            model,
            duty: 0.0,
            trajectory_ticks: 0.0,
            trajectory_speed: 0.0,
            speed_integral: 0.0,
            registered: None,
            baud,
            permanent: Vec::new(),
        };
        servo.body.judge.tick_rad = model.rad_per_tick;
        servo.restore(0);
        servo.put_if(layout.model, model.number);
        servo.put_id(spec.id);
        servo.put_baud();
        servo.permanent = servo.memory[..layout.ram].to_vec();
        servo.boot();
        servo
    }

    fn restore(&mut self, from: usize) {
        self.memory[from..].fill(0);
        for &(register, value) in self.layout.factory {
            if register.range().start >= from {
                self.put(register, value);
            }
        }
    }

    fn boot(&mut self) {
        self.restore(self.layout.ram);
        self.memory[..self.permanent.len()].copy_from_slice(&self.permanent);
        if let Some(service) = self.service() {
            self.id = self.get(service.id) as u8;
        }
        self.flags = 0;
        self.registered = None;
        self.body.stalled_s = 0.0;
        self.body.judge.end();
        self.refresh();
        self.goal = self.get(self.position());
        self.put(self.layout.registers.goal, self.goal);
    }

    fn position(&self) -> Register {
        Register { size: 2, ..self.layout.registers.present }
    }

    fn get(&self, register: Register) -> u16 {
        register.value(&self.memory[register.range()]) as u16
    }

    /// The value of a register, or what a servo without it does.
    pub(super) fn get_or(&self, register: Option<Register>, without: u16) -> u16 {
        register.map_or(without, |register| self.get(register))
    }

    fn put(&mut self, register: Register, value: u16) {
        let range = register.range();
        let size = range.len();
        self.memory[range].copy_from_slice(&value.to_le_bytes()[..size]);
    }

    fn put_if(&mut self, register: Option<Register>, value: u16) {
        if let Some(register) = register {
            self.put(register, value);
        }
    }

    fn service(&self) -> Option<&'static ServiceRegisters> {
        self.layout.registers.service.as_ref()
    }

    fn put_id(&mut self, id: u8) {
        self.id = id;
        self.put_if(self.service().map(|service| service.id), u16::from(id));
    }

    /// The baud register says the rate that the servo has.
    fn put_baud(&mut self) {
        if let Some((register, baud_of)) = self.layout.baud {
            let near = |code: &u8| baud_of(*code).abs_diff(self.baud) * 50 < self.baud;
            let code = (0..=u8::MAX).find(near).unwrap_or(u8::MAX);
            self.put(register, u16::from(code));
        }
    }

    /// The rate that was written is the one at which it listens from now on.
    fn take_baud(&mut self) {
        if let Some((register, baud_of)) = self.layout.baud {
            let written = baud_of(self.get(register) as u8);
            let usual =
                family_of(self.model.kind).map_or(&[][..], |family| family.bauds(self.model));
            // 2 Mbps divided by 35 is 57,142: the servo's 57,600.
            let meant = usual.iter().find(|baud| baud.abs_diff(written) * 50 < **baud);
            self.baud = meant.copied().unwrap_or(written);
        }
    }

    pub(crate) fn return_delay_s(&self) -> f64 {
        f64::from(self.get_or(self.layout.return_delay, 0)) * 2e-6
    }

    pub(crate) fn answers_reads(&self) -> bool {
        self.status_level() >= self.writes_level() - 1
    }

    pub(crate) fn answers_writes(&self) -> bool {
        self.status_level() >= self.writes_level()
    }

    fn status_level(&self) -> u16 {
        self.get_or(self.layout.status_level, 2)
    }

    fn writes_level(&self) -> u16 {
        if self.layout.sync_read { 1 } else { 2 }
    }

    fn torque_on(&self) -> bool {
        self.get(self.layout.registers.torque) == 1
    }

    fn offset_ticks(&self) -> f64 {
        f64::from(sign_magnitude(self.get_or(self.layout.offset, 0), 11))
    }

    pub(super) fn encoder_ticks(&self) -> f64 {
        (self.body.motor.angle_rad / self.model.rad_per_tick).round() - self.offset_ticks()
    }

    pub(super) fn goal_ticks(&self) -> f64 {
        f64::from(sign_magnitude(self.goal, 15))
    }

    fn goal_rad(&self) -> f64 {
        let ticks = self.goal_ticks() + self.offset_ticks();
        self.body.joint_rad(ticks * self.model.rad_per_tick)
    }

    /// Ticks a second in one unit of speed.
    pub(super) fn speed_ticks_s(&self) -> f64 {
        self.model.velocity_rad_s_per_unit / self.model.rad_per_tick
    }

    /// `size` bytes from `address` on; none where there is no memory.
    pub(crate) fn read(&mut self, address: u8, size: u8) -> Vec<u8> {
        self.refresh();
        let start = usize::from(address);
        let end = start + usize::from(size);
        self.memory.get(start..end).unwrap_or_default().to_vec()
    }

    /// Stores bytes; what is read-only stays. The error flags of the answer.
    pub(crate) fn write(&mut self, address: u8, bytes: &[u8]) -> u8 {
        let layout = self.layout;
        let (goal, torque) = (layout.registers.goal, layout.registers.torque);
        let start = usize::from(address);
        let was_on = self.torque_on();
        let touched = start..start + bytes.len();
        let touches = |register: Register| touched.contains(&register.range().start);
        let first = self.service().map_or(0, |service| service.id.range().start);
        let lock = self.service().and_then(|service| service.lock);
        let locked = lock.is_some_and(|lock| self.get(lock) != 0);
        for (at, byte) in (start..).zip(bytes) {
            let writable = (first..=layout.last_writable).contains(&at);
            if at < layout.size && (writable || layout.also_writable.contains(&at)) {
                self.memory[at] = *byte;
                if !locked && let Some(kept) = self.permanent.get_mut(at) {
                    *kept = *byte;
                }
            }
        }
        if let Some(service) = self.service() {
            self.id = self.get(service.id) as u8;
        }
        if layout.baud.is_some_and(|(register, _)| touches(register)) {
            self.take_baud();
        }
        let old_goal = self.goal;
        if goal.range().any(|at| touched.contains(&at)) {
            self.goal = self.get(goal);
        }
        let mut error = 0;
        if touches(goal) {
            if let Some((lowest, highest)) = layout.goal_limits {
                let (lowest, highest) = (self.get(lowest), self.get(highest));
                if layout.refuses_goals && !(lowest..=highest).contains(&self.goal) {
                    self.goal = old_goal;
                    error = ANGLE_LIMIT;
                } else if highest > lowest {
                    self.goal = self.goal.clamp(lowest, highest);
                }
                self.put(goal, self.goal);
            }
            // AX and MX turn torque on when they get a goal.
            if layout.refuses_goals && error == 0 {
                self.put(torque, 1);
            }
        }
        if touches(torque) || self.torque_on() != was_on {
            self.set_torque(was_on);
        }
        if touches(goal) && error == 0 {
            let goal_rad = self.goal_rad();
            self.body.judge.judge_goal(self.body.time_s, goal_rad);
        }
        error
    }

    fn set_torque(&mut self, was_on: bool) {
        if self.torque_on() && !was_on {
            let shutdown = self.layout.protection.and_then(|own| own.shutdown);
            if shutdown.is_none() || self.torque_limit() > 0 {
                self.flags = 0;
            }
            self.trajectory_ticks = self.encoder_ticks();
            (self.trajectory_speed, self.speed_integral) = (0.0, 0.0);
            let (goal_rad, position_rad) = (self.goal_rad(), self.body.position_rad());
            self.body.judge.begin(goal_rad, position_rad);
            self.body.judge.judge_goal(self.body.time_s, goal_rad);
        } else if !self.torque_on() {
            self.body.judge.end();
        }
    }

    pub(crate) fn register(&mut self, address: u8, bytes: &[u8]) {
        self.registered = Some((address, bytes.to_vec()));
    }

    pub(crate) fn act(&mut self) {
        if let Some((address, bytes)) = self.registered.take() {
            self.write(address, &bytes);
        }
    }

    /// Restarts: memory from the torque switch on lost; deaf for a while.
    pub(crate) fn reboot(&mut self) {
        self.boot();
        self.body.be_deaf_for(REBOOT_S);
    }

    fn lose_supply(&mut self) {
        self.put(self.layout.registers.torque, 0);
        self.body.judge.end();
    }

    /// Factory settings for everything but the model; id 1 and the factory's rate again.
    pub(crate) fn factory_reset(&mut self) {
        self.restore(0);
        self.put_if(self.layout.model, self.model.number);
        self.put_id(1);
        self.take_baud();
        self.permanent = self.memory[..self.layout.ram].to_vec();
        self.reboot();
    }

    pub(super) fn torque_limit(&self) -> u16 {
        self.get_or(self.layout.torque_limit, 1000)
    }

    fn raise(&mut self, bits: u8) {
        self.flags |= bits;
        let shutdown = self.layout.protection.and_then(|own| own.shutdown);
        if shutdown.is_none_or(|shutdown| self.get(shutdown) as u8 & bits != 0) {
            self.put(self.layout.registers.torque, 0);
            if shutdown.is_some() {
                self.put_if(self.layout.torque_limit, 0);
            }
            self.body.judge.end();
        }
    }

    fn protect(&mut self, dt_s: f64) {
        let Some(own) = self.layout.protection else {
            return;
        };
        let (voltage, heat, overload) = own.conditions;
        let stall_a = self.model.sheet.stall_current_a * OVERLOAD_SHARE;
        let pushes_hard = self.body.motor.current_a.abs() > stall_a;
        if self.body.stalled_for(dt_s, pushes_hard) > OVERLOAD_S {
            self.raise(overload);
        }
        if self.body.motor.temperature_c > f64::from(self.get(own.hottest)) {
            self.raise(heat);
        }
        let tenths = self.body.volts() * 10.0;
        let lowest = f64::from(self.get(own.min_voltage));
        if tenths < lowest || tenths > f64::from(self.get(own.max_voltage)) {
            self.raise(voltage);
        }
    }

    fn refresh(&mut self) {
        let layout = self.layout;
        let ticks = match self.is_endless() {
            true => self.encoder_ticks().rem_euclid(f64::from(self.model.last_tick) + 1.0),
            false => self.encoder_ticks(),
        };
        let position = as_sign_magnitude(ticks, 15);
        self.put(self.position(), position);
        let speed = self.body.motor.speed_rad_s / self.model.rad_per_tick / self.speed_ticks_s();
        let speed = speed.round();
        self.put_if(layout.speed, as_sign_magnitude(speed, layout.sign_bit));
        let load = as_sign_magnitude((self.duty * 1e3).round(), 10);
        self.put_if(layout.load, load);
        self.put_if(layout.moving, u16::from(speed.abs() > 5.0));
        if let Some(service) = self.service() {
            let tenths = (self.body.volts() * 10.0).round() as u8;
            self.put(service.voltage, u16::from(tenths));
            let celsius = self.body.motor.temperature_c.round() as u8;
            self.put(service.temperature, u16::from(celsius));
            self.put_if(service.status, u16::from(self.flags));
        }
        if let Some(amperes) = self.model.current_a_per_unit {
            let current = (self.body.motor.current_a / amperes).round();
            self.put_if(layout.current, as_sign_magnitude(current, 15));
        }
    }
}

impl LineServo for ByteServo {
    fn body(&self) -> &ServoBody {
        &self.body
    }

    fn body_mut(&mut self) -> &mut ServoBody {
        &mut self.body
    }

    fn id(&self) -> u8 {
        self.id
    }

    fn baud(&self) -> u32 {
        self.baud
    }

    fn state(&self) -> SimServoState {
        SimServoState {
            goal_rad: self.goal_rad(),
            torque_enabled: self.torque_on(),
            hardware_error: self.flags,
            ..self.body.state()
        }
    }

    fn suffer(&mut self, fault: ServoFault) {
        match self.body.suffer(fault) {
            Some(ServoFault::Reboot) => self.reboot(),
            Some(ServoFault::Overload) => {
                if let Some(own) = self.layout.protection {
                    self.raise(own.conditions.2);
                }
            }
            Some(ServoFault::Flags(bits)) => self.raise(bits),
            Some(ServoFault::Id(id)) => {
                self.put_id(id);
                self.permanent = self.memory[..self.layout.ram].to_vec();
            }
            Some(ServoFault::Baud(baud)) => self.baud = baud,
            Some(ServoFault::Unplug) => self.lose_supply(),
            Some(ServoFault::Plug) => self.reboot(),
            Some(ServoFault::New) => self.factory_reset(),
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
        for (value, bit, word) in
            [(5.0, 15, 5), (-5.0, 15, 0x8005), (-5.0, 10, 0x405), (-2.0, 11, 0x802)]
        {
            assert_eq!(as_sign_magnitude(value, bit), word);
            assert_eq!(f64::from(sign_magnitude(word, bit)), value);
        }
    }
}
