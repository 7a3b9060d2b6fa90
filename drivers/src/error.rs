//! What can go wrong on a bus and in its configuration.
//!
//! Every error that a servo causes names the joint and the id.

use std::fmt;

#[allow(missing_docs)] // each field says its name
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServoId {
    pub joint: String,
    pub id: u8,
}

impl fmt::Display for ServoId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (id {})", self.joint, self.id)
    }
}

/// The error number in a status packet, as the vendor names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal(pub u8);

impl Refusal {
    /// The servo heard the instruction with a wrong checksum.
    pub const CRC: Self = Self(3);
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self.0 & 0x7F {
            1 => "result fail",
            2 => "unknown instruction",
            3 => "CRC error",
            4 => "data out of range",
            5 => "wrong data length",
            6 => "data beyond its limit register",
            7 => "access denied (EEPROM while torque is on, or a read-only register)",
            _ => "unknown error",
        };
        write!(f, "{name} (error {})", self.0 & 0x7F)
    }
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // each field stands in the message above it
pub enum ConfigError {
    #[error("joint {joint}: {key} is {actual}, must be {wanted}")]
    Joint { joint: String, key: &'static str, actual: String, wanted: String },
    #[error("joint {joint}: {reason}")]
    Limits { joint: String, reason: String },
    #[error(
        "joint {joint} (id {id}) clashes with {other} (id {other_id}): \
         names must be unique, and ids on one bus (of Damiao's motors with one reply_id the \
         lowest four bits of the ids)"
    )]
    Twice { joint: String, id: u8, other: String, other_id: u8 },
    #[error("the robot has no [[joint]] table")]
    NoJoints,
    #[error("the robot has no [bus] table")]
    NoBus,
    #[error("no such bus \"{actual}\": {reason}")]
    Port { actual: String, reason: String },
    #[error("bus: {key} is {actual}, must be {wanted}")]
    Bus { key: &'static str, actual: String, wanted: &'static str },
    #[error("imu: {key} is {actual}, must be {wanted}")]
    Imu { key: &'static str, actual: String, wanted: String },
    #[error(
        "{servos} servos at {baud} baud carry at most {limit_hz:.0} cycles a second \
         ({bytes} bytes each), but the robot asks for {asked_hz}: raise the baud or lower control_hz"
    )]
    Rate { servos: usize, baud: u32, limit_hz: f64, bytes: usize, asked_hz: f64 },
    #[error(
        "{motors} motors on CAN at {bitrate} bit/s carry at most {nominal_hz:.0} cycles a second \
         ({bits} bits each; {worst_hz:.0} with the most stuff bits), but the robot asks for \
         {asked_hz}: raise the bitrate, use a second bus, or lower control_hz"
    )]
    CanRate {
        motors: usize,
        bitrate: u32,
        nominal_hz: f64,
        worst_hz: f64,
        bits: u32,
        asked_hz: f64,
    },
}

/// What a bus operation gives, or why it failed after its retries.
pub type BusResult<T> = Result<T, BusError>;

