//! The `[[joint]]` tables of a robot file, and their check.
//!
//! The one place where degrees exist. Refused, with the joint named: unknown
//! keys and models, a direction other than 1 or -1, limits that are not finite
//! or inverted or out of the servo's single turn, ids used twice.

use serde::Deserialize;
use servodance_types::JointLimits;

use crate::bus::kind::BusKind;
use crate::can::{MotorModel, MotorSettings};
use crate::error::ConfigError;
use crate::servo::model::ServoModel;
use crate::servo::{SerialSettings, Servo};

/// One `[[joint]]` table. The keys from `kp` on are for CAN motors only, and
/// `firmware` is for serial servos only.
#[allow(missing_docs)] // docs/serial.md and docs/can.md describe every key
#[derive(Clone, Debug, Default, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct ServoConfig {
    pub name: String,
    #[serde(default)]
    pub bus: Option<String>,
    pub id: u8,
    pub model: String,
    /// The firmware that a serial servo must have, as `servodance scan` shows it; any if left out.
    pub firmware: Option<u8>,
    /// What the serial servo adds to its own angle, ticks; `servodance calibrate` writes it.
    pub homing_offset: Option<i32>,
    /// Position gains P, I and D of the serial servo; the factory's if left out.
    pub gains: Option<[u16; 3]>,
    pub direction: i8,
    /// Servo angle, degrees (0 to 360, centre 180), where the joint reads zero;
    /// for a CAN motor its own angle after the gear, of either sign.
    pub zero_deg: f64,
    pub lower_deg: f64,
    pub upper_deg: f64,
    pub velocity_deg_s: f64,
    pub acceleration_deg_s2: f64,
    pub kp: Option<f64>,
    pub kd: Option<f64>,
    pub torque_limit_nm: Option<f64>,
    pub position_range_rad: Option<f64>,
    pub velocity_range_rad_s: Option<f64>,
    pub torque_range_nm: Option<f64>,
    pub gear_ratio: Option<f64>,
    pub reply_id: Option<u16>,
    pub counts_per_turn: Option<f64>,
}

impl ServoConfig {
    fn bad(
        &self,
        key: &'static str,
        actual: impl ToString,
        wanted: impl Into<String>,
    ) -> ConfigError {
        ConfigError::Joint {
            joint: self.name.clone(),
            key,
            actual: actual.to_string(),
            wanted: wanted.into(),
        }
    }

    /// The servo in radians, if the table makes sense.
    pub fn servo(&self) -> Result<Servo, ConfigError> {
        if self.name.is_empty() {
            return Err(self.bad("name", "\"\"", "a joint name"));
        }
        let model = ServoModel::from_name(&self.model).ok_or_else(|| {
            let names: Vec<_> = ServoModel::all().map(|model| model.name).collect();
            let wanted = format!("one of {}", names.join(", "));
            self.bad("model", format!("{:?}", self.model), wanted)
        })?;
        let (lowest, highest) = model.kind.ids();
        if !(lowest..=highest).contains(&self.id) {
            let wanted = format!("{lowest} to {highest}");
            return Err(self.bad("id", self.id, wanted));
        }
        if self.direction.abs() != 1 {
            return Err(self.bad("direction", self.direction, "1 or -1"));
        }
        let zeros = if model.motor.is_some() { -3.6e4..=3.6e4 } else { 0.0..=360.0 };
        if !zeros.contains(&self.zero_deg) {
            let wanted = format!("{} to {}", zeros.start(), zeros.end());
            return Err(self.bad("zero_deg", self.zero_deg, wanted));
        }
        let limits = JointLimits {
            lower_rad: self.lower_deg.to_radians(),
            upper_rad: self.upper_deg.to_radians(),
            velocity_rad_s: self.velocity_deg_s.to_radians(),
            acceleration_rad_s2: self.acceleration_deg_s2.to_radians(),
        }
        .checked()
        .map_err(|reason| ConfigError::Limits { joint: self.name.clone(), reason })?;
        let servo = Servo {
            name: self.name.clone(),
            id: self.id,
            model,
            firmware: self.firmware,
            direction: f64::from(self.direction),
            zero_rad: self.zero_deg.to_radians(),
            limits,
            motor: self.motor_settings(model)?,
            settings: SerialSettings { homing_offset: self.homing_offset, gains: self.gains },
        };
        match &servo.motor {
            Some(motor) => self.check_motor_reach(&servo, motor)?,
            None => return self.check_reach(servo),
        }
        Ok(servo)
    }

