//! Play between a servo's gear and its shaft: inside it the gear turns alone and
//! the shaft is free; where it ends both move as one.

/// Gear and shaft of one joint, in joint radians.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct GearPlay {
    /// Half of the play, radians; 0 has none.
    half_rad: f64,
    /// How far the gear is ahead of the shaft.
    ahead_rad: f64,
    gear_rad_s: f64,
    free: bool,
}

impl GearPlay {
    pub fn new(play_rad: f64) -> Self {
        Self { half_rad: play_rad / 2.0, ..Self::default() }
    }

    /// Whether the gear turns the shaft in this step.
    pub fn is_engaged(&self) -> bool {
        !self.free
    }

    /// The shaft has moved with the gear by `acceleration`: the gear lets go
    /// where it would have had to pull.
    pub fn moved_together(&mut self, drive_nm: f64, armature: f64, rate: f64, acceleration: f64) {
        self.gear_rad_s = rate;
        if self.half_rad > 0.0 {
            let passed_on = drive_nm - armature * acceleration;
            let side = if self.ahead_rad < 0.0 { -1.0 } else { 1.0 };
            self.free = passed_on * side < 0.0 || self.ahead_rad.abs() < self.half_rad;
        }
    }

    /// The gear turns by itself for a step; the speed that it brings into the
    /// shaft if it has arrived at an end.
    pub fn moved_alone(
        &mut self,
        drive_nm: f64,
        damping: f64,
        armature: f64,
        rate: f64,
        dt_s: f64,
    ) {
        let speed = self.gear_rad_s;
        self.gear_rad_s += dt_s * (drive_nm - damping * speed) / (armature + dt_s * damping);
        let ahead_rad = self.ahead_rad + dt_s * (self.gear_rad_s - rate);
        self.ahead_rad = ahead_rad.clamp(-self.half_rad, self.half_rad);
        self.free = self.ahead_rad.abs() < self.half_rad;
    }

    /// How much faster the gear is than a shaft that it has just met, radians a second.
    pub fn arriving_rad_s(&self, rate: f64) -> f64 {
        self.gear_rad_s - rate
    }
}