#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // each field stands in the message above it
pub enum BusError {
    #[error("cannot open {port}: {reason}{choices}")]
    Open { port: String, reason: String, choices: String },
    #[error("serial port {port} failed ({doing}): {reason}")]
    Port { port: String, doing: &'static str, reason: std::io::Error },
    #[error("no answer from {} ({doing}, tried {tries} times){hint}", list(.servos))]
    Silent { servos: Vec<ServoId>, doing: &'static str, tries: u32, hint: String },
    #[error("only corrupt replies from {} ({doing}, tried {tries} times)", list(.servos))]
    Corrupt { servos: Vec<ServoId>, doing: &'static str, tries: u32 },
    #[error("{servo} refused {doing}: {refusal}")]
    Refused { servo: ServoId, doing: &'static str, refusal: Refusal },
    #[error("{servo} is model number {actual}, but the robot file says {wanted} (number {number})")]
    WrongModel { servo: ServoId, actual: String, wanted: &'static str, number: u16 },
    #[error("{servo} reports a hardware error: {flags}")]
    Hardware { servo: ServoId, flags: String },
    #[error("{} stopped by their own watchdog ({})", list(.servos), silence(*.silent_s))]
    Tripped { servos: Vec<ServoId>, silent_s: Option<f64> },
    #[error("{servo}: {register} reads {actual} after writing {wanted}")]
    ReadBack { servo: ServoId, register: &'static str, wanted: i64, actual: i64 },
    #[error("{servo}: {what} is {actual}, must be {wanted}")]
    Unfit { servo: ServoId, what: &'static str, actual: String, wanted: String },
    #[error("ROS 2 bridge {port} failed ({doing}): {reason}")]
    Bridge { port: String, doing: &'static str, reason: std::io::Error },
    #[error("CAN link {port} failed ({doing}): {reason}")]
    Link { port: String, doing: &'static str, reason: std::io::Error },
    #[error(
        "CAN link {port} is bus-off ({doing}): check wiring, termination and bitrate, \
         then restart the interface"
    )]
    BusOff { port: String, doing: &'static str },
    #[error(
        "CAN link {port}: the transmit queue stays full ({doing}); nobody acknowledges, \
         or it is too short (ip link set IFACE txqueuelen 100)"
    )]
    QueueFull { port: String, doing: &'static str },
    #[error("{servo} refused {doing}: {said}")]
    Said { servo: ServoId, doing: &'static str, said: String },
    #[error(
        "{why}, and {servos} servos at {baud} baud carry at most {limit_hz:.0} cycles a second \
         with a plain Sync Read ({bytes} bytes each), but the robot asks for {asked_hz}: \
         update the firmware, raise the baud or lower control_hz"
    )]
    PlainTooSlow {
        why: String,
        servos: usize,
        baud: u32,
        limit_hz: f64,
        bytes: usize,
        asked_hz: f64,
    },
    #[error(
        "{servo}: {why}: a killed program would leave it driving; set accept_no_watchdog = true \
         in the [bus] table of the robot file to move it all the same"
    )]
    NoWatchdog { servo: ServoId, why: String },
    #[error("target for {servo} is {target}, not a finite number: nothing was sent")]
    NotFinite { servo: ServoId, target: f64 },
    #[error("the bus has {servos} servos, but {actual} {what} were given")]
    Length { servos: usize, actual: usize, what: &'static str },
    #[error("the bus of {} did not finish {doing} within {limit_s:.1} s", list(.servos))]
    Wedged { servos: Vec<ServoId>, doing: &'static str, limit_s: f64 },
    #[error("{servo} cannot rejoin while the others go on")]
    NoReturn { servo: ServoId },
    #[error("the bus is not armed")]
    NotArmed,
    #[error("torque may still be ON at {}: cut the power ({reason})", list(.servos))]
    TorqueUnverified { servos: Vec<ServoId>, reason: String },
}

impl BusError {
    pub(crate) fn not_opened(port: &str, reason: impl ToString) -> Self {
        Self::Open { port: port.into(), reason: reason.to_string(), choices: String::new() }
    }

    /// Whether a servo's own settings or condition are what is wrong.
    pub(crate) fn is_of_the_servo(&self) -> bool {
        matches!(self, Self::Unfit { .. } | Self::WrongModel { .. } | Self::Hardware { .. })
    }

    pub(crate) fn brief(&self) -> String {
        match self {
            Self::TorqueUnverified { servos, .. } => {
                format!("torque may still be ON at {}: cut the power", list(servos))
            }
            error => error.to_string(),
        }
    }
}

/// Why a watchdog tripped: how long nothing was sent, seconds, where that is known.
fn silence(silent_s: Option<f64>) -> String {
    match silent_s {
        Some(silent_s) => format!("nothing was sent for {silent_s:.2} s"),
        None => "they heard nothing for too long".into(),
    }
}

/// `a (id 1), b (id 2)`; of many the first few: then it is the bus.
fn list(servos: &[ServoId]) -> String {
    const MOST: usize = 5;
    let named = if servos.len() > MOST { MOST - 1 } else { MOST };
    let names: Vec<String> = servos.iter().take(named).map(ServoId::to_string).collect();
    match servos.len().saturating_sub(named) {
        0 => names.join(", "),
        more => format!("{} and {more} more", names.join(", ")),
    }
}