    fn motor_settings(&self, model: &ServoModel) -> Result<Option<MotorSettings>, ConfigError> {
        if let Some(stock) = &model.motor {
            let given = [
                ("firmware", self.firmware.is_some()),
                ("homing_offset", self.homing_offset.is_some()),
                ("gains", self.gains.is_some()),
            ];
            if let Some((key, _)) = given.into_iter().find(|(_, is_given)| *is_given) {
                let wanted = format!("left out: {} is a CAN motor", model.name);
                return Err(self.bad(key, "given", wanted));
            }
            return self.settings_with(stock).map(Some);
        }
        let given = [
            ("kp", self.kp.is_some()),
            ("kd", self.kd.is_some()),
            ("torque_limit_nm", self.torque_limit_nm.is_some()),
            ("position_range_rad", self.position_range_rad.is_some()),
            ("velocity_range_rad_s", self.velocity_range_rad_s.is_some()),
            ("torque_range_nm", self.torque_range_nm.is_some()),
            ("gear_ratio", self.gear_ratio.is_some()),
            ("reply_id", self.reply_id.is_some()),
            ("counts_per_turn", self.counts_per_turn.is_some()),
        ];
        match given.into_iter().find(|(_, is_given)| *is_given) {
            None => Ok(None),
            Some((key, _)) => {
                Err(self.bad(key, "given", format!("left out: {} is no CAN motor", model.name)))
            }
        }
    }

    fn settings_with(&self, stock: &MotorModel) -> Result<MotorSettings, ConfigError> {
        let within = |key, value: f64, low: f64, high: f64| {
            if value > low && value <= high {
                return Ok(value);
            }
            Err(self.bad(key, value, format!("above {low}, at most {high}")))
        };
        let or = |value: Option<f64>, stock: f64| value.unwrap_or(stock);
        let position = or(self.position_range_rad, stock.position_rad);
        let velocity = or(self.velocity_range_rad_s, stock.velocity_rad_s);
        let torque = or(self.torque_range_nm, stock.torque_nm);
        let model = MotorModel {
            position_rad: within("position_range_rad", position, 0.0, 1e4)?,
            velocity_rad_s: within("velocity_range_rad_s", velocity, 0.0, 1e4)?,
            torque_nm: within("torque_range_nm", torque, 0.0, 1e4)?,
            ..*stock
        };
        let kd = or(self.kd, model.stock_kd());
        let kp = or(self.kp, model.stock_kp(kd));
        let torque_limit = or(self.torque_limit_nm, model.torque_nm);
        let counts = or(self.counts_per_turn, 65_536.0);
        Ok(MotorSettings {
            model,
            kp: within("kp", kp, 0.0, model.kp_max)?,
            kd: within("kd", kd, 0.0, model.kd_max)?,
            torque_limit_nm: within("torque_limit_nm", torque_limit, 0.0, model.torque_nm)?,
            gear_ratio: within("gear_ratio", or(self.gear_ratio, 1.0), 0.0, 1e4)?,
            reply_id: self.reply_id.unwrap_or(0),
            counts_per_turn: within("counts_per_turn", counts, 0.0, 1e8)?,
        })
    }

    /// The limits must lie within what the motor's numbers can say.
    fn check_motor_reach(&self, servo: &Servo, motor: &MotorSettings) -> Result<(), ConfigError> {
        let range = motor.model.position_rad;
        for (key, joint_deg) in [("lower_deg", self.lower_deg), ("upper_deg", self.upper_deg)] {
            let motor_rad = servo.motor_rad(joint_deg.to_radians());
            if motor_rad.abs() > range {
                let motor_deg = motor_rad.to_degrees();
                return Err(self.bad(
                    key,
                    format!("{joint_deg} (motor angle {motor_deg:.1} degrees)"),
                    format!("a motor angle of +-{:.1} degrees", range.to_degrees()),
                ));
            }
        }
        let fastest_deg_s = motor.model.velocity_rad_s.to_degrees();
        if self.velocity_deg_s > fastest_deg_s {
            let wanted = format!("at most {fastest_deg_s:.0}, the motor's range");
            return Err(self.bad("velocity_deg_s", self.velocity_deg_s, wanted));
        }
        Ok(())
    }

