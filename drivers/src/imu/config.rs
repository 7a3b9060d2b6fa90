//! The `[imu]` table of a robot file; [`crate::assign_imu`] checks it.

use serde::Deserialize;

use super::mounting::Mounting;
use super::{opencr, witmotion};

/// What measures the robot's motion.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum ImuKind {
    /// The board of OP3, or one that answers as it does, on a Dynamixel 2 bus.
    Opencr,
    /// A BNO055 on a serial port of its own.
    Bno055,
    /// A BNO085 (or BNO080) in its mode UART-RVC, on a serial port of its own.
    Bno085,
    /// A WitMotion board: an MPU-6050 or its like behind a processor, on a serial port of its
    /// own or on a CAN bus.
    Witmotion,
    /// None that is real: in a simulated world the body's own motion, else nothing.
    Simulated,
}

/// The `[imu]` table.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct ImuConfig {
    /// What it is.
    pub kind: ImuKind,
    /// Its id on the bus; left out: as the board leaves the factory.
    #[serde(default)]
    pub id: Option<u8>,
    /// The bus that it is on; left out where there is one bus only.
    #[serde(default)]
    pub bus: Option<String>,
    /// The serial port of its own that it is on, such as `/dev/ttyUSB1`.
    #[serde(default)]
    pub port: Option<String>,
    /// Bits a second of that port; left out: 115200.
    #[serde(default)]
    pub baud: Option<u32>,
    /// How it is turned in the root link: about x, then y, then z of the root link, degrees.
    #[serde(default)]
    pub mounting_deg: [f64; 3],
}

impl ImuConfig {
    /// A sensor of this kind as it leaves the factory, mounted straight.
    pub fn of_kind(kind: ImuKind) -> Self {
        Self { kind, id: None, bus: None, port: None, baud: None, mounting_deg: [0.0; 3] }
    }

    /// Its id on the bus.
    pub fn id(&self) -> u8 {
        self.id.unwrap_or(match self.kind {
            ImuKind::Witmotion => witmotion::FACTORY_ID,
            _ => opencr::FACTORY_ID,
        })
    }

    /// Bits a second of a serial port of its own.
    pub fn baud(&self) -> u32 {
        self.baud.unwrap_or(115_200)
    }

    /// From the board's axes to the root link's.
    pub fn mounting(&self) -> Mounting {
        Mounting::from_deg(self.mounting_deg)
    }
}
