//! Requests to and answers from the motors of one CAN bus, whatever their family.
//!
//! Sending with pacing, waiting for an answer, retries, and the servo that an error
//! names. Every exchange is bounded: wire time at the most stuff bits and the
//! reply timeout, times the tries. A full transmit queue (ENOBUFS) is waited
//! out for a frame's time and tried again within the same bound.

use std::time::{Duration, Instant};

use crate::bus::BusStats;
use crate::bus::config::BusConfig;
use crate::bus::error_counters::ErrorCounters;
use crate::bus::reply_clock::Patience;
use crate::can::cycle_frames::CycleFrames;
use crate::can::transport::{CanEvent, CanFault, CanFrame, CanLink, Sent, open_link, worst_bits};
use crate::error::{BusError, BusResult, ServoId};
use crate::servo::Servo;

#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct MotorStatus {
    /// Its own angle after the gear, radians.
    pub position_rad: f64,
    /// Velocity after the gear, radians a second.
    pub velocity_rad_s: f64,
    pub active: bool,
    pub fault: Option<String>,
    /// Temperature, Celsius; `None` where reports have none.
    pub temperature_c: Option<f64>,
}

struct ClosedLink;

impl CanLink for ClosedLink {
    fn send(&mut self, _frame: &CanFrame) -> std::io::Result<Sent> {
        Err(std::io::ErrorKind::NotConnected.into())
    }

    fn receive(&mut self, _deadline: Instant) -> std::io::Result<CanEvent> {
        Err(std::io::ErrorKind::NotConnected.into())
    }
}

pub(crate) struct CanExchange {
    link: Box<dyn CanLink>,
    port: String,
    frames: CycleFrames,
    pub servos: Vec<Servo>,
    pub config: BusConfig,
    pub stats: BusStats,
    pub errors: ErrorCounters,
    pub queue_full: u64,
    pub tries: u32,
    overdue: u32,
    /// The least time that a motor's command and answer took so far, as part of a cycle, seconds.
    quickest_s: Option<f64>,
}

/// A rest ends this much before the answers can be there: waking up takes time.
const WAKE_EARLY_S: f64 = 200e-6;

/// What is there already when the time is up is still taken, but no storm of
/// frames or faults without an end: more than a bus carries in a tenth of a second.
pub(crate) const MOST_OVERDUE: u32 = 1000;

impl CanExchange {
    pub fn new(
        link: Box<dyn CanLink>,
        port: &str,
        config: BusConfig,
        servos: Vec<Servo>,
        frames: CycleFrames,
    ) -> Self {
        Self {
            frames,
            link,
            port: port.into(),
            tries: config.retries + 1,
            errors: ErrorCounters::new(servos.len()),
            servos,
            config,
            stats: BusStats::default(),
            queue_full: 0,
            overdue: 0,
            quickest_s: None,
        }
    }

    pub fn reopen(&mut self) -> BusResult<()> {
        // An adapter is open once: the old one goes first.
        self.link = Box::new(ClosedLink);
        self.link = open_link(&self.port, self.config.baud)?;
        Ok(())
    }

    /// The servo at `index`, as errors name it.
    pub fn id_of(&self, index: usize) -> ServoId {
        ServoId::of(&self.servos[index])
    }

    pub fn ids_of(&self, indices: impl IntoIterator<Item = usize>) -> Vec<ServoId> {
        indices.into_iter().map(|index| self.id_of(index)).collect()
    }

    /// When `frames` more frames, the longest there are, must have passed.
    pub fn deadline(&self, frames: usize) -> Instant {
        let wire_s = self.frame_s() * frames as f64;
        Instant::now() + Duration::from_secs_f64(wire_s + self.config.reply_timeout_ms * 1e-3)
    }

    fn frame_s(&self) -> f64 {
        f64::from(worst_bits(true, 8)) / f64::from(self.config.baud)
    }

