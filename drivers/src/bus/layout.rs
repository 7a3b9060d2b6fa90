//! Which joints are on which bus.
//!
//! A robot has its joints in one order; every bus knows some of them. Refused,
//! with the joint or bus named: a joint on no bus or an unknown one, a bus
//! without joints, names used twice, ids used twice on one bus.

use servodance_types::JointState;

use crate::bus::config::BusConfig;
use crate::bus::kind::BusKind;
use crate::error::ConfigError;
use crate::imu::{ImuConfig, ImuKind};
use crate::servo::Servo;
use crate::servo::config::{ServoConfig, servos};

#[allow(missing_docs)] // each field says its name
#[derive(Clone, Debug, PartialEq)]
pub struct BusLayout {
    pub config: BusConfig,
    pub servos: Vec<Servo>,
    pub joints: Vec<usize>,
}

impl BusLayout {
    /// Picks this bus's values out of those of all joints.
    pub fn gather<T: Copy>(&self, all: &[T], own: &mut Vec<T>) {
        own.clear();
        own.extend(self.joints.iter().filter_map(|&joint| all.get(joint)));
    }

    /// Puts this bus's states where all joints have theirs.
    pub fn scatter(&self, own: &[JointState], all: &mut [JointState]) {
        for (&joint, state) in self.joints.iter().zip(own) {
            if let Some(place) = all.get_mut(joint) {
                *place = *state;
            }
        }
    }
}

/// All joints of a robot in order, and the same bus by bus.
pub fn layouts(
    buses: Vec<BusConfig>,
    joints: &[ServoConfig],
) -> Result<(Vec<Servo>, Vec<BusLayout>), ConfigError> {
    let names = checked_names(&buses)?;
    let all = servos(joints)?;
    let mut layouts: Vec<BusLayout> = Vec::with_capacity(buses.len());
    for config in buses {
        layouts.push(BusLayout {
            config: config.checked()?,
            servos: Vec::new(),
            joints: Vec::new(),
        });
    }
    for (place, (joint, servo)) in joints.iter().zip(&all).enumerate() {
        let bus = match &joint.bus {
            None if layouts.len() == 1 => Some(0),
            None => None,
            Some(name) => names.iter().position(|known| known == name),
        };
        let layout = bus.and_then(|bus| layouts.get_mut(bus));
        let layout = layout.ok_or_else(|| ConfigError::Joint {
            joint: joint.name.clone(),
            key: "bus",
            actual: format!("{:?}", joint.bus.as_deref().unwrap_or_default()),
            wanted: match names.join(", ").as_str() {
                "" => "left out: the robot's one bus has no name".into(),
                names => format!("one of {names}"),
            },
        })?;
        layout.servos.push(servo.clone());
        layout.joints.push(place);
    }
    match layouts.iter().find(|layout| layout.joints.is_empty()) {
        Some(idle) => Err(ConfigError::Bus {
            key: "name",
            actual: format!("{:?}", idle.config.name),
            wanted: "the bus of at least one joint",
        }),
        None => Ok((all, layouts)),
    }
}

/// Gives a motion sensor to the bus that reads it. Refused: a bus that is unknown or of
/// another kind, an id that a servo has or that there is none, a turn that is no number.
pub fn assign_imu(imu: &ImuConfig, buses: &mut [BusLayout]) -> Result<(), ConfigError> {
    let bad = |key, actual: String, wanted: String| ConfigError::Imu { key, actual, wanted };
    if imu.mounting_deg.iter().any(|turn| turn.is_nan() || turn.abs() > 360.0) {
        let actual = format!("{:?}", imu.mounting_deg);
        return Err(bad("mounting_deg", actual, "three angles of -360 to 360".into()));
    }
    let alone = |what: &str| match &imu.bus {
        Some(bus) => Err(bad("bus", format!("{bus:?}"), format!("left out: {what}"))),
        None => Ok(()),
    };
    let port = |port: &Option<String>| match port.as_deref() {
        None | Some("") => {
            let wanted = "the serial port that the sensor is on, such as /dev/ttyUSB1".into();
            Err(bad("port", format!("{:?}", imu.port.as_deref().unwrap_or_default()), wanted))
        }
        Some(_) => Ok(()),
    };
    let needed = match imu.kind {
        ImuKind::Simulated => return alone("it is on none"),
        ImuKind::Bno055 | ImuKind::Bno085 => {
            alone("it has a port of its own")?;
            return port(&imu.port);
        }
        ImuKind::Witmotion if imu.port.is_some() => {
            alone("it has a port of its own")?;
            return port(&imu.port);
        }
        ImuKind::Witmotion => "a CAN bus; or say port, if it is on a serial port",
        ImuKind::Opencr => "a bus of kind dynamixel2",
    };
    let names: Vec<String> = buses.iter().map(|bus| bus.config.name.clone()).collect();
    let found = match (&imu.bus, buses) {
        (None, [only]) => Some(only),
        (None, _) => None,
        (Some(name), buses) => buses.iter_mut().find(|bus| bus.config.name == *name),
    };
    let Some(bus) = found else {
        let actual = format!("{:?}", imu.bus.as_deref().unwrap_or_default());
        return Err(bad("bus", actual, format!("one of {}", names.join(", "))));
    };
    let fits = match imu.kind {
        ImuKind::Witmotion => bus.config.kind.is_can(),
        _ => bus.config.kind == BusKind::Dynamixel2,
    };
    if !fits {
        let actual = format!("{:?}", bus.config.name);
        return Err(bad("bus", actual, needed.into()));
    }
    let taken = bus.servos.iter().any(|servo| servo.id == imu.id());
    if imu.id() > 252 || taken {
        let wanted = "an id of 0 to 252 that no servo has".into();
        return Err(bad("id", imu.id().to_string(), wanted));
    }
    bus.config.imu = Some(imu.clone());
    Ok(())
}

