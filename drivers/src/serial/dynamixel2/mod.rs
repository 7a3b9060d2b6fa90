//! X series servos, and MX with Protocol 2.0.
//!
//! Everyone is read with a Fast Sync Read where all servos answer it (probed
//! once, when arming), else with a plain Sync Read; which one is said. A plain
//! one that the wire does not carry at the robot's rate is refused.

mod known_state;
mod models;
pub mod registers;
mod table;
mod xl320;

use dynamixel2::instructions::instruction_id as instruction;
use dynamixel2::instructions::packet_id::BROADCAST;

use crate::error::BusError;
use crate::serial::deviation::Deviation;
use crate::serial::family::prelude::*;
use crate::serial::wire::port::{Received, bytes_hz};
use registers::*;

pub use models::BAUDS;

/// Fast Sync Read; the `dynamixel2` crate does not know it.
const FAST_SYNC_READ: u8 = 0x8A;

/// A Fast Sync Read that is damaged anywhere tells nothing of anybody; plain ones follow a
/// loss, which lose one servo at a time: so many at first, twice as many after each loss.
const PLAIN_AFTER_LOSS: u32 = 20;
const MOST_PLAIN: u32 = 2000;

/// The rate of every model as the vendor sends it out, bits a second.
const FACTORY_BAUD: u32 = 57_600;

/// What the watchdog register reads when it has tripped: -1 in its one byte.
const WATCHDOG_TRIPPED: u64 = 0xFF;

/// Dynamixel X, and MX with Protocol 2.0.
pub struct Dynamixel2;

fn fast_read(client: &mut ServoClient, present: &mut [u8]) -> BusResult<Option<usize>> {
    let register = PRESENT;
    let size = usize::from(register.size);
    // One packet for all: a part of it is no answer.
    client.begin_read();
    let count = client.read_request(register);
    if count == 0 {
        return Ok(None);
    }
    let length = 1 + count * (size + 4);
    client.send_request(FAST_SYNC_READ, length, register.name)?;
    let deadline = client.deadline(7 + length, 1);
    loop {
        match client.port.receive(deadline, register.name)? {
            Received::Packet => {}
            Received::Corrupt | Received::Nothing => {
                client.learn_loss();
                client.plain_after_loss =
                    (2 * client.plain_after_loss).clamp(PLAIN_AFTER_LOSS, MOST_PLAIN);
                client.plain_reads = client.plain_after_loss;
                return Ok(None);
            }
        }
        let packet = client.port.packet();
        if packet.id != BROADCAST {
            continue;
        }
        let mut alert = None;
        let mut index = 0;
        for (error, id, data) in packet.blocks(size) {
            while client.aside.get(index) == Some(&true) {
                index += 1;
            }
            let expected = client.servos.get(index);
            if expected.is_none_or(|servo| servo.id != id) || error & 0x7F != 0 {
                return Ok(None);
            }
            present[index * size..][..size].copy_from_slice(data);
            client.answered[index] = true;
            alert = alert.or((error & 0x80 != 0).then_some(index));
            index += 1;
        }
        client.learn(7 + length);
        client.plain_after_loss = client.plain_after_loss.saturating_sub(1);
        return Ok(alert);
    }
}

/// The plain Sync Read it is, if the wire carries that as often as the robot asks.
fn fall_back(client: &ServoClient, why: String, notes: &mut Notes) -> BusResult<()> {
    let asked_hz = client.config.control_hz.unwrap_or(0.0);
    let bytes = cycle_bytes(client.servos.len()).plain;
    let limit_hz = bytes_hz(client.config.baud, bytes);
    if asked_hz > limit_hz {
        return Err(BusError::PlainTooSlow {
            why,
            servos: client.servos.len(),
            baud: client.config.baud,
            limit_hz,
            bytes,
            asked_hz,
        });
    }
    notes.push(format!("plain Sync Read: {why}"));
    Ok(())
}

/// Goals out 14 + N(1 + 4), request 14 + N, reply 8 + N(10 + 4) fast or N(11 + 10) plain.
fn cycle_bytes(servos: usize) -> CycleBytes {
    let out = 14 + servos * 5 + 14 + servos;
    CycleBytes { fast: out + 8 + servos * 14, plain: out + servos * 21 }
}

