//! Feetech STS servos: Protocol 1 framing, little-endian, signs as a bit.
//!
//! One Sync Read brings the fifteen bytes from position to current, with
//! voltage, temperature and the status flags.
//!
//! These servos have **no bus watchdog**: a servo that hears nothing more holds
//! its last goal.

mod registers;
mod table;

use std::f64::consts::TAU;

use dynamixel2::instructions::instruction_id as instruction;

use crate::serial::deviation::Deviation;
use crate::serial::family::prelude::*;
use registers::*;

const TICK_RAD: f64 = TAU / 4096.0;

static MODELS: &[ServoModel] = &[ServoModel {
    name: "STS3215",
    number: 777,
    current_a_per_unit: Some(6.5e-3),
    velocity_rad_s_per_unit: TICK_RAD, // a tick a second
    fast_read_firmware: u8::MAX,
    rad_per_tick: TICK_RAD,
    last_tick: 4095,
    bulk_read: false,
    kind: BusKind::Feetech,
    sheet: DataSheet::new(5.47, 46.4, 2.7, 12.0),
    motor: None,
}];

/// Feetech STS servos, as they leave the factory.
pub struct Feetech;

impl ServoFamily for Feetech {
    fn name(&self) -> &'static str {
        "Feetech STS"
    }

    fn framing(&self) -> Framing {
        Framing::Protocol1
    }

    fn error_flags(&self) -> ErrorFlags {
        ErrorFlags::Conditions
    }

    fn models(&self) -> &'static [ServoModel] {
        MODELS
    }

    fn bauds(&self, _model: &ServoModel) -> &'static [u32] {
        &BAUDS
    }

    fn registers(&self) -> &'static Registers {
        &REGISTERS
    }

    fn firmware(&self, _model: &ServoModel) -> Firmware {
        Firmware::Bytes(&STS)
    }

    /// Goals out 8 + N(1 + 2), request 8 + N, replies N(6 + 15).
    fn cycle_bytes(&self, servos: &[Servo]) -> CycleBytes {
        let count = servos.len();
        let bytes = 8 + count * 3 + 8 + count + count * 21;
        CycleBytes { fast: bytes, plain: bytes }
    }

    fn parse(&self, bytes: &[u8]) -> PresentState {
        let word = |at: usize| match bytes.get(at..at + 2) {
            Some(&[low, high]) => sign_magnitude(u16::from_le_bytes([low, high]), SIGN_BIT),
            _ => 0,
        };
        PresentState { ticks: word(0), velocity: word(2), current: word(13) as i16 }
    }

    fn ticks(&self, raw: u64) -> i32 {
        sign_magnitude(raw as u16, SIGN_BIT)
    }

    fn identity_register(&self) -> Option<Register> {
        Some(IDENTITY)
    }

    fn identity(&self, bytes: &[u8]) -> Option<Identity> {
        Some(match *bytes {
            [firmware, _, _, low, high] => Identity::new([low, high], firmware),
            _ => Identity::default(), // a read returns what was asked for
        })
    }

    fn lacks_watchdog(&self) -> Option<&'static str> {
        Some("has no watchdog")
    }

    fn conditions(&self) -> &'static [(u8, &'static str)] {
        &CONDITIONS
    }

    fn condition(&self, client: &mut ServoClient, index: usize) -> BusResult<Option<String>> {
        let flags = client.read(index, STATUS)? as u8;
        Ok((flags != 0).then(|| names_of(flags, &CONDITIONS)))
    }

    fn table(&self, model_number: u16) -> Option<RegisterTable> {
        let model = MODELS.iter().find(|model| model.number == model_number)?;
        Some(table::table(model))
    }

    fn own_limits(&self, client: &mut ServoClient, index: usize) -> BusResult<Option<OwnLimits>> {
        let limits = LIMITS.read(client, index)?;
        // Both limits zero is a servo without limits.
        let ticks = match limits.ticks {
            (0, 0) => (0, 4095),
            ticks => ticks,
        };
        Ok(Some(OwnLimits { ticks, ..limits }))
    }

    fn set_up(&self, client: &mut ServoClient, index: usize, notes: &mut Notes) -> BusResult<()> {
        client.settle(index, TORQUE, 0, notes)?;
        client.write(index, LOCK, 0)?;
        client.settle(index, STATUS_LEVEL, 1, notes)?;
        client.settle(index, RETURN_DELAY, 0, notes)?;
        client.settle(index, MODE, 0, notes)?;
        client.write(index, LOCK, 1)?;
        let deviations = self.deviations(client, index)?;
        client.put_right(index, &deviations, notes)?;
        // No profile: the host shapes the motion.
        client.settle(index, ACCELERATION, 0, notes)?;
        client.settle(index, GOAL_TIME, 0, notes)?;
        client.settle(index, GOAL_SPEED, 0, notes)
    }

    fn homing_offset(&self, client: &mut ServoClient, index: usize) -> BusResult<Option<i32>> {
        let raw = client.read(index, OFFSET)? as u16;
        Ok(Some(sign_magnitude(raw, OFFSET_SIGN_BIT)))
    }

    fn deviations(&self, client: &mut ServoClient, index: usize) -> BusResult<Vec<Deviation>> {
        let actual = sign_magnitude(client.read(index, OFFSET)? as u16, OFFSET_SIGN_BIT);
        let wanted = client.servos[index].settings.homing_offset;
        let other = wanted.filter(|wanted| *wanted != actual);
        Ok(other.map(|wanted| Deviation::shifted(OFFSET, actual, wanted)).into_iter().collect())
    }

    fn read_all(&self, client: &mut ServoClient, present: &mut [u8]) -> BusResult<Option<usize>> {
        client.sync_read(PRESENT, present)
    }

    fn reboot(&self, client: &mut ServoClient, index: usize) -> BusResult<bool> {
        client.transfer(index, instruction::REBOOT, &[], 0, "reboot")?;
        Ok(true)
    }
}
