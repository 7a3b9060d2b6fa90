//! The loops of a servo of byte memory: from its registers to the duty of the motor.
//!
//! Where a family has modes they are those of Feetech STS servos:
//!
//! | mode | what is followed |
//! |---|---|
//! | 0, and any other | the goal position: at once, or at most at the goal speed |
//! | 1, "wheel" | the goal speed, signed; the shaft turns without an end |
//! | 2, open loop | the goal time register as a duty, in thousandths, bit 10 its sign |
//!
//! The acceleration is that of speeds, in hundreds of ticks a second each second; 0 is at once.

use servodance_drivers::serial::sign_magnitude;

use crate::servo::byte_servo::ByteServo;
use crate::servo::motor::FULL_PWM_ERROR_RAD;

pub(super) const WHEEL: u16 = 1;
const OPEN_LOOP: u16 = 2;
const DUTY_SIGN_BIT: u32 = 10;
/// Duty for an error of a tick a second, and for that error lasting a second.
const SPEED_P: f64 = 1.0 / 2000.0;
const SPEED_I: f64 = 1.0 / 200.0;

impl ByteServo {
    /// Duty from -1 to 1.
    pub(super) fn control(&mut self, dt_s: f64) -> f64 {
        let most = (f64::from(self.torque_limit()) * 1e-3).min(1.0);
        let duty = match self.mode() {
            WHEEL => self.turn(dt_s),
            OPEN_LOOP => {
                let duty = self.get_or(self.layout.goal_time, 0);
                f64::from(sign_magnitude(duty, DUTY_SIGN_BIT)) * 1e-3
            }
            _ => self.go(dt_s),
        };
        duty.clamp(-most, most)
    }

    pub(super) fn mode(&self) -> u16 {
        self.get_or(self.layout.mode, 0)
    }

    /// Whether the shaft turns without an end, so that positions begin anew each turn.
    pub(super) fn is_endless(&self) -> bool {
        matches!(self.mode(), WHEEL | OPEN_LOOP)
    }

    /// The goal speed, ticks a second.
    fn goal_speed(&self) -> f64 {
        let units = sign_magnitude(self.get_or(self.layout.goal_speed, 0), self.layout.sign_bit);
        f64::from(units) * self.speed_ticks_s()
    }

    /// By how much a speed may change in `dt_s`, ticks a second.
    fn speed_step(&self, dt_s: f64) -> f64 {
        match self.get_or(self.layout.acceleration, 0) {
            0 => f64::INFINITY,
            units => f64::from(units) * 100.0 * dt_s,
        }
    }

    /// To the goal: proportional; goal speed and acceleration shape the way there.
    fn go(&mut self, dt_s: f64) -> f64 {
        let (goal, fastest) = (self.goal_ticks(), self.goal_speed().abs());
        let left = goal - self.trajectory_ticks;
        if fastest == 0.0 {
            (self.trajectory_ticks, self.trajectory_speed) = (goal, 0.0);
        } else {
            let step = self.speed_step(dt_s);
            // As fast as still lets it stop at the goal.
            let braking = (2.0 * step / dt_s * left.abs()).sqrt();
            let wanted = left.signum() * fastest.min(braking);
            self.trajectory_speed += (wanted - self.trajectory_speed).clamp(-step, step);
            let moved = self.trajectory_speed * dt_s;
            match moved.abs() >= left.abs() {
                true => (self.trajectory_ticks, self.trajectory_speed) = (goal, 0.0),
                false => self.trajectory_ticks += moved,
            }
        }
        let error_rad = (self.trajectory_ticks - self.encoder_ticks()) * self.model.rad_per_tick;
        let gain = f64::from(self.get_or(self.layout.p_gain, 32)) / 32.0;
        gain * error_rad / FULL_PWM_ERROR_RAD
    }

    /// At the goal speed.
    fn turn(&mut self, dt_s: f64) -> f64 {
        let step = self.speed_step(dt_s);
        let left = self.goal_speed() - self.trajectory_speed;
        self.trajectory_speed += left.clamp(-step, step);
        let speed = self.body.motor.speed_rad_s / self.model.rad_per_tick;
        let error = self.trajectory_speed - speed;
        self.speed_integral = (self.speed_integral + SPEED_I * error * dt_s).clamp(-1.0, 1.0);
        SPEED_P * error + self.speed_integral
    }
}
