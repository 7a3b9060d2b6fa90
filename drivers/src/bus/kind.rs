//! What a robot file may call the protocol of a bus.

use serde::Deserialize;

#[allow(missing_docs)] // each kind is a protocol, and each protocol a folder
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum BusKind {
    /// Dynamixel Protocol 2.0 over a serial port.
    Dynamixel2,
    /// Dynamixel Protocol 1.0 (AX, and MX as they left the factory) over a serial port.
    Dynamixel1,
    Feetech,
    /// Serial servos of a family that a program brings itself; a robot file cannot say.
    #[serde(skip)]
    Custom,
    Mit,
    Robstride,
    /// ODrive controllers (CANSimple, firmware 0.6), on CAN.
    Odrive,
    /// CiA 402 drives (CANopen, cyclic synchronous position), on CAN.
    Cia402,
    /// MyActuator RMD motors (motion protocol V4.2), on CAN.
    Myactuator,
    /// moteus controllers, on CAN FD.
    Moteus,
}

impl BusKind {
    pub(crate) fn ids(self) -> (u8, u8) {
        match self {
            Self::Dynamixel2 | Self::Dynamixel1 | Self::Feetech | Self::Custom => (0, 252),
            Self::Mit | Self::Robstride | Self::Cia402 | Self::Moteus => (1, 127),
            Self::Odrive => (0, 63),
            Self::Myactuator => (1, 32),
        }
    }

    /// Whether it is on CAN; otherwise on a serial port.
    pub fn is_can(self) -> bool {
        !matches!(self, Self::Dynamixel2 | Self::Dynamixel1 | Self::Feetech | Self::Custom)
    }
}
