//! One simulated servo: control table, firmware loops and motor together.
//!
//! Modes 0 (current), 1 (velocity), 3 (position), 4 (extended position),
//! 5 (current-based position) and 16 (PWM); trapezoidal profiles in the
//! position modes; bus watchdog; shutdown by overload, heat and voltage, which
//! only a reboot clears. Not simulated: time-based profiles (refused), feed-forward
//! gains (stored, without effect).

use std::f64::consts::TAU;

use crate::fault::ServoFault;
use crate::judge::Judge;
use crate::motor::{FULL_PWM, Motor};
use crate::roster::Device;
use crate::spec::{ServoModel, SimServoSpec};
use crate::table::{AccessError, Table, at};

const RAD_PER_TICK: f64 = TAU / 4096.0;
const RAD_S_PER_UNIT: f64 = 0.229 * TAU / 60.0;
const RAD_S2_PER_UNIT: f64 = 214.577 * TAU / 3600.0;
/// How long a servo is deaf after a reboot.
const REBOOT_S: f64 = 0.3;
/// Stall for this long is an overload, ...
const OVERLOAD_S: f64 = 2.0;
/// ... and stall is this share of the stall torque.
const OVERLOAD_SHARE: f64 = 0.8;
/// Hardware error bits.
const VOLTAGE_ERROR: i64 = 1;
const OVERHEAT_ERROR: i64 = 1 << 2;
const OVERLOAD_ERROR: i64 = 1 << 5;

/// What a servo really does, whatever it says on the wire.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SimServoState {
    /// Simulated time, seconds.
    pub time_s: f64,
    /// True joint position, radians.
    pub position_rad: f64,
    /// True joint velocity, radians a second.
    pub velocity_rad_s: f64,
    /// The goal it holds, joint radians.
    pub goal_rad: f64,
    /// Motor current towards higher joint positions, amperes.
    pub current_a: f64,
    /// Winding temperature, Celsius.
    pub temperature_c: f64,
    /// Whether it drives.
    pub torque_enabled: bool,
    /// Whether its bus watchdog has tripped.
    pub watchdog_tripped: bool,
    /// The hardware error register.
    pub hardware_error: u8,
}

/// One servo.
#[derive(Clone, Debug)]
pub struct SimServo {
    spec: SimServoSpec,
    model: &'static ServoModel,
    table: Table,
    motor: Motor,
    judge: Judge,
    supply_v: f64,
    sag_v: f64,
    backup: Option<Table>,
    registered: Option<Vec<(u16, i64)>>,
    /// Where the profile is, ticks, and its speed, ticks a second.
    trajectory_ticks: f64,
    trajectory_speed: f64,
    integral: f64,
    duty: f64,
    overload_s: f64,
    deaf_until_s: f64,
    fed_s: f64,
    time_s: f64,
    dead: bool,
}

impl SimServo {
    /// A servo fresh from the factory but for its id and baud code.
    pub fn new(
        spec: &SimServoSpec,
        model: &'static ServoModel,
        baud_code: u8,
        supply_v: f64,
        period_s: f64,
    ) -> Self {
        let angle_rad = spec.zero_rad + spec.direction * spec.initial_rad;
        let mut servo = Self {
            table: Table::new(model, spec.id, baud_code, spec.firmware),
            motor: Motor::new(model, spec.load_inertia_kg_m2, angle_rad),
            judge: Judge::new(&spec.name, spec.limits, period_s),
            spec: spec.clone(),
            model,
            supply_v,
            sag_v: 0.0,
            backup: None,
            registered: None,
            trajectory_ticks: 0.0,
            trajectory_speed: 0.0,
            integral: 0.0,
            duty: 0.0,
            overload_s: 0.0,
            deaf_until_s: 0.0,
            fed_s: 0.0,
            time_s: 0.0,
            dead: false,
        };
        servo.boot();
        servo
    }

