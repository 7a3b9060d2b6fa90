//! What is simulated: servo models, one servo, the options of a bus.
//!
//! Torque, speed and current are the vendor's data sheet figures at the
//! nominal voltage, rounded.

use std::f64::consts::{PI, TAU};
use std::net::SocketAddrV4;
use std::path::PathBuf;

use crate::layout::{self, Layout};
use servodance_drivers::can::MotorSettings;
use servodance_drivers::{BusKind, Servo};
use servodance_types::JointLimits;

/// What a servo model does at its nominal voltage.
#[derive(Debug, PartialEq)]
pub struct ServoModel {
    /// The vendor's name.
    pub name: &'static str,
    /// What it answers to a ping.
    pub number: u16,
    /// Stall torque, newton metres.
    pub stall_torque_nm: f64,
    /// No-load speed, revolutions a minute.
    pub no_load_rpm: f64,
    /// Stall current, amperes.
    pub stall_current_a: f64,
    /// Nominal voltage.
    pub voltage_v: f64,
    /// Amperes a unit of current; 0 where the model has no current sensor.
    pub current_a_per_unit: f64,
}

/// Factory settings that a family of models shares.
#[derive(Debug)]
pub(crate) struct Family {
    pub temperature_limit: i64,
    pub min_voltage: i64,
    pub max_voltage: i64,
    pub current_limit: i64,
    pub velocity_limit: i64,
    pub shutdown: i64,
    pub velocity_i: i64,
    pub velocity_p: i64,
    pub position_p: i64,
    pub top_baud_code: i64,
}

const X430: Family = Family {
    temperature_limit: 80,
    min_voltage: 95,
    max_voltage: 160,
    current_limit: 1193,
    velocity_limit: 350,
    shutdown: 52,
    velocity_i: 1920,
    velocity_p: 100,
    position_p: 800,
    top_baud_code: 7,
};

const X330: Family = Family {
    temperature_limit: 70,
    min_voltage: 35,
    max_voltage: 70,
    current_limit: 1750,
    velocity_limit: 445,
    shutdown: 53,
    velocity_i: 1600,
    velocity_p: 180,
    position_p: 400,
    top_baud_code: 6,
};

const MX: Family = Family {
    velocity_limit: 380,
    position_p: 850,
    ..X430
};

const STS3215: u16 = 777;

/// The rates of the X series' baud register, in the order of its values.
pub(crate) const X_BAUDS: [u32; 8] = [
    9_600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000,
];
const STS_BAUDS: [u32; 8] = [
    1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400,
];
/// AX up to 1 Mbps, MX beyond.
const PROTOCOL1_BAUDS: [u32; 13] = [
    9_600, 19_200, 57_600, 115_200, 200_000, 250_000, 400_000, 500_000, 1_000_000, 2_000_000,
    2_250_000, 2_500_000, 3_000_000,
];

const fn model(
    name: &'static str,
    number: u16,
    stall_torque_nm: f64,
    no_load_rpm: f64,
    stall_current_a: f64,
    voltage_v: f64,
    current_a_per_unit: f64,
) -> ServoModel {
    ServoModel {
        name,
        number,
        stall_torque_nm,
        no_load_rpm,
        stall_current_a,
        voltage_v,
        current_a_per_unit,
    }
}

/// Every model that can be simulated.
pub const MODELS: &[ServoModel] = &[
    model("AX-12A", 12, 1.5, 59.0, 1.5, 12.0, 0.0),
    model("AX-18A", 18, 1.8, 97.0, 2.2, 12.0, 0.0),
    model("MX-28(1.0)", 29, 2.5, 55.0, 1.4, 12.0, 0.0),
    model("MX-64(1.0)", 310, 6.0, 63.0, 4.1, 12.0, 0.0),
    model("MX-106(1.0)", 320, 8.4, 45.0, 5.2, 12.0, 0.0),
    model("MX-64", 311, 6.0, 63.0, 4.1, 12.0, 3.36e-3),
    model("MX-106", 321, 8.4, 45.0, 5.2, 12.0, 3.36e-3),
    model("MX-28", 30, 2.5, 55.0, 1.4, 12.0, 0.0),
    model("XH430-W350", 1000, 3.4, 30.0, 1.3, 12.0, 2.69e-3),
    model("XH430-W210", 1010, 2.5, 50.0, 1.3, 12.0, 2.69e-3),
    model("XM430-W350", 1020, 4.1, 46.0, 2.3, 12.0, 2.69e-3),
    model("XM430-W210", 1030, 3.0, 77.0, 2.3, 12.0, 2.69e-3),
    model("XL430-W250", 1060, 1.5, 61.0, 1.4, 12.0, 0.0),
    model("XC430-W150", 1070, 1.6, 106.0, 1.4, 12.0, 0.0),
    model("XH540-W270", 1100, 9.9, 39.0, 4.9, 12.0, 2.69e-3),
    model("XM540-W270", 1120, 10.6, 30.0, 4.4, 12.0, 2.69e-3),
    model("XL330-M077", 1190, 0.215, 383.0, 1.47, 5.0, 1e-3),
    model("XL330-M288", 1200, 0.52, 103.0, 1.47, 5.0, 1e-3),
    model("XC330-T181", 1210, 0.76, 104.0, 0.8, 12.0, 1e-3),
    model("XC330-T288", 1220, 0.95, 69.0, 0.8, 12.0, 1e-3),
    model("XC330-M181", 1230, 0.6, 129.0, 1.8, 5.0, 1e-3),
    model("XC330-M288", 1240, 0.93, 81.0, 1.8, 5.0, 1e-3),
    model("STS3215", STS3215, 5.47, 46.4, 2.7, 12.0, 6.5e-3),
];

