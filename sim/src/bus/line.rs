//! The wire's far end: what the host sends goes in, what the servos reply comes out.

use servodance_drivers::can::CanFrame;

use crate::fault::ServoFault;
use crate::judge::Judge;
use crate::servo::body::{ServoBody, SimServoState};

/// One reply: a pause on the line, then bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct Burst {
    /// The place of the servo that speaks.
    pub servo: usize,
    /// Silence before the first byte, seconds.
    pub delay_s: f64,
    /// What passes over the wire.
    pub bytes: Vec<u8>,
}

/// Servos on one wire.
pub trait Line: std::fmt::Debug + Send {
    /// Takes one byte from the host. True if it completed something, to be
    /// carried out by [`Line::execute`] when its time on the wire has passed.
    fn push(&mut self, byte: u8) -> bool;

    /// Carries out what was completed, `late_s` after its time on the wire has passed;
    /// returns the replies in order.
    fn execute(&mut self, late_s: f64) -> Vec<Burst>;

    /// What was completed is lost on the wire.
    fn lose(&mut self) {}

    /// What the host sends to a wire that may damage or lose it: the judges are to know how
    /// many goals there were.
    fn witness(&mut self, _bytes: &[u8]) {}

    /// Takes one CAN frame from the host; the answers in the order in which the
    /// bus carries them. A serial line has none.
    fn receive(&mut self, _frame: &CanFrame) -> Vec<CanFrame> {
        Vec::new()
    }

    /// CAN frames that motors send by themselves by now.
    fn due(&mut self) -> Vec<CanFrame> {
        Vec::new()
    }

    /// Bytes of the host begin to come: the rate at which it speaks, bits a second. CAN adapters
    /// see to that by themselves.
    fn set_host_baud(&mut self, _baud: u32) {}

    /// One step of every servo, ending at `time_s`.
    fn step(&mut self, time_s: f64, dt_s: f64, period_ends: bool);

    /// Shows the motors in their joints, in order, to a world that moves them.
    fn each_body(&mut self, each: &mut dyn FnMut(usize, &mut ServoBody));

    /// The judges of the servos, in order.
    fn judges(&self) -> Vec<&Judge>;

    /// What one servo really does.
    fn state(&self, index: usize) -> Option<SimServoState>;

    /// Something goes wrong with one servo; false if there is none.
    fn suffer(&mut self, index: usize, fault: ServoFault) -> bool;

    /// A board on the line that is no servo falls silent, or answers again.
    fn silence_board(&mut self, _silent: bool) {}

    /// Sound and damaged packets from the host so far.
    fn packets(&self) -> (u64, u64);
}