    /// The limits must lie within the servo's single turn.
    fn check_reach(&self, servo: Servo) -> Result<Servo, ConfigError> {
        let last_tick_rad = f64::from(servo.model.last_tick) * servo.model.rad_per_tick;
        for (key, joint_deg) in [("lower_deg", self.lower_deg), ("upper_deg", self.upper_deg)] {
            let servo_rad = servo.zero_rad + servo.direction * joint_deg.to_radians();
            if !(-1e-9..=last_tick_rad + 1e-9).contains(&servo_rad) {
                return Err(self.bad(
                    key,
                    format!("{joint_deg} (servo angle {:.1} degrees)", servo_rad.to_degrees()),
                    format!("a servo angle of 0 to {:.1} degrees", last_tick_rad.to_degrees()),
                ));
            }
        }
        let (lowest, highest) = servo.goal_range_ticks();
        if lowest > highest {
            return Err(ConfigError::Limits {
                joint: self.name.clone(),
                reason: "lower and upper limit lie between two encoder ticks".into(),
            });
        }
        Ok(servo)
    }
}

/// All joints of a robot file, checked one by one and against each other.
pub fn servos(configs: &[ServoConfig]) -> Result<Vec<Servo>, ConfigError> {
    if configs.is_empty() {
        return Err(ConfigError::NoJoints);
    }
    let mut servos: Vec<Servo> = Vec::with_capacity(configs.len());
    for config in configs {
        let servo = config.servo()?;
        let clash = configs.iter().zip(&servos).find(|(other_config, other)| {
            let share_bus = may_share_bus(config, other_config);
            other.name == servo.name || (share_bus && answer_alike(&servo, other))
        });
        if let Some((_, other)) = clash {
            return Err(ConfigError::Twice {
                joint: servo.name,
                id: servo.id,
                other: other.name.clone(),
                other_id: other.id,
            });
        }
        servos.push(servo);
    }
    Ok(servos)
}

/// A joint that names no bus is on the robot's one bus, whatever that is called.
fn may_share_bus(one: &ServoConfig, other: &ServoConfig) -> bool {
    one.bus == other.bus || one.bus.is_none() || other.bus.is_none()
}