    fn boot(&mut self) {
        self.table.reset_ram();
        self.registered = None;
        self.overload_s = 0.0;
        self.integral = 0.0;
        self.judge.end();
        let here = self.present_ticks();
        self.table.put(at::GOAL_POSITION, here);
        self.trajectory_ticks = here as f64;
        self.trajectory_speed = 0.0;
    }

    /// Microseconds between an instruction and its reply.
    pub fn return_delay_s(&self) -> f64 {
        self.table.get(at::RETURN_DELAY) as f64 * 2e-6
    }

    /// 0: answers pings only; 1: and reads; 2: everything.
    pub fn return_level(&self) -> i64 {
        self.table.get(at::STATUS_RETURN_LEVEL)
    }

    /// Whether it knows the fast reads.
    pub fn knows_fast_reads(&self) -> bool {
        self.table.get(at::FIRMWARE) as u8 >= self.model.fast_read_firmware()
    }

    /// 0x80 when the hardware error register is set.
    pub fn alert_bit(&self) -> u8 {
        u8::from(self.table.get(at::HARDWARE_ERROR) != 0) << 7
    }

    /// Model number and firmware: what a ping returns.
    pub fn ping(&self) -> [u8; 3] {
        let [low, high] = (self.table.get(at::MODEL) as u16).to_le_bytes();
        [low, high, self.table.get(at::FIRMWARE) as u8]
    }

    /// The supply at its terminals.
    fn volts(&self) -> f64 {
        self.supply_v - self.sag_v
    }

    /// Keeps the settings that survive a power cycle; refused with torque on.
    pub fn back_up(&mut self) -> bool {
        let allowed = !self.torque_on();
        if allowed {
            self.table.put(at::BACKUP_READY, 1);
            self.backup = Some(self.table.clone());
        }
        allowed
    }

    /// Whether there is a backup that may be restored now.
    pub fn has_backup(&self) -> bool {
        self.backup.is_some() && !self.torque_on()
    }

    /// Settings as they were backed up, then a restart; the id stays.
    pub fn restore_backup(&mut self) {
        if let Some(backup) = self.backup.clone() {
            let id = self.table.get(at::ID);
            self.table = backup;
            self.table.put(at::ID, id);
            self.reboot();
            self.table.put(at::BACKUP_READY, 1);
        }
    }

    fn torque_on(&self) -> bool {
        self.table.get(at::TORQUE) == 1
    }

    fn watchdog_tripped(&self) -> bool {
        self.table.get(at::BUS_WATCHDOG) == 255
    }

    fn joint_rad(&self, angle_rad: f64) -> f64 {
        (angle_rad - self.spec.zero_rad) * self.spec.direction
    }

    /// +1, or -1 in reverse drive mode.
    fn drive_sign(&self) -> f64 {
        if self.table.get(at::DRIVE_MODE) & 1 == 1 {
            -1.0
        } else {
            1.0
        }
    }

    fn angle_of_ticks(&self, ticks: f64) -> f64 {
        let offset = self.table.get(at::HOMING_OFFSET) as f64;
        (ticks - offset) * self.drive_sign() * RAD_PER_TICK
    }

    /// The encoder through offset and drive mode, turns counted.
    fn encoder_ticks(&self) -> f64 {
        let raw = (self.motor.angle_rad / RAD_PER_TICK).round();
        raw * self.drive_sign() + self.table.get(at::HOMING_OFFSET) as f64
    }

    /// Present position as the register shows it: within a turn in mode 3.
    fn present_ticks(&self) -> i64 {
        let ticks = self.encoder_ticks() as i64;
        match self.table.get(at::OPERATING_MODE) {
            3 => ticks.rem_euclid(4096),
            _ => ticks,
        }
    }

    /// Any instruction on the bus feeds the watchdog.
    pub fn feed_watchdog(&mut self) {
        self.fed_s = self.time_s;
    }

    /// A read of the control table: error number and data.
    pub fn read(&mut self, address: u16, size: u16) -> Result<Vec<u8>, AccessError> {
        self.refresh();
        self.table.read(address, size)
    }

