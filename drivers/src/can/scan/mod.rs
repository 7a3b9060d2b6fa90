//! Who is on a CAN bus, whatever they speak, before there is a robot.
//!
//! First it listens: ODrive controllers and CANopen devices tell of themselves
//! (heartbeats). Then every id is asked in each language that has a question,
//! some ids at a time:
//!
//! | motors | question |
//! |---|---|
//! | ODrive | its version, of the nodes that were heard |
//! | RobStride | its id (type 0) |
//! | Damiao | register 14, its firmware |
//! | CANopen | object 1000, its profile |
//!
//! Nothing here turns torque on or off, and nothing moves. Motors that cannot be
//! asked without that are not found: CubeMars in MIT mode, an ODrive without
//! heartbeat. Questions to Damiao motors and CANopen devices have the ids of
//! orders to ODrive controllers (7FF would send a node 63 into its boot loader): on
//! a bus with an ODrive nobody else is asked with 11-bit ids.
//!
//! A question at another bitrate than the bus has disturbs those who talk on it.

mod canopen;
mod damiao;
mod odrive;
mod robstride;

use std::io::{self, ErrorKind};
use std::time::{Duration, Instant};

use crate::can::exchange::MOST_OVERDUE;
use crate::can::frame::{CanFrame, worst_bits};
use crate::can::link::{CanFault, CanLink, Received, Sent};
use crate::can::open_link;
use crate::error::BusError;

/// The ids that are asked for.
const IDS: std::ops::RangeInclusive<u8> = 1..=127;
/// Heartbeats come ten times a second as ODrive and drives leave the factory,
/// or once.
const LISTEN: Duration = Duration::from_millis(1200);
/// So many questions go out together, less than what a transmit queue holds, ...
const GROUP: usize = 8;
/// ... and this is how long their answers may take.
const WAIT: Duration = Duration::from_millis(20);
/// How often one motor is asked one thing.
const TRIES: usize = 3;

/// A motor, or a device, that answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CanFound {
    /// Its id on the bus.
    pub id: u8,
    /// What it speaks, e.g. `RobStride`.
    pub family: &'static str,
    /// Its model, as far as it tells.
    pub model: Option<&'static str>,
    /// Its firmware, as far as it tells.
    pub firmware: Option<String>,
    /// What else it says of itself.
    pub detail: Option<String>,
    /// What it complains about.
    pub error: Option<String>,
}

impl CanFound {
    fn new(id: u8, family: &'static str) -> Self {
        Self {
            id,
            family,
            model: None,
            firmware: None,
            detail: None,
            error: None,
        }
    }
}

/// A CAN bus to be looked at.
pub struct CanScanner {
    link: Box<dyn CanLink>,
    listen: Duration,
    wait: Duration,
}

impl CanScanner {
    /// Opens a port: see [`crate::can::CanPort`]. Nothing is sent.
    pub fn open(port: &str, bitrate: u32) -> Result<Self, BusError> {
        let bits = worst_bits(true, 8) * 2 * GROUP as u32;
        let wire_s = f64::from(bits) / f64::from(bitrate);
        Ok(Self {
            link: open_link(port, bitrate)?,
            listen: LISTEN,
            wait: WAIT + Duration::from_secs_f64(wire_s),
        })
    }

    /// A bus over a link that is open already. `wait` is how long an answer may
    /// take, `listen` how long the bus is listened to first.
    pub fn over(link: Box<dyn CanLink>, listen: Duration, wait: Duration) -> Self {
        Self { link, listen, wait }
    }

    /// Everyone who is heard or answers, family by family, by id.
    ///
    /// # Errors
    /// The link fails, or its controller leaves the bus: another bitrate, or
    /// nobody there who acknowledges.
    pub fn everyone(&mut self) -> io::Result<Vec<CanFound>> {
        let heard = self.listen()?;
        let mut found = odrive::ask(self, &heard)?;
        let has_odrive = !found.is_empty();
        found.extend(robstride::ask(self)?);
        if !has_odrive {
            found.extend(damiao::ask(self)?);
        }
        found.extend(canopen::ask(self, &heard, !has_odrive)?);
        Ok(found)
    }

    /// What is said unasked.
    fn listen(&mut self) -> io::Result<Vec<CanFrame>> {
        let mut heard = Vec::new();
        self.hear(Instant::now() + self.listen, |frame| heard.push(*frame))?;
        Ok(heard)
    }

    /// Asks every id; `take` gets whatever is said meanwhile.
    fn ask_all(
        &mut self,
        question: impl Fn(u8) -> CanFrame,
        mut take: impl FnMut(&CanFrame),
    ) -> io::Result<()> {
        let questions: Vec<CanFrame> = IDS.map(question).collect();
        for group in questions.chunks(GROUP) {
            for question in group {
                self.send(question)?;
            }
            self.hear(Instant::now() + self.wait, &mut take)?;
        }
        Ok(())
    }

    /// Asks one motor until `accept` finds its answer; `None` if it stays silent.
    fn ask_one<T>(
        &mut self,
        question: &CanFrame,
        accept: impl Fn(&CanFrame) -> Option<T>,
    ) -> io::Result<Option<T>> {
        let mut answer = None;
        for _ in 0..TRIES {
            self.send(question)?;
            let deadline = Instant::now() + self.wait;
            self.hear(deadline, |frame| {
                answer = answer.take().or_else(|| accept(frame))
            })?;
            if answer.is_some() {
                break;
            }
        }
        Ok(answer)
    }

    /// Hands a question over; waits for room in the queue.
    fn send(&mut self, question: &CanFrame) -> io::Result<()> {
        let deadline = Instant::now() + 10 * self.wait;
        while self.link.send(question)? == Sent::Full {
            if Instant::now() >= deadline {
                let reason = "the transmit queue stays full: nobody acknowledges";
                return Err(io::Error::new(ErrorKind::TimedOut, reason));
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        Ok(())
    }

    /// Everything that is said until `deadline`.
    fn hear(&mut self, deadline: Instant, mut take: impl FnMut(&CanFrame)) -> io::Result<()> {
        let mut overdue = 0;
        while overdue < MOST_OVERDUE {
            match self.link.receive(deadline)? {
                Received::Frame(frame) => take(&frame),
                Received::Fault(CanFault::BusOff) => {
                    let reason = "bus-off: another bitrate, or nobody there?";
                    return Err(io::Error::new(ErrorKind::ConnectionAborted, reason));
                }
                Received::Fault(_) => {}
                Received::Nothing => return Ok(()),
            }
            overdue += u32::from(Instant::now() >= deadline);
        }
        Ok(())
    }
}

/// Four bytes of eight.
fn word(data: &[u8; 8], at: usize) -> [u8; 4] {
    [data[at], data[at + 1], data[at + 2], data[at + 3]]
}
