//! The `[bus]` and `[[joint]]` tables of a robot file, and their check.
//!
//! The one place where degrees exist. Refused, with the joint named: unknown
//! keys and models, a direction other than 1 or -1, limits that are not finite
//! or inverted or out of the servo's single turn, ids used twice.

use std::fmt;
use std::time::Duration;

use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use servodance_types::JointLimits;

use crate::can::MotorSettings;
use crate::error::ConfigError;
use crate::model::{MODELS, Model};
use crate::reply_clock::ReplyClock;
use crate::servo::Servo;

/// One `[[joint]]` table. The keys from `kp` on are for CAN motors only, and
/// `firmware` is for serial servos only.
#[derive(Clone, Debug, Default, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct ServoConfig {
    /// The joint's name in the robot description.
    pub name: String,
    /// The bus it is on; left out where there is one bus only.
    #[serde(default)]
    pub bus: Option<String>,
    /// Bus id: 0 to 252 on a serial bus, 1 to 127 on CAN (ODrive 0 to 63).
    pub id: u8,
    /// Model name, e.g. `XM430-W350`.
    pub model: String,
    /// The firmware that a serial servo must have, as `servodance scan` shows
    /// it; any if left out.
    pub firmware: Option<u8>,
    /// +1 or -1: the servo's direction against the joint axis.
    pub direction: i8,
    /// Servo angle, degrees (0 to 360, centre 180), where the joint reads zero;
    /// for a CAN motor its own angle after the gear, of either sign.
    pub zero_deg: f64,
    /// Lowest joint position, degrees.
    pub lower_deg: f64,
    /// Highest joint position, degrees.
    pub upper_deg: f64,
    /// Highest speed, degrees a second.
    pub velocity_deg_s: f64,
    /// Highest acceleration, degrees a second squared.
    pub acceleration_deg_s2: f64,
    /// Position gain, newton metres a radian; fits the model if left out.
    pub kp: Option<f64>,
    /// Damping, newton metre seconds a radian; fits the model if left out.
    pub kd: Option<f64>,
    /// Most torque, newton metres; the model's if left out.
    pub torque_limit_nm: Option<f64>,
    /// The motor's position range, +- radians, where it differs from the model's.
    pub position_range_rad: Option<f64>,
    /// The motor's velocity range, +- radians a second, likewise.
    pub velocity_range_rad_s: Option<f64>,
    /// The motor's torque range, +- newton metres, likewise.
    pub torque_range_nm: Option<f64>,
    /// Turns of the motor for one of the joint: ODrive and CiA 402. Default 1.
    pub gear_ratio: Option<f64>,
    /// The id that replies come with: Damiao's MST_ID. Default 0.
    pub reply_id: Option<u16>,
    /// Position increments a turn of the motor: CiA 402. Default 65536.
    pub counts_per_turn: Option<f64>,
}

/// Which protocol a bus speaks.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum BusKind {
    /// Dynamixel Protocol 2.0 over a serial port.
    Dynamixel2,
    /// Dynamixel Protocol 1.0 (AX, and MX as they left the factory) over a serial port.
    Dynamixel1,
    /// Feetech STS servos over a serial port.
    Feetech,
    /// CubeMars and Damiao motors in MIT mode, on CAN.
    Mit,
    /// RobStride motors, on CAN.
    Robstride,
    /// ODrive controllers (CANSimple, firmware 0.6), on CAN.
    Odrive,
    /// CiA 402 drives (CANopen, cyclic synchronous position), on CAN.
    Cia402,
}

impl BusKind {
    /// The lowest and highest id of a servo.
    fn ids(self) -> (u8, u8) {
        match self {
            Self::Dynamixel2 | Self::Dynamixel1 | Self::Feetech => (0, 252),
            Self::Mit | Self::Robstride | Self::Cia402 => (1, 127),
            Self::Odrive => (0, 63),
        }
    }

    /// Whether it is on CAN; otherwise on a serial port.
    pub fn is_can(self) -> bool {
        matches!(
            self,
            Self::Mit | Self::Robstride | Self::Odrive | Self::Cia402
        )
    }
}

