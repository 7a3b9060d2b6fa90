//! Scan for Damiao motors: reading their registers leaves their torque alone, and
//! their ranges tell the model.

use std::io;

use crate::can::family::prelude::*;
use crate::can::mit::models::MODELS;
use crate::can::mit::registers::{
    FIRMWARE, PMAX, READ, REFRESH, REGISTER_ID, TMAX, VMAX, damiao_fault,
};

pub fn damiao_motors(scanner: &mut ScanLink) -> io::Result<Vec<CanFound>> {
    let mut answers = Vec::new();
    scanner.ask_all(
        |id| request(id, READ, FIRMWARE.0),
        |frame| {
            answers.extend(answer(frame, FIRMWARE.0).map(|(id, value)| (id, frame.id(), value)))
        },
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

fn request(id: u8, command: u8, register: u8) -> CanFrame {
    CanFrame::standard(REGISTER_ID, &[id, 0, command, register, 0, 0, 0, 0])
}

/// The motor whose register it is, and its bytes.
fn answer(frame: &CanFrame, register: u8) -> Option<(u8, [u8; 4])> {
    let data = frame.eight().filter(|_| !frame.is_extended())?;
    let is_answer = data[1..4] == [0, READ, register] && frame.id() != REGISTER_ID;
    is_answer.then(|| (data[0], word(&data, 4)))
}

fn model(scanner: &mut ScanLink, id: u8) -> io::Result<Option<&'static str>> {
    let mut ranges = [f64::NAN; 3];
    for (range, register) in ranges.iter_mut().zip([PMAX.0, VMAX.0, TMAX.0]) {
        let value = scanner.ask_one(&request(id, READ, register), |frame| {
            answer(frame, register).filter(|(from, _)| *from == id)
        })?;
        *range = value.map_or(f64::NAN, |(_, bytes)| f64::from(f32::from_le_bytes(bytes)));
    }
    let has_them = |name: &&ServoModel| {
        name.motor.is_some_and(|motor| {
            let theirs = [motor.position_rad, motor.velocity_rad_s, motor.torque_nm];
            motor.has_registers && theirs == ranges
        })
    };
    Ok(MODELS.iter().find(has_them).map(|model| model.name))
}

/// The fault that it reports; a motor that does not know the request stays silent.
fn fault(scanner: &mut ScanLink, id: u8, reply_id: u32) -> io::Result<Option<String>> {
    let state = scanner.ask_one(&request(id, REFRESH, 0), |frame| {
        let data = frame.eight().filter(|_| !frame.is_extended())?;
        (frame.id() == reply_id && data[0] & 0xF == id & 0xF).then(|| data[0] >> 4)
    })?;
    let name = |nibble| damiao_fault(nibble).map(|name| format!("{name} (error {nibble:X})"));
    Ok(state.and_then(name))
}
