//! ODrive controllers (CANSimple, ids `node << 5 | command`): known by their
//! heartbeat, then asked for their version.

use std::collections::BTreeMap;
use std::io;

use crate::can::frame::CanFrame;
use crate::can::odrive::error_names;
use crate::can::scan::{CanFound, CanScanner, word};

const VERSION: u32 = 0x00;
const HEARTBEAT: u32 = 0x01;
/// The last of the axis states.
const LAST_STATE: u8 = 14;

/// The controllers whose heartbeat was heard.
pub fn ask(scanner: &mut CanScanner, heard: &[CanFrame]) -> io::Result<Vec<CanFound>> {
    let nodes: BTreeMap<u8, u32> = heard.iter().filter_map(heartbeat).collect();
    let mut found = Vec::with_capacity(nodes.len());
    for (node, errors) in nodes {
        let mut one = CanFound::new(node, "ODrive");
        one.error = error_names(errors);
        let id = u32::from(node) << 5 | VERSION;
        let version = scanner.ask_one(&CanFrame::remote(id, 8), |frame| {
            let is_answer = !frame.is_extended() && frame.id() == id;
            is_answer.then(|| frame.eight()).flatten()
        })?;
        // Protocol, hardware (three bytes), firmware (three bytes).
        one.firmware = version.map(|data| format!("{}.{}.{}", data[4], data[5], data[6]));
        found.push(one);
    }
    Ok(found)
}

/// Node and errors. Other frames of eight bytes pass for no heartbeat: its last
/// byte is zero, and result, trajectory flag and state are small.
fn heartbeat(frame: &CanFrame) -> Option<(u8, u32)> {
    let data = frame.eight()?;
    let is_heartbeat = !frame.is_extended()
        && frame.id() & 0x1F == HEARTBEAT
        && data[4] <= LAST_STATE
        && data[5] <= 32
        && data[6] <= 1
        && data[7] == 0;
    is_heartbeat.then(|| ((frame.id() >> 5) as u8, u32::from_le_bytes(word(&data, 0))))
}
