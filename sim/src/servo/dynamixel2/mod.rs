//! One simulated servo: control table, firmware loops and motor together.
//!
//! Modes 0 (current), 1 (velocity), 3 (position), 4 (extended position),
//! 5 (current-based position) and 16 (PWM); trapezoidal profiles in the
//! position modes; bus watchdog; shutdown by overload, heat and voltage, which
//! only a reboot clears. Not simulated: time-based profiles (refused), feed-forward
//! gains (stored, without effect).

mod factory;
mod loops;
mod memory;
pub(crate) mod table;

use std::f64::consts::TAU;

use servodance_drivers::ServoModel;
use servodance_drivers::serial::Register;
use servodance_drivers::serial::dynamixel2::BAUDS;
use servodance_drivers::serial::dynamixel2::registers as at;

use crate::fault::ServoFault;
use crate::serial::serial_line::LineServo;
use crate::servo::body::{ServoBody, SimServoState};
use crate::servo::spec::SimServoSpec;
use table::{ControlTable, RAM};

const RAD_PER_TICK: f64 = TAU / 4096.0;
const RAD_S_PER_UNIT: f64 = 0.229 * TAU / 60.0;
const RAD_S2_PER_UNIT: f64 = 214.577 * TAU / 3600.0;
const REBOOT_S: f64 = 0.3;
const OVERLOAD_S: f64 = 2.0;
/// ... and stall is this share of the stall torque.
const OVERLOAD_SHARE: f64 = 0.8;
const VOLTAGE_ERROR: i64 = 1;
const OVERHEAT_ERROR: i64 = 1 << 2;
const OVERLOAD_ERROR: i64 = 1 << 5;

/// A Dynamixel servo with Protocol 2.0: the X series, and MX with that firmware.
#[derive(Clone, Debug)]
pub struct XServo {
    model: &'static ServoModel,
    table: ControlTable,
    body: ServoBody,
    backup: Option<ControlTable>,
    registered: Option<Vec<(Register, i64)>>,
    /// Where the profile is, ticks, and its speed, ticks a second.
    trajectory_ticks: f64,
    trajectory_speed: f64,
    integral: f64,
    duty: f64,
    fed_s: f64,
    tripped_s: Option<f64>,
    /// A tripped watchdog was cleared; the next goal is where it is judged from.
    unjudged: bool,
    /// No two servos are switched on in the same millisecond: what its clock began with.
    switched_on_ms: i64,
}

impl XServo {
    /// A servo fresh from the factory but for its id and baud code.
    pub fn new(
        spec: &SimServoSpec,
        model: &'static ServoModel,
        baud_code: u8,
        supply_v: f64,
        period_s: f64,
    ) -> Self {
        let motor = spec.servo_motor(model);
        let mut servo = Self {
            table: ControlTable::new(model, spec.id, baud_code, spec.firmware),
            body: ServoBody::new(spec, motor, period_s, supply_v),
            model,
            backup: None,
            registered: None,
            trajectory_ticks: 0.0,
            trajectory_speed: 0.0,
            integral: 0.0,
            duty: 0.0,
            fed_s: 0.0,
            tripped_s: None,
            unjudged: false,
            switched_on_ms: spec.name.bytes().map(|byte| i64::from(byte) * 7).sum::<i64>() % 500,
        };
        servo.boot();
        servo
    }

    fn boot(&mut self) {
        self.table.reset(RAM);
        self.registered = None;
        self.body.stalled_s = 0.0;
        self.integral = 0.0;
        self.body.judge.end();
        let here = self.present_ticks();
        self.table.put(at::GOAL_POSITION, here);
        self.trajectory_ticks = here as f64;
        self.trajectory_speed = 0.0;
        if self.table.get(at::STARTUP) & 1 != 0 {
            self.set_torque(true);
        }
    }

    pub(crate) fn return_delay_s(&self) -> f64 {
        self.table.get(at::RETURN_DELAY) as f64 * 2e-6
    }

