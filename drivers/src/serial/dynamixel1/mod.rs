//! AX servos, and MX with Protocol 1.0.
//!
//! There is no Sync Read. MX servos are read with one Bulk Read; as soon as one
//! AX is on the bus, each servo is asked by itself, which costs its adapter's
//! delay every time. There is no bus watchdog and no reboot.
//!
//! A servo that shuts itself down says so in every answer, and its torque limit
//! drops to zero until it is written again.

mod models;
mod registers;
mod table;

use dynamixel2::instructions::instruction_id as instruction;

use crate::serial::family::prelude::*;
use registers::*;

/// Dynamixel AX, RX and MX with Protocol 1.
pub struct Dynamixel1;

impl ServoFamily for Dynamixel1 {
    fn name(&self) -> &'static str {
        "Dynamixel 1"
    }

    fn framing(&self) -> Framing {
        Framing::Protocol1
    }

    fn models(&self) -> &'static [ServoModel] {
        models::MODELS
    }

    fn bauds(&self, model: &ServoModel) -> &'static [u32] {
        match model.bulk_read {
            true => &models::BAUDS,
            false => &models::BAUDS[..models::AX_BAUDS],
        }
    }

    fn baud_code(&self, model: &ServoModel, baud: u32) -> Option<u8> {
        (0..=u8::MAX).find(|&code| {
            self.bauds(model).contains(&baud) && registers::baud_of(code).abs_diff(baud) * 50 < baud
        })
    }

    fn registers(&self) -> &'static Registers {
        &REGISTERS
    }

    fn firmware(&self, model: &ServoModel) -> Firmware {
        Firmware::Bytes(match model.bulk_read {
            true => &MX1,
            false => &AX,
        })
    }

    /// Goals out 8 + N(1 + 2); request 7 + 3N and replies N(6 + 8), or where each is asked by
    /// itself N(8 + 6 + 8).
    fn cycle_bytes(&self, servos: &[Servo]) -> CycleBytes {
        let count = servos.len();
        let out = 8 + count * 3;
        let plain = out + count * 22;
        let fast = match asked_singly(servos) {
            Some(_) => plain,
            None => out + 7 + count * 3 + count * 14,
        };
        CycleBytes { fast, plain }
    }

    fn parse(&self, bytes: &[u8]) -> PresentState {
        let &[p0, p1, s0, s1, ..] = bytes else {
            return PresentState::default();
        };
        PresentState {
            ticks: i32::from(u16::from_le_bytes([p0, p1])),
            velocity: sign_magnitude(u16::from_le_bytes([s0, s1]), SIGN_BIT),
            current: 0,
        }
    }

    fn identity_register(&self) -> Option<Register> {
        Some(IDENTITY)
    }

    fn identity(&self, bytes: &[u8]) -> Option<Identity> {
        Some(match *bytes {
            [low, high, firmware] => Identity::new([low, high], firmware),
            _ => Identity::default(), // a read returns what was asked for
        })
    }

    fn lacks_watchdog(&self) -> Option<&'static str> {
        Some("has no watchdog in Protocol 1.0")
    }

    fn conditions(&self) -> &'static [(u8, &'static str)] {
        &CONDITIONS
    }

    fn condition(&self, client: &mut ServoClient, index: usize) -> BusResult<Option<String>> {
        client.ping(index)?;
        let mask = CONDITIONS.iter().fold(0, |mask, (bit, _)| mask | 1 << bit);
        let flags = client.flags() & mask;
        Ok((flags != 0).then(|| names_of(flags, &CONDITIONS)))
    }

    fn table(&self, model_number: u16) -> Option<RegisterTable> {
        let model = models::MODELS.iter().find(|model| model.number == model_number)?;
        Some(table::table(model))
    }

    fn reset_params(&self, keeps_address: bool) -> Option<&'static [u8]> {
        // There is one kind of reset, which forgets everything.
        (!keeps_address).then_some(&[])
    }

    fn own_limits(&self, client: &mut ServoClient, index: usize) -> BusResult<Option<OwnLimits>> {
        LIMITS.read(client, index).map(Some)
    }

    fn set_up(&self, client: &mut ServoClient, index: usize, notes: &mut Notes) -> BusResult<()> {
        // Answers to writes first: without them nothing can be read back.
        if client.read(index, STATUS_LEVEL)? != 2 {
            client.write_unheard(index, STATUS_LEVEL, 2)?;
            client.expect(index, STATUS_LEVEL, 2)?;
        }
        client.settle(index, TORQUE, 0, notes)?;
        client.settle(index, RETURN_DELAY, 0, notes)?;
        let most = client.read(index, MAX_TORQUE)?;
        client.settle(index, TORQUE_LIMIT, most, notes)?;
        // No profile: the host shapes the motion.
        client.settle(index, SPEED, 0, notes)?;
        if client.servos[index].model.bulk_read {
            client.settle(index, TORQUE_MODE, 0, notes)?;
            client.settle(index, ACCELERATION, 0, notes)?;
        }
        Ok(())
    }

    fn choose_read(&self, client: &mut ServoClient, notes: &mut Notes) -> BusResult<()> {
        if let Some(index) = asked_singly(&client.servos) {
            let servo = client.id_of(index);
            let model = client.servos[index].model.name;
            notes.push(format!(
                "a read for each servo: {servo} is an {model}, which knows no Bulk Read"
            ));
        }
        Ok(())
    }

    fn read_all(&self, client: &mut ServoClient, present: &mut [u8]) -> BusResult<Option<usize>> {
        if asked_singly(&client.servos).is_some() {
            return client.read_each(PRESENT, present);
        }
        let count = client.bulk_request(PRESENT);
        client.collect(instruction::BULK_READ, count, PRESENT, present)
    }
}

fn asked_singly(servos: &[Servo]) -> Option<usize> {
    servos.iter().position(|servo| !servo.model.bulk_read)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn present_registers_are_read_as_the_vendor_says() {
        let present = Dynamixel1.parse(&[0x00, 0x02, 0x05, 0x04, 0, 0, 120, 40]);
        assert_eq!((present.ticks, present.velocity), (512, -5));
    }
}