/// The `[bus]` table, or one of several `[[bus]]`.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct BusConfig {
    /// The name that joints and `--bus` call it by; may be empty where there is one bus only.
    #[serde(default)]
    pub name: String,
    /// The protocol.
    pub kind: BusKind,
    /// Bits a second; `bitrate` says the same.
    #[serde(alias = "bitrate")]
    pub baud: u32,
    /// How long a reply may be late, milliseconds, on top of its time on the wire.
    #[serde(default = "default_reply_timeout_ms")]
    pub reply_timeout_ms: f64,
    /// By whose clock; a file cannot say.
    #[serde(skip)]
    pub reply_clock: ReplyClock,
    /// How often a failed exchange is tried again before it is an error.
    #[serde(default = "default_retries")]
    pub retries: u32,
    /// The servos stop by themselves after this much silence, milliseconds
    /// (20 to 2540, in steps of 20).
    #[serde(default = "default_watchdog_ms")]
    pub watchdog_ms: u32,
    /// Arm even servos that have no watchdog and would go on after a program
    /// that is killed.
    #[serde(default)]
    pub accept_no_watchdog: bool,
    /// ODrive: endpoint ids of `axis0.config.watchdog_timeout` and
    /// `axis0.config.enable_watchdog`, from the firmware's `flat_endpoints.json`.
    #[serde(default)]
    pub watchdog_endpoints: Option<[u16; 2]>,
    /// Control cycles a second, which the robot file has elsewhere; `None` where
    /// nobody asks for a rate.
    #[serde(skip)]
    pub control_hz: Option<f64>,
}

fn default_reply_timeout_ms() -> f64 {
    20.0
}

fn default_retries() -> u32 {
    2
}

/// A killed program's servos are to stand within 200 ms; its last commands are
/// still under way, and a Dynamixel counts in steps of 20 ms.
fn default_watchdog_ms() -> u32 {
    160
}

impl BusConfig {
    /// A Dynamixel Protocol 2.0 bus with the defaults of the robot file.
    pub fn dynamixel2(baud: u32) -> Self {
        Self::of_kind(BusKind::Dynamixel2, baud)
    }

    /// A bus with the defaults of the robot file.
    pub fn of_kind(kind: BusKind, baud: u32) -> Self {
        Self {
            name: String::new(),
            kind,
            baud,
            reply_timeout_ms: default_reply_timeout_ms(),
            reply_clock: ReplyClock::Wall,
            retries: default_retries(),
            watchdog_ms: default_watchdog_ms(),
            accept_no_watchdog: false,
            watchdog_endpoints: None,
            control_hz: None,
        }
    }

    /// The longest that a cycle of `servos` servos may take, every retry, and
    /// the search for who is silent, included.
    pub fn longest_cycle(&self, servos: usize) -> Duration {
        const SEND_S: f64 = 0.1;
        const REPLY_BYTES: f64 = 40.0;
        let exchange_s = self.reply_timeout_ms * 1e-3 + SEND_S;
        let wire_s = servos as f64 * REPLY_BYTES * 10.0 / f64::from(self.baud);
        let exchanges = f64::from(self.retries + 1) + servos as f64;
        Duration::from_secs_f64(exchanges * (exchange_s + wire_s))
    }

    /// The same configuration, if it is usable.
    pub fn checked(self) -> Result<Self, ConfigError> {
        let bad = |key, actual: String, wanted| ConfigError::Bus {
            key,
            actual,
            wanted,
        };
        if !(9_600..=10_000_000).contains(&self.baud) {
            return Err(bad("baud", self.baud.to_string(), "9600 to 10000000"));
        }
        if !(self.reply_timeout_ms > 0.0 && self.reply_timeout_ms <= 60_000.0) {
            let actual = self.reply_timeout_ms.to_string();
            return Err(bad("reply_timeout_ms", actual, "above 0, at most 60000"));
        }
        if self.retries > 10 {
            return Err(bad("retries", self.retries.to_string(), "0 to 10"));
        }
        if !(20..=2540).contains(&self.watchdog_ms) || !self.watchdog_ms.is_multiple_of(20) {
            let actual = self.watchdog_ms.to_string();
            return Err(bad("watchdog_ms", actual, "20 to 2540 in steps of 20"));
        }
        Ok(self)
    }
}