    /// 0: answers pings only; 1: and reads; 2: everything.
    pub(crate) fn return_level(&self) -> i64 {
        self.table.get(at::STATUS_RETURN_LEVEL)
    }

    pub(crate) fn knows_fast_reads(&self) -> bool {
        self.table.get(at::FIRMWARE) as u8 >= self.model.fast_read_firmware
    }

    /// 0x80 when the hardware error register is set.
    pub(crate) fn alert_bit(&self) -> u8 {
        u8::from(self.table.get(at::HARDWARE_ERROR) != 0) << 7
    }

    pub(crate) fn ping(&self) -> [u8; 3] {
        let [low, high] = (self.table.get(at::MODEL) as u16).to_le_bytes();
        [low, high, self.table.get(at::FIRMWARE) as u8]
    }

    /// Keeps the settings that survive a power cycle; refused with torque on.
    pub(crate) fn back_up(&mut self) -> bool {
        let allowed = !self.torque_on();
        if allowed {
            self.table.put(at::BACKUP_READY, 1);
            self.backup = Some(self.table.clone());
        }
        allowed
    }

    /// Whether there is a backup that may be restored now.
    pub(crate) fn has_backup(&self) -> bool {
        self.backup.is_some() && !self.torque_on()
    }

    /// Settings as they were backed up, then a restart; the id stays.
    pub(crate) fn restore_backup(&mut self) {
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

    fn goal_rad(&self) -> f64 {
        let goal = self.table.get(at::GOAL_POSITION) as f64;
        self.body.joint_rad(self.angle_of_ticks(goal))
    }

    /// +1, or -1 in reverse drive mode.
    fn drive_sign(&self) -> f64 {
        1.0 - 2.0 * (self.table.get(at::DRIVE_MODE) & 1) as f64
    }

    /// Ticks that are added to the angle; in position mode more than a quarter of a turn is
    /// ignored.
    fn offset_ticks(&self) -> f64 {
        let offset = self.table.get(at::HOMING_OFFSET);
        let ignored = self.table.get(at::OPERATING_MODE) == 3 && offset.abs() > 1024;
        if ignored { 0.0 } else { offset as f64 }
    }

    fn angle_of_ticks(&self, ticks: f64) -> f64 {
        (ticks - self.offset_ticks()) * self.drive_sign() * RAD_PER_TICK
    }

    fn encoder_ticks(&self) -> f64 {
        let raw = (self.body.motor.angle_rad / RAD_PER_TICK).round();
        raw * self.drive_sign() + self.offset_ticks()
    }

    /// Present position as the register shows it: within a turn in mode 3.
    fn present_ticks(&self) -> i64 {
        let ticks = self.encoder_ticks() as i64;
        match self.table.get(at::OPERATING_MODE) {
            3 => ticks.rem_euclid(4096),
            _ => ticks,
        }
    }

    pub(crate) fn feed_watchdog(&mut self) {
        self.fed_s = self.body.time_s;
    }

    /// Restarts: RAM lost, torque off, errors cleared; deaf for a while.
    pub(crate) fn reboot(&mut self) {
        self.boot();
        self.body.be_deaf_for(REBOOT_S);
    }

    /// Factory settings, but for the id and the baud code if they are to stay.
    pub(crate) fn factory_reset(&mut self, keep_id: bool, keep_baud: bool) {
        let id = self.table.get(at::ID);
        let baud = self.table.get(at::BAUD);
        self.table.reset(0);
        self.table.put(at::ID, if keep_id { id } else { 1 });
        self.table.put(at::BAUD, if keep_baud { baud } else { 1 });
        self.reboot();
    }

    pub(crate) fn clear_turns(&mut self) -> bool {
        if self.body.motor.speed_rad_s.abs() > RAD_S_PER_UNIT {
            return false;
        }
        self.body.clear_turns();
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
            self.body.judge.begin(state.goal_rad, state.position_rad);
            // The goal it starts towards must itself be allowed.
            self.body.judge.judge_goal(self.body.time_s, state.goal_rad);
        } else if !on {
            self.body.judge.end();
        }
    }

