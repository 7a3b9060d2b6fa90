//! Play between a servo's gear and its shaft: inside it the gear turns alone and the
//! shaft is free; at its ends they push each other through a stiff, damped spring.
//!
//! The spring is taken implicitly on both sides: the gear's equation is solved for the
//! shaft's speed at the end of the step, and what is left goes into the mass matrix.

/// Time constant of the rotor on the spring at the ends, seconds; it is critically damped.
const TIME_S: f64 = 2e-3;

/// The motor's side of one joint in one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct GearDrive {
    pub torque_nm: f64,
    /// Newton metres for one radian a second, friction included.
    pub damping_nm_s: f64,
    pub armature_kg_m2: f64,
}

/// What the gear does to its shaft in one step: `torque - damping * speed at its end`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ShaftPush {
    pub torque_nm: f64,
    pub damping_nm_s: f64,
}

/// Gear and shaft of one joint, in joint radians.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct GearPlay {
    /// Half of the play, radians; 0 has none.
    half_rad: f64,
    /// How far the gear is ahead of the shaft.
    ahead_rad: f64,
    gear_rad_s: f64,
    /// The gear's speed at the end of the step: a part of its own, and a share of the
    /// shaft's.
    own_rad_s: f64,
    share: f64,
}

impl GearPlay {
    pub fn new(play_rad: f64) -> Self {
        Self { half_rad: play_rad / 2.0, ..Self::default() }
    }

    pub fn is_there(&self) -> bool {
        self.half_rad > 0.0
    }

    /// The gear stands still in the middle of its play.
    pub fn rest(&mut self) {
        *self = Self { half_rad: self.half_rad, ..Self::default() };
    }

    /// Prepares a step of `dt_s`, in which the shaft begins with `rate`.
    pub fn push(&mut self, drive: &GearDrive, rate: f64, dt_s: f64) -> ShaftPush {
        let inertia = drive.armature_kg_m2;
        let (stiffness, damping) = (inertia / (TIME_S * TIME_S), 2.0 * inertia / TIME_S);
        let beyond = self.ahead_rad - self.ahead_rad.clamp(-self.half_rad, self.half_rad);
        let pressed = stiffness * beyond;
        let total = pressed + damping * (self.gear_rad_s - rate);
        // The ends push, they do not pull.
        let touches = beyond != 0.0 && total * beyond > 0.0;
        let (pressed, coupling) =
            if touches { (pressed, damping + dt_s * stiffness) } else { (0.0, 0.0) };
        let held = inertia + dt_s * (drive.damping_nm_s + coupling);
        let momentum = inertia * self.gear_rad_s + dt_s * (drive.torque_nm - pressed);
        self.own_rad_s = momentum / held;
        self.share = dt_s * coupling / held;
        ShaftPush {
            torque_nm: pressed + coupling * self.own_rad_s,
            damping_nm_s: coupling * (1.0 - self.share),
        }
    }

    /// The gear's part of the step, at whose end the shaft has this speed.
    pub fn advance(&mut self, rate: f64, dt_s: f64) {
        self.gear_rad_s = self.own_rad_s + self.share * rate;
        self.ahead_rad += dt_s * (self.gear_rad_s - rate);
    }
}
