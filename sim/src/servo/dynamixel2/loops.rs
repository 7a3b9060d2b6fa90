//! The loops of the servo's firmware: from its registers to the duty of the motor.

use servodance_drivers::serial::dynamixel2::registers as at;

use crate::servo::dynamixel2::{RAD_PER_TICK, RAD_S_PER_UNIT, RAD_S2_PER_UNIT, XServo};
use crate::servo::motor::FULL_PWM;

impl XServo {
    /// Duty from -1 to 1.
    pub(super) fn control(&mut self, dt_s: f64) -> f64 {
        let sign = self.drive_sign();
        let mode = self.table.get(at::OPERATING_MODE);
        let goal_current_a = self.table.get(at::GOAL_CURRENT) as f64 * self.current_unit_a();
        let stopped = self.watchdog_tripped() && matches!(mode, 0 | 1 | 16);
        let pwm = match mode {
            _ if stopped => 0.0,
            0 => {
                let volts = self.body.volts();
                FULL_PWM * self.body.motor.duty_for_current(goal_current_a, volts)
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
        let most_a = if mode == 5 { goal_current_a.abs() } else { f64::INFINITY };
        self.limit_current(duty, most_a)
    }

    /// Amperes a unit; models without a sensor are taken as 2.69 mA.
    fn current_unit_a(&self) -> f64 {
        self.model.current_a_per_unit.unwrap_or(2.69e-3)
    }

    fn limit_current(&self, duty: f64, asked_a: f64) -> f64 {
        let limit_a = self.table.get(at::CURRENT_LIMIT) as f64 * self.current_unit_a();
        let most_a = limit_a.min(asked_a);
        let low = self.body.motor.duty_for_current(-most_a, self.body.volts());
        let high = self.body.motor.duty_for_current(most_a, self.body.volts());
        duty.clamp(low, high).clamp(-1.0, 1.0)
    }

    fn velocity_pwm(&mut self, dt_s: f64) -> f64 {
        let goal = self.table.get(at::GOAL_VELOCITY) as f64;
        let present = self.drive_sign() * self.body.motor.speed_rad_s / RAD_S_PER_UNIT;
        let error = goal - present;
        self.integral += error * dt_s * 1e3;
        let gain = |register, scale: f64| self.table.get(register) as f64 / scale;
        gain(at::VELOCITY_P, 128.0) * error + gain(at::VELOCITY_I, 65536.0) * self.integral
    }

    fn position_pwm(&mut self, dt_s: f64) -> f64 {
        self.run_profile(dt_s);
        let error = self.trajectory_ticks - self.encoder_ticks();
        self.integral += error * dt_s * 1e3;
        let speed = self.drive_sign() * self.body.motor.speed_rad_s / RAD_PER_TICK * 1e-3;
        let gain = |register, scale: f64| self.table.get(register) as f64 / scale;
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
        let speed = if change > 0.0 {
            let wanted = left.signum() * top.min((2.0 * change / dt_s * left.abs()).sqrt());
            let now = self.trajectory_speed;
            wanted.clamp(now - change, now + change)
        } else {
            left.signum() * top
        };
        self.trajectory_speed = speed;
        if (speed * dt_s).abs() >= left.abs() {
            self.trajectory_ticks = goal;
            self.trajectory_speed = 0.0;
        } else {
            self.trajectory_ticks += speed * dt_s;
        }
    }
}