    /// A write to the control table.
    pub fn write(&mut self, address: u16, bytes: &[u8]) -> Result<(), AccessError> {
        let writes = self.checked(address, bytes)?;
        self.apply(&writes);
        Ok(())
    }

    /// A write that waits for an action.
    pub fn register(&mut self, address: u16, bytes: &[u8]) -> Result<(), AccessError> {
        self.registered = Some(self.checked(address, bytes)?);
        self.table.put(at::REGISTERED, 1);
        Ok(())
    }

    /// Carries out the registered write; false if there is none.
    pub fn act(&mut self) -> bool {
        let Some(writes) = self.registered.take() else {
            return false;
        };
        self.table.put(at::REGISTERED, 0);
        self.apply(&writes);
        true
    }

    /// Restarts: RAM lost, torque off, errors cleared; deaf for a while.
    pub fn reboot(&mut self) {
        self.boot();
        self.deaf_until_s = self.time_s + REBOOT_S;
    }

    /// Factory settings, but for the id and the baud code if they are to stay.
    pub fn factory_reset(&mut self, keep_id: bool, keep_baud: bool) {
        let id = self.table.get(at::ID);
        let baud = self.table.get(at::BAUD);
        self.table.reset_all();
        self.table.put(at::ID, if keep_id { id } else { 1 });
        self.table.put(at::BAUD, if keep_baud { baud } else { 1 });
        self.reboot();
    }

    /// Forgets whole turns; refused while the motor turns.
    pub fn clear_turns(&mut self) -> bool {
        if self.motor.speed_rad_s.abs() > RAD_S_PER_UNIT {
            return false;
        }
        self.motor.angle_rad = self.motor.angle_rad.rem_euclid(TAU);
        true
    }

    /// Sets hardware error bits; those that the shutdown register names cut torque.
    fn raise(&mut self, bits: i64) {
        let old = self.table.get(at::HARDWARE_ERROR);
        self.table.put(at::HARDWARE_ERROR, old | bits);
        if bits & self.table.get(at::SHUTDOWN) != 0 && self.torque_on() {
            self.set_torque(false);
        }
    }

    fn checked(&self, address: u16, bytes: &[u8]) -> Result<Vec<(u16, i64)>, AccessError> {
        let writes = self.table.check_write(address, bytes, self.torque_on())?;
        for (address, value) in &writes {
            self.check_value(*address, *value)?;
        }
        Ok(writes)
    }

    /// Ranges that depend on other registers.
    fn check_value(&self, address: u16, value: i64) -> Result<(), AccessError> {
        let within = |range: std::ops::RangeInclusive<i64>| {
            if range.contains(&value) {
                Ok(())
            } else {
                Err(AccessError::Limit)
            }
        };
        let limit = |register| self.table.get(register);
        if (at::GOAL_PWM..=at::GOAL_POSITION).contains(&address) && self.watchdog_tripped() {
            return Err(AccessError::Range);
        }
        match address {
            at::OPERATING_MODE if ![0, 1, 3, 4, 5, 16].contains(&value) => Err(AccessError::Range),
            at::DRIVE_MODE if value & 4 != 0 => Err(AccessError::Range),
            at::GOAL_POSITION if limit(at::OPERATING_MODE) == 3 => {
                within(limit(at::MIN_POSITION)..=limit(at::MAX_POSITION))
            }
            at::GOAL_VELOCITY => within(-limit(at::VELOCITY_LIMIT)..=limit(at::VELOCITY_LIMIT)),
            at::GOAL_CURRENT => within(-limit(at::CURRENT_LIMIT)..=limit(at::CURRENT_LIMIT)),
            at::GOAL_PWM => within(-limit(at::PWM_LIMIT)..=limit(at::PWM_LIMIT)),
            _ => Ok(()),
        }
    }

