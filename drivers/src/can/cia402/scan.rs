//! Scan for CANopen devices: known by their heartbeat, or asked for their device type
//! (object 1000). Reading objects changes nothing.

use std::io;

use crate::can::cia402::errors::error_name;
use crate::can::cia402::registers::{
    ABORT, DEVICE_TYPE, ERROR_CODE, HEARTBEAT, REVISION, SDO_ANSWER, SDO_REQUEST, SdoObject, UPLOAD,
};
use crate::can::scan::inquiry::{CanFound, IDS, ScanLink};
use crate::can::transport::{CanFrame, word};

const CIA402: u32 = 402;

/// The CANopen devices that were heard, and those that answer if they may be asked.
pub fn devices(scanner: &mut ScanLink) -> io::Result<Vec<CanFound>> {
    let mut ids: Vec<u8> = scanner.heard.iter().filter_map(heartbeat).collect();
    let may_ask = scanner.may_send_standard;
    if may_ask {
        let request = |id| request(id, DEVICE_TYPE);
        scanner.ask_all(request, |frame| {
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

fn describe(scanner: &mut ScanLink, id: u8) -> io::Result<CanFound> {
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
    let id = u8::try_from(frame.id().checked_sub(HEARTBEAT)?).ok()?;
    (is_state && !frame.is_extended() && IDS.contains(&id)).then_some(id)
}

fn request(id: u8, (index, subindex, ..): SdoObject) -> CanFrame {
    let [low, high] = index.to_le_bytes();
    let data = [UPLOAD, low, high, subindex, 0, 0, 0, 0];
    CanFrame::standard(SDO_REQUEST + u32::from(id), &data)
}

/// The value of an object; 0 if the device has none.
fn answer(frame: &CanFrame, id: u8, (index, subindex, ..): SdoObject) -> Option<u32> {
    let is_from = !frame.is_extended() && frame.id() == SDO_ANSWER + u32::from(id);
    let data = frame.eight().filter(|_| is_from)?;
    let [low, high] = index.to_le_bytes();
    if data[1..4] != [low, high, subindex] {
        return None;
    }
    match data[0] {
        ABORT => Some(0),
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

fn read(scanner: &mut ScanLink, id: u8, object: SdoObject) -> io::Result<Option<u32>> {
    scanner.ask_one(&request(id, object), |frame| answer(frame, id, object))
}
