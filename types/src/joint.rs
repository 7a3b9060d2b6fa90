//! One robot joint: what it may do and what it does.

/// The limits of one robot joint. Every field is finite, `lower <= upper`,
/// and the rates are positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimits {
    /// Lowest position, radians.
    pub lower_rad: f64,
    /// Highest position, radians.
    pub upper_rad: f64,
    /// Highest speed, radians a second.
    pub velocity_rad_s: f64,
    /// Highest acceleration, radians a second squared.
    pub acceleration_rad_s2: f64,
}

impl JointLimits {
    /// The same limits, if they are usable; else what is wrong with them.
    pub fn checked(self) -> Result<Self, String> {
        let finite = [
            self.lower_rad,
            self.upper_rad,
            self.velocity_rad_s,
            self.acceleration_rad_s2,
        ]
        .iter()
        .all(|v| v.is_finite());
        if !finite {
            return Err("a limit is not a finite number".into());
        }
        if self.lower_rad >= self.upper_rad {
            return Err(format!(
                "lower limit {:.4} rad is not below upper limit {:.4} rad",
                self.lower_rad, self.upper_rad
            ));
        }
        if self.velocity_rad_s <= 0.0 || self.acceleration_rad_s2 <= 0.0 {
            return Err("velocity and acceleration limits must be above zero".into());
        }
        Ok(self)
    }

    /// `position_rad` moved to the nearest allowed position.
    pub fn clamp_rad(&self, position_rad: f64) -> f64 {
        position_rad.clamp(self.lower_rad, self.upper_rad)
    }
}

/// What a servo said of itself in one cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointState {
    /// Position, radians, in the robot's joint convention.
    pub position_rad: f64,
    /// Velocity, radians a second.
    pub velocity_rad_s: f64,
    /// Motor current, amperes; positive pushes towards higher positions.
    pub current_a: f64,
}
