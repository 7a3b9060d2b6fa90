//! Simulated motion sensors that are no node on a servo's line: on a serial port of their
//! own ([`SimImu`]), or among the motors of a CAN bus. They measure a world's body, or a
//! robot that stands still. The OpenCR board is in `serial/imu_board.rs`.
//!
//! A kind of board is one file; its bytes come from `servodance_drivers::imu`.

mod bno055;
mod bno085;
mod can_board;
mod witmotion;

use servodance_drivers::imu::{Mounting, seen_by_board};
use servodance_drivers::{ImuConfig, ImuKind};
use servodance_types::ImuState;

use crate::bus::host_end::{HostEnd, HostLink};
use crate::bus::options::SimLink;
use crate::error::SimError;
use crate::serial::host_port::{HostInput, HostPort};
use crate::world::SharedWorld;

pub(crate) use can_board::CanBoard;

/// How often boards measure by themselves, seconds.
const MEASURED_S: f64 = 0.01;
/// A level robot at rest.
const LEVEL: ImuState =
    ImuState { rate_rad_s: [0.0; 3], force_m_s2: [0.0, 0.0, 9.80665], up: [0.0, 0.0, 1.0] };

/// What a board measures, in its own axes.
#[derive(Clone, Copy, Debug)]
struct Measured {
    state: ImuState,
    /// Heading since the start, radians.
    yaw_rad: f64,
}

/// The bytes of one kind of board.
trait BoardTwin: std::fmt::Debug + Send {
    /// Takes a byte of the host; the answer, if this was the last byte of a question.
    fn hear(&mut self, byte: u8, measured: &Measured, out: &mut Vec<u8>);

    /// A hundredth of a second has passed.
    fn measure(&mut self, measured: &Measured, out: &mut Vec<u8>);
}

fn twin(kind: ImuKind) -> Option<Box<dyn BoardTwin>> {
    Some(match kind {
        ImuKind::Bno055 => Box::new(bno055::Bno055Board::new()),
        ImuKind::Bno085 => Box::new(bno085::Bno085Board::default()),
        ImuKind::Witmotion => Box::new(witmotion::WitmotionBoard),
        ImuKind::Opencr | ImuKind::Simulated => return None,
    })
}

/// The body's motion as one board sees it.
#[derive(Debug)]
struct Sensed {
    world: Option<SharedWorld>,
    mounting: Mounting,
    yaw_rad: f64,
}

impl Sensed {
    fn new(config: &ImuConfig, world: Option<SharedWorld>) -> Self {
        Self { world, mounting: config.mounting(), yaw_rad: 0.0 }
    }

    /// What is measured after so many more seconds.
    fn after(&mut self, seconds: f64) -> Measured {
        let state = self.world.as_ref().map_or(LEVEL, SharedWorld::imu);
        let state = seen_by_board(&state, &self.mounting);
        let turns: f64 = state.rate_rad_s.iter().zip(state.up).map(|(a, b)| a * b).sum();
        let turned = self.yaw_rad + turns * seconds + std::f64::consts::PI;
        self.yaw_rad = turned.rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
        Measured { state, yaw_rad: self.yaw_rad }
    }
}

/// A board on a serial port of its own. Its bytes take no time on the wire.
#[derive(Debug)]
pub struct SimImu {
    host: HostPort,
    path: String,
    kind: ImuKind,
    twin: Box<dyn BoardTwin>,
    sensed: Sensed,
    time_s: f64,
    measured: u64,
    silent: bool,
}

impl SimImu {
    /// Opens a socket in the place of the port. Fails for a kind that has no port of its own.
    pub fn start(config: &ImuConfig, world: Option<SharedWorld>) -> Result<Self, SimError> {
        let refused = || SimError::Option {
            key: "imu",
            actual: format!("{:?}", config.kind),
            wanted: "a sensor with a serial port of its own",
        };
        let twin = twin(config.kind).ok_or_else(refused)?;
        let (link, bitrate) = (SimLink::Unix, config.baud());
        let link = HostLink { is_can: false, is_flexible: false, bitrate, link, path: None };
        let (HostEnd::Serial(host), path, _) = link.open()? else { return Err(refused()) };
        let sensed = Sensed::new(config, world);
        let kind = config.kind;
        Ok(Self { host, path, kind, twin, sensed, time_s: 0.0, measured: 0, silent: false })
    }

    /// What the driver is to open.
    pub fn port_path(&self) -> &str {
        &self.path
    }

    /// Answers what the host has asked, then lets so much simulated time pass.
    pub fn advance(&mut self, seconds: f64) {
        let mut out = Vec::new();
        let now = self.sensed.after(0.0);
        let mut chunk = [0; 256];
        while let Ok(HostInput::Bytes(count)) = self.host.read(&mut chunk) {
            for &byte in &chunk[..count] {
                self.twin.hear(byte, &now, &mut out);
            }
        }
        self.time_s += seconds;
        let due = (self.time_s / MEASURED_S + 1e-6) as u64;
        for _ in self.measured..due {
            let now = self.sensed.after(MEASURED_S);
            self.twin.measure(&now, &mut out);
        }
        self.measured = due;
        if !self.silent {
            self.host.write(&out);
        }
    }

    /// The board loses its power, or has it again and has forgotten what it was told.
    pub fn silence(&mut self, silent: bool) {
        if self.silent && !silent {
            self.twin = twin(self.kind).unwrap_or_else(|| Box::new(witmotion::WitmotionBoard));
        }
        self.silent = silent;
    }
}