    /// Hands one frame over, waiting for room in the queue until `deadline`.
    pub fn transmit(
        &mut self,
        frame: &CanFrame,
        deadline: Instant,
        doing: &'static str,
    ) -> BusResult<()> {
        loop {
            let sent = self.link.send(frame);
            match sent.map_err(|reason| self.failed(doing, reason))? {
                Sent::Taken => break,
                Sent::Full => self.queue_full += 1,
            }
            if Instant::now() >= deadline {
                return Err(BusError::QueueFull { port: self.port.clone(), doing });
            }
            std::thread::sleep(Duration::from_secs_f64(self.frame_s()));
        }
        self.stats.packets += 1;
        self.stats.bytes += frame.data().len() as u64;
        Ok(())
    }

    /// Sleeps until nearly all of `motors` motors can have answered, so that their answers are
    /// taken together: a wake-up for each would cost more than all else in a cycle. The wire cannot
    /// be faster than without stuff bits; a simulated one can, which the cycles before have shown.
    pub fn rest(&mut self, motors: usize, doing: &'static str) -> BusResult<()> {
        let flushed = self.link.flush();
        flushed.map_err(|reason| self.failed(doing, reason))?;
        let bits = self.frames.bits(motors).nominal;
        let wire_s = f64::from(bits) / f64::from(self.config.baud);
        let best_s = self.quickest_s.unwrap_or(0.0) * motors as f64;
        let rest_s = wire_s.min(best_s) - WAKE_EARLY_S;
        if rest_s > 0.0 {
            std::thread::sleep(Duration::from_secs_f64(rest_s));
        }
        Ok(())
    }

    /// Notes that all of `motors` motors answered within `took`.
    pub fn answered_after(&mut self, motors: usize, took: Duration) {
        let bits = self.frames.bits(motors).nominal;
        let wire_s = f64::from(bits) / f64::from(self.config.baud);
        let late = took.saturating_sub(Duration::from_secs_f64(wire_s));
        self.stats.note_delay(&self.config.reply_clock, late);
        let each_s = took.as_secs_f64() / motors.max(1) as f64;
        let quickest_s = self.quickest_s.unwrap_or(each_s);
        self.quickest_s = Some(quickest_s.min(each_s));
    }

    /// The next frame until `deadline`, whatever storm rages on the bus. Rare
    /// faults are counted; bus-off is an error.
    pub fn receive(
        &mut self,
        deadline: Instant,
        doing: &'static str,
    ) -> BusResult<Option<CanFrame>> {
        loop {
            if self.is_over(deadline) {
                return Ok(None);
            }
            // What is still to be handed over is not carried out yet.
            let flushed = self.link.flush();
            flushed.map_err(|reason| self.failed(doing, reason))?;
            let Patience { until, last } = self.config.reply_clock.patience(deadline);
            let received = self.link.receive(until);
            match received.map_err(|reason| self.failed(doing, reason))? {
                CanEvent::Frame(frame) => {
                    self.stats.packets += 1;
                    self.stats.bytes += frame.data().len() as u64;
                    return Ok(Some(frame));
                }
                CanEvent::Fault(CanFault::BusOff) => {
                    return Err(BusError::BusOff { port: self.port.clone(), doing });
                }
                CanEvent::Fault(_) => self.stats.crc_errors += 1,
                CanEvent::Nothing if !last => {}
                CanEvent::Nothing => {
                    self.overdue = 0;
                    return Ok(None);
                }
            }
        }
    }

    fn is_over(&mut self, deadline: Instant) -> bool {
        let in_time = Instant::now() < deadline;
        if in_time || self.overdue == MOST_OVERDUE {
            self.overdue = 0;
            return !in_time;
        }
        self.overdue += 1;
        false
    }

    pub fn silent(&self, servos: Vec<ServoId>, doing: &'static str) -> BusError {
        BusError::Silent { servos, doing, tries: self.tries, hint: String::new() }
    }