    fn set_mode(&mut self, mode: i64) {
        let keep = [at::STATUS_RETURN_LEVEL, at::BUS_WATCHDOG, at::HARDWARE_ERROR];
        let kept = keep.map(|register| self.table.get(register));
        if self.table.get(at::OPERATING_MODE) != mode {
            self.table.reset(RAM);
            for (register, value) in keep.into_iter().zip(kept) {
                self.table.put(register, value);
            }
        }
        self.table.put(at::OPERATING_MODE, mode);
        if mode == 3 {
            // Within one turn from here on.
            self.body.clear_turns();
        }
        self.table.put(at::GOAL_POSITION, self.present_ticks());
    }

    fn run_watchdog(&mut self) {
        let units = self.table.get(at::BUS_WATCHDOG);
        let armed = (1..=127).contains(&units) && self.torque_on();
        if armed && self.body.time_s - self.fed_s > units as f64 * 0.02 {
            self.trip_watchdog();
        }
    }

    fn trip_watchdog(&mut self) {
        self.table.put(at::BUS_WATCHDOG, -1);
        self.tripped_s = Some(self.body.time_s);
        let here = self.encoder_ticks();
        self.table.put(at::GOAL_POSITION, here as i64);
        self.trajectory_ticks = here;
        self.trajectory_speed = 0.0;
        self.body.judge.end();
    }

    fn protect(&mut self, dt_s: f64) {
        let stall_a = self.model.sheet.stall_current_a * OVERLOAD_SHARE;
        let pushes_hard = self.body.motor.current_a.abs() > stall_a;
        if self.body.stalled_for(dt_s, pushes_hard) > OVERLOAD_S {
            self.raise(OVERLOAD_ERROR);
        }
        if self.body.motor.temperature_c > self.table.get(at::TEMPERATURE_LIMIT) as f64 {
            self.raise(OVERHEAT_ERROR);
        }
        let tenths = (self.body.volts() * 10.0).round() as i64;
        let allowed = self.table.get(at::MIN_VOLTAGE)..=self.table.get(at::MAX_VOLTAGE);
        if !allowed.contains(&tenths) {
            self.raise(VOLTAGE_ERROR);
        }
    }
}

impl LineServo for XServo {
    fn body(&self) -> &ServoBody {
        &self.body
    }

    fn body_mut(&mut self) -> &mut ServoBody {
        &mut self.body
    }

    fn id(&self) -> u8 {
        self.table.get(at::ID) as u8
    }

    fn baud(&self) -> u32 {
        let code = self.table.get(at::BAUD) as usize;
        BAUDS.get(code).copied().unwrap_or(0)
    }

    fn state(&self) -> SimServoState {
        SimServoState {
            goal_rad: self.goal_rad(),
            torque_enabled: self.torque_on(),
            watchdog_tripped: self.watchdog_tripped(),
            tripped_s: self.tripped_s,
            hardware_error: self.table.get(at::HARDWARE_ERROR) as u8,
            ..self.body.state()
        }
    }

    fn step(&mut self, dt_s: f64) {
        self.run_watchdog();
        let duty = self.torque_on().then(|| self.control(dt_s));
        self.duty = duty.unwrap_or(0.0);
        self.body.step(dt_s, duty);
        self.protect(dt_s);
    }

    fn suffer(&mut self, fault: ServoFault) {
        match self.body.suffer(fault) {
            Some(ServoFault::Reboot) => self.reboot(),
            Some(ServoFault::Overload) => self.raise(OVERLOAD_ERROR),
            Some(ServoFault::Trip) => self.trip_watchdog(),
            Some(ServoFault::Unplug) => self.set_torque(false),
            Some(ServoFault::Plug) => self.reboot(),
            Some(ServoFault::New) => self.factory_reset(false, false),
            Some(ServoFault::Id(id)) => self.table.put(at::ID, i64::from(id)),
            Some(ServoFault::Baud(baud)) => {
                let code = BAUDS.iter().position(|known| *known == baud);
                self.table.put(at::BAUD, code.unwrap_or(255) as i64);
            }
            _ => {}
        }
    }
}
