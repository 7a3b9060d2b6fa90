//! What can go wrong on a bus and in its configuration.
//!
//! Every error that a servo causes names the joint and the id.

use std::fmt;

/// Which servo: the joint's name and the bus id.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServoId {
    /// The joint it moves.
    pub joint: String,
    /// Its bus id.
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

/// A robot file that cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ConfigError {
    /// One key of a `[[joint]]` table.
    #[error("joint {joint}: {key} is {actual}, must be {wanted}")]
    Joint {
        /// The joint's name.
        joint: String,
        /// The key in the table.
        key: &'static str,
        /// What it holds.
        actual: String,
        /// What it may hold.
        wanted: String,
    },
    /// Limits that do not fit together.
    #[error("joint {joint}: {reason}")]
    Limits {
        /// The joint's name.
        joint: String,
        /// What is wrong.
        reason: String,
    },
    /// A name or an id that is already taken.
    #[error(
        "joint {joint} (id {id}) clashes with {other} (id {other_id}): \
         names must be unique, and ids on one bus"
    )]
    Twice {
        /// The second joint.
        joint: String,
        /// Its id.
        id: u8,
        /// The first joint.
        other: String,
        /// Its id.
        other_id: u8,
    },
    /// No `[[joint]]` table at all.
    #[error("the robot has no [[joint]] table")]
    NoJoints,
    /// No `[bus]` table at all.
    #[error("the robot has no [bus] table")]
    NoBus,
    /// A place for a bus that is none.
    #[error("no such bus \"{actual}\": {reason}")]
    Port {
        /// What was given.
        actual: String,
        /// What is wrong, with the choices.
        reason: String,
    },
    /// One key of the `[bus]` table.
    #[error("bus: {key} is {actual}, must be {wanted}")]
    Bus {
        /// The key in the table.
        key: &'static str,
        /// What it holds.
        actual: String,
        /// What it may hold.
        wanted: &'static str,
    },
    /// More cycles a second than the wire carries.
    #[error(
        "{servos} servos at {baud} baud carry at most {limit_hz:.0} cycles a second \
         ({bytes} bytes each), but the robot asks for {asked_hz}: raise the baud or lower control_hz"
    )]
    Rate {
        /// How many servos share the bus.
        servos: usize,
        /// Bits a second.
        baud: u32,
        /// What the wire carries.
        limit_hz: f64,
        /// Bytes of one cycle.
        bytes: usize,
        /// What the configuration asks for.
        asked_hz: f64,
    },
    /// More cycles a second than a CAN bus carries.
    #[error(
        "{motors} motors on CAN at {bitrate} bit/s carry at most {nominal_hz:.0} cycles a second \
         ({bits} bits each; {worst_hz:.0} with the most stuff bits), but the robot asks for \
         {asked_hz}: raise the bitrate, use a second bus, or lower control_hz"
    )]
    CanRate {
        /// How many motors share the bus.
        motors: usize,
        /// Bits a second.
        bitrate: u32,
        /// What the wire carries without stuff bits.
        nominal_hz: f64,
        /// What it carries with the most stuff bits there can be.
        worst_hz: f64,
        /// Bits of one cycle without stuff bits.
        bits: u32,
        /// What the configuration asks for.
        asked_hz: f64,
    },
}

