//! What a CAN motor model's numbers mean, and one motor's settings.
//!
//! MIT-style commands pack each quantity into 12 or 16 bits over a range that
//! both sides must agree on. Vendor tables disagree, so a robot file may
//! override a range; motors that can tell theirs are asked, and refused if
//! they differ.

#[allow(missing_docs)] // units stand in the names
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorModel {
    pub position_rad: f64,
    pub velocity_rad_s: f64,
    pub torque_nm: f64,
    /// Position gain from 0 to this, newton metres a radian.
    pub kp_max: f64,
    /// Damping from 0 to this, newton metre seconds a radian.
    pub kd_max: f64,
    /// MIT only: registers can be read and written (Damiao), and with them
    /// ranges and a watchdog. CubeMars and RobStride motors have none.
    pub has_registers: bool,
    /// MIT only: a reply ends with the temperature in tenths, and has no fault (RobStride).
    pub tells_tenths: bool,
    /// MIT only: driven in position-velocity mode (Damiao): its own loops, no gains.
    pub own_loops: bool,
}

/// Rotor inertia after the gear for each newton metre of peak torque, as the
/// stock gains assume: kilogram square metres.
const INERTIA_PER_NM: f64 = 2.5e-4;
/// Stock damping against the peak torque, seconds a radian.
const DAMPING_SHARE: f64 = 0.055;
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

#[allow(missing_docs)] // units stand in the names
#[derive(Clone, Debug, PartialEq)]
pub struct MotorSettings {
    pub model: MotorModel,
    pub kp: f64,
    pub kd: f64,
    pub torque_limit_nm: f64,
    /// Turns of the motor for one of the joint (ODrive, CiA 402; the others
    /// have their gear inside).
    pub gear_ratio: f64,
    pub reply_id: u16,
    /// Position increments a turn of the motor (CiA 402).
    pub counts_per_turn: f64,
}
