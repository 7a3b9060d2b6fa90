//! Finding servos on a serial port: which rates, which framing, how long to wait.

use crate::process::wrong_usage::misused;
use anyhow::bail;
use clap::ValueEnum;
use servodance_drivers::serial::family_of;
use servodance_drivers::{BusConfig, FoundServo, Framing, Port, SerialScanner, latency_timer};
use std::time::Duration;

/// How long a servo may take to answer, on top of the time on the wire, behind
/// an adapter that passes bytes on at once.
const PATIENCE: Duration = Duration::from_millis(10);

/// The same for one servo that is asked for by its id: nobody waits for the
/// other 252, and a busy computer may be late itself.
const PATIENCE_WITH_ONE: Duration = Duration::from_millis(100);

/// Framings to look for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum ProtocolChoice {
    /// All of them.
    #[default]
    All,
    /// Dynamixel Protocol 2.0.
    #[value(name = "2")]
    Two,
    /// Dynamixel Protocol 1, and Feetech.
    #[value(name = "1")]
    One,
}

impl From<Framing> for ProtocolChoice {
    fn from(framing: Framing) -> Self {
        match framing {
            Framing::Protocol2 => Self::Two,
            Framing::Protocol1 => Self::One,
        }
    }
}

impl ProtocolChoice {
    fn protocols(self) -> &'static [Framing] {
        match self {
            Self::All => &SerialScanner::FRAMINGS,
            Self::Two => &[Framing::Protocol2],
            Self::One => &[Framing::Protocol1],
        }
    }
}

/// The path of a serial port, given as `dance --bus` takes it or bare.
fn serial_path(port: &str) -> anyhow::Result<&str> {
    let path = port.strip_prefix("serial:").unwrap_or(port);
    if ["can:", "slcan:", "udp:"].iter().any(|kind| path.starts_with(kind)) {
        misused!(
            "{port} leads to a CAN bus; this looks at serial ones (scan and ping --robot know CAN)"
        );
    }
    if path.is_empty() {
        misused!("\"{port}\" names no port; give its path, e.g. /dev/ttyUSB0");
    }
    Ok(path)
}

/// A serial port, and the rates and framings to try on it.
#[derive(Clone, Debug)]
pub struct SerialListener {
    path: String,
    baud: Option<u32>,
    protocol: ProtocolChoice,
    wait: Duration,
}

impl SerialListener {
    /// On a serial port; at every usual rate unless one is given.
    pub fn new(port: &str, baud: Option<u32>, protocol: ProtocolChoice) -> anyhow::Result<Self> {
        let path = serial_path(port)?.to_owned();
        if let Some(baud) = baud
            && !(9_600..=10_000_000).contains(&baud)
        {
            misused!("--baud {baud} is outside 9600..10000000");
        }
        let latency_ms = latency_timer(&path).map_or(0, |timer| timer.latency_ms);
        Ok(Self {
            wait: PATIENCE + Duration::from_millis(u64::from(latency_ms)),
            path,
            baud,
            protocol,
        })
    }

    /// On the port of a robot's bus, at its rate.
    pub fn of_bus(port: &Port, bus: &BusConfig) -> anyhow::Result<Self> {
        match (port, family_of(bus.kind)) {
            (Port::Serial(path), Some(family)) => {
                Self::new(path, Some(bus.baud), family.framing().into())
            }
            _ => misused!("{port} leads to motors on CAN; this is for serial servos"),
        }
    }

    pub fn path(&self) -> &str {
        &self.path
    }

    /// The one rate that is listened to; `None` for every usual one.
    pub fn baud(&self) -> Option<u32> {
        self.baud
    }

    /// The same port at another rate, or at every usual one.
    pub fn at(&self, baud: Option<u32>) -> Self {
        Self { baud, ..self.clone() }
    }

    /// Every framing and rate that is listened to.
    pub fn channels(&self) -> Vec<(Framing, u32)> {
        let protocols = self.protocol.protocols().iter();
        protocols
            .flat_map(|&protocol| {
                let bauds = match self.baud {
                    Some(baud) => vec![baud],
                    None => SerialScanner::bauds(protocol).to_vec(),
                };
                bauds.into_iter().map(move |baud| (protocol, baud))
            })
            .collect()
    }

    /// Those that a look at all of them takes: slow rates only if asked for.
    pub fn usual_channels(&self) -> Vec<(Framing, u32)> {
        let usual = |&(protocol, baud): &(Framing, u32)| {
            self.baud.is_some() || SerialScanner::usual_bauds(protocol).any(|known| known == baud)
        };
        self.channels().into_iter().filter(usual).collect()
    }

    pub fn probe(&self, protocol: Framing, baud: u32) -> anyhow::Result<SerialScanner> {
        Ok(SerialScanner::open(&self.path, baud, protocol, self.wait)?)
    }

    /// The same for one servo that is asked for by its id.
    pub fn patient_probe(&self, protocol: Framing, baud: u32) -> anyhow::Result<SerialScanner> {
        let wait = self.wait.max(PATIENCE_WITH_ONE);
        Ok(SerialScanner::open(&self.path, baud, protocol, wait)?)
    }

    /// The servo with this id, at the first rate where it answers, and the way to it.
    pub fn find(&self, id: u8) -> anyhow::Result<(SerialScanner, FoundServo)> {
        for (protocol, baud) in self.channels() {
            let mut probe = self.patient_probe(protocol, baud)?;
            if let Some(found) = probe.ping(id)? {
                return Ok((probe, found));
            }
        }
        bail!(
            "{}: id {id} does not answer at {}; `servodance scan {}` lists who does",
            self.path,
            self.rates(),
            self.path
        );
    }

    pub fn rates(&self) -> String {
        match self.baud {
            Some(baud) => format!("{baud} baud"),
            None => "any usual baud rate".into(),
        }
    }
}

/// One servo in one line: who, then how.
pub fn line(found: &FoundServo, vitals: &str) -> String {
    let protocol = match found.family.framing() {
        Framing::Protocol2 => "2.0",
        Framing::Protocol1 => "1",
    };
    format!(
        "{} baud  protocol {protocol}  id {:>3}  {} ({})  firmware {}  {vitals}  {}",
        found.baud,
        found.id,
        if is_motion_sensor(found) {
            "OpenCR board"
        } else {
            found.model.unwrap_or("unknown model")
        },
        found.model_number,
        found.firmware,
        found.hardware_error.as_deref().unwrap_or("no error")
    )
}

/// State of a servo in words. One that answers a ping but cannot be read shares
/// its id with another.
pub fn vitals(probe: &mut SerialScanner, found: &FoundServo) -> String {
    if is_motion_sensor(found) {
        return "motion sensor".into();
    }
    match probe.vitals(found) {
        Ok(Some(vitals)) => format!(
            "{:.1} V  {} C  at {}  torque {}",
            vitals.voltage_v,
            vitals.temperature_c,
            vitals.position_ticks,
            if vitals.torque_enabled { "ON" } else { "off" }
        ),
        Ok(None) => "silent when read".into(),
        Err(error) => format!("{error}: is this id given twice?"),
    }
}

pub(super) fn is_motion_sensor(found: &FoundServo) -> bool {
    found.model_number == servodance_drivers::imu::opencr::registers::MODEL_NUMBER
}
