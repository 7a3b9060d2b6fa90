//! Which servos a tool is for, and where each of them answers: those of a robot, or whoever
//! is on a port.

use crate::bus_tools::listen::{SerialListener, is_motion_sensor};
use crate::bus_tools::{ProtocolChoice, plug};
use crate::process::wrong_usage::{WrongUsage, misused};
use crate::robot::{BUILT_IN, Robot};
use anyhow::{Context, anyhow, bail};
use servodance_drivers::serial::family_of;
use servodance_drivers::serial::table::RegisterTable;
use servodance_drivers::serial::table::error::TableError;
use servodance_drivers::{FoundServo, Framing, SerialScanner, Servo};

/// What a user says by a robot and `--bus`, or by a port alone.
#[derive(Debug)]
pub enum ServoPlaces {
    /// The servos of a robot.
    Robot {
        /// The robot.
        robot: Box<Robot>,
        /// A listener for each of its buses.
        listeners: Vec<SerialListener>,
    },
    /// Whoever answers on a port.
    Port(SerialListener),
}

/// One servo and where it answers.
#[derive(Clone, Debug)]
pub struct ServoPlace {
    /// The joint, or the id where there is no robot.
    pub label: String,
    /// Its id.
    pub id: u8,
    /// Bits a second; every usual rate if `None`.
    pub baud: Option<u32>,
    /// What a robot file says of it.
    pub servo: Option<Servo>,
    listener: SerialListener,
    framing: Option<Framing>,
}

/// A servo that has answered, its registers, and the way to it.
pub(super) struct OpenServo {
    pub label: String,
    pub probe: SerialScanner,
    pub found: FoundServo,
    pub table: RegisterTable,
}

impl ServoPlaces {
    /// From what was typed: a robot where `bus` says where its servos are, else a port.
    /// `baud` is the one rate to look at on a port.
    pub fn new(typed: &str, bus: &[String], baud: Option<u32>) -> anyhow::Result<Self> {
        let is_robot = typed.ends_with(".toml") || BUILT_IN.iter().any(|r| r.name == typed);
        match (bus.is_empty(), is_robot) {
            (true, true) => misused!("{typed} is a robot: --bus says where its servos are"),
            (true, false) => {
                let listener = SerialListener::new(typed, baud, ProtocolChoice::All)?;
                Ok(Self::Port(listener))
            }
            (false, _) if baud.is_some() => {
                misused!("--baud is for a port; the rate of {typed} stands in its robot file")
            }
            (false, _) => {
                let robot = Box::new(Robot::load(typed)?);
                let listeners = listeners(&robot, bus)?;
                Ok(Self::Robot { robot, listeners })
            }
        }
    }

    /// The servo that `who` names: an id, or a joint of a robot.
    pub fn one(&self, who: &str) -> anyhow::Result<ServoPlace> {
        let id = who.parse().ok().filter(|id: &u8| *id <= 253);
        match self {
            Self::Port(_) => match id {
                Some(id) => self.by_id(id, None),
                None => {
                    misused!("\"{who}\" is no id (0 to 253); the name of a joint needs a robot")
                }
            },
            Self::Robot { robot, .. } => match id {
                Some(id) => self.by_id(id, None),
                None => {
                    let joint = robot.servo(who)?.name.clone();
                    let mut all = self.of_robot();
                    all.retain(|place| place.label == joint);
                    all.pop().with_context(|| format!("{joint} is on no bus"))
                }
            },
        }
    }

    /// The servo with this id, which spoke at `baud` once.
    pub fn by_id(&self, id: u8, baud: Option<u32>) -> anyhow::Result<ServoPlace> {
        match self {
            Self::Port(listener) => Ok(ServoPlace {
                label: format!("id {id}"),
                id,
                baud: baud.or(listener.baud()),
                servo: None,
                listener: listener.clone(),
                framing: None,
            }),
            Self::Robot { robot, .. } => {
                let mut places = self.of_robot();
                places.retain(|place| place.id == id);
                match places.len() {
                    0 => bail!("{} has no servo with id {id}", robot.name),
                    1 => Ok(places.remove(0)),
                    _ => misused!("{} has id {id} on several buses: name the joint", robot.name),
                }
            }
        }
    }

