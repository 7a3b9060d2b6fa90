//! The one list of serial servo families. A kind of bus without its family here
//! does not compile.

use crate::bus::kind::BusKind;
use crate::serial::dynamixel1::Dynamixel1;
use crate::serial::dynamixel2::Dynamixel2;
use crate::serial::family::ServoFamily;
use crate::serial::feetech::Feetech;

/// Every family. A servo that is found on a bus is held against the last one
/// first: some Dynamixel 1 memories look like those of the others.
pub static FAMILIES: [&dyn ServoFamily; 3] = [&Dynamixel1, &Dynamixel2, &Feetech];

/// The family that a kind of bus speaks; `None` for CAN, and for a family that a
/// program brings with [`crate::SerialBus::open_family`].
pub fn family_of(kind: BusKind) -> Option<&'static dyn ServoFamily> {
    match kind {
        BusKind::Dynamixel2 => Some(&Dynamixel2),
        BusKind::Dynamixel1 => Some(&Dynamixel1),
        BusKind::Feetech => Some(&Feetech),
        BusKind::Custom
        | BusKind::Mit
        | BusKind::Robstride
        | BusKind::Odrive
        | BusKind::Cia402
        | BusKind::Myactuator
        | BusKind::Moteus => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_model_is_found_by_the_kind_that_it_names() {
        for family in FAMILIES {
            for model in family.models() {
                assert_eq!(family_of(model.kind), Some(family), "{}", model.name);
            }
        }
    }
}
