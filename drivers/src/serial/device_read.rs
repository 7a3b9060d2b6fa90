//! Reading what is on a servo bus and is no servo: a board with a motion sensor.

use std::time::{Duration, Instant};

use crate::error::BusResult;
use crate::serial::client::ServoClient;
use crate::serial::instruction;
use crate::serial::register::Register;
use crate::serial::timeout::LONGEST_RETURN_DELAY;
use crate::serial::wire::port::Received;
use crate::serial::wire::stale_replies::ServoRequest;

/// One Read of a device of Protocol 2 that was sent and is not tried again.
#[derive(Debug)]
pub(crate) struct DeviceQuestion {
    id: u8,
    params: [u8; 4],
    register: Register,
    deadline: Instant,
}

impl DeviceQuestion {
    fn request(&self) -> ServoRequest<'_> {
        let (params, reply) = (&self.params, self.register.size.into());
        ServoRequest { id: self.id, instruction: instruction::READ, params, reply }
    }
}

impl ServoClient {
    /// Sends what is held for the wire, and asks a device. Its answer is waited for until
    /// `patience` beyond its time on the wire.
    pub(crate) fn ask_device(
        &mut self,
        id: u8,
        register: Register,
        patience: Duration,
    ) -> BusResult<DeviceQuestion> {
        let [[a0, a1], [s0, s1]] = [register.address, register.size].map(u16::to_le_bytes);
        let params = [a0, a1, s0, s1]; // as Protocol 2 has them
        let bytes = self.port.framing().status_bytes() + usize::from(register.size);
        let wait = LONGEST_RETURN_DELAY + patience + self.port.time(bytes);
        let mut question = DeviceQuestion { id, params, register, deadline: Instant::now() };
        self.port.ask(&question.request(), wait, register.name)?;
        question.deadline = Instant::now() + wait + self.port.passing();
        Ok(question)
    }

    /// The answer to a question; `None` if no sound one comes in time.
    pub(crate) fn hear_device<const SIZE: usize>(
        &mut self,
        question: &DeviceQuestion,
    ) -> BusResult<Option<[u8; SIZE]>> {
        let doing = question.register.name;
        loop {
            match self.port.receive(question.deadline, doing)? {
                Received::Packet => {
                    let packet = self.port.packet();
                    if packet.id == question.id && packet.error() == 0 {
                        return Ok(packet.params().try_into().ok());
                    }
                }
                Received::Corrupt => return Ok(None),
                Received::Nothing => {
                    self.port.note_unanswered(&question.request());
                    return Ok(None);
                }
            }
        }
    }
}
