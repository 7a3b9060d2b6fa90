//! CiA 402 drives over CANopen, cyclic synchronous position.
//!
//! The PDOs are mapped by this driver, with the drive pre-operational. Objects
//! are written with torque off and read back. When our heartbeat ends, the drive
//! switches its voltage off (6007 = 2).
//!
//! The drive's own position loop is used, so `kp` and `kd` mean nothing here.

mod errors;
#[doc(hidden)] // public for the simulated motors alone
pub mod registers;
mod scan;

use std::f64::consts::TAU;
use std::io;

use crate::can::family::prelude::*;

use self::errors::{LOST, abort_name, error_name};
use self::registers::{
    ABORT, ABORT_OPTION, CONSUMER, CONTROL, CYCLIC_POSITION, DEVICE_TYPE, DOWNLOADED, EMERGENCY,
    ERROR_CODE, FAULT, FAULT_RESET, HEARTBEAT, MAX_TORQUE, MODE, MODE_SHOWN, NMT_PRE_OPERATIONAL,
    NMT_START, OPERATIONAL, PDO_OFF, POSITION, RPDO, RPDO_PARAMETERS, SDO_ANSWER, SDO_REQUEST,
    STATUS, SYNC, SdoObject, TARGET, TORQUE, TPDO, TPDO_PARAMETERS, UPLOAD, download, mapped,
};

const HOST: u32 = 127;
/// Device profile in the low word of object 1000.
const PROFILE: u32 = 402;
/// Value of [`ABORT_OPTION`]: switch the voltage off.
const DISABLE_VOLTAGE: u32 = 2;
const OPERATION_ENABLED: (u16, u16) = (0x6F, 0x27);
/// Control words on the way to torque, and the status word each must bring.
const LADDER: [(u32, u16, &str); 3] = [
    (0x06, 0x21, "ready to switch on"),
    (0x07, 0x23, "switched on"),
    (0x0F, OPERATION_ENABLED.1, "operation enabled"),
];

static MODELS: [ServoModel; 1] = [drive("CiA402", BusKind::Cia402)];

pub(crate) struct Cia402;

fn sdo(servo: &Servo, command: u8, object: SdoObject, value: [u8; 4]) -> CanFrame {
    let [low, high] = object.0.to_le_bytes();
    let [a, b, c, d] = value;
    let data = [command, low, high, object.1, a, b, c, d];
    CanFrame::standard(SDO_REQUEST + u32::from(servo.id), &data)
}

/// Sends one SDO; the value bytes of the answer.
fn transfer(
    client: &mut MotorClient,
    command: u8,
    object: SdoObject,
    value: [u8; 4],
) -> BusResult<[u8; 4]> {
    let request = sdo(client.servo(), command, object, value);
    let [low, high] = object.0.to_le_bytes();
    client.ask(&request, object.3, |servo, frame| {
        if frame.is_extended() || frame.id() != SDO_ANSWER + u32::from(servo.id) {
            return None;
        }
        let [said, l, h, sub, value @ ..] = frame.eight()?;
        if [l, h, sub] != [low, high, object.1] {
            return None;
        }
        match said {
            ABORT => Some(Err(abort_name(u32::from_le_bytes(value)))),
            DOWNLOADED if command != UPLOAD => Some(Ok(value)),
            // Expedited, with or without a size.
            0x42..=0x4F if command == UPLOAD => Some(Ok(value)),
            _ => None,
        }
    })
}

fn read(client: &mut MotorClient, object: SdoObject) -> BusResult<u32> {
    let bytes = transfer(client, UPLOAD, object, [0; 4])?;
    let unused = 8 * (4 - u32::from(object.2));
    Ok(u32::from_le_bytes(bytes) << unused >> unused)
}

fn write(client: &mut MotorClient, object: SdoObject, value: u32) -> BusResult<()> {
    transfer(client, download(object), object, value.to_le_bytes()).map(|_| ())
}

fn set(client: &mut MotorClient, object: SdoObject, value: u32) -> BusResult<()> {
    write(client, object, value)?;
    let actual = read(client, object)?;
    client.verify(object.3, actual, value)
}

