//! What a CAN motor model's numbers mean, and one motor's settings.
//!
//! MIT-style commands pack each quantity into 12 or 16 bits over a range that
//! both sides must agree on. Vendor tables disagree, so a robot file may
//! override a range; motors that can tell theirs are asked, and refused if
//! they differ.

/// The ranges and abilities of a motor model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorModel {
    /// Positions are +- this, radians.
    pub position_rad: f64,
    /// Velocities are +- this, radians a second.
    pub velocity_rad_s: f64,
    /// Torques are +- this, newton metres.
    pub torque_nm: f64,
    /// Position gain from 0 to this, newton metres a radian.
    pub kp_max: f64,
    /// Damping from 0 to this, newton metre seconds a radian.
    pub kd_max: f64,
    /// MIT only: registers can be read and written (Damiao), and with them
    /// ranges and a watchdog. CubeMars motors have none.
    pub has_registers: bool,
}

/// Rotor inertia after the gear for each newton metre of peak torque, as the
/// stock gains assume: kilogram square metres.
const INERTIA_PER_NM: f64 = 2.5e-4;
/// Stock damping against the peak torque, seconds a radian.
const DAMPING_SHARE: f64 = 0.055;
/// How far above critical damping the stock gains are, squared.
const OVERDAMPED: f64 = 1.375;

impl MotorModel {
    pub(crate) fn stock_kd(&self) -> f64 {
        (DAMPING_SHARE * self.torque_nm).min(self.kd_max)
    }

    /// The stock position gain for a damping: overdamped with the rotor that a
    /// motor of this torque has, so that a joint without load does not overshoot.
    pub(crate) fn stock_kp(&self, kd: f64) -> f64 {
        let inertia = INERTIA_PER_NM * self.torque_nm;
        (kd * kd / (4.0 * OVERDAMPED * inertia)).min(self.kp_max)
    }

    /// The rotor inertia that the stock gains assume, after the gear.
    pub fn rotor_inertia_kg_m2(&self) -> f64 {
        INERTIA_PER_NM * self.torque_nm
    }
}

/// The settings of one motor, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct MotorSettings {
    /// Its ranges, overrides applied.
    pub model: MotorModel,
    /// Position gain, newton metres a radian of the joint.
    pub kp: f64,
    /// Damping, newton metre seconds a radian of the joint.
    pub kd: f64,
    /// Most torque, newton metres.
    pub torque_limit_nm: f64,
    /// Turns of the motor for one of the joint (ODrive, CiA 402; the others
    /// have their gear inside).
    pub gear_ratio: f64,
    /// The id that replies come with (Damiao's MST_ID).
    pub reply_id: u16,
    /// Position increments a turn of the motor (CiA 402).
    pub counts_per_turn: f64,
}