impl ServoModel {
    /// The model with this number.
    pub fn from_number(number: u16) -> Option<&'static ServoModel> {
        MODELS.iter().find(|model| model.number == number)
    }

    /// Whether it is a servo of byte memory, with Protocol 1 framing.
    pub fn is_protocol1(&self) -> bool {
        matches!(self.number, 12 | 18 | 29 | 310 | 320 | STS3215)
    }

    /// The memory of such a servo.
    pub(crate) fn layout(&self) -> &'static Layout {
        match self.number {
            STS3215 => &layout::STS,
            12 | 18 => &layout::AX,
            _ => &layout::MX1,
        }
    }

    /// Whether a line can have this rate.
    pub(crate) fn takes_baud(&self, baud: u32) -> bool {
        match self.number {
            STS3215 => STS_BAUDS.contains(&baud),
            12 | 18 => baud <= 1_000_000 && PROTOCOL1_BAUDS.contains(&baud),
            _ => PROTOCOL1_BAUDS.contains(&baud),
        }
    }

    /// Play of the gear, radians: 15 arc minutes for the models of which the
    /// vendor's manual says so, none for the others.
    pub fn backlash_rad(&self) -> f64 {
        match self.number {
            1020 | 1030 | 1100 | 1120 => 15.0 / 60.0 * PI / 180.0,
            _ => 0.0,
        }
    }

    /// No-load speed, radians a second.
    pub fn no_load_rad_s(&self) -> f64 {
        self.no_load_rpm * TAU / 60.0
    }

    pub(crate) fn family(&self) -> &'static Family {
        match self.number {
            0..1000 => &MX,
            1190..1210 | 1230..1250 => &X330,
            _ => &X430,
        }
    }

    /// Blocks of indirect addresses: first pointer, first data byte, count.
    pub(crate) fn indirect_blocks(&self) -> &'static [(u16, u16, u16)] {
        match self.number {
            1190..1250 => &[(168, 208, 20)],
            _ => &[(168, 224, 28), (578, 634, 28)],
        }
    }

    /// The first firmware that answers fast reads.
    pub(crate) fn fast_read_firmware(&self) -> u8 {
        match self.number {
            0..1000 => u8::MAX,
            1190..1250 => 46,
            _ => 45,
        }
    }
}

/// One simulated servo: what the driver knows of it, and what it does not.
#[derive(Clone, Debug, PartialEq)]
pub struct SimServoSpec {
    /// The joint's name, for messages.
    pub name: String,
    /// Bus id.
    pub id: u8,
    /// What the servo is. A number of [`MODELS`].
    pub model_number: u16,
    /// Firmware version; Fast Sync Read came with 45 (46 in the smallest models).
    pub firmware: u8,
    /// +1 or -1: the servo's direction against the joint axis.
    pub direction: f64,
    /// The servo's angle where the joint reads zero, radians.
    pub zero_rad: f64,
    /// What the joint is judged against.
    pub limits: JointLimits,
    /// Where the joint stands at the start, radians.
    pub initial_rad: f64,
    /// What the joint carries besides the gear: kilogram square metres.
    pub load_inertia_kg_m2: f64,
    /// Torque that gravity puts on the joint at 90 degrees, newton metres.
    pub gravity_nm: f64,
    /// Play of its gear, radians.
    pub backlash_rad: f64,
    /// The protocol it speaks.
    pub kind: BusKind,
    /// What only a CAN motor has.
    pub motor: Option<MotorSettings>,
}