    /// The servo of a joint, where these are a robot's servos and it has that joint.
    pub fn joint(&self, name: &str) -> Option<ServoPlace> {
        self.of_robot().into_iter().find(|place| place.label == name)
    }

    /// All servos of the robot, or everyone who answers on the port.
    pub fn all(&self) -> anyhow::Result<Vec<ServoPlace>> {
        let Self::Port(listener) = self else { return Ok(self.of_robot()) };
        let mut places = Vec::new();
        for (framing, baud) in listener.usual_channels() {
            let everyone = listener.probe(framing, baud)?.everyone()?;
            for found in everyone.iter().filter(|found| !is_motion_sensor(found)) {
                let place = self.by_id(found.id, Some(baud))?;
                places.push(ServoPlace { framing: Some(framing), ..place });
            }
        }
        if places.is_empty() {
            bail!("{}: no servo answers at {}", listener.path(), listener.rates());
        }
        Ok(places)
    }

    /// The servos of the robot, in joint order; none of a port.
    fn of_robot(&self) -> Vec<ServoPlace> {
        let Self::Robot { robot, listeners } = self else { return Vec::new() };
        let mut places: Vec<(usize, ServoPlace)> = Vec::new();
        for (bus, listener) in robot.buses.iter().zip(listeners) {
            for (&joint, servo) in bus.joints.iter().zip(&bus.servos) {
                let place = ServoPlace {
                    label: servo.name.clone(),
                    id: servo.id,
                    baud: Some(bus.config.baud),
                    servo: Some(servo.clone()),
                    listener: listener.clone(),
                    framing: family_of(bus.config.kind).map(|family| family.framing()),
                };
                places.push((joint, place));
            }
        }
        places.sort_by_key(|(joint, _)| *joint);
        places.into_iter().map(|(_, place)| place).collect()
    }
}

impl ServoPlace {
    /// The framing and rate of the line, where they are known.
    pub(super) fn channel(&self) -> Option<(Framing, u32)> {
        self.framing.zip(self.baud)
    }

    /// The port and how long a servo may take to answer.
    pub(super) fn listener(&self) -> &SerialListener {
        &self.listener
    }

    /// Finds it and its registers. Refused: a servo that does not answer, or of a model whose
    /// registers are not known.
    pub(super) fn open(&self) -> anyhow::Result<OpenServo> {
        let (probe, found) = self.find()?;
        let table = found.table().ok_or_else(|| {
            let number = found.model_number;
            anyhow!("{}: the registers of model number {number} are not known", self.label)
        })?;
        Ok(OpenServo { label: self.label.clone(), probe, found, table })
    }

    fn find(&self) -> anyhow::Result<(SerialScanner, FoundServo)> {
        if let Some((framing, baud)) = self.channel() {
            let mut probe = self.listener.patient_probe(framing, baud)?;
            let found = probe.ping(self.id)?;
            let path = self.listener.path();
            let found = found.with_context(|| {
                format!(
                    "{} (id {}) does not answer at {baud} baud; `servodance scan {path}` lists who does",
                    self.label, self.id
                )
            })?;
            return Ok((probe, found));
        }
        self.listener.at(self.baud).find(self.id)
    }
}

impl OpenServo {
    /// Model, id and rate in words.
    pub fn who(&self) -> String {
        let FoundServo { id, baud, .. } = self.found;
        format!("{} with id {id} at {baud} baud", self.table.model)
    }
}

/// What the user typed is wrong, as wrong usage.
pub(super) fn usage(error: TableError) -> anyhow::Error {
    WrongUsage(error.to_string()).into()
}

/// A listener for each bus of a robot, all of them serial.
fn listeners(robot: &Robot, given: &[String]) -> anyhow::Result<Vec<SerialListener>> {
    let ports = plug::ports(robot, given)?;
    let mut listeners = Vec::with_capacity(ports.len());
    for (port, bus) in ports.iter().zip(&robot.buses) {
        listeners.push(SerialListener::of_bus(port, &bus.config)?);
    }
    Ok(listeners)
}
