//! The servos of one serial line, in whichever protocol: who hears the host, the
//! shared supply, answers that collide.

use std::fmt::Debug;

use crate::bus::line::{Burst, Line};
use crate::fault::ServoFault;
use crate::judge::Judge;
use crate::serial::imu_board::ImuBoard;
use crate::serial::protocol2_packet::Parsed;
use crate::servo::body::{ServoBody, SimServoState};

pub trait LineServo: Debug + Send + Sized {
    fn body(&self) -> &ServoBody;

    fn body_mut(&mut self) -> &mut ServoBody;

    fn id(&self) -> u8;

    /// The rate at which it hears and answers, bits a second.
    fn baud(&self) -> u32;

    fn step(&mut self, dt_s: f64);

    fn state(&self) -> SimServoState;

    fn suffer(&mut self, fault: ServoFault);
}

/// The protocol of such servos.
pub trait LineProtocol: LineServo {
    type Parser: Debug + Default + Send;

    /// Takes a byte; returns the packet that it completed.
    fn parse(parser: &mut Self::Parser, byte: u8) -> Option<Parsed>;

    /// Carries out a packet; returns the replies in order.
    fn execute(line: &mut SerialLine<Self>, packet: Parsed) -> Vec<Burst>;

    /// The ids to which a packet sends a goal in one Sync Write.
    fn goals(line: &SerialLine<Self>, packet: &Parsed) -> Vec<u8>;
}

/// Servos of one protocol on one line.
#[derive(Debug)]
pub struct SerialLine<S: LineProtocol> {
    parser: S::Parser,
    /// Hears what the host sends before the wire damages it.
    witness: S::Parser,
    witnessed: Option<Parsed>,
    /// The last packet that arrived sound, and when it came for the first time in a row.
    arrived: Option<(Parsed, f64)>,
    packet: Option<Parsed>,
    pub(crate) servos: Vec<S>,
    pub(crate) packets_in: u64,
    pub(crate) bad_packets: u64,
    supply_ohm: f64,
    /// The board with a motion sensor, a node beside the servos.
    pub(crate) board: Option<ImuBoard>,
    /// The rate of the line, and the one at which the host speaks.
    line_baud: u32,
    baud: u32,
    time_s: f64,
    /// When the host's bytes came last, seconds.
    heard_s: f64,
}

/// After so long a pause the rest of a packet is not waited for any more, seconds.
const BYTE_TIMEOUT_S: f64 = 0.1;

impl<S: LineProtocol> SerialLine<S> {
    /// A line of this rate with these servos on a supply of this resistance.
    pub fn new(servos: Vec<S>, line_baud: u32, supply_ohm: f64) -> Self {
        Self {
            parser: S::Parser::default(),
            witness: S::Parser::default(),
            witnessed: None,
            arrived: None,
            packet: None,
            servos,
            packets_in: 0,
            bad_packets: 0,
            supply_ohm,
            board: None,
            line_baud,
            baud: line_baud,
            time_s: 0.0,
            heard_s: 0.0,
        }
    }

    /// The same with a board on it.
    pub(crate) fn with_board(self, board: Option<ImuBoard>) -> Self {
        Self { board, ..self }
    }

    /// Whether the host speaks at the line's own rate, which boards keep to.
    pub(crate) fn is_at_line_rate(&self) -> bool {
        self.baud == self.line_baud
    }

    /// The places of the servos that hear and answer: what comes at another rate is garbage.
    pub(crate) fn listeners(&self) -> Vec<usize> {
        let servos = self.servos.iter().enumerate();
        let hears = |servo: &S| servo.body().listens() && servo.baud() == self.baud;
        let heard = servos.filter(|(_, servo)| hears(servo));
        heard.map(|(index, _)| index).collect()
    }

    /// Those of them with this id: more than one where it was given twice.
    pub(crate) fn find_all(&self, id: u8) -> Vec<usize> {
        let mut found = self.listeners();
        found.retain(|&index| self.servos[index].id() == id);
        found
    }
}

