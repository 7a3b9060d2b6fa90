//! What a servo says of itself, held against the robot file: what does not fit
//! is refused before any torque, with both figures.

use super::Link;
use crate::error::BusError;
use crate::model::Model;

impl Link {
    /// Refuses another model than the configured one.
    pub fn check_model(&self, index: usize, number: u16) -> Result<(), BusError> {
        let wanted = self.servos[index].model;
        if number == wanted.number {
            return Ok(());
        }
        let actual = match Model::from_number(number) {
            Some(model) => format!("{number} ({})", model.name),
            None => number.to_string(),
        };
        Err(BusError::WrongModel {
            servo: self.id_of(index),
            actual,
            wanted: wanted.name,
            number: wanted.number,
        })
    }

    /// Refuses a supply (0.1 V) outside the servo's own limits.
    pub fn check_voltage(
        &self,
        index: usize,
        present: u64,
        lowest: u64,
        highest: u64,
    ) -> Result<(), BusError> {
        let volts = |units: u64| format!("{:.1} V", units as f64 * 0.1);
        if (lowest..=highest).contains(&present) {
            return Ok(());
        }
        Err(BusError::Unfit {
            servo: self.id_of(index),
            what: "input voltage",
            actual: volts(present),
            wanted: format!("{} to {}", volts(lowest), volts(highest)),
        })
    }

    /// Refuses a temperature (Celsius) at the servo's own limit.
    pub fn check_temperature(
        &self,
        index: usize,
        present: u64,
        limit: u64,
    ) -> Result<(), BusError> {
        if present < limit {
            return Ok(());
        }
        Err(BusError::Unfit {
            servo: self.id_of(index),
            what: "temperature",
            actual: format!("{present} C"),
            wanted: format!("below {limit} C"),
        })
    }

    /// Refuses another firmware than the robot file wants.
    pub fn check_firmware(&self, index: usize, actual: u8) -> Result<(), BusError> {
        match self.servos[index].firmware {
            Some(wanted) if wanted != actual => Err(BusError::Unfit {
                servo: self.id_of(index),
                what: "firmware",
                actual: actual.to_string(),
                wanted: format!("{wanted}, as the robot file says"),
            }),
            _ => Ok(()),
        }
    }

    /// Refuses a servo whose own velocity limit (in its units) cuts the joint's.
    pub fn check_velocity(&self, index: usize, own: Option<u64>) -> Result<(), BusError> {
        let servo = &self.servos[index];
        let asked_deg_s = servo.limits.velocity_rad_s.to_degrees();
        let unit_deg_s = servo.model.velocity_rad_s_per_unit.to_degrees();
        let own_deg_s = own.map_or(f64::INFINITY, |units| units as f64 * unit_deg_s);
        if asked_deg_s <= own_deg_s {
            return Ok(());
        }
        Err(BusError::Unfit {
            servo: self.id_of(index),
            what: "velocity limit in the servo, degrees a second,",
            actual: format!("{own_deg_s:.1}"),
            wanted: format!("at least velocity_deg_s = {asked_deg_s:.1}"),
        })
    }

    /// Refuses a servo whose own position limits cut the joint's range.
    pub fn check_goal_range(&self, index: usize, own: (i32, i32)) -> Result<(), BusError> {
        let (lowest, highest) = self.servos[index].goal_range_ticks();
        if lowest >= own.0 && highest <= own.1 {
            return Ok(());
        }
        Err(BusError::Unfit {
            servo: self.id_of(index),
            what: "position limits in the servo, ticks,",
            actual: format!("{} to {}", own.0, own.1),
            wanted: format!("at least {lowest} to {highest}"),
        })
    }
}