impl ServoFamily for Dynamixel2 {
    fn name(&self) -> &'static str {
        "Dynamixel 2"
    }

    fn framing(&self) -> Framing {
        Framing::Protocol2
    }

    fn models(&self) -> &'static [ServoModel] {
        models::MODELS
    }

    fn bauds(&self, _model: &ServoModel) -> &'static [u32] {
        &models::BAUDS
    }

    fn registers(&self) -> &'static Registers {
        &REGISTERS
    }

    fn firmware(&self, _model: &ServoModel) -> Firmware {
        Firmware::DynamixelX
    }

    fn table(&self, model_number: u16) -> Option<RegisterTable> {
        match model_number {
            xl320::NUMBER => Some(xl320::table()),
            number => {
                let model = models::MODELS.iter().find(|model| model.number == number)?;
                Some(table::table(model))
            }
        }
    }

    fn factory_baud(&self, _model: &ServoModel) -> Option<u32> {
        Some(FACTORY_BAUD)
    }

    fn reset_params(&self, keeps_address: bool) -> Option<&'static [u8]> {
        Some(if keeps_address { &[0x02] } else { &[0xFF] })
    }

    fn cycle_bytes(&self, servos: &[Servo]) -> CycleBytes {
        cycle_bytes(servos.len())
    }

    fn parse(&self, bytes: &[u8]) -> PresentState {
        let &[c0, c1, v0, v1, v2, v3, p0, p1, p2, p3] = bytes else {
            return PresentState::default();
        };
        PresentState {
            ticks: i32::from_le_bytes([p0, p1, p2, p3]),
            velocity: i32::from_le_bytes([v0, v1, v2, v3]),
            current: i16::from_le_bytes([c0, c1]),
        }
    }

    fn identity(&self, pinged: &[u8]) -> Option<Identity> {
        Some(match *pinged {
            [low, high, firmware] => Identity::new([low, high], firmware),
            _ => Identity::default(), // a ping returns what was asked for
        })
    }

    fn conditions(&self) -> &'static [(u8, &'static str)] {
        &CONDITIONS
    }

    fn condition(&self, client: &mut ServoClient, index: usize) -> BusResult<Option<String>> {
        let flags = client.read(index, HARDWARE_ERROR)? as u8;
        let words = || {
            let names = names_of(flags, &CONDITIONS);
            format!("{names}; only a reboot or a power cycle clears it")
        };
        Ok((flags != 0).then(words))
    }

    fn own_limits(&self, client: &mut ServoClient, index: usize) -> BusResult<Option<OwnLimits>> {
        let lowest_volts = client.read(index, MIN_VOLTAGE)?;
        let highest_volts = client.read(index, MAX_VOLTAGE)?;
        let lowest = client.read(index, MIN_POSITION)? as i32;
        let highest = client.read(index, MAX_POSITION)? as i32;
        let senses_current = client.servos[index].model.current_a_per_unit.is_some();
        Ok(Some(OwnLimits {
            tenth_volts: (lowest_volts, highest_volts),
            celsius: client.read(index, TEMPERATURE_LIMIT)?,
            ticks: (lowest, highest),
            current: match senses_current {
                true => Some(client.read(index, CURRENT_LIMIT)?),
                false => None,
            },
            velocity: Some(client.read(index, VELOCITY_LIMIT)?),
        }))
    }

    fn set_up(&self, client: &mut ServoClient, index: usize, notes: &mut Notes) -> BusResult<()> {
        client.settle(index, TORQUE, 0, notes)?;
        client.settle(index, STATUS_RETURN_LEVEL, 2, notes)?;
        client.settle(index, RETURN_DELAY, 0, notes)?;
        // Modes first: a change resets gains, limits and profiles.
        for (register, wanted, _) in known_state::MODES {
            client.settle(index, register, wanted, notes)?;
        }
        // A tripped watchdog refuses goals until it is cleared.
        client.write(index, BUS_WATCHDOG, 0)?;
        let deviations = self.deviations(client, index)?;
        client.put_right(index, &deviations, notes)
    }

    fn deviations(&self, client: &mut ServoClient, index: usize) -> BusResult<Vec<Deviation>> {
        known_state::deviations(client, index)
    }

    fn homing_offset(&self, client: &mut ServoClient, index: usize) -> BusResult<Option<i32>> {
        client.read(index, HOMING_OFFSET).map(|raw| Some(raw as i32))
    }

    fn arm_watchdog(&self, client: &mut ServoClient, index: usize) -> BusResult<()> {
        let units = u64::from(client.config.watchdog_ms / 20);
        client.set(index, BUS_WATCHDOG, units)
    }

    fn tripped(&self, client: &mut ServoClient, who: Option<usize>) -> BusResult<Vec<usize>> {
        let values = match who {
            Some(index) => vec![(index, client.once(|c| c.read(index, BUS_WATCHDOG))?)],
            None => client.read_everyone(BUS_WATCHDOG)?,
        };
        let tripped = values.into_iter().filter(|(_, value)| *value == WATCHDOG_TRIPPED);
        Ok(tripped.map(|(index, _)| index).collect())
    }

    fn clear_watchdog(&self, client: &mut ServoClient, index: usize) -> BusResult<()> {
        // Read back when it is armed again.
        client.write(index, BUS_WATCHDOG, 0)
    }

    fn choose_read(&self, client: &mut ServoClient, notes: &mut Notes) -> BusResult<()> {
        client.fast_read = false;
        let firmware = client.servos.iter().zip(&client.firmware);
        let old =
            firmware.clone().position(|(servo, &version)| version < servo.model.fast_read_firmware);
        if let Some(index) = old {
            let servo = client.id_of(index);
            let why = format!(
                "{servo} runs firmware {}, Fast Sync Read needs {}",
                client.firmware[index], client.servos[index].model.fast_read_firmware
            );
            return fall_back(client, why, notes);
        }
        let mut probe = vec![0; usize::from(PRESENT.size) * client.servos.len()];
        for _ in 0..client.tries() {
            fast_read(client, &mut probe)?;
            if client.complete() {
                client.fast_read = true;
                return Ok(());
            }
        }
        let why = "the bus did not answer the Fast Sync Read probe";
        fall_back(client, why.into(), notes)
    }

    fn read_all(&self, client: &mut ServoClient, present: &mut [u8]) -> BusResult<Option<usize>> {
        if client.fast_read && client.plain_reads == 0 {
            fast_read(client, present)
        } else {
            client.plain_reads = client.plain_reads.saturating_sub(1);
            client.sync_read(PRESENT, present)
        }
    }

    fn reboot(&self, client: &mut ServoClient, index: usize) -> BusResult<bool> {
        client.transfer(index, instruction::REBOOT, &[], 0, "reboot")?;
        Ok(true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twenty_servos_match_the_published_limits() {
        let bytes = cycle_bytes(20);
        assert_eq!((bytes.fast, bytes.plain), (436, 568));
        let hz = |baud| bytes_hz(baud, bytes.fast).round();
        assert_eq!([1_000_000, 2_000_000, 4_000_000].map(hz), [229.0, 459.0, 917.0]);
    }
}