fn map_pdo(
    client: &mut MotorClient,
    (communication, mapping): (u16, u16),
    id: u32,
    objects: &[SdoObject],
) -> BusResult<()> {
    const NAME: &str = "PDO mapping";
    write(client, (communication, 1, 4, NAME), id | PDO_OFF)?;
    write(client, (communication, 2, 1, NAME), 1)?;
    write(client, (mapping, 0, 1, NAME), 0)?;
    for (entry, object) in (1..).zip(objects) {
        set(client, (mapping, entry, 4, NAME), mapped(*object))?;
    }
    set(client, (mapping, 0, 1, NAME), objects.len() as u32)?;
    set(client, (communication, 1, 4, NAME), id)
}

fn counts(motor: &MotorSettings, motor_rad: f64) -> f64 {
    motor_rad / TAU * motor.gear_ratio * motor.counts_per_turn
}

fn angle_rad(motor: &MotorSettings, counts: i32) -> f64 {
    f64::from(counts) * TAU / (motor.gear_ratio * motor.counts_per_turn)
}

fn target_counts(servo: &Servo, motor: &MotorSettings, joint_rad: f64) -> i32 {
    let exact = |joint_rad| counts(motor, servo.motor_rad(joint_rad));
    let (lowest, highest) = whole_range(servo, exact);
    exact(joint_rad).round().clamp(lowest, highest) as i32
}

fn is_enabled(status: u16) -> bool {
    status & OPERATION_ENABLED.0 == OPERATION_ENABLED.1
}

fn nmt(servo: &Servo, command: u8) -> CanFrame {
    CanFrame::standard(0, &[command, servo.id])
}

fn heartbeat() -> CanFrame {
    CanFrame::standard(HEARTBEAT + HOST, &[OPERATIONAL])
}

impl Cia402 {
    fn fault(client: &mut MotorClient, status: u16) -> BusResult<Option<String>> {
        if status & FAULT == 0 {
            return Ok(None);
        }
        let code = read(client, ERROR_CODE)?;
        Ok(Some(format!("fault, {}", error_name(code as u16))))
    }
}

