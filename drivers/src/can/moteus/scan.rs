//! Scan for moteus controllers: they are asked for firmware, supply and fault, which moves
//! nothing.

use std::io;

use crate::can::family::prelude::*;

use super::framing::{Kind, Payload, Said, Saying};
use super::registers::{FAULT, FIRMWARE, VOLTAGE, fault_name};
use super::{ANSWER, answer_of};

pub fn controllers(scanner: &mut ScanLink) -> io::Result<Vec<CanFound>> {
    let mut found: Vec<CanFound> = Vec::new();
    let ask = |id: u8| {
        let question = Payload::default().read(Kind::I32, FIRMWARE, 1).read(Kind::I8, VOLTAGE, 3);
        question.frame(ANSWER | u32::from(id))
    };
    scanner.ask_all(ask, |frame| {
        let id = (frame.id() >> 8) as u8;
        if answer_of(id, frame).is_none() || found.iter().any(|one| one.id == id) {
            return;
        }
        let mut one = CanFound::new(id, "moteus");
        for said in Saying::of(frame.data()) {
            let Said::Reply { register, value } = said else { continue };
            match register {
                FIRMWARE => one.firmware = Some(format!("{:06x}", value as u32)),
                VOLTAGE => one.detail = Some(format!("{value:.1} V")),
                FAULT if value > 0.0 => {
                    one.error = Some(format!("{} (fault {value})", fault_name(value as u8)));
                }
                _ => {}
            }
        }
        found.push(one);
    })?;
    found.sort_by_key(|one| one.id);
    Ok(found)
}