    fn apply(&mut self, writes: &[(u16, i64)]) {
        for &(address, value) in writes {
            match address {
                at::TORQUE => self.set_torque(value == 1),
                at::OPERATING_MODE => self.set_mode(value),
                at::BUS_WATCHDOG => {
                    self.table.put(address, value);
                    self.feed_watchdog();
                }
                at::GOAL_POSITION => {
                    self.table.put(address, value);
                    let by_goal = self.table.get(at::DRIVE_MODE) & 8 != 0;
                    if by_goal && !self.torque_on() {
                        self.set_torque(true);
                    }
                    let goal_rad = self.joint_rad(self.angle_of_ticks(value as f64));
                    self.judge.told(self.time_s, goal_rad);
                }
                _ => self.table.put(address, value),
            }
        }
    }

    /// Torque on is ignored after a shutdown: only a reboot restores it.
    fn set_torque(&mut self, on: bool) {
        let shut_down = self.table.get(at::HARDWARE_ERROR) & self.table.get(at::SHUTDOWN) != 0;
        let was_on = self.torque_on();
        let on = on && !shut_down;
        self.table.put(at::TORQUE, i64::from(on));
        if on && !was_on {
            self.integral = 0.0;
            self.trajectory_ticks = self.encoder_ticks();
            self.trajectory_speed = 0.0;
            self.feed_watchdog();
            let state = self.state();
            self.judge.begin(state.goal_rad, state.position_rad);
            // The goal it starts towards must itself be allowed.
            self.judge.told(self.time_s, state.goal_rad);
        } else if !on {
            self.judge.end();
        }
    }

    /// A mode change resets gains, profiles and goals.
    fn set_mode(&mut self, mode: i64) {
        let keep = [
            at::STATUS_RETURN_LEVEL,
            at::BUS_WATCHDOG,
            at::HARDWARE_ERROR,
        ];
        let kept = keep.map(|address| self.table.get(address));
        if self.table.get(at::OPERATING_MODE) != mode {
            self.table.reset_ram();
            for (address, value) in keep.into_iter().zip(kept) {
                self.table.put(address, value);
            }
        }
        self.table.put(at::OPERATING_MODE, mode);
        self.table.put(at::GOAL_POSITION, self.present_ticks());
    }

    fn run_watchdog(&mut self) {
        let units = self.table.get(at::BUS_WATCHDOG);
        let armed = (1..=127).contains(&units) && self.torque_on();
        if armed && self.time_s - self.fed_s > units as f64 * 0.02 {
            self.table.put(at::BUS_WATCHDOG, -1);
            let here = self.encoder_ticks();
            self.table.put(at::GOAL_POSITION, here as i64);
            self.trajectory_ticks = here;
            self.trajectory_speed = 0.0;
            self.judge.end();
        }
    }

    /// Duty from -1 to 1.
    fn control(&mut self, dt_s: f64) -> f64 {
        let sign = self.drive_sign();
        let mode = self.table.get(at::OPERATING_MODE);
        let goal_current_a = self.table.get(at::GOAL_CURRENT) as f64 * self.current_unit_a();
        let stopped = self.watchdog_tripped() && matches!(mode, 0 | 1 | 16);
        let pwm = match mode {
            _ if stopped => 0.0,
            0 => {
                let duty = self.motor.duty_for_current(goal_current_a, self.volts());
                FULL_PWM * duty
            }
            1 => self.velocity_pwm(dt_s),
            16 => self.table.get(at::GOAL_PWM) as f64,
            _ => self.position_pwm(dt_s),
        };
        let most = self.table.get(at::PWM_LIMIT) as f64;
        let asked = match mode {
            1 | 3..=5 => self.table.get(at::GOAL_PWM).abs() as f64,
            _ => most,
        };
        let duty = sign * pwm.clamp(-most.min(asked), most.min(asked)) / FULL_PWM;
        self.limit_current(
            duty,
            if mode == 5 {
                goal_current_a.abs()
            } else {
                f64::INFINITY
            },
        )
    }

