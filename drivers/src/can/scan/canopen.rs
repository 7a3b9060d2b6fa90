//! CANopen devices: heard by their heartbeat, or asked for their device type
//! (object 1000). Reading objects changes nothing.

use std::io;

use crate::can::cia402::error_name;
use crate::can::frame::CanFrame;
use crate::can::scan::{CanFound, CanScanner, IDS, word};

/// Index and subindex of an object.
type Object = (u16, u8);

const DEVICE_TYPE: Object = (0x1000, 0);
const REVISION: Object = (0x1018, 3);
const ERROR_CODE: Object = (0x603F, 0);
const CIA402: u32 = 402;

/// The devices that were heard, and those that answer if they may be asked.
pub fn ask(
    scanner: &mut CanScanner,
    heard: &[CanFrame],
    may_ask: bool,
) -> io::Result<Vec<CanFound>> {
    let mut ids: Vec<u8> = heard.iter().filter_map(heartbeat).collect();
    if may_ask {
        let question = |id| question(id, DEVICE_TYPE);
        scanner.ask_all(question, |frame| {
            let answers = IDS.filter(|id| answer(frame, *id, DEVICE_TYPE).is_some());
            ids.extend(answers);
        })?;
    }
    ids.sort_unstable();
    ids.dedup();
    let mut found = Vec::with_capacity(ids.len());
    for id in ids {
        found.push(match may_ask {
            true => describe(scanner, id)?,
            false => CanFound::new(id, "CANopen"),
        });
    }
    Ok(found)
}

fn describe(scanner: &mut CanScanner, id: u8) -> io::Result<CanFound> {
    let device_type = read(scanner, id, DEVICE_TYPE)?.unwrap_or(0);
    if device_type & 0xFFFF != CIA402 {
        let mut one = CanFound::new(id, "CANopen");
        one.detail = Some(format!("profile {}", device_type & 0xFFFF));
        return Ok(one);
    }
    let mut one = CanFound::new(id, "CiA 402");
    one.firmware = read(scanner, id, REVISION)?.map(|revision| format!("revision {revision:08X}"));
    let code = read(scanner, id, ERROR_CODE)?.unwrap_or(0) as u16;
    one.error = (code != 0).then(|| error_name(code));
    Ok(one)
}

fn heartbeat(frame: &CanFrame) -> Option<u8> {
    let is_state = matches!(frame.data(), [0 | 4 | 5 | 127]);
    let id = u8::try_from(frame.id().checked_sub(0x700)?).ok()?;
    (is_state && !frame.is_extended() && IDS.contains(&id)).then_some(id)
}

fn question(id: u8, (index, subindex): Object) -> CanFrame {
    let [low, high] = index.to_le_bytes();
    let data = [0x40, low, high, subindex, 0, 0, 0, 0];
    CanFrame::standard(0x600 + u32::from(id), &data)
}

/// The value of an object; 0 if the device has none.
fn answer(frame: &CanFrame, id: u8, (index, subindex): Object) -> Option<u32> {
    let is_from = !frame.is_extended() && frame.id() == 0x580 + u32::from(id);
    let data = frame.eight().filter(|_| is_from)?;
    let [low, high] = index.to_le_bytes();
    if data[1..4] != [low, high, subindex] {
        return None;
    }
    match data[0] {
        0x80 => Some(0),
        // Expedited, with or without a size; one or two bytes leave the rest unused.
        said @ 0x40..=0x4F => {
            let unused = match said & 1 {
                1 => 8 * u32::from(said >> 2 & 3),
                _ => 0,
            };
            Some(u32::from_le_bytes(word(&data, 4)) << unused >> unused)
        }
        _ => None,
    }
}

fn read(scanner: &mut CanScanner, id: u8, object: Object) -> io::Result<Option<u32>> {
    scanner.ask_one(&question(id, object), |frame| answer(frame, id, object))
}
