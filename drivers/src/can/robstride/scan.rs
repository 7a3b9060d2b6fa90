//! Scan for RobStride motors: they are asked for their id (type 0) with 29-bit ids that
//! no other family listens to. Their faults come with commands only.

use std::io;

use crate::can::robstride::registers::{BUS_VOLTAGE, EVERY_HOST, HOST, id, message};
use crate::can::scan::inquiry::{CanFound, ScanLink};
use crate::can::transport::{CanFrame, word};

pub fn motors(scanner: &mut ScanLink) -> io::Result<Vec<CanFound>> {
    let mut ids = Vec::new();
    let request = |motor: u8| CanFrame::extended(id(message::GET_ID, HOST, motor.into()), &[0; 8]);
    scanner.ask_all(request, |frame| ids.extend(answer(frame)))?;
    ids.sort_unstable();
    ids.dedup();
    let mut found = Vec::with_capacity(ids.len());
    for id in ids {
        let mut one = CanFound::new(id, "RobStride");
        one.detail = volts(scanner, id)?.map(|volts| format!("{volts:.1} V"));
        found.push(one);
    }
    Ok(found)
}

/// The id in an answer to "get id".
fn answer(frame: &CanFrame) -> Option<u8> {
    let (id, data) = (frame.id(), frame.eight());
    let motor = u8::try_from(id >> 8 & 0xFFFF).ok()?;
    let is_answer = frame.is_extended() && id >> 24 == message::GET_ID && id & 0xFF == EVERY_HOST;
    (is_answer && data.is_some()).then_some(motor)
}

fn volts(scanner: &mut ScanLink, motor: u8) -> io::Result<Option<f32>> {
    let [low, high] = BUS_VOLTAGE.0.to_le_bytes();
    let data = [low, high, 0, 0, 0, 0, 0, 0];
    let motor = u32::from(motor);
    let request = CanFrame::extended(id(message::READ, HOST, motor), &data);
    scanner.ask_one(&request, |frame| {
        let data = frame.eight()?;
        let from = frame.id() & 0x1F00_FFFF;
        let is_answer = frame.is_extended() && from == id(message::READ, motor, HOST);
        (is_answer && data[..2] == [low, high]).then(|| f32::from_le_bytes(word(&data, 4)))
    })
}
