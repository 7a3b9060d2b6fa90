//! A leg's servo as balance has to know it.

/// The position loop of a leg's servo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegServo {
    /// Newton metres a radian.
    pub kp_nm_rad: f64,
    /// Newton metres for one radian a second.
    pub damping_nm_s: f64,
}