    pub fn faulty(&self, index: usize, fault: &str) -> BusError {
        BusError::Hardware { servo: self.id_of(index), flags: fault.into() }
    }

    fn failed(&self, doing: &'static str, reason: std::io::Error) -> BusError {
        BusError::Link { port: self.port.clone(), doing, reason }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::kind::BusKind;

    const FRAMES: CycleFrames = CycleFrames::new(false, &[], &[8, 8]);

    struct ShortQueue {
        room: usize,
        sent: usize,
        stuck: bool,
    }

    impl CanLink for ShortQueue {
        fn send(&mut self, _frame: &CanFrame) -> std::io::Result<Sent> {
            if self.room == 0 {
                self.room = usize::from(!self.stuck);
                return Ok(Sent::Full);
            }
            self.room -= 1;
            self.sent += 1;
            Ok(Sent::Taken)
        }

        fn receive(&mut self, _deadline: Instant) -> std::io::Result<CanEvent> {
            Ok(match self.sent {
                0 => CanEvent::Fault(CanFault::BusOff),
                _ => CanEvent::Nothing,
            })
        }
    }

    fn exchange(room: usize, stuck: bool) -> CanExchange {
        let link = ShortQueue { room, sent: 0, stuck };
        let config = BusConfig::of_kind(BusKind::Mit, 1_000_000);
        CanExchange::new(Box::new(link), "can:test", config, Vec::new(), FRAMES)
    }

    #[test]
    fn a_full_queue_is_waited_out_and_counted() {
        let mut bus = exchange(10, false);
        let frame = CanFrame::standard(1, &[0; 8]);
        for _ in 0..20 {
            let deadline = Instant::now() + Duration::from_secs(60);
            bus.transmit(&frame, deadline, "target").unwrap();
        }
        assert_eq!((bus.queue_full, bus.stats.packets), (10, 20));
    }

    #[test]
    fn a_queue_that_stays_full_is_an_error_in_bounded_time() {
        let mut bus = exchange(0, true);
        let frame = CanFrame::standard(1, &[0; 8]);
        let deadline = bus.deadline(1);
        let error = bus.transmit(&frame, deadline, "target").unwrap_err();
        assert!(matches!(error, BusError::QueueFull { .. }), "{error}");
    }

    /// A bus on which the same comes again and again without a pause.
    struct Storm(CanEvent);

    impl CanLink for Storm {
        fn send(&mut self, _frame: &CanFrame) -> std::io::Result<Sent> {
            Ok(Sent::Taken)
        }

        fn receive(&mut self, _deadline: Instant) -> std::io::Result<CanEvent> {
            Ok(self.0)
        }
    }

    #[test]
    fn a_storm_of_faults_or_frames_ends_at_the_deadline() {
        let stranger = CanEvent::Frame(CanFrame::standard(0x123, &[]));
        for storm in [CanEvent::Fault(CanFault::Error), stranger] {
            let config = BusConfig::of_kind(BusKind::Mit, 1_000_000);
            let mut bus =
                CanExchange::new(Box::new(Storm(storm)), "can:test", config, Vec::new(), FRAMES);
            for wait_ms in [0, 20, 0] {
                let deadline = Instant::now() + Duration::from_millis(wait_ms);
                let mut taken = 0u64;
                while bus.receive(deadline, "state").unwrap().is_some() {
                    taken += 1;
                }
                assert!(Instant::now() >= deadline);
                // What was there already is taken all the same.
                let frames = matches!(storm, CanEvent::Frame(_));
                assert!(!frames || taken >= u64::from(MOST_OVERDUE), "{taken}");
            }
        }
    }

    #[test]
    fn bus_off_is_an_error_that_names_the_port() {
        let error = exchange(1, false).receive(Instant::now(), "state");
        let error = error.unwrap_err().to_string();
        assert!(error.starts_with("CAN link can:test is bus-off (state)"), "{error}");
    }
}