fn checked_names(buses: &[BusConfig]) -> Result<Vec<String>, ConfigError> {
    let names: Vec<String> = buses.iter().map(|bus| bus.name.clone()).collect();
    let bad = |actual: &str, wanted| ConfigError::Bus {
        key: "name",
        actual: format!("{actual:?}"),
        wanted,
    };
    for (place, name) in names.iter().enumerate() {
        if name.contains(['=', ':', ' ']) {
            return Err(bad(name, "a name without = : and blanks"));
        }
        if buses.len() > 1 && (name.is_empty() || names[..place].contains(name)) {
            return Err(bad(name, "a name of its own for each of several buses"));
        }
    }
    if buses.is_empty() {
        return Err(ConfigError::NoBus);
    }
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bus(name: &str) -> BusConfig {
        BusConfig { name: name.into(), ..BusConfig::dynamixel2(1_000_000) }
    }

    fn joint(name: &str, id: u8, bus: Option<&str>) -> ServoConfig {
        ServoConfig {
            name: name.into(),
            id,
            bus: bus.map(Into::into),
            model: "XM430-W350".into(),
            direction: 1,
            zero_deg: 180.0,
            lower_deg: -60.0,
            upper_deg: 60.0,
            velocity_deg_s: 100.0,
            acceleration_deg_s2: 1000.0,
            ..Default::default()
        }
    }

    #[test]
    fn ids_may_repeat_on_different_buses() {
        let joints = [
            joint("a", 1, Some("left")),
            joint("b", 1, Some("right")),
            joint("c", 2, Some("left")),
        ];
        let (all, layouts) = layouts(vec![bus("left"), bus("right")], &joints).unwrap();
        assert_eq!(all.len(), 3);
        assert_eq!((&layouts[0].joints[..], &layouts[1].joints[..]), (&[0, 2][..], &[1][..]));
        let mut own = Vec::new();
        layouts[0].gather(&[10, 20, 30], &mut own);
        assert_eq!(own, [10, 30]);
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let two = || vec![bus("left"), bus("right")];
        let one = |joint: ServoConfig| [joint, joint_b()];
        let joint_b = || joint_b();
        for (buses, joints, says) in [
            (
                two(),
                one(joint("a", 1, Some("top"))),
                "joint a: bus is \"top\", must be one of left, right",
            ),
            (two(), one(joint("a", 1, None)), "joint a: bus is \"\""),
            (two(), one(joint("a", 2, Some("right"))), "joint b (id 2) clashes with a (id 2)"),
            (two(), one(joint("a", 1, Some("right"))), "bus: name is \"left\""),
            (vec![bus(""), bus("right")], one(joint("a", 1, None)), "a name of its own"),
            (vec![bus("right"), bus("right")], one(joint("a", 1, None)), "a name of its own"),
            (
                vec![bus("")],
                [joint("a", 1, None), joint_b()],
                "joint b: bus is \"right\", must be left out",
            ),
        ] {
            let error = layouts(buses, &joints).unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
        }
    }

    #[test]
    fn a_motion_sensor_that_cannot_be_read_is_refused_with_its_key() {
        let refused = |text: &str| {
            let (_, mut buses) = layouts(vec![bus("")], &[joint("a", 1, None)]).unwrap();
            let imu: ImuConfig = toml::from_str(text).unwrap();
            assign_imu(&imu, &mut buses).err().map(|error| error.to_string())
        };
        assert_eq!(refused("kind = \"opencr\""), None);
        assert_eq!(refused("kind = \"simulated\""), None);
        for (text, says) in [
            ("kind = \"opencr\"\nid = 1", "imu: id is 1"),
            ("kind = \"opencr\"\nid = 254", "imu: id is 254"),
            ("kind = \"opencr\"\nbus = \"left\"", "imu: bus is \"left\""),
            ("kind = \"simulated\"\nbus = \"left\"", "left out"),
            ("kind = \"opencr\"\nmounting_deg = [0.0, nan, 0.0]", "mounting_deg"),
        ] {
            let error = refused(text).unwrap_or_default();
            assert!(error.contains(says), "{text}: {error}");
        }
    }

    fn joint_b() -> ServoConfig {
        joint("b", 2, Some("right"))
    }
}
