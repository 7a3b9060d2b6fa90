//! Scan for MyActuator motors: they are asked for the date of their firmware, which moves
//! nothing.

use std::io;

use crate::can::family::prelude::*;
use crate::can::myactuator::registers::{ANSWER, COMMAND, LAST_ID, MODEL, STATUS, VERSION};

use super::parse_status;

pub fn motors(scanner: &mut ScanLink) -> io::Result<Vec<CanFound>> {
    let mut answers = Vec::new();
    let ask = |id: u8| CanFrame::standard(COMMAND + u32::from(id), &[VERSION, 0, 0, 0, 0, 0, 0, 0]);
    scanner.ask(1..=LAST_ID, ask, |frame| answers.extend(answer(frame, VERSION)))?;
    answers.sort_unstable();
    answers.dedup_by_key(|answer| answer.0);
    let mut found = Vec::with_capacity(answers.len());
    for (id, data) in answers {
        let mut one = CanFound::new(id, "MyActuator");
        one.firmware = Some(u32::from_le_bytes(word(&data, 4)).to_string());
        one.detail = ask_one(scanner, id, MODEL)?.map(|data| letters(&data[1..]));
        let status = ask_one(scanner, id, STATUS)?;
        one.error = status.and_then(|data| parse_status(&data).fault);
        found.push(one);
    }
    Ok(found)
}

fn ask_one(scanner: &mut ScanLink, id: u8, command: u8) -> io::Result<Option<[u8; 8]>> {
    let request = CanFrame::standard(COMMAND + u32::from(id), &[command, 0, 0, 0, 0, 0, 0, 0]);
    scanner.ask_one(&request, |frame| {
        answer(frame, command).filter(|(from, _)| *from == id).map(|(_, data)| data)
    })
}

fn answer(frame: &CanFrame, command: u8) -> Option<(u8, [u8; 8])> {
    let data = frame.eight().filter(|data| !frame.is_extended() && data[0] == command)?;
    let id = u8::try_from(frame.id().checked_sub(ANSWER)?).ok()?;
    (1..=LAST_ID).contains(&id).then_some((id, data))
}

fn letters(bytes: &[u8]) -> String {
    let letters = bytes.iter().filter(|byte| byte.is_ascii_graphic());
    letters.map(|byte| char::from(*byte)).collect()
}
