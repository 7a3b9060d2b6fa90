//! A bus of servos: the interface of every kind ([`Bus`]), and what all kinds share.

pub(crate) mod config;
pub(crate) mod error_counters;
pub(crate) mod kind;
pub(crate) mod layout;
pub(crate) mod open;
pub(crate) mod port;
pub(crate) mod rate;
pub(crate) mod reply_clock;
pub(crate) mod timer_slack;
pub(crate) mod torque_alarm;

use servodance_types::{ImuState, JointState};

use crate::bus::error_counters::ErrorCounters;
use crate::bus::reply_clock::ReplyClock;
use crate::error::{BusError, BusResult, ServoId};
use crate::serial::ServoDeviation;
use crate::servo::Servo;

/// The link's delay is that of so many cycles.
const DELAY_CYCLES: u64 = 16;

#[allow(missing_docs)] // each counter says its name
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusStats {
    pub cycles: u64,
    pub packets: u64,
    pub bytes: u64,
    pub crc_errors: u64,
    pub timeouts: u64,
    pub retries: u64,
    /// Cycles in which nobody answered.
    pub unheard: u64,
    /// How long after their time on the wire the answers of a cycle come, microseconds: what
    /// adapter and system add, over the last cycles. Of several buses the longest.
    pub delay_us: u64,
}

impl BusStats {
    /// Answers that did not come, or came damaged.
    pub(crate) fn errors(&self) -> u64 {
        self.timeouts + self.crc_errors
    }

    /// The answers of a cycle came so long after their time on the wire. In simulated time
    /// there is no such thing.
    pub(crate) fn note_delay(&mut self, clock: &ReplyClock, late: std::time::Duration) {
        if *clock != ReplyClock::Wall {
            return;
        }
        self.delay_us =
            (self.delay_us * (DELAY_CYCLES - 1) + late.as_micros() as u64) / DELAY_CYCLES;
    }
}

impl std::ops::AddAssign for BusStats {
    fn add_assign(&mut self, other: Self) {
        self.cycles += other.cycles;
        self.packets += other.packets;
        self.bytes += other.bytes;
        self.crc_errors += other.crc_errors;
        self.timeouts += other.timeouts;
        self.retries += other.retries;
        self.unheard += other.unheard;
        self.delay_us = self.delay_us.max(other.delay_us);
    }
}

/// Lines for the user: what was changed, what works less well than it could.
pub type Notes = Vec<String>;

#[allow(missing_docs)] // each field says its name
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ArmReport {
    pub states: Vec<JointState>,
    pub notes: Notes,
}

/// What a servo measures of itself, and its own limits; `None` where it does not say.
#[allow(missing_docs)] // units stand in the names
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Health {
    pub temperature_c: Option<f64>,
    pub highest_temperature_c: Option<f64>,
    pub voltage_v: Option<f64>,
    pub lowest_voltage_v: Option<f64>,
    pub highest_voltage_v: Option<f64>,
    pub highest_current_a: Option<f64>,
}

/// Servos that take targets and return states once a control cycle.
///
/// A bus turns torque off when it is dropped. It is not a safety layer:
/// wrap it in [`crate::SafeBus`].
pub trait Bus: Send {
    /// The servos, in the order of targets and states.
    fn servos(&self) -> &[Servo];

    /// Reads every joint's state, for a bus at rest: never turns torque on,
    /// writes no register. Silent servos are named. Serial servos keep the torque
    /// they have; CAN motors lose it, because they answer no other question.
    fn observe(&mut self) -> BusResult<Vec<JointState>>;

    /// Checks every servo and sets it up, torque off: what must hold before any
    /// torque. Returns a line for each thing that the user should know.
    fn prepare(&mut self) -> BusResult<Notes>;

    /// Torque off, and every servo's settings as arming makes them: its modes first, so
    /// that its angle counts as the robot file says. A line for each change.
    fn set_up(&mut self) -> BusResult<Notes> {
        Ok(Vec::new())
    }

    /// What of the servos' settings is not as it should be; nothing is written.
    fn deviations(&mut self) -> BusResult<Vec<ServoDeviation>> {
        Ok(Vec::new())
    }

    /// Servos that would get no torque for what they say of themselves (model, condition,
    /// supply, temperature, own limits), each with what does not fit; nothing is written.
    fn refused(&mut self) -> BusResult<Vec<BusError>> {
        Ok(Vec::new())
    }

    /// What a servo adds to its own angle, ticks; `None` where it has no such setting.
    fn homing_offset(&mut self, _index: usize) -> BusResult<Option<i32>> {
        Ok(None)
    }

    /// Turns torque on with each joint holding where it stands; to be called
    /// after [`Bus::prepare`]. On an error every torque is off again.
    ///
    /// The servos' own watchdog runs from here on: the first cycle must follow within its time.
    fn engage(&mut self) -> BusResult<Vec<JointState>>;

    /// Both steps to torque: [`Bus::prepare`], then [`Bus::engage`].
    fn arm(&mut self) -> BusResult<ArmReport> {
        let notes = self.prepare()?;
        let states = self.engage()?;
        Ok(ArmReport { states, notes })
    }

