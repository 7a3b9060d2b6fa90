//! What an inertial measurement unit fixed to the root link reads: rate, specific
//! force and attitude, with noise, bias and delay.

use std::collections::VecDeque;

use servodance_types::ImuState;

use super::spatial::{Mat3, Vec3};

/// How good a sensor is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuErrors {
    /// Standard deviation of one rate reading, radians a second.
    pub rate_noise_rad_s: f64,
    /// Of one acceleration reading, m/s2.
    pub force_noise_m_s2: f64,
    /// Of the attitude's roll and pitch, radians.
    pub attitude_noise_rad: f64,
    /// Constant error of the rate, radians a second.
    pub rate_bias_rad_s: f64,
    /// Age of what is read, seconds.
    pub delay_s: f64,
    /// Seed of the noise.
    pub seed: u64,
}

impl Default for ImuErrors {
    /// A sensor without errors.
    fn default() -> Self {
        Self {
            rate_noise_rad_s: 0.0,
            force_noise_m_s2: 0.0,
            attitude_noise_rad: 0.0,
            rate_bias_rad_s: 0.0,
            delay_s: 0.0,
            seed: 0,
        }
    }
}

#[derive(Clone, Debug)]
pub(super) struct Imu {
    errors: ImuErrors,
    random: u64,
    past: VecDeque<ImuState>,
    kept: usize,
}

impl Imu {
    pub fn new(errors: ImuErrors, dt_s: f64) -> Self {
        let kept = (errors.delay_s / dt_s).round().max(0.0) as usize + 1;
        let random = errors.seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        Self { errors, random, past: VecDeque::with_capacity(kept + 1), kept }
    }

    /// The oldest reading that the delay allows.
    pub fn reading(&self) -> Option<ImuState> {
        self.past.front().copied()
    }

    pub fn observe(&mut self, root: &Mat3, rate: &Vec3, acceleration: &Vec3) {
        let errors = self.errors;
        let into = root.transpose();
        let rate = into * rate + Vec3::repeat(errors.rate_bias_rad_s);
        let force = into * (acceleration + Vec3::z() * super::GRAVITY_M_S2);
        let up = into * Vec3::z();
        let rate = rate + self.noise(errors.rate_noise_rad_s);
        let force = force + self.noise(errors.force_noise_m_s2);
        let up = (up + up.cross(&self.noise(errors.attitude_noise_rad))).normalize();
        let [rate_rad_s, force_m_s2, up] = [rate, force, up].map(Into::into);
        self.past.push_back(ImuState { rate_rad_s, force_m_s2, up });
        if self.past.len() > self.kept {
            self.past.pop_front();
        }
    }

    fn noise(&mut self, deviation: f64) -> Vec3 {
        match deviation > 0.0 {
            true => Vec3::from_fn(|_, _| self.normal()) * deviation,
            false => Vec3::zeros(),
        }
    }

    /// Near enough to a normal deviate: twelve uniform ones less six.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }

    /// Xorshift (Marsaglia 2003).
    fn uniform(&mut self) -> f64 {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        (self.random >> 11) as f64 / (1_u64 << 53) as f64
    }
}
