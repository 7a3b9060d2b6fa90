//! A motion sensor on a serial port of its own. A cycle takes what has come, asks for more
//! and waits for nothing: the servos' bus is never late because of the sensor. A port
//! that is gone is opened again twice a second.

use std::io::{ErrorKind, Read, Write};
use std::time::Duration;

use servodance_types::ImuState;

use super::bno055::Bno055;
use super::bno085::Bno085;
use super::config::{ImuConfig, ImuKind};
use super::freshness::Freshness;
use super::mounted;
use super::mounting::Mounting;
use super::protocol::ImuProtocol;
use super::witmotion::Witmotion;
use crate::error::{BusError, BusResult};
use crate::serial::wire::open_error::remedy;
use crate::serial::wire::stream::PortStream;

/// How often a port that is gone is tried again, seconds.
const TRY_AGAIN_S: f64 = 0.5;
/// More than a sensor says in a cycle; what is older has no worth.
const MOST_BYTES: usize = 4096;

/// An open sensor.
pub struct SerialImu {
    port: Option<PortStream>,
    path: String,
    baud: u32,
    hz: f64,
    protocol: Box<dyn ImuProtocol>,
    mounting: Mounting,
    fresh: Freshness,
    out: Vec<u8>,
    chunk: Vec<u8>,
}

impl SerialImu {
    /// Opens the sensor of a robot that is cycled so many times a second, at `path`. Fails
    /// where the port cannot be opened, or the kind has no port of its own.
    pub fn open(config: &ImuConfig, path: &str, hz: f64) -> BusResult<Self> {
        let protocol: Box<dyn ImuProtocol> = match config.kind {
            ImuKind::Bno055 => Box::new(Bno055::new()),
            ImuKind::Bno085 => Box::new(Bno085::new()),
            ImuKind::Witmotion => Box::new(Witmotion::new()),
            ImuKind::Opencr | ImuKind::Simulated => {
                return Err(BusError::not_opened(
                    path,
                    "this motion sensor has no port of its own",
                ));
            }
        };
        let baud = config.baud();
        let port = open(path, baud).map_err(|error| BusError::Open {
            port: path.into(),
            choices: remedy(path, &error),
            reason: error.to_string(),
        })?;
        Ok(Self {
            port: Some(port),
            path: path.into(),
            baud,
            hz,
            protocol,
            mounting: config.mounting(),
            fresh: Freshness::new(hz),
            out: Vec::with_capacity(64),
            chunk: vec![0; 512],
        })
    }

    /// One control cycle: takes what the sensor has said and asks it for more.
    pub fn cycle(&mut self) {
        let again = (TRY_AGAIN_S * self.hz).ceil().max(1.0) as u32;
        if self.port.is_none() && self.fresh.missed().is_multiple_of(again) {
            self.port = open(&self.path, self.baud).ok();
            self.protocol.restart();
        }
        let reading = self.exchange();
        self.fresh.cycle(reading.map(|board| mounted(&board, &self.mounting)));
    }

    fn exchange(&mut self) -> Option<ImuState> {
        let port = self.port.as_mut()?;
        let (mut newest, mut taken) = (None, 0);
        while taken < MOST_BYTES {
            match port.read(&mut self.chunk) {
                Ok(0) => {
                    self.port = None;
                    return newest;
                }
                Ok(count) => {
                    taken += count;
                    for &byte in &self.chunk[..count] {
                        newest = self.protocol.hear(byte).or(newest);
                    }
                }
                Err(error) if error.kind() == ErrorKind::TimedOut => break,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => {
                    self.port = None;
                    return newest;
                }
            }
        }
        self.out.clear();
        self.protocol.ask(&mut self.out);
        if !self.out.is_empty() && port.write_all(&self.out).is_err() {
            self.port = None;
        }
        newest
    }

    /// What the sensor told in the last 100 ms, in the axes of the root link.
    pub fn state(&self) -> Option<ImuState> {
        self.fresh.state()
    }
}

fn open(path: &str, baud: u32) -> std::io::Result<PortStream> {
    PortStream::open(path, baud, Duration::ZERO)
}
