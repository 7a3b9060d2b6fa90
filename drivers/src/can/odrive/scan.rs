//! Scan for ODrive controllers: known by their heartbeat, then asked for their version.

use std::collections::BTreeMap;
use std::io;

use crate::can::odrive::errors::error_names;
use crate::can::odrive::registers::{HEARTBEAT, LAST_STATE, VERSION, id};
use crate::can::scan::inquiry::{CanFound, ScanLink};
use crate::can::transport::{CanFrame, word};

pub fn controllers(scanner: &mut ScanLink) -> io::Result<Vec<CanFound>> {
    let nodes: BTreeMap<u8, u32> = scanner.heard.iter().filter_map(heartbeat).collect();
    let mut found = Vec::with_capacity(nodes.len());
    for (node, errors) in nodes {
        let mut one = CanFound::new(node, "ODrive");
        one.error = error_names(errors);
        let id = id(node, VERSION);
        let version = scanner.ask_one(&CanFrame::remote(id, 8), |frame| {
            let is_answer = !frame.is_extended() && frame.id() == id;
            is_answer.then(|| frame.eight()).flatten()
        })?;
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