    /// Amperes a unit; models without a sensor are taken as 2.69 mA.
    fn current_unit_a(&self) -> f64 {
        match self.model.current_a_per_unit {
            0.0 => 2.69e-3,
            unit => unit,
        }
    }

    fn limit_current(&self, duty: f64, asked_a: f64) -> f64 {
        let limit_a = self.table.get(at::CURRENT_LIMIT) as f64 * self.current_unit_a();
        let most_a = limit_a.min(asked_a);
        let low = self.motor.duty_for_current(-most_a, self.volts());
        let high = self.motor.duty_for_current(most_a, self.volts());
        duty.clamp(low, high).clamp(-1.0, 1.0)
    }

    fn velocity_pwm(&mut self, dt_s: f64) -> f64 {
        let goal = self.table.get(at::GOAL_VELOCITY) as f64;
        let present = self.drive_sign() * self.motor.speed_rad_s / RAD_S_PER_UNIT;
        let error = goal - present;
        self.integral += error * dt_s * 1e3;
        let gain = |address, scale: f64| self.table.get(address) as f64 / scale;
        gain(at::VELOCITY_P, 128.0) * error + gain(at::VELOCITY_I, 65536.0) * self.integral
    }

    fn position_pwm(&mut self, dt_s: f64) -> f64 {
        self.run_profile(dt_s);
        let error = self.trajectory_ticks - self.encoder_ticks();
        self.integral += error * dt_s * 1e3;
        let speed = self.drive_sign() * self.motor.speed_rad_s / RAD_PER_TICK * 1e-3;
        let gain = |address, scale: f64| self.table.get(address) as f64 / scale;
        gain(at::POSITION_P, 128.0) * error - gain(at::POSITION_D, 16.0) * speed
            + gain(at::POSITION_I, 65536.0) * self.integral
    }

    /// Moves the trajectory towards the goal: at once without a profile.
    fn run_profile(&mut self, dt_s: f64) {
        let goal = self.table.get(at::GOAL_POSITION) as f64;
        let velocity = self.table.get(at::PROFILE_VELOCITY) as f64;
        if velocity == 0.0 {
            self.trajectory_ticks = goal;
            self.trajectory_speed = 0.0;
            return;
        }
        let top = velocity * RAD_S_PER_UNIT / RAD_PER_TICK;
        let left = goal - self.trajectory_ticks;
        let units = self.table.get(at::PROFILE_ACCELERATION) as f64;
        let change = units * RAD_S2_PER_UNIT / RAD_PER_TICK * dt_s;
        let wanted = if change > 0.0 {
            left.signum() * top.min((2.0 * change / dt_s * left.abs()).sqrt())
        } else {
            left.signum() * top
        };
        let speed = if change > 0.0 {
            wanted.clamp(
                self.trajectory_speed - change,
                self.trajectory_speed + change,
            )
        } else {
            wanted
        };
        self.trajectory_speed = speed;
        if (speed * dt_s).abs() >= left.abs() {
            self.trajectory_ticks = goal;
            self.trajectory_speed = 0.0;
        } else {
            self.trajectory_ticks += speed * dt_s;
        }
    }

    /// Shutdown conditions.
    fn protect(&mut self, dt_s: f64) {
        let stall_a = self.model.stall_current_a * OVERLOAD_SHARE;
        let stalled = self.motor.current_a.abs() > stall_a && self.motor.speed_rad_s.abs() < 0.1;
        self.overload_s = if stalled { self.overload_s + dt_s } else { 0.0 };
        if self.overload_s > OVERLOAD_S {
            self.raise(OVERLOAD_ERROR);
        }
        if self.motor.temperature_c > self.table.get(at::TEMPERATURE_LIMIT) as f64 {
            self.raise(OVERHEAT_ERROR);
        }
        let tenths = (self.volts() * 10.0).round() as i64;
        let allowed = self.table.get(at::MIN_VOLTAGE)..=self.table.get(at::MAX_VOLTAGE);
        if !allowed.contains(&tenths) {
            self.raise(VOLTAGE_ERROR);
        }
    }

