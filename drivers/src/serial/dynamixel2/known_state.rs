//! What a Dynamixel must hold before it gets torque, beyond what every arming writes:
//! nothing that another program left behind may make it move otherwise than the robot
//! file says.

use crate::error::BusError;
use crate::serial::deviation::{Deviation, Remedy};
use crate::serial::dynamixel2::registers::*;
use crate::serial::family::prelude::*;

/// Overheat and overload must shut a servo down, whatever else does.
const NEEDED_SHUTDOWN: u64 = 1 << 2 | 1 << 5;
/// A secondary id above this is none.
const LAST_SHADOW_ID: u64 = 252;
/// Full scale of the PWM registers of the X series.
const FULL_PWM: u64 = 885;
/// A current limit below this share of the stall current leaves little of the servo.
const WEAK_SHARE: f64 = 0.25;

/// Modes of position and drive: direction and turns as the robot file counts them.
pub(super) const MODES: [(Register, u64, &str); 2] = [
    (DRIVE_MODE, 0, "its direction and its profile would be others"),
    (OPERATING_MODE, 3, "goals would mean something else"),
];

/// Position gains P, I, D from the factory; `None` where this crate does not know them.
fn factory_gains(model: &ServoModel) -> Option<[u16; 3]> {
    match model.number {
        0..1000 => Some([850, 0, 0]),
        1190..1210 => Some([400, 0, 0]),
        1210..1250 => None,
        _ => Some([800, 0, 0]),
    }
}

fn factory_shutdown(model: &ServoModel) -> u64 {
    if (1190..1250).contains(&model.number) { 53 } else { 52 }
}

/// Reads registers and collects what deviates.
struct Look<'a> {
    client: &'a mut ServoClient,
    index: usize,
    found: Vec<Deviation>,
}

impl Look<'_> {
    /// A register that old firmware may not have.
    fn read(&mut self, register: Register) -> BusResult<Option<u64>> {
        match self.client.read(self.index, register) {
            Err(BusError::Refused { .. }) => Ok(None),
            read => read.map(Some),
        }
    }

    fn model(&self) -> &'static ServoModel {
        self.client.servos[self.index].model
    }

    fn tell(&mut self, register: Register, actual: u64, wanted: String, why: &'static str) {
        let actual = actual as i64;
        self.found.push(Deviation { register, actual, wanted, why, remedy: Remedy::Tell });
    }

    /// Must hold `wanted`, and is made to.
    fn must(&mut self, register: Register, wanted: u64, why: &'static str) -> BusResult<()> {
        if let Some(actual) = self.read(register)?.filter(|actual| *actual != wanted) {
            self.found.push(Deviation::write(register, actual, wanted, why));
        }
        Ok(())
    }

    fn second_id(&mut self) -> BusResult<()> {
        if let Some(actual) = self.read(SHADOW_ID)?.filter(|id| *id <= LAST_SHADOW_ID) {
            let why = "it would obey what another servo is told";
            self.found.push(Deviation::write(SHADOW_ID, actual, 255, why));
        }
        Ok(())
    }

    fn shutdown(&mut self) -> BusResult<()> {
        let misses = |mask: &u64| mask & NEEDED_SHUTDOWN != NEEDED_SHUTDOWN;
        if let Some(actual) = self.read(SHUTDOWN)?.filter(misses) {
            let why = "overload or heat would not stop it";
            let wanted = factory_shutdown(self.model());
            self.found.push(Deviation::write(SHUTDOWN, actual, wanted, why));
        }
        Ok(())
    }

    fn homing(&mut self) -> BusResult<()> {
        let Some(actual) = self.read(HOMING_OFFSET)?.map(|raw| raw as i32) else {
            return Ok(());
        };
        let wanted = self.client.servos[self.index].settings.homing_offset;
        if wanted.unwrap_or(0) != actual {
            let shifted = Deviation::shifted(HOMING_OFFSET, actual, wanted.unwrap_or(0));
            // A robot file that does not name it may have been measured with it.
            let remedy = wanted.map_or(Remedy::Tell, |_| Remedy::Refuse);
            self.found.push(Deviation { remedy, ..shifted });
        }
        Ok(())
    }

    fn strength(&mut self) -> BusResult<()> {
        let Some(limit) = self.read(PWM_LIMIT)? else { return Ok(()) };
        if limit < FULL_PWM {
            self.tell(PWM_LIMIT, limit, FULL_PWM.to_string(), "the servo is weaker and slower");
        }
        self.must(GOAL_PWM, limit, "the servo would be weaker and slower")?;
        let model = self.model();
        if let Some(unit_a) = model.current_a_per_unit
            && let Some(actual) = self.read(CURRENT_LIMIT)?
        {
            let weak = WEAK_SHARE * model.sheet.stall_current_a / unit_a;
            if (actual as f64) < weak {
                let wanted = format!("at least {weak:.0}");
                self.tell(CURRENT_LIMIT, actual, wanted, "little of the servo's torque is left");
            }
        }
        Ok(())
    }

    /// Gains of the robot file are made so; without any, gains far from the factory's are
    /// put back, and others told.
    fn gains(&mut self) -> BusResult<()> {
        let own = self.client.servos[self.index].settings.gains;
        let Some(wanted) = own.or(factory_gains(self.model())) else { return Ok(()) };
        let registers = [POSITION_P, POSITION_I, POSITION_D];
        let why = "it would follow otherwise; `gains` in the robot file has others kept";
        for (register, wanted) in registers.into_iter().zip(wanted.map(u64::from)) {
            let Some(actual) = self.read(register)?.filter(|actual| *actual != wanted) else {
                continue;
            };
            let near = register != POSITION_P || (wanted / 2..=wanted * 4).contains(&actual);
            match own.is_none() && near {
                true => self.tell(register, actual, wanted.to_string(), why),
                false => self.found.push(Deviation::write(register, actual, wanted, why)),
            }
        }
        for register in [FEED_FORWARD_1, FEED_FORWARD_2] {
            self.must(register, 0, "it would run ahead of its goals")?;
        }
        Ok(())
    }
}

/// Everything of a servo that is not as it should be; nothing is written.
pub(super) fn deviations(client: &mut ServoClient, index: usize) -> BusResult<Vec<Deviation>> {
    let mut look = Look { client, index, found: Vec::new() };
    for (register, wanted, why) in MODES {
        look.must(register, wanted, why)?;
    }
    look.second_id()?;
    look.must(STARTUP, 0, "torque or old settings would come back by themselves")?;
    look.shutdown()?;
    look.homing()?;
    look.strength()?;
    look.gains()?;
    look.must(PROFILE_ACCELERATION, 0, "the host shapes the motion")?;
    look.must(PROFILE_VELOCITY, 0, "the host shapes the motion")?;
    Ok(look.found)
}
