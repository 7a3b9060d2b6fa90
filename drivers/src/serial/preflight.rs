//! The checks before any torque: what a servo says of itself, held against the
//! robot file. What does not fit is refused with both figures.

use crate::error::{BusError, BusResult};
use crate::serial::client::ServoClient;
use crate::serial::family::ServoFamily;
use crate::serial::registers::{Identity, Measured, OwnLimits};
use crate::servo::model::ServoModel;

impl ServoClient {
    /// Model, condition, supply, temperature and limits of a servo that answered a
    /// ping; its own limits.
    pub(super) fn check(
        &mut self,
        family: &dyn ServoFamily,
        index: usize,
        pinged: &[u8],
    ) -> BusResult<Option<OwnLimits>> {
        if let Some(identity) = self.identify(family, index, pinged)? {
            self.check_model(index, identity.model_number)?;
            self.check_firmware(index, identity.firmware)?;
        }
        let lacks = family.lacks_watchdog();
        if let Some(why) = lacks.filter(|_| !self.config.accept_no_watchdog) {
            return Err(BusError::NoWatchdog {
                servo: self.id_of(index),
                why: format!("{} {why}", self.servos[index].model.name),
            });
        }
        self.check_condition(family, index)?;
        let Some(own) = family.own_limits(self, index)? else {
            return Ok(None);
        };
        if let Some(measured) = self.measure(family, index)? {
            self.check_voltage(index, measured.tenth_volts, own.tenth_volts)?;
            self.check_temperature(index, measured.celsius, own.celsius)?;
        }
        self.check_goal_range(index, own.ticks)?;
        self.check_velocity(index, own.velocity)?;
        Ok(Some(own))
    }

    fn identify(
        &mut self,
        family: &dyn ServoFamily,
        index: usize,
        pinged: &[u8],
    ) -> BusResult<Option<Identity>> {
        let identity = match family.identity_register() {
            Some(register) => family.identity(&self.read_bytes(index, register)?),
            None => family.identity(pinged),
        };
        self.firmware[index] = identity.map_or(0, |identity| identity.firmware);
        Ok(identity)
    }

    pub(super) fn check_condition(
        &mut self,
        family: &dyn ServoFamily,
        index: usize,
    ) -> BusResult<()> {
        match family.condition(self, index)? {
            None => Ok(()),
            Some(flags) => Err(BusError::Hardware { servo: self.id_of(index), flags }),
        }
    }

    pub(super) fn measure(
        &mut self,
        family: &dyn ServoFamily,
        index: usize,
    ) -> BusResult<Option<Measured>> {
        let Some(service) = &family.registers().service else {
            return Ok(None);
        };
        let register = service.voltage_and_temperature();
        let bytes = self.read_bytes(index, register)?;
        Ok(Some(Measured::new(register, &bytes)))
    }

    fn check_model(&self, index: usize, number: u16) -> BusResult<()> {
        let wanted = self.servos[index].model;
        if number == wanted.number {
            return Ok(());
        }
        let actual = match ServoModel::from_number(number) {
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
    fn check_voltage(&self, index: usize, present: u64, own: (u64, u64)) -> BusResult<()> {
        let (lowest, highest) = own;
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

    fn check_temperature(&self, index: usize, present: u64, limit: u64) -> BusResult<()> {
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

    fn check_firmware(&self, index: usize, actual: u8) -> BusResult<()> {
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

    fn check_velocity(&self, index: usize, own: Option<u64>) -> BusResult<()> {
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

    fn check_goal_range(&self, index: usize, own: (i32, i32)) -> BusResult<()> {
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
