//! Reading what is on a servo bus and is no servo: a board with a motion sensor.

use std::time::{Duration, Instant};

use crate::error::BusResult;
use crate::serial::client::ServoClient;
use crate::serial::instruction;
use crate::serial::register::Register;
use crate::serial::timeout::LONGEST_RETURN_DELAY;
use crate::serial::wire::port::Received;
use crate::serial::wire::stale_replies::ServoRequest;

impl ServoClient {
    /// One Read of a device of Protocol 2 that is no servo, not tried again; `None` if no
    /// sound answer comes within `patience` beyond its time on the wire.
    pub(crate) fn read_device<const SIZE: usize>(
        &mut self,
        id: u8,
        register: Register,
        patience: Duration,
    ) -> BusResult<Option<[u8; SIZE]>> {
        let [[a0, a1], [s0, s1]] = [register.address, register.size].map(u16::to_le_bytes);
        let params = &[a0, a1, s0, s1]; // as Protocol 2 has them
        let request = ServoRequest { id, instruction: instruction::READ, params, reply: SIZE };
        let bytes = self.port.framing().status_bytes() + SIZE;
        let wait = LONGEST_RETURN_DELAY + patience + self.port.time(bytes);
        self.port.ask(&request, wait, register.name)?;
        let deadline = Instant::now() + wait + self.port.passing();
        loop {
            match self.port.receive(deadline, register.name)? {
                Received::Packet => {
                    let packet = self.port.packet();
                    if packet.id == id && packet.error() == 0 {
                        return Ok(packet.params().try_into().ok());
                    }
                }
                Received::Corrupt => return Ok(None),
                Received::Nothing => {
                    self.port.note_unanswered(&request);
                    return Ok(None);
                }
            }
        }
    }
}
