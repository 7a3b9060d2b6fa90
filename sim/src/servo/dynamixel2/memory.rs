//! The servo's memory as the host sees it: what may be read and written when, and
//! what a write sets off.

use servodance_drivers::serial::Register;
use servodance_drivers::serial::dynamixel2::registers as at;

use crate::servo::dynamixel2::table::AccessError;
use crate::servo::dynamixel2::{RAD_PER_TICK, RAD_S_PER_UNIT, XServo};
use crate::servo::motor::FULL_PWM;

/// Nearer than this to its goal a servo has arrived, ticks.
const ARRIVED_TICKS: f64 = 12.0;
/// Goals of the extended modes, ticks: 256 turns either way.
const EXTENDED_TICKS: i64 = 1_048_575;

impl XServo {
    /// A read of the control table: error number and data.
    pub(crate) fn read(&mut self, address: u16, size: u16) -> Result<Vec<u8>, AccessError> {
        self.refresh();
        self.table.read(address, size)
    }

    pub(crate) fn write(&mut self, address: u16, bytes: &[u8]) -> Result<(), AccessError> {
        let writes = self.checked(address, bytes)?;
        self.apply(&writes);
        Ok(())
    }

    pub(crate) fn register(&mut self, address: u16, bytes: &[u8]) -> Result<(), AccessError> {
        self.registered = Some(self.checked(address, bytes)?);
        self.table.put(at::REGISTERED, 1);
        Ok(())
    }

    /// Carries out the registered write; false if there is none.
    pub(crate) fn act(&mut self) -> bool {
        let Some(writes) = self.registered.take() else {
            return false;
        };
        self.table.put(at::REGISTERED, 0);
        self.apply(&writes);
        true
    }

    fn checked(&self, address: u16, bytes: &[u8]) -> Result<Vec<(Register, i64)>, AccessError> {
        let writes = self.table.check_write(address, bytes, self.torque_on())?;
        for (register, value) in &writes {
            self.check_value(*register, *value)?;
        }
        Ok(writes)
    }

    fn check_value(&self, register: Register, value: i64) -> Result<(), AccessError> {
        let within = |range: std::ops::RangeInclusive<i64>| {
            let allowed = range.contains(&value).then_some(());
            allowed.ok_or(AccessError::Limit)
        };
        let limit = |register| self.table.get(register);
        let goals = at::GOAL_PWM.address..=at::GOAL_POSITION.address;
        if goals.contains(&register.address) && self.watchdog_tripped() {
            return Err(AccessError::Range);
        }
        match register {
            at::OPERATING_MODE if ![0, 1, 3, 4, 5, 16].contains(&value) => Err(AccessError::Range),
            // Not simulated: a profile by time. Unknown: bit 1.
            at::DRIVE_MODE if value & 6 != 0 => Err(AccessError::Range),
            at::PROTOCOL_TYPE if ![1, 2, 20, 21, 22].contains(&value) => Err(AccessError::Range),
            at::GOAL_POSITION if limit(at::OPERATING_MODE) == 3 => {
                within(limit(at::MIN_POSITION)..=limit(at::MAX_POSITION))
            }
            at::GOAL_POSITION if matches!(limit(at::OPERATING_MODE), 4 | 5) => {
                within(-EXTENDED_TICKS..=EXTENDED_TICKS)
            }
            at::GOAL_VELOCITY => within(-limit(at::VELOCITY_LIMIT)..=limit(at::VELOCITY_LIMIT)),
            at::GOAL_CURRENT => within(-limit(at::CURRENT_LIMIT)..=limit(at::CURRENT_LIMIT)),
            at::GOAL_PWM => within(-limit(at::PWM_LIMIT)..=limit(at::PWM_LIMIT)),
            _ => Ok(()),
        }
    }

    fn apply(&mut self, writes: &[(Register, i64)]) {
        for &(register, value) in writes {
            match register {
                at::TORQUE => self.set_torque(value == 1),
                at::OPERATING_MODE => self.set_mode(value),
                at::BUS_WATCHDOG => {
                    self.unjudged |= self.watchdog_tripped() && self.torque_on();
                    self.table.put(register, value);
                    self.feed_watchdog();
                }
                at::GOAL_POSITION => {
                    self.table.put(register, value);
                    let by_goal = self.table.get(at::DRIVE_MODE) & 8 != 0;
                    if by_goal && !self.torque_on() {
                        self.set_torque(true);
                    }
                    let goal_rad = self.goal_rad();
                    if std::mem::take(&mut self.unjudged) && self.torque_on() {
                        // It takes goals again, beginning with this one.
                        self.body.judge.begin(goal_rad, self.body.position_rad());
                    }
                    self.body.judge.judge_goal(self.body.time_s, goal_rad);
                }
                _ => self.table.put(register, value),
            }
        }
    }

    /// Arrived (bit 0), profile under way (bit 1), its kind (bits 4 and 5: 0 a step, 1
    /// rectangular, 3 trapezoidal).
    fn moving_status(&self) -> i64 {
        if !matches!(self.table.get(at::OPERATING_MODE), 3..=5) {
            return 0;
        }
        let goal = self.table.get(at::GOAL_POSITION) as f64;
        let arrived = (goal - self.encoder_ticks()).abs() <= ARRIVED_TICKS;
        let under_way = self.torque_on() && self.trajectory_ticks != goal;
        let kind = match [at::PROFILE_VELOCITY, at::PROFILE_ACCELERATION].map(|r| self.table.get(r))
        {
            [0, _] => 0,
            [_, 0] => 1,
            _ => 3,
        };
        i64::from(arrived) | i64::from(under_way) << 1 | kind << 4
    }

    fn refresh(&mut self) {
        let sign = self.drive_sign();
        let speed = self.body.motor.speed_rad_s;
        let moving = speed.abs() / RAD_S_PER_UNIT > self.table.get(at::MOVING_THRESHOLD) as f64;
        let effort = match self.model.current_a_per_unit {
            None => self.duty * 1000.0,
            Some(unit) => self.body.motor.current_a / unit,
        };
        for (register, value) in [
            (at::TICK_MS, ((self.body.time_s * 1e3) as i64 + self.switched_on_ms) % 32768),
            (at::MOVING, i64::from(moving)),
            (at::MOVING_STATUS, self.moving_status()),
            (at::PRESENT_POSITION, self.present_ticks()),
        ] {
            self.table.put(register, value);
        }
        let trajectory_speed = self.trajectory_speed * RAD_PER_TICK / RAD_S_PER_UNIT;
        for (register, value) in [
            (at::PRESENT_PWM, sign * self.duty * FULL_PWM),
            (at::PRESENT_CURRENT, sign * effort),
            (at::PRESENT_VELOCITY, sign * speed / RAD_S_PER_UNIT),
            (at::VELOCITY_TRAJECTORY, trajectory_speed),
            (at::POSITION_TRAJECTORY, self.trajectory_ticks),
            (at::PRESENT_VOLTAGE, self.body.volts() * 10.0),
            (at::PRESENT_TEMPERATURE, self.body.motor.temperature_c),
        ] {
            self.table.put(register, value.round() as i64);
        }
    }
}