impl<S: LineProtocol> Line for SerialLine<S> {
    fn push(&mut self, byte: u8) -> bool {
        self.packet = S::parse(&mut self.parser, byte);
        self.packet.is_some()
    }

    fn execute(&mut self, late_s: f64) -> Vec<Burst> {
        let Some(packet) = self.packet.take() else { return Vec::new() };
        let passed_s = self.time_s - late_s;
        let same = self.arrived.as_ref().filter(|(arrived, _)| *arrived == packet);
        let repeated_after_s = same.map(|(_, first_s)| passed_s - first_s);
        for servo in &mut self.servos {
            servo.body_mut().judge.repeated_after_s = repeated_after_s;
        }
        if repeated_after_s.is_none() && matches!(packet, Parsed::Instruction(_)) {
            self.arrived = Some((packet.clone(), passed_s));
        }
        S::execute(self, packet)
    }

    fn lose(&mut self) {
        self.packet = None;
    }

    fn witness(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            let Some(packet) = S::parse(&mut self.witness, byte) else { continue };
            let ids = S::goals(self, &packet);
            // The same goals again are no goals of their own.
            if self.witnessed.as_ref() == Some(&packet) {
                continue;
            }
            self.witnessed = Some(packet);
            for servo in &mut self.servos {
                if ids.contains(&servo.id()) {
                    servo.body_mut().judge.send_goal();
                }
            }
        }
    }

    /// Nobody understands a host at a rate of its own. A socket has no rate (0): its host is
    /// taken to be at the line's.
    fn set_host_baud(&mut self, baud: u32) {
        self.baud = if baud == 0 { self.line_baud } else { baud };
        if self.time_s - self.heard_s > BYTE_TIMEOUT_S {
            self.parser = S::Parser::default();
        }
        self.heard_s = self.time_s;
    }

    fn step(&mut self, time_s: f64, dt_s: f64, period_ends: bool) {
        self.time_s = time_s;
        if self.supply_ohm > 0.0 {
            let currents_a = self.servos.iter().map(|s| s.state().current_a.abs());
            let sag_v = self.supply_ohm * currents_a.sum::<f64>();
            for servo in &mut self.servos {
                servo.body_mut().sag_v = sag_v;
            }
        }
        for servo in &mut self.servos {
            servo.body_mut().time_s = time_s;
            servo.step(dt_s);
            if period_ends {
                servo.body_mut().end_period();
            }
        }
    }

    fn each_body(&mut self, each: &mut dyn FnMut(usize, &mut ServoBody)) {
        for (index, servo) in self.servos.iter_mut().enumerate() {
            each(index, servo.body_mut());
        }
    }

    fn judges(&self) -> Vec<&Judge> {
        self.servos.iter().map(|s| &s.body().judge).collect()
    }

    fn state(&self, index: usize) -> Option<SimServoState> {
        self.servos.get(index).map(LineServo::state)
    }

    fn suffer(&mut self, index: usize, fault: ServoFault) -> bool {
        let servo = self.servos.get_mut(index);
        servo.map(|servo| servo.suffer(fault)).is_some()
    }

    fn silence_board(&mut self, silent: bool) {
        if let Some(board) = &mut self.board {
            board.silent = silent;
        }
    }

    fn packets(&self) -> (u64, u64) {
        (self.packets_in, self.bad_packets)
    }
}

/// Servos that answer at the same time pull the line low together: every zero
/// bit wins. Identical answers pass, as on a real bus.
pub(crate) fn collided(answers: Vec<Burst>) -> Vec<Burst> {
    let mut answers = answers.into_iter();
    let Some(mut heard) = answers.next() else {
        return Vec::new();
    };
    for other in answers {
        for (byte, also) in heard.bytes.iter_mut().zip(&other.bytes) {
            *byte &= also;
        }
        let tail = other.bytes.get(heard.bytes.len()..).unwrap_or_default();
        heard.bytes.extend_from_slice(tail);
    }
    vec![heard]
}