impl SimServoSpec {
    /// The model, if the servo makes sense.
    pub(crate) fn checked(&self) -> Result<&'static ServoModel, SimError> {
        let bad = |reason: String| SimError::Servo {
            joint: self.name.clone(),
            id: self.id,
            reason,
        };
        let model = ServoModel::from_number(self.model_number)
            .ok_or_else(|| bad(format!("unknown model number {}", self.model_number)))?;
        self.limits.checked().map_err(bad)?;
        let finite = [self.initial_rad, self.zero_rad, self.gravity_nm]
            .iter()
            .all(|value| value.is_finite());
        let sizes = [self.load_inertia_kg_m2, self.backlash_rad];
        if !finite || sizes.iter().any(|size| size.is_nan() || *size < 0.0) {
            let reason = "a figure is not a finite number, or an inertia or play below zero";
            return Err(bad(reason.into()));
        }
        Ok(model)
    }

    /// The same with the play that the vendor states for its model's gear.
    pub fn with_stated_backlash(self) -> Self {
        let model = ServoModel::from_number(self.model_number);
        Self {
            backlash_rad: model.map_or(0.0, ServoModel::backlash_rad),
            ..self
        }
    }
}

impl From<&Servo> for SimServoSpec {
    /// The servo as the robot file describes it, at rest at zero (or the nearest
    /// position inside its limits), unloaded, its gear without play.
    fn from(servo: &Servo) -> Self {
        Self {
            name: servo.name.clone(),
            id: servo.id,
            model_number: servo.model.number,
            firmware: 48,
            direction: servo.direction,
            zero_rad: servo.zero_rad,
            limits: servo.limits,
            initial_rad: servo.limits.clamp_rad(0.0),
            load_inertia_kg_m2: 0.0,
            gravity_nm: 0.0,
            backlash_rad: 0.0,
            kind: servo.model.kind,
            motor: servo.motor.clone(),
        }
    }
}

/// Who moves time on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SimClock {
    /// The machine's clock; replies are held back until their wire time has passed.
    Realtime,
    /// [`crate::SimBus::advance`] only; wire time is counted, not waited for.
    Lockstep,
}

/// What the host opens to reach the servos.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum SimLink {
    /// A serial adapter on a pseudo-terminal, an slcan adapter for CAN motors.
    #[default]
    Terminal,
    /// The same on a Unix socket: quicker, for programs that know sockets.
    Unix,
    /// A multicast group of this machine, as python-can's `udp_multicast`: CAN only.
    Multicast(SocketAddrV4),
    /// A CAN interface of this machine (a virtual one, for instance): CAN only.
    Interface(String),
}

/// How a bus of simulated servos behaves.
#[derive(Clone, Debug, PartialEq)]
pub struct SimOptions {
    /// What the host opens.
    pub link: SimLink,
    /// Who moves time on.
    pub clock: SimClock,
    /// Bits a second of the wire and of every servo.
    pub baud: u32,
    /// Control periods a second: the time over which rates are judged.
    pub control_hz: f64,
    /// Supply voltage; `None` is each model's nominal voltage.
    pub supply_v: Option<f64>,
    /// What a USB adapter adds before the host sees a reply, seconds. Real time only.
    pub adapter_s: f64,
    /// Resistance of the supply and its cable, ohms: what all servos of the line
    /// draw makes the supply sag. 0 is an ideal supply.
    pub supply_ohm: f64,
    /// Seed of everything random: faults.
    pub seed: u64,
    /// Where the port is found, also after the adapter was pulled out and put back:
    /// a symbolic link to a terminal, or the socket itself. Without one the port
    /// has a new path then.
    pub path: Option<PathBuf>,
}

impl SimOptions {
    /// Simulated time, moved on by the control loop; the same commands give
    /// the same bytes and states.
    pub fn lockstep(baud: u32, control_hz: f64) -> Self {
        Self {
            link: SimLink::Terminal,
            clock: SimClock::Lockstep,
            baud,
            control_hz,
            supply_v: None,
            adapter_s: 0.0,
            supply_ohm: 0.0,
            seed: 0,
            path: None,
        }
    }

    /// The machine's time.
    pub fn realtime(baud: u32, control_hz: f64) -> Self {
        Self {
            clock: SimClock::Realtime,
            ..Self::lockstep(baud, control_hz)
        }
    }
}

/// Why a simulated bus cannot start.
#[derive(Debug, thiserror::Error)]
pub enum SimError {
    /// An option that makes no sense.
    #[error("simulated bus: {key} is {actual}, must be {wanted}")]
    Option {
        /// Which option.
        key: &'static str,
        /// Its value.
        actual: String,
        /// What it may be.
        wanted: &'static str,
    },
    /// A servo that makes no sense.
    #[error("simulated servo {joint} (id {id}): {reason}")]
    Servo {
        /// The joint's name.
        joint: String,
        /// Its id.
        id: u8,
        /// What is wrong.
        reason: String,
    },
    /// A line of a script of faults.
    #[error("fault \"{line}\": {reason}")]
    Script {
        /// The line.
        line: String,
        /// What is wrong.
        reason: String,
    },
    /// The system gave no pseudo-terminal or thread.
    #[error("simulated bus: {what}: {reason}")]
    System {
        /// What was asked for.
        what: &'static str,
        /// What the system said.
        reason: std::io::Error,
    },
}