/// A bus operation that failed, after its retries.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// The port cannot be opened.
    #[error("cannot open {port}: {reason}{choices}")]
    Open {
        /// The port: a path, or `KIND:...` for CAN.
        port: String,
        /// What the system said.
        reason: String,
        /// Ports that exist, in words; empty when there are none.
        choices: String,
    },
    /// The port failed while in use: an adapter was unplugged, for instance.
    #[error("serial port {port} failed ({doing}): {reason}")]
    Port {
        /// The port's path.
        port: String,
        /// What was read or written.
        doing: &'static str,
        /// What the system said.
        reason: std::io::Error,
    },
    /// Servos that stay silent.
    #[error("no answer from {} ({doing}, tried {tries} times)", list(.servos))]
    Silent {
        /// Which servos.
        servos: Vec<ServoId>,
        /// What was read or written.
        doing: &'static str,
        /// How often it asked.
        tries: u32,
    },
    /// Only damaged replies came.
    #[error("only corrupt replies from {} ({doing}, tried {tries} times)", list(.servos))]
    Corrupt {
        /// Which servos.
        servos: Vec<ServoId>,
        /// What was read or written.
        doing: &'static str,
        /// How often it asked.
        tries: u32,
    },
    /// A servo refused an instruction.
    #[error("{servo} refused {doing}: {refusal}")]
    Refused {
        /// Which servo.
        servo: ServoId,
        /// What was read or written.
        doing: &'static str,
        /// What the servo said.
        refusal: Refusal,
    },
    /// A servo is not the model that the robot file names.
    #[error("{servo} is model number {actual}, but the robot file says {wanted} (number {number})")]
    WrongModel {
        /// Which servo.
        servo: ServoId,
        /// The number it answers, with its name where known.
        actual: String,
        /// The configured model.
        wanted: &'static str,
        /// The configured model's number.
        number: u16,
    },
    /// A servo has shut itself down.
    #[error("{servo} reports a hardware error: {flags}")]
    Hardware {
        /// Which servo.
        servo: ServoId,
        /// The named flags.
        flags: String,
    },
    /// A register did not keep what was written.
    #[error("{servo}: {register} reads {actual} after writing {wanted}")]
    ReadBack {
        /// Which servo.
        servo: ServoId,
        /// The register's name.
        register: &'static str,
        /// What was written.
        wanted: i64,
        /// What it holds.
        actual: i64,
    },
    /// Something a servo measures forbids torque.
    #[error("{servo}: {what} is {actual}, must be {wanted}")]
    Unfit {
        /// Which servo.
        servo: ServoId,
        /// The quantity.
        what: &'static str,
        /// Its value, with the unit.
        actual: String,
        /// Its range, with the unit.
        wanted: String,
    },
    /// A CAN link failed while in use: an adapter was unplugged, for instance.
    #[error("CAN link {port} failed ({doing}): {reason}")]
    Link {
        /// The port.
        port: String,
        /// What was read or written.
        doing: &'static str,
        /// What the system said.
        reason: std::io::Error,
    },
    /// The CAN controller has left the bus.
    #[error(
        "CAN link {port} is bus-off ({doing}): check wiring, termination and bitrate, \
         then restart the interface"
    )]
    BusOff {
        /// The port.
        port: String,
        /// What was read or written.
        doing: &'static str,
    },
    /// The transmit queue stayed full for a whole exchange's time.
    #[error(
        "CAN link {port}: the transmit queue stays full ({doing}); nobody acknowledges, \
         or it is too short (ip link set IFACE txqueuelen 100)"
    )]
    QueueFull {
        /// The port.
        port: String,
        /// What was to be sent.
        doing: &'static str,
    },
    /// A motor refused, in its own words.
    #[error("{servo} refused {doing}: {said}")]
    Said {
        /// Which motor.
        servo: ServoId,
        /// What was read or written.
        doing: &'static str,
        /// What it said.
        said: String,
    },
    /// More cycles a second than the wire carries without the fast read.
    #[error(
        "{why}, and {servos} servos at {baud} baud carry at most {limit_hz:.0} cycles a second \
         with a plain Sync Read ({bytes} bytes each), but the robot asks for {asked_hz}: \
         update the firmware, raise the baud or lower control_hz"
    )]
    PlainTooSlow {
        /// Why there is no fast read.
        why: String,
        /// How many servos share the bus.
        servos: usize,
        /// Bits a second.
        baud: u32,
        /// What the wire carries.
        limit_hz: f64,
        /// Bytes of one cycle.
        bytes: usize,
        /// What the robot file asks for.
        asked_hz: f64,
    },
    /// A motor that would go on if this program died.
    #[error(
        "{servo}: {why}: a killed program would leave it driving; set accept_no_watchdog = true \
         in the bus table to dance all the same"
    )]
    NoWatchdog {
        /// Which motor.
        servo: ServoId,
        /// Why there is none.
        why: String,
    },
    /// A target that is not a number. Nothing was sent.
    #[error("target for {servo} is {target}, not a finite number: nothing was sent")]
    NotFinite {
        /// Which servo.
        servo: ServoId,
        /// The value.
        target: f64,
    },
    /// A slice of the wrong length. Nothing was sent.
    #[error("the bus has {servos} servos, but {actual} {what} were given")]
    Length {
        /// Servos on the bus.
        servos: usize,
        /// Items given.
        actual: usize,
        /// Which items.
        what: &'static str,
    },
    /// One of several buses did not come back from what it was told to do.
    #[error("the bus of {} did not finish {doing} within {limit_s:.1} s", list(.servos))]
    Wedged {
        /// The servos on it.
        servos: Vec<ServoId>,
        /// What it was to do.
        doing: &'static str,
        /// The time it had, seconds.
        limit_s: f64,
    },
    /// A bus that cannot take one servo back while the others go on.
    #[error("{servo} cannot rejoin while the others go on")]
    NoReturn {
        /// Which servo.
        servo: ServoId,
    },
    /// A cycle on a bus that is not armed.
    #[error("the bus is not armed")]
    NotArmed,
    /// Torque off was sent, but these servos did not confirm it.
    #[error("torque may still be ON at {}: cut the power ({reason})", list(.servos))]
    TorqueUnverified {
        /// Which servos.
        servos: Vec<ServoId>,
        /// Why it is not known.
        reason: String,
    },
}

impl BusError {
    /// The same in short, where the reason is told already.
    pub(crate) fn brief(&self) -> String {
        match self {
            Self::TorqueUnverified { servos, .. } => {
                format!("torque may still be ON at {}: cut the power", list(servos))
            }
            error => error.to_string(),
        }
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
