//! The motors on a CAN bus, whatever their family, before there is a robot file.
//!
//! First the scanner listens: ODrive controllers and CANopen devices send heartbeats.
//! Then every family asks all ids that it can, some ids at a time:
//!
//! | motors | request |
//! |---|---|
//! | ODrive | its version, of the nodes that were heard |
//! | RobStride | its id (type 0) |
//! | Damiao | register 14, its firmware |
//! | CANopen | object 1000, its profile |
//! | MyActuator | the date of its firmware |
//! | moteus | its firmware, on a link that carries CAN FD |
//!
//! Nothing here turns torque on or off, and nothing moves. Motors that cannot be
//! asked without that are not found: CubeMars in MIT mode, an ODrive without
//! heartbeat. Requests to Damiao motors and CANopen devices have the ids of
//! commands to ODrive controllers (7FF would send a node 63 into its boot loader): on
//! a bus with an ODrive no other family is asked with 11-bit ids.
//!
//! A request at another bitrate than the bus has disturbs its traffic.

pub(crate) mod inquiry;

pub use inquiry::CanFound;

use std::io;
use std::time::{Duration, Instant};

use crate::bus::kind::BusKind;
use crate::can::families;
use crate::can::family::IdSetting;
use crate::can::scan::inquiry::{GROUP, ScanLink};
use crate::can::transport::{CanLink, open_link, worst_bits};
use crate::error::BusResult;
use crate::servo::Servo;
use crate::servo::model::ServoModel;

/// The families in the order in which they are asked; ODrive decides whether the
/// others may use 11-bit ids.
const ORDER: [BusKind; 6] = [
    BusKind::Odrive,
    BusKind::Robstride,
    BusKind::Mit,
    BusKind::Cia402,
    BusKind::Myactuator,
    BusKind::Moteus,
];
/// Factory settings send a heartbeat ten times a second, or once.
const LISTEN: Duration = Duration::from_millis(1200);
const WAIT: Duration = Duration::from_millis(20);
/// For so long nothing is sent after a frame that writes permanent memory.
const KEEP: Duration = Duration::from_millis(100);

/// A CAN bus to be scanned for motors.
pub struct CanScanner {
    link: ScanLink,
    listen: Duration,
}

impl CanScanner {
    /// Opens a port: see [`crate::can::CanPort`]. Nothing is sent.
    pub fn open(port: &str, bitrate: u32) -> BusResult<Self> {
        let bits = worst_bits(true, 8) * 2 * GROUP as u32;
        let wire_s = f64::from(bits) / f64::from(bitrate);
        let wait = WAIT + Duration::from_secs_f64(wire_s);
        Ok(Self::over(open_link(port, bitrate)?, LISTEN, wait))
    }

    /// A bus over a link that is open already. `wait` is how long an answer may
    /// take, `listen` how long the scanner listens first.
    pub fn over(link: Box<dyn CanLink>, listen: Duration, wait: Duration) -> Self {
        let link = ScanLink { link, wait, heard: Vec::new(), may_send_standard: false };
        Self { link, listen }
    }

    /// Every motor that is heard or answers, family by family, by id.
    ///
    /// # Errors
    /// The link fails, or its controller leaves the bus: another bitrate, or
    /// no other node that acknowledges.
    pub fn everyone(&mut self) -> io::Result<Vec<CanFound>> {
        let mut heard = Vec::new();
        let deadline = Instant::now() + self.listen;
        self.link.receive(deadline, |frame| heard.push(*frame))?;
        self.link.heard = heard;
        self.link.may_send_standard = false;
        let mut found = Vec::new();
        for family in ORDER.into_iter().filter_map(families::of_kind) {
            // The first family decides: on a bus with an ODrive all others are careful.
            found.extend(family.scan(&mut self.link)?);
            self.link.may_send_standard |= found.is_empty();
        }
        Ok(found)
    }

    /// Gives the motor with id `from` the ids of `servo`, for good. False where that cannot be
    /// done here.
    ///
    /// # Errors
    /// The link fails.
    pub fn set_id(&mut self, from: u8, servo: &Servo) -> io::Result<bool> {
        let family = families::of_kind(servo.model.kind);
        let Some(family) = family else { return Ok(false) };
        let Some(frames) = family.id_frames(&mut self.link, from, servo)? else { return Ok(false) };
        for frame in &frames {
            // Permanent memory takes its time.
            self.link.send(frame)?;
            self.link.receive(Instant::now() + KEEP, |_| ())?;
        }
        Ok(true)
    }

    /// Who sets the id of such a motor.
    pub fn id_setting(model: &ServoModel) -> IdSetting {
        let family = families::of_kind(model.kind);
        family.map_or(IdSetting::Vendor, |family| family.id_setting(model))
    }
}
