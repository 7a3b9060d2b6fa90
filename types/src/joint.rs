//! Limits and measured state of one robot joint.

/// The limits of one robot joint. Every field is finite, `lower <= upper`,
/// and the rates are positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimits {
    /// Lowest allowed position, radians.
    pub lower_rad: f64,
    /// Highest allowed position, radians.
    pub upper_rad: f64,
    /// Highest allowed speed, radians a second.
    pub velocity_rad_s: f64,
    /// Highest allowed acceleration, radians a second squared.
    pub acceleration_rad_s2: f64,
}

/// A slower joint, degrees a second, cannot show a dance, nor come to rest in a time that
/// somebody waits for.
const LEAST_DEG_S: f64 = 0.05;

impl JointLimits {
    /// Returns the limits if they are usable, otherwise the reason in one line.
    pub fn checked(self) -> Result<Self, String> {
        let rates = [self.velocity_rad_s, self.acceleration_rad_s2];
        let positions = [self.lower_rad, self.upper_rad];
        if !positions.iter().chain(&rates).all(|v| v.is_finite()) {
            return Err("a limit is not a finite number".into());
        }
        if self.lower_rad >= self.upper_rad {
            return Err(format!(
                "lower limit {:.4} rad is not below upper limit {:.4} rad",
                self.lower_rad, self.upper_rad
            ));
        }
        let [velocity, acceleration] = rates.map(f64::to_degrees);
        if velocity.min(acceleration) < LEAST_DEG_S {
            return Err(format!(
                "velocity limit {velocity:?} degrees/s and acceleration limit {acceleration:?} \
                 degrees/s2 must be at least {LEAST_DEG_S}"
            ));
        }
        Ok(self)
    }

    /// The allowed position that is nearest to `position_rad`, radians.
    pub fn clamp_rad(&self, position_rad: f64) -> f64 {
        position_rad.clamp(self.lower_rad, self.upper_rad)
    }
}

/// The state that a servo reports in one control cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointState {
    /// Position in the robot's joint convention, radians.
    pub position_rad: f64,
    /// Measured velocity, radians a second.
    pub velocity_rad_s: f64,
    /// Motor current, amperes; positive pushes towards higher positions.
    pub current_a: f64,
}

/// What an inertial measurement unit reads, in the axes of the robot's root link.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImuState {
    /// Rate of turn, radians a second.
    pub rate_rad_s: [f64; 3],
    /// Acceleration less gravity, m/s2: +9.81 along the vertical at rest.
    pub force_m_s2: [f64; 3],
    /// Unit vector that points up.
    pub up: [f64; 3],
}
