//! The one list of CAN motor families. A kind of bus without its family here does not
//! compile.

use crate::bus::kind::BusKind;
use crate::can::cia402::Cia402;
use crate::can::family::CanFamily;
use crate::can::mit::Mit;
use crate::can::moteus::Moteus;
use crate::can::myactuator::Myactuator;
use crate::can::odrive::Odrive;
use crate::can::robstride::Robstride;

pub(crate) static CAN_FAMILIES: [&dyn CanFamily; 6] =
    [&Mit, &Robstride, &Odrive, &Cia402, &Myactuator, &Moteus];

/// The family that a bus speaks; `None` for a serial bus.
pub(crate) fn of_kind(kind: BusKind) -> Option<&'static dyn CanFamily> {
    Some(match kind {
        BusKind::Mit => &Mit,
        BusKind::Robstride => &Robstride,
        BusKind::Odrive => &Odrive,
        BusKind::Cia402 => &Cia402,
        BusKind::Myactuator => &Myactuator,
        BusKind::Moteus => &Moteus,
        BusKind::Dynamixel2 | BusKind::Dynamixel1 | BusKind::Feetech | BusKind::Custom => {
            return None;
        }
    })
}
