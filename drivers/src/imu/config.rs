//! The `[imu]` table of a robot file; [`crate::assign_imu`] checks it.

use serde::Deserialize;

use super::mounting::Mounting;

/// What measures the robot's motion.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum ImuKind {
    /// The board of OP3, or one that answers as it does, on a Dynamixel 2 bus.
    Opencr,
    /// None that is real: in a simulated world the body's own motion, else nothing.
    Simulated,
}

/// The `[imu]` table.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct ImuConfig {
    /// What it is.
    pub kind: ImuKind,
    /// Its id on the bus; 200 as the board leaves the factory.
    #[serde(default = "default_id")]
    pub id: u8,
    /// The bus that it is on; left out where there is one bus only.
    #[serde(default)]
    pub bus: Option<String>,
    /// How it is turned in the root link: about x, then y, then z of the root link, degrees.
    #[serde(default)]
    pub mounting_deg: [f64; 3],
}

fn default_id() -> u8 {
    200
}

impl ImuConfig {
    /// From the board's axes to the root link's.
    pub fn mounting(&self) -> Mounting {
        Mounting::from_deg(self.mounting_deg)
    }
}