/// Whether replies of two servos on one bus cannot be told apart.
fn answer_alike(one: &Servo, other: &Servo) -> bool {
    // Damiao's motors give the lowest four bits of their id in replies.
    let nibble = |servo: &Servo| {
        let is_damiao =
            |motor: &&MotorSettings| servo.model.kind == BusKind::Mit && motor.model.has_registers;
        let motor = servo.motor.as_ref().filter(is_damiao)?;
        Some((motor.reply_id, servo.id & 0xF))
    };
    one.id == other.id || (nibble(one).is_some() && nibble(one) == nibble(other))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::config::{BusConfig, one_or_several};
    use crate::bus::layout::layouts;

    #[derive(Debug, Deserialize)]
    struct File {
        #[serde(deserialize_with = "one_or_several")]
        bus: Vec<BusConfig>,
        joint: Vec<ServoConfig>,
    }

    const GOOD: &str = r#"
        [bus]
        kind = "dynamixel2"
        baud = 2_000_000
        [[joint]]
        name = "l_knee"
        id = 14
        model = "XM430-W350"
        direction = -1
        zero_deg = 180.0
        lower_deg = -18.0
        upper_deg = 126.0
        velocity_deg_s = 230.0
        acceleration_deg_s2 = 2300.0
    "#;

    /// The error that `GOOD` with one text replaced gives.
    fn complaint(from: &str, to: &str) -> String {
        let text = GOOD.replace(from, to);
        assert_ne!(text, GOOD);
        match toml::from_str::<File>(&text) {
            Err(error) => error.to_string(),
            Ok(file) => match layouts(file.bus, &file.joint) {
                Err(error) => error.to_string(),
                other => panic!("accepted: {other:?}"),
            },
        }
    }

    #[test]
    fn good_file_is_read() {
        let file: File = toml::from_str(GOOD).unwrap();
        assert_eq!(file.bus, [BusConfig::dynamixel2(2_000_000)]);
        let servo = &servos(&file.joint).unwrap()[0];
        assert_eq!((servo.id, servo.direction), (14, -1.0));
        assert!((servo.limits.upper_rad - 2.199).abs() < 1e-3);
    }

    #[test]
    fn several_buses_are_an_array() {
        let text = GOOD
            .replace("[bus]", "[[bus]]\nname = \"left\"")
            .replace("[[joint]]", "[[bus]]\nname = \"right\"\nkind = \"feetech\"\nbaud = 1_000_000\n[[joint]]\nbus = \"left\"");
        let file: File = toml::from_str(&text).unwrap();
        let names: Vec<&str> = file.bus.iter().map(|bus| bus.name.as_str()).collect();
        assert_eq!(names, ["left", "right"]);
        assert_eq!(file.joint[0].bus.as_deref(), Some("left"));
    }

    #[test]
    fn bad_tables_name_the_joint_and_the_key() {
        for (from, to, says) in [
            ("direction = -1", "direction = 2", "joint l_knee: direction is 2, must be 1 or -1"),
            ("XM430-W350", "XM430", "joint l_knee: model is \"XM430\", must be one of AX-12A"),
            ("id = 14", "id = 253", "joint l_knee: id is 253"),
            ("upper_deg = 126.0", "upper_deg = -20.0", "joint l_knee: lower limit"),
            ("upper_deg = 126.0", "upper_deg = nan", "joint l_knee: a limit is not a finite"),
            ("upper_deg = 126.0", "upper_deg = 190.0", "joint l_knee: upper_deg is 190"),
            ("velocity_deg_s = 230.0", "velocity_deg_s = 0.0", "must be at least 0.05"),
            ("zero_deg = 180.0", "zero_deg = nan", "joint l_knee: zero_deg is NaN"),
            ("id = 14", "idd = 14", "unknown field `idd`"),
            ("\"dynamixel2\"", "\"dynamixel9\"", "unknown variant `dynamixel9`"),
            ("baud = 2_000_000", "baud = 2", "bus: baud is 2"),
            ("baud = 2_000_000", "baud = 57600\nwatchdog_ms = 0", "bus: watchdog_ms is 0"),
        ] {
            let error = complaint(from, to);
            assert!(error.contains(says), "{from} -> {to}: {error}");
        }
    }

    #[test]
    fn an_id_used_twice_is_refused() {
        let file: File = toml::from_str(GOOD).unwrap();
        let mut second = file.joint[0].clone();
        second.name = "r_knee".into();
        let error = servos(&[file.joint[0].clone(), second]).unwrap_err();
        assert!(error.to_string().contains("r_knee (id 14) clashes with l_knee (id 14)"));
    }

    #[test]
    fn an_id_used_twice_is_refused_where_one_of_the_joints_names_the_only_bus() {
        let file: File = toml::from_str(&GOOD.replace("[bus]", "[bus]\nname = \"main\"")).unwrap();
        let first = file.joint[0].clone();
        let second =
            ServoConfig { name: "r_knee".into(), bus: Some("main".into()), ..first.clone() };
        let error = layouts(file.bus, &[first, second]).unwrap_err().to_string();
        assert!(error.contains("r_knee (id 14) clashes with l_knee (id 14)"), "{error}");
    }

    #[test]
    fn motors_whose_replies_cannot_be_told_apart_are_refused() {
        let motor = |id: u8, reply_id: u16| ServoConfig {
            name: format!("joint_{id}"),
            id,
            model: "DM-J4310".into(),
            reply_id: Some(reply_id),
            lower_deg: -60.0,
            upper_deg: 60.0,
            velocity_deg_s: 100.0,
            acceleration_deg_s2: 1000.0,
            direction: 1,
            ..Default::default()
        };
        let error = servos(&[motor(1, 0), motor(17, 0)]).unwrap_err().to_string();
        assert!(error.contains("joint_17 (id 17) clashes with joint_1 (id 1)"), "{error}");
        assert!(error.contains("lowest four bits"), "{error}");
        assert!(servos(&[motor(1, 0), motor(17, 0x11)]).is_ok());
        assert!(servos(&[motor(1, 0), motor(2, 0)]).is_ok());
        // Others give the whole id.
        let whole = |id| ServoConfig { model: "RS01".into(), reply_id: None, ..motor(id, 0) };
        servos(&[whole(1), whole(17)]).unwrap();
    }
}
