//! Requests of a scan, and what it finds.

use std::io::{self, ErrorKind};
use std::ops::RangeInclusive;
use std::time::{Duration, Instant};

use crate::can::exchange::MOST_OVERDUE;
use crate::can::transport::{CanEvent, CanFault, CanFrame, CanLink, Sent};

pub(crate) const IDS: RangeInclusive<u8> = 1..=127;
pub(crate) const GROUP: usize = 8;
const TRIES: usize = 3;

#[allow(missing_docs)] // each field says its name
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CanFound {
    pub id: u8,
    pub family: &'static str,
    /// Its model; `None` where the motor cannot tell.
    pub model: Option<&'static str>,
    /// Its firmware; `None` where the motor cannot tell.
    pub firmware: Option<String>,
    pub detail: Option<String>,
    pub error: Option<String>,
}

impl CanFound {
    pub(crate) fn new(id: u8, family: &'static str) -> Self {
        Self { id, family, model: None, firmware: None, detail: None, error: None }
    }
}

pub(crate) struct ScanLink {
    pub link: Box<dyn CanLink>,
    pub wait: Duration,
    pub heard: Vec<CanFrame>,
    /// Whether requests may have 11-bit ids.
    pub may_send_standard: bool,
}

impl ScanLink {
    /// Asks every id; `take` gets every frame that comes meanwhile.
    pub fn ask_all(
        &mut self,
        request: impl Fn(u8) -> CanFrame,
        take: impl FnMut(&CanFrame),
    ) -> io::Result<()> {
        self.ask(IDS, request, take)
    }

    /// The same of some ids.
    pub fn ask(
        &mut self,
        ids: RangeInclusive<u8>,
        request: impl Fn(u8) -> CanFrame,
        mut take: impl FnMut(&CanFrame),
    ) -> io::Result<()> {
        let requests: Vec<CanFrame> = ids.map(request).collect();
        for group in requests.chunks(GROUP) {
            for request in group {
                self.send(request)?;
            }
            self.receive(Instant::now() + self.wait, &mut take)?;
        }
        Ok(())
    }

    /// Asks one motor until `accept` finds its answer; `None` if it stays silent.
    pub fn ask_one<T>(
        &mut self,
        request: &CanFrame,
        accept: impl Fn(&CanFrame) -> Option<T>,
    ) -> io::Result<Option<T>> {
        let mut answer = None;
        for _ in 0..TRIES {
            self.send(request)?;
            let deadline = Instant::now() + self.wait;
            self.receive(deadline, |frame| answer = answer.take().or_else(|| accept(frame)))?;
            if answer.is_some() {
                break;
            }
        }
        Ok(answer)
    }

    pub fn send(&mut self, request: &CanFrame) -> io::Result<()> {
        let deadline = Instant::now() + 10 * self.wait;
        while self.link.send(request)? == Sent::Full {
            if Instant::now() >= deadline {
                let reason = "the transmit queue stays full: nobody acknowledges";
                return Err(io::Error::new(ErrorKind::TimedOut, reason));
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        Ok(())
    }

    /// Every frame until `deadline`.
    pub fn receive(
        &mut self,
        deadline: Instant,
        mut take: impl FnMut(&CanFrame),
    ) -> io::Result<()> {
        let mut overdue = 0;
        while overdue < MOST_OVERDUE {
            match self.link.receive(deadline)? {
                CanEvent::Frame(frame) => take(&frame),
                CanEvent::Fault(CanFault::BusOff) => {
                    let reason = "bus-off: another bitrate, or nobody there?";
                    return Err(io::Error::new(ErrorKind::ConnectionAborted, reason));
                }
                CanEvent::Fault(_) => {}
                CanEvent::Nothing => return Ok(()),
            }
            overdue += u32::from(Instant::now() >= deadline);
        }
        Ok(())
    }
}