    /// Sends one target a joint (radians, finite) and reads one state a joint.
    ///
    /// Bounded in time: wire time, plus the reply timeout and retries. A target
    /// beyond a position limit is moved to the limit.
    fn cycle(&mut self, targets_rad: &[f64], states: &mut [JointState]) -> BusResult<()>;

    /// Whether the present control period leaves time for another question.
    fn has_time(&self) -> bool {
        true
    }

    /// Whether the last cycle sent this servo its goal. A bus that asks first leaves out who
    /// did not answer.
    fn sent_goal(&self, _index: usize) -> bool {
        true
    }

    /// Turns every torque off and verifies it. An error names each joint whose
    /// torque may still be on. Safe to call at any time.
    fn disarm(&mut self) -> BusResult<()>;

    /// Whether torque is on, as far as this side knows.
    fn is_armed(&self) -> bool;

    /// Counters since the bus was opened.
    fn stats(&self) -> BusStats;

    /// What the motion sensor on this bus told in the last 100 ms, in the axes of the
    /// root link; `None` where there is no sensor, or none that answers.
    fn imu(&self) -> Option<ImuState> {
        None
    }

    /// What went wrong with each servo so far; empty where nobody counts.
    fn error_counters(&self) -> ErrorCounters {
        ErrorCounters::default()
    }

    /// Asks one servo how it is, and whether its own watchdog has stopped it (then
    /// [`BusError::Tripped`]): two short exchanges, not tried again.
    fn examine(&mut self, _index: usize) -> BusResult<Health> {
        Ok(Health::default())
    }

    /// Leaves a servo out of cycles from now on: it gets no goals, its state
    /// stays, and its silence is no error. False where the bus cannot do that.
    fn set_aside(&mut self, _index: usize) -> bool {
        false
    }

    /// One step, short enough to be done between two cycles, of taking a servo
    /// back that was set aside: found, rebooted if it shut itself down, checked,
    /// set up, and torque on where it stands. Its state when it is back; `None`
    /// while there is more to do. After an error the way begins anew.
    fn rejoin(&mut self, index: usize) -> BusResult<Option<JointState>> {
        Err(BusError::NoReturn { servo: ServoId::of(&self.servos()[index]) })
    }

    /// Takes a servo on again that its own watchdog has stopped ([`BusError::Tripped`]):
    /// torque stays on, it holds where it stands, its watchdog is armed and read back.
    fn resume(&mut self, index: usize) -> BusResult<JointState> {
        Err(BusError::NoReturn { servo: ServoId::of(&self.servos()[index]) })
    }

    /// Opens the port again after it failed. Nothing is sent.
    fn reopen(&mut self) -> BusResult<()> {
        Ok(())
    }
}

impl<B: Bus + ?Sized> Bus for Box<B> {
    fn servos(&self) -> &[Servo] {
        (**self).servos()
    }
    fn observe(&mut self) -> BusResult<Vec<JointState>> {
        (**self).observe()
    }
    fn prepare(&mut self) -> BusResult<Notes> {
        (**self).prepare()
    }
    fn engage(&mut self) -> BusResult<Vec<JointState>> {
        (**self).engage()
    }
    fn set_up(&mut self) -> BusResult<Notes> {
        (**self).set_up()
    }
    fn deviations(&mut self) -> BusResult<Vec<ServoDeviation>> {
        (**self).deviations()
    }
    fn refused(&mut self) -> BusResult<Vec<BusError>> {
        (**self).refused()
    }
    fn homing_offset(&mut self, index: usize) -> BusResult<Option<i32>> {
        (**self).homing_offset(index)
    }
    fn cycle(&mut self, targets_rad: &[f64], states: &mut [JointState]) -> BusResult<()> {
        (**self).cycle(targets_rad, states)
    }
    fn has_time(&self) -> bool {
        (**self).has_time()
    }
    fn sent_goal(&self, index: usize) -> bool {
        (**self).sent_goal(index)
    }
    fn disarm(&mut self) -> BusResult<()> {
        (**self).disarm()
    }
    fn is_armed(&self) -> bool {
        (**self).is_armed()
    }
    fn stats(&self) -> BusStats {
        (**self).stats()
    }
    fn imu(&self) -> Option<ImuState> {
        (**self).imu()
    }
    fn examine(&mut self, index: usize) -> BusResult<Health> {
        (**self).examine(index)
    }
    fn set_aside(&mut self, index: usize) -> bool {
        (**self).set_aside(index)
    }
    fn rejoin(&mut self, index: usize) -> BusResult<Option<JointState>> {
        (**self).rejoin(index)
    }
    fn reopen(&mut self) -> BusResult<()> {
        (**self).reopen()
    }
    fn resume(&mut self, index: usize) -> BusResult<JointState> {
        (**self).resume(index)
    }
    fn error_counters(&self) -> ErrorCounters {
        (**self).error_counters()
    }
}
