//! RobStride motors: asked for their id (type 0) with 29-bit ids that no other
//! family hears. What they complain about comes with orders only.

use std::io;

use crate::can::frame::CanFrame;
use crate::can::scan::{CanFound, CanScanner, word};

const HOST: u32 = 0xFD;
const GET_ID: u32 = 0;
const READ: u32 = 17;
const BUS_VOLTAGE: u16 = 0x701C;
/// Whom an answer to "get id" is for.
const EVERYONE: u32 = 0xFE;

/// The motors that answer.
pub fn ask(scanner: &mut CanScanner) -> io::Result<Vec<CanFound>> {
    let mut ids = Vec::new();
    let question = |id: u8| CanFrame::extended(GET_ID << 24 | HOST << 8 | u32::from(id), &[0; 8]);
    scanner.ask_all(question, |frame| ids.extend(answer(frame)))?;
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

/// The id of a motor that tells it.
fn answer(frame: &CanFrame) -> Option<u8> {
    let (id, data) = (frame.id(), frame.eight());
    let motor = u8::try_from(id >> 8 & 0xFFFF).ok()?;
    let is_answer = frame.is_extended() && id >> 24 == GET_ID && id & 0xFF == EVERYONE;
    (is_answer && data.is_some()).then_some(motor)
}

fn volts(scanner: &mut CanScanner, motor: u8) -> io::Result<Option<f32>> {
    let [low, high] = BUS_VOLTAGE.to_le_bytes();
    let data = [low, high, 0, 0, 0, 0, 0, 0];
    let motor = u32::from(motor);
    let question = CanFrame::extended(READ << 24 | HOST << 8 | motor, &data);
    scanner.ask_one(&question, |frame| {
        let data = frame.eight()?;
        let from = frame.id() & 0x1F00_FFFF;
        let is_answer = frame.is_extended() && from == READ << 24 | motor << 8 | HOST;
        (is_answer && data[..2] == [low, high]).then(|| f32::from_le_bytes(word(&data, 4)))
    })
}
