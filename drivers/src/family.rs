//! Families of serial servos: where each keeps what every servo has.

use crate::dialect::{names_of, sign_magnitude};
use crate::feetech;
use crate::packet::Protocol;
use crate::register::{Register, hardware_error_names, register};

/// Servos that share a control table, as far as this crate looks at one servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// Dynamixel X, and MX with Protocol 2.0.
    X,
    /// Dynamixel AX, RX and MX with Protocol 1.
    Ax,
    /// Feetech STS.
    Sts,
}

/// Where a family keeps what.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// The bus id, permanent.
    pub id: Register,
    /// 1 is torque on.
    pub torque: Register,
    /// Where the servo stands.
    pub position: Register,
    /// 0.1 V.
    pub voltage: Register,
    /// Celsius.
    pub temperature: Register,
    /// What is wrong, as flags; `None` where only the answers' flags tell.
    pub status: Option<Register>,
    /// 0 lets permanent memory be written.
    pub lock: Option<Register>,
    /// The highest id.
    pub last_id: u8,
}

const X: Layout = Layout {
    id: register(7, 1, "id"),
    torque: Register::TORQUE,
    position: register(132, 4, "present position"),
    voltage: register(144, 2, "present input voltage"),
    temperature: register(146, 1, "present temperature"),
    status: Some(Register::HARDWARE_ERROR),
    lock: None,
    last_id: 252,
};

const AX: Layout = Layout {
    id: register(3, 1, "id"),
    torque: register(24, 1, "torque enable"),
    position: register(36, 2, "present position"),
    voltage: register(42, 1, "present input voltage"),
    temperature: register(43, 1, "present temperature"),
    status: None,
    lock: None,
    last_id: 253,
};

const STS: Layout = Layout {
    id: register(5, 1, "id"),
    torque: register(40, 1, "torque enable"),
    position: register(56, 2, "present position"),
    voltage: register(62, 1, "present input voltage"),
    temperature: register(63, 1, "present temperature"),
    status: Some(register(65, 1, "status")),
    lock: Some(register(55, 1, "EEPROM lock")),
    last_id: 253,
};

impl Family {
    /// Where it keeps what.
    pub fn layout(self) -> &'static Layout {
        match self {
            Self::X => &X,
            Self::Ax => &AX,
            Self::Sts => &STS,
        }
    }

    /// The framing it speaks.
    pub fn protocol(self) -> Protocol {
        match self {
            Self::X => Protocol::Dynamixel2,
            Self::Ax | Self::Sts => Protocol::Protocol1,
        }
    }

    /// Family, model number and firmware from the first six bytes of memory:
    /// both families of Protocol 1 keep their id there, in different places.
    pub(crate) fn of_protocol1(id: u8, start: &[u8]) -> Option<(Self, u16, u8)> {
        let &[a, b, c, d, e, f] = start else {
            return None;
        };
        if f == id {
            Some((Self::Sts, u16::from_le_bytes([d, e]), a))
        } else {
            (d == id).then_some((Self::Ax, u16::from_le_bytes([a, b]), c))
        }
    }

    /// The position register as a number.
    pub(crate) fn position_ticks(self, raw: u64) -> i32 {
        match self {
            Self::X => raw as u32 as i32,
            Self::Ax => raw as i32,
            Self::Sts => sign_magnitude(raw as u16, feetech::SIGN_BIT),
        }
    }

    /// The status flags in words.
    pub(crate) fn error_names(self, flags: u8) -> String {
        match self {
            Self::X | Self::Ax => hardware_error_names(flags),
            Self::Sts => names_of(flags, &feetech::CONDITIONS),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn protocol_1_families_are_told_apart_by_where_their_id_is() {
        // STS3215, id 7; AX-12, id 7; MX-28, id 7 with a return delay of 0.
        let sts = [3, 10, 0, 9, 3, 7];
        assert_eq!(Family::of_protocol1(7, &sts), Some((Family::Sts, 777, 3)));
        let ax = [12, 0, 24, 7, 1, 250];
        assert_eq!(Family::of_protocol1(7, &ax), Some((Family::Ax, 12, 24)));
        let mx = [29, 0, 40, 7, 34, 0];
        assert_eq!(Family::of_protocol1(7, &mx), Some((Family::Ax, 29, 40)));
        assert_eq!(Family::of_protocol1(7, &[0; 6]), None);
    }
}
