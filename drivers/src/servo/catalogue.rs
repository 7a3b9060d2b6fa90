//! Every servo model that this crate can drive, from the folders of the families.

use crate::can::families::CAN_FAMILIES;
use crate::serial::families::FAMILIES;
use crate::servo::model::ServoModel;

fn serial() -> impl Iterator<Item = &'static ServoModel> {
    FAMILIES.iter().flat_map(|family| family.models())
}

impl ServoModel {
    /// Every model, family by family.
    pub fn all() -> impl Iterator<Item = &'static ServoModel> {
        serial().chain(CAN_FAMILIES.iter().flat_map(|family| family.models()))
    }

    /// The model with this name; a connector suffix (`-T`, `-R`) is ignored.
    pub fn from_name(name: &str) -> Option<&'static ServoModel> {
        let bare = name.strip_suffix("-T").or_else(|| name.strip_suffix("-R")).unwrap_or(name);
        Self::all().find(|model| model.name == bare)
    }

    /// The serial model with this number.
    pub fn from_number(number: u16) -> Option<&'static ServoModel> {
        serial().find(|model| model.number == number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn connector_suffix_is_ignored() {
        assert_eq!(ServoModel::from_name("XM430-W350-R").unwrap().number, 1020);
        assert!(ServoModel::from_name("XM430").is_none());
    }

    #[test]
    fn numbers_and_names_are_unique() {
        for (i, a) in ServoModel::all().enumerate() {
            for b in ServoModel::all().skip(i + 1) {
                let numbered = a.number != b.number || a.motor.is_some();
                assert!(numbered && a.name != b.name, "{}", a.name);
            }
        }
    }
}
