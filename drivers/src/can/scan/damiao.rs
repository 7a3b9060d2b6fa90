//! Damiao motors: their registers are read (id 7FF), which leaves their torque
//! alone. The ranges tell the model.

use std::io;

use crate::can::CAN_MODELS;
use crate::can::frame::CanFrame;
use crate::can::mit::damiao_fault;
use crate::can::scan::{CanFound, CanScanner, word};

const REGISTERS: u32 = 0x7FF;
const READ: u8 = 0x33;
/// "Refresh": say how you are.
const REFRESH: u8 = 0xCC;
const FIRMWARE: u8 = 14;
/// PMAX, VMAX and TMAX.
const RANGES: [u8; 3] = [21, 22, 23];

/// The motors that answer.
pub fn ask(scanner: &mut CanScanner) -> io::Result<Vec<CanFound>> {
    let mut answers = Vec::new();
    scanner.ask_all(
        |id| question(id, READ, FIRMWARE),
        |frame| answers.extend(answer(frame, FIRMWARE).map(|(id, value)| (id, frame.id(), value))),
    )?;
    answers.sort_unstable();
    answers.dedup_by_key(|answer| answer.0);
    let mut found = Vec::with_capacity(answers.len());
    for (id, reply_id, firmware) in answers {
        let mut one = CanFound::new(id, "Damiao");
        one.firmware = Some(u32::from_le_bytes(firmware).to_string());
        one.detail = Some(format!("reply_id = 0x{reply_id:03X}"));
        one.model = model(scanner, id)?;
        one.error = fault(scanner, id, reply_id)?;
        found.push(one);
    }
    Ok(found)
}

fn question(id: u8, command: u8, register: u8) -> CanFrame {
    CanFrame::standard(REGISTERS, &[id, 0, command, register, 0, 0, 0, 0])
}

/// Whose register, and its bytes.
fn answer(frame: &CanFrame, register: u8) -> Option<(u8, [u8; 4])> {
    let data = frame.eight().filter(|_| !frame.is_extended())?;
    let is_answer = data[1..4] == [0, READ, register] && frame.id() != REGISTERS;
    is_answer.then(|| (data[0], word(&data, 4)))
}

/// The model that has the motor's ranges.
fn model(scanner: &mut CanScanner, id: u8) -> io::Result<Option<&'static str>> {
    let mut ranges = [f64::NAN; 3];
    for (range, register) in ranges.iter_mut().zip(RANGES) {
        let value = scanner.ask_one(&question(id, READ, register), |frame| {
            answer(frame, register).filter(|(from, _)| *from == id)
        })?;
        *range = value.map_or(f64::NAN, |(_, bytes)| f64::from(f32::from_le_bytes(bytes)));
    }
    let has_them = |name: &&crate::ServoModel| {
        name.motor.is_some_and(|motor| {
            let theirs = [motor.position_rad, motor.velocity_rad_s, motor.torque_nm];
            motor.has_registers && theirs == ranges
        })
    };
    let known = CAN_MODELS
        .iter()
        .filter(|model| model.kind == crate::BusKind::Mit);
    Ok(known.clone().find(has_them).map(|model| model.name))
}

/// What it complains about; a motor that does not know the question says nothing.
fn fault(scanner: &mut CanScanner, id: u8, reply_id: u32) -> io::Result<Option<String>> {
    let state = scanner.ask_one(&question(id, REFRESH, 0), |frame| {
        let data = frame.eight().filter(|_| !frame.is_extended())?;
        (frame.id() == reply_id && data[0] & 0xF == id & 0xF).then(|| data[0] >> 4)
    })?;
    let name = |nibble| damiao_fault(nibble).map(|name| format!("{name} (error {nibble:X})"));
    Ok(state.and_then(name))
}