impl ServoConfig {
    /// The servo in radians, if the table makes sense.
    pub fn servo(&self) -> Result<Servo, ConfigError> {
        let bad = |key, actual: String, wanted: String| ConfigError::Joint {
            joint: self.name.clone(),
            key,
            actual,
            wanted,
        };
        if self.name.is_empty() {
            return Err(bad("name", "\"\"".into(), "a joint name".into()));
        }
        let model = Model::from_name(&self.model).ok_or_else(|| {
            let names: Vec<_> = MODELS.iter().map(|model| model.name).collect();
            let wanted = format!("one of {}", names.join(", "));
            bad("model", format!("{:?}", self.model), wanted)
        })?;
        let (lowest, highest) = model.kind.ids();
        if !(lowest..=highest).contains(&self.id) {
            let wanted = format!("{lowest} to {highest}");
            return Err(bad("id", self.id.to_string(), wanted));
        }
        if self.direction.abs() != 1 {
            let actual = self.direction.to_string();
            return Err(bad("direction", actual, "1 or -1".into()));
        }
        let zeros = if model.motor.is_some() {
            -3.6e4..=3.6e4
        } else {
            0.0..=360.0
        };
        if !zeros.contains(&self.zero_deg) {
            let wanted = format!("{} to {}", zeros.start(), zeros.end());
            return Err(bad("zero_deg", self.zero_deg.to_string(), wanted));
        }
        let limits = JointLimits {
            lower_rad: self.lower_deg.to_radians(),
            upper_rad: self.upper_deg.to_radians(),
            velocity_rad_s: self.velocity_deg_s.to_radians(),
            acceleration_rad_s2: self.acceleration_deg_s2.to_radians(),
        }
        .checked()
        .map_err(|reason| ConfigError::Limits {
            joint: self.name.clone(),
            reason,
        })?;
        let servo = Servo {
            name: self.name.clone(),
            id: self.id,
            model,
            firmware: self.firmware,
            direction: f64::from(self.direction),
            zero_rad: self.zero_deg.to_radians(),
            limits,
            motor: self.motor_settings(model)?,
        };
        match &servo.motor {
            Some(motor) => self.check_motor_reach(&servo, motor)?,
            None => return self.check_reach(servo),
        }
        Ok(servo)
    }

    /// A CAN motor's settings; a serial servo may have none.
    fn motor_settings(&self, model: &Model) -> Result<Option<MotorSettings>, ConfigError> {
        if let Some(stock) = &model.motor {
            if self.firmware.is_some() {
                return Err(ConfigError::Joint {
                    joint: self.name.clone(),
                    key: "firmware",
                    actual: "given".into(),
                    wanted: format!("left out: {} is a CAN motor", model.name),
                });
            }
            return MotorSettings::resolve(self, stock).map(Some);
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
            Some((key, _)) => Err(ConfigError::Joint {
                joint: self.name.clone(),
                key,
                actual: "given".into(),
                wanted: format!("left out: {} is no CAN motor", model.name),
            }),
        }
    }