    /// Brings the present-value registers up to date.
    fn refresh(&mut self) {
        let sign = self.drive_sign();
        let moving = self.motor.speed_rad_s.abs() / RAD_S_PER_UNIT
            > self.table.get(at::MOVING_THRESHOLD) as f64;
        let effort = match self.model.current_a_per_unit {
            0.0 => self.duty * 1000.0,
            unit => self.motor.current_a / unit,
        };
        for (address, value) in [
            (at::TICK_MS, (self.time_s * 1e3) as i64 % 32768),
            (at::MOVING, i64::from(moving)),
            (
                at::PRESENT_PWM,
                (sign * self.duty * FULL_PWM).round() as i64,
            ),
            (at::PRESENT_CURRENT, (sign * effort).round() as i64),
            (
                at::PRESENT_VELOCITY,
                (sign * self.motor.speed_rad_s / RAD_S_PER_UNIT).round() as i64,
            ),
            (at::PRESENT_POSITION, self.present_ticks()),
            (
                at::VELOCITY_TRAJECTORY,
                (self.trajectory_speed * RAD_PER_TICK / RAD_S_PER_UNIT).round() as i64,
            ),
            (
                at::POSITION_TRAJECTORY,
                self.trajectory_ticks.round() as i64,
            ),
            (at::PRESENT_VOLTAGE, (self.volts() * 10.0).round() as i64),
            (
                at::PRESENT_TEMPERATURE,
                self.motor.temperature_c.round() as i64,
            ),
        ] {
            self.table.put(address, value);
        }
    }
}

impl Device for SimServo {
    fn set_sag_v(&mut self, sag_v: f64) {
        self.sag_v = sag_v;
    }

    fn id(&self) -> u8 {
        self.table.get(at::ID) as u8
    }

    fn listens(&self) -> bool {
        !self.dead && self.time_s >= self.deaf_until_s
    }

    fn judge(&self) -> &Judge {
        &self.judge
    }

    fn state(&self) -> SimServoState {
        let goal = self.table.get(at::GOAL_POSITION);
        SimServoState {
            time_s: self.time_s,
            position_rad: self.joint_rad(self.motor.angle_rad),
            velocity_rad_s: self.spec.direction * self.motor.speed_rad_s,
            goal_rad: self.joint_rad(self.angle_of_ticks(goal as f64)),
            current_a: self.spec.direction * self.motor.current_a,
            temperature_c: self.motor.temperature_c,
            torque_enabled: self.torque_on(),
            watchdog_tripped: self.watchdog_tripped(),
            hardware_error: self.table.get(at::HARDWARE_ERROR) as u8,
        }
    }

    fn step(&mut self, time_s: f64, dt_s: f64) {
        self.time_s = time_s;
        self.run_watchdog();
        let duty = self.torque_on().then(|| self.control(dt_s));
        self.duty = duty.unwrap_or(0.0);
        let joint_rad = self.joint_rad(self.motor.angle_rad);
        let gravity_nm = -self.spec.direction * self.spec.gravity_nm * joint_rad.sin();
        self.motor.step(dt_s, duty, self.volts(), gravity_nm);
        self.protect(dt_s);
    }

    fn end_period(&mut self) {
        let state = self.state();
        self.judge.went(self.time_s, state.position_rad);
    }

    fn suffer(&mut self, fault: ServoFault) {
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
            ServoFault::Overload => self.raise(OVERLOAD_ERROR),
            ServoFault::Supply(volts) => self.supply_v = volts,
            ServoFault::Moved(joint_rad) => {
                self.motor.angle_rad = self.spec.zero_rad + self.spec.direction * joint_rad;
            }
            ServoFault::Id(id) => self.table.put(at::ID, i64::from(id)),
        }
    }
}