impl CanFamily for Cia402 {
    fn models(&self) -> &'static [ServoModel] {
        &MODELS
    }

    fn cycle_frames(&self) -> CycleFrames {
        CycleFrames::new(false, &[0, 1], &[6, 8])
    }

    fn torque_off(&self, client: &mut MotorClient) -> BusResult<MotorStatus> {
        write(client, CONTROL, 0)?;
        let status = read(client, STATUS)? as u16;
        if is_enabled(status) {
            return Err(client.unfit(
                STATUS.3,
                format!("{status:04X}"),
                "off after control word 0",
            ));
        }
        let mut fault = Self::fault(client, status)?;
        // A heartbeat that was lost before this program began is cleared.
        if fault.as_ref().is_some_and(|fault| fault.contains(LOST)) {
            write(client, CONTROL, FAULT_RESET)?;
            let status = read(client, STATUS)? as u16;
            fault = Self::fault(client, status)?;
        }
        let position = read(client, POSITION)? as i32;
        let motor = client.servo().motor.as_ref();
        Ok(MotorStatus {
            position_rad: motor.map_or(f64::NAN, |motor| angle_rad(motor, position)),
            velocity_rad_s: 0.0,
            active: false,
            fault,
            temperature_c: None,
        })
    }

    fn set_up(&self, client: &mut MotorClient, _notes: &mut Notes) -> BusResult<()> {
        let servo = client.servo().clone();
        let id = u32::from(servo.id);
        let device = read(client, DEVICE_TYPE)?;
        if device & 0xFFFF != PROFILE {
            let actual = format!("profile {}", device & 0xFFFF);
            return Err(client.unfit(DEVICE_TYPE.3, actual, "profile 402"));
        }
        client.send(&[nmt(&servo, NMT_PRE_OPERATIONAL)], "setting up")?;
        map_pdo(client, RPDO_PARAMETERS, RPDO + id, &[CONTROL, TARGET])?;
        let reported = [STATUS, POSITION, TORQUE];
        map_pdo(client, TPDO_PARAMETERS, TPDO + id, &reported)?;
        write(client, MODE, CYCLIC_POSITION)?;
        let mode = read(client, MODE_SHOWN)?;
        client.verify(MODE_SHOWN.3, mode, CYCLIC_POSITION)?;
        if let Some(motor) = &servo.motor {
            let share = motor.torque_limit_nm / motor.model.torque_nm;
            let per_mille = (share * 1000.0).round() as u32;
            set(client, MAX_TORQUE, per_mille)?;
        }
        set(client, ABORT_OPTION, DISABLE_VOLTAGE)?;
        let watched = HOST << 16 | client.config().watchdog_ms;
        set(client, CONSUMER, watched)
    }

    fn torque_on(&self, client: &mut MotorClient, motor_rad: f64) -> BusResult<()> {
        let servo = client.servo().clone();
        let Some(motor) = &servo.motor else {
            return Ok(());
        };
        // The drive begins to watch with the first heartbeat that it receives.
        client.send(&[heartbeat(), nmt(&servo, NMT_START)], "torque on")?;
        let hold = target_counts(&servo, motor, servo.joint_rad(motor_rad));
        set(client, TARGET, hold as u32)?;
        for (control, wanted, name) in LADDER {
            write(client, CONTROL, control)?;
            let status = read(client, STATUS)? as u16;
            if let Some(fault) = Self::fault(client, status)? {
                return Err(client.bus.faulty(client.index, &fault));
            }
            if status & OPERATION_ENABLED.0 != wanted {
                let actual = format!("{status:04X}");
                return Err(client.unfit(STATUS.3, actual, name));
            }
        }
        client.send(&[heartbeat()], "torque on")
    }

    fn torque_off_frames(&self, servo: &Servo, out: &mut Vec<CanFrame>) {
        out.push(sdo(servo, download(CONTROL), CONTROL, [0; 4]));
    }

    fn target_frames(
        &self,
        _: &BusConfig,
        servo: &Servo,
        joint_rad: f64,
        _: &MotorStatus,
        out: &mut Vec<CanFrame>,
    ) {
        let Some(motor) = &servo.motor else {
            return;
        };
        let mut data = [0; 6];
        data[..2].copy_from_slice(&0x0Fu16.to_le_bytes());
        let target = target_counts(servo, motor, joint_rad);
        data[2..].copy_from_slice(&target.to_le_bytes());
        out.push(CanFrame::standard(RPDO + u32::from(servo.id), &data));
    }

    fn cycle_end_frames(&self, out: &mut Vec<CanFrame>) {
        out.push(heartbeat());
        out.push(CanFrame::standard(SYNC, &[]));
    }

    fn parse_frame(
        &self,
        servos: &[Servo],
        frame: &CanFrame,
        status: &mut [MotorStatus],
    ) -> Option<usize> {
        if frame.is_extended() {
            return None;
        }
        let node = frame.id() & 0x7F;
        let index = servos.iter().position(|servo| u32::from(servo.id) == node)?;
        let motor = servos[index].motor.as_ref()?;
        let status = &mut status[index];
        match (frame.id() & 0x780, frame.data()) {
            (TPDO, &[s0, s1, p0, p1, p2, p3, _, _]) => {
                let word = u16::from_le_bytes([s0, s1]);
                let position = i32::from_le_bytes([p0, p1, p2, p3]);
                status.position_rad = angle_rad(motor, position);
                status.active = is_enabled(word);
                if word & FAULT != 0 && status.fault.is_none() {
                    status.fault = Some(format!("fault (status word {word:04X})"));
                }
                Some(index)
            }
            (EMERGENCY, &[c0, c1, ..]) => {
                let code = u16::from_le_bytes([c0, c1]);
                status.fault = (code != 0).then(|| error_name(code));
                None
            }
            _ => None,
        }
    }

    fn scan(&self, scanner: &mut ScanLink) -> io::Result<Vec<CanFound>> {
        scan::devices(scanner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn expedited_downloads_have_their_published_command_bytes() {
        let commands = [1, 2, 4].map(|bytes| download((0x6060, 0, bytes, "")));
        assert_eq!(commands, [0x2F, 0x2B, 0x23]);
    }
}