    /// The limits must lie within what the motor's numbers can say.
    fn check_motor_reach(&self, servo: &Servo, motor: &MotorSettings) -> Result<(), ConfigError> {
        let bad = |key, actual: String, wanted: String| ConfigError::Joint {
            joint: self.name.clone(),
            key,
            actual,
            wanted,
        };
        let range = motor.model.position_rad;
        for (key, joint_deg) in [("lower_deg", self.lower_deg), ("upper_deg", self.upper_deg)] {
            let motor_rad = servo.motor_rad(joint_deg.to_radians());
            if motor_rad.abs() > range {
                let motor_deg = motor_rad.to_degrees();
                return Err(bad(
                    key,
                    format!("{joint_deg} (motor angle {motor_deg:.1} degrees)"),
                    format!("a motor angle of +-{:.1} degrees", range.to_degrees()),
                ));
            }
        }
        let fastest_deg_s = motor.model.velocity_rad_s.to_degrees();
        if self.velocity_deg_s > fastest_deg_s {
            let wanted = format!("at most {fastest_deg_s:.0}, the motor's range");
            return Err(bad(
                "velocity_deg_s",
                self.velocity_deg_s.to_string(),
                wanted,
            ));
        }
        Ok(())
    }

    /// The limits must lie within the servo's single turn.
    fn check_reach(&self, servo: Servo) -> Result<Servo, ConfigError> {
        let last_tick_rad = servo.model.last_tick() * servo.model.rad_per_tick;
        for (key, joint_deg) in [("lower_deg", self.lower_deg), ("upper_deg", self.upper_deg)] {
            let servo_rad = servo.zero_rad + servo.direction * joint_deg.to_radians();
            if !(-1e-9..=last_tick_rad + 1e-9).contains(&servo_rad) {
                return Err(ConfigError::Joint {
                    joint: self.name.clone(),
                    key,
                    actual: format!(
                        "{joint_deg} (servo angle {:.1} degrees)",
                        servo_rad.to_degrees()
                    ),
                    wanted: format!(
                        "a servo angle of 0 to {:.1} degrees",
                        last_tick_rad.to_degrees()
                    ),
                });
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

/// Reads `[bus]` or several `[[bus]]`.
pub fn one_or_several<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<BusConfig>, D::Error> {
    struct Buses;
    impl<'de> Visitor<'de> for Buses {
        type Value = Vec<BusConfig>;

        fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
            f.write_str("a [bus] table or several [[bus]] tables")
        }

        fn visit_map<A: MapAccess<'de>>(self, table: A) -> Result<Self::Value, A::Error> {
            Ok(vec![BusConfig::deserialize(MapAccessDeserializer::new(
                table,
            ))?])
        }

        fn visit_seq<A: SeqAccess<'de>>(self, tables: A) -> Result<Self::Value, A::Error> {
            Vec::deserialize(SeqAccessDeserializer::new(tables))
        }
    }
    from.deserialize_any(Buses)
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
            other.name == servo.name || (other_config.bus == config.bus && other.id == servo.id)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::layouts;

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
            (
                "direction = -1",
                "direction = 2",
                "joint l_knee: direction is 2, must be 1 or -1",
            ),
            (
                "XM430-W350",
                "XM430",
                "joint l_knee: model is \"XM430\", must be one of AX-12A",
            ),
            ("id = 14", "id = 253", "joint l_knee: id is 253"),
            (
                "upper_deg = 126.0",
                "upper_deg = -20.0",
                "joint l_knee: lower limit",
            ),
            (
                "upper_deg = 126.0",
                "upper_deg = nan",
                "joint l_knee: a limit is not a finite",
            ),
            (
                "upper_deg = 126.0",
                "upper_deg = 190.0",
                "joint l_knee: upper_deg is 190",
            ),
            (
                "velocity_deg_s = 230.0",
                "velocity_deg_s = 0.0",
                "must be above zero",
            ),
            (
                "zero_deg = 180.0",
                "zero_deg = nan",
                "joint l_knee: zero_deg is NaN",
            ),
            ("id = 14", "idd = 14", "unknown field `idd`"),
            (
                "\"dynamixel2\"",
                "\"dynamixel9\"",
                "unknown variant `dynamixel9`",
            ),
            ("baud = 2_000_000", "baud = 2", "bus: baud is 2"),
            (
                "baud = 2_000_000",
                "baud = 57600\nwatchdog_ms = 0",
                "bus: watchdog_ms is 0",
            ),
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
        assert!(
            error
                .to_string()
                .contains("r_knee (id 14) clashes with l_knee (id 14)")
        );
    }
}
