//! Simulated servos against what the vendors' manuals say, byte by byte, without a driver.

mod common;

use common::*;
use servodance_drivers::serial::instruction as code;
use servodance_drivers::serial::{Register, dynamixel2::registers as at};
use servodance_drivers::{BusKind, Decoded, Decoder, Framing, ReplyClock, Servo, encode};
use servodance_sim::{SimBus, SimLink, SimOptions};
use std::io::{Read, Write};
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixStream};
use std::time::Duration;

/// A program at the other end of the line.
struct Host {
    line: UnixStream,
    framing: Framing,
    sim: SimBus,
}

/// Who answered, the error, the parameters.
type Answer = (u8, u8, Vec<u8>);

fn host(servos: &[Servo], framing: Framing, baud: u32) -> Host {
    let options = SimOptions { link: SimLink::Unix, ..SimOptions::lockstep(baud, HZ) };
    let sim = SimBus::start(&specs(servos), options).unwrap();
    let name = sim.port_path().trim_start_matches('@');
    let address = SocketAddr::from_abstract_name(name).unwrap();
    let line = UnixStream::connect_addr(&address).unwrap();
    line.set_read_timeout(Some(Duration::from_millis(20))).unwrap();
    Host { line, framing, sim }
}

fn dynamixels() -> Host {
    host(&robot(2), Framing::Protocol2, BAUD)
}

impl Host {
    fn send(&mut self, id: u8, instruction: u8, params: &[u8]) {
        let mut packet = Vec::new();
        match self.framing {
            Framing::Protocol2 => encode(&mut packet, id, instruction, params),
            Framing::Protocol1 => {
                packet.extend([0xFF, 0xFF, id, params.len() as u8 + 2, instruction]);
                packet.extend(params);
                let sum = packet[2..].iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
                packet.push(!sum);
            }
        }
        self.line.write_all(&packet).unwrap();
    }

    /// Everything that is answered.
    fn answers(&mut self) -> Vec<Answer> {
        let mut decoder = Decoder::new(self.framing);
        decoder.reset(1000);
        let mut bytes = [0; 256];
        let mut found = Vec::new();
        let ReplyClock::FarEnd(servos) = self.sim.reply_clock() else { return found };
        loop {
            // In this order: what was said until then is found.
            let all_is_said = servos.is_idle();
            match self.line.read(&mut bytes) {
                Ok(count @ 1..) => decoder.push(&bytes[..count]),
                _ if all_is_said => return found,
                _ => {}
            }
            while decoder.advance() == Decoded::Packet {
                let packet = decoder.packet();
                found.push((packet.id, packet.error(), packet.params().to_vec()));
            }
        }
    }

    fn ask(&mut self, id: u8, instruction: u8, params: &[u8]) -> Vec<Answer> {
        self.send(id, instruction, params);
        self.answers()
    }

    /// The error of a write; `None` if nobody answers.
    /// An address or a size as this protocol has it.
    fn place(&self, number: u16) -> Vec<u8> {
        match self.framing {
            Framing::Protocol2 => number.to_le_bytes().to_vec(),
            Framing::Protocol1 => vec![number as u8],
        }
    }

    fn write(&mut self, id: u8, register: Register, value: i64) -> Option<u8> {
        let mut params = self.place(register.address);
        params.extend(&value.to_le_bytes()[..usize::from(register.size)]);
        self.ask(id, code::WRITE, &params).first().map(|answer| answer.1)
    }

    fn read(&mut self, id: u8, register: Register) -> u64 {
        let params = [self.place(register.address), self.place(register.size)].concat();
        let answers = self.ask(id, code::READ, &params);
        register.value(&answers[0].2)
    }
}

#[test]
fn a_new_id_is_confirmed_by_the_old_one() {
    let mut host = dynamixels();
    let answers = host.ask(1, code::WRITE, &[7, 0, 9]);
    assert_eq!(answers, [(1, 0, vec![])]);
    assert_eq!(host.ask(9, code::PING, &[])[0].0, 9);
    assert_eq!(host.ask(1, code::PING, &[]), []);
}

#[test]
fn the_rest_of_a_packet_is_waited_for_a_tenth_of_a_second() {
    let mut host = dynamixels();
    let part = [0xFF, 0xFF, 0xFD, 0, 1, 0, 0x0F];
    for (pause_s, heard) in [(0.02, false), (0.2, true)] {
        host.line.write_all(&part).unwrap();
        assert_eq!(host.answers(), []);
        host.sim.advance(pause_s);
        assert_eq!(!host.ask(1, code::PING, &[]).is_empty(), heard, "after {pause_s} s");
        host.sim.advance(1.0);
    }
}

#[test]
fn values_that_the_manual_refuses_are_refused() {
    let mut host = dynamixels();
    let indirect = Register::word(168, "indirect address 1");
    for (register, value, error) in [
        (at::DRIVE_MODE, 2, 4),
        (at::PROTOCOL_TYPE, 7, 4),
        (at::PROTOCOL_TYPE, 2, 0),
        (indirect, 11, 4),
        (indirect, 132, 0),
        (at::OPERATING_MODE, 4, 0),
        (at::GOAL_POSITION, 2_000_000, 6),
        (at::GOAL_POSITION, 1_048_575, 0),
        (at::GOAL_POSITION, -1_048_575, 0),
    ] {
        assert_eq!(host.write(1, register, value), Some(error), "{} {value}", register.name);
    }
}

#[test]
fn everyone_is_not_made_to_forget_ids_at_once() {
    let mut host = dynamixels();
    assert_eq!(host.ask(0xFE, code::FACTORY_RESET, &[0xFF]), []);
    host.sim.advance(1.0);
    assert_eq!(host.ask(2, code::PING, &[]).len(), 1);
}

#[test]
fn a_homing_offset_beyond_a_quarter_turn_is_ignored_in_position_mode() {
    let mut host = dynamixels();
    let before = host.read(1, at::PRESENT_POSITION);
    for (offset, shifted) in [(2000, 0), (1000, 1000), (-1000, -1000)] {
        assert_eq!(host.write(1, at::HOMING_OFFSET, offset), Some(0));
        let now = host.read(1, at::PRESENT_POSITION) as i64;
        assert_eq!(now - before as i64, shifted, "{offset}");
    }
}

#[test]
fn a_servo_counts_within_a_turn_again_when_it_leaves_the_extended_mode() {
    let mut host = dynamixels();
    assert_eq!(host.write(1, at::OPERATING_MODE, 4), Some(0));
    host.sim.set_servo_fault(0, servodance_sim::ServoFault::Moved(10.0));
    assert!(i64::from(host.read(1, at::PRESENT_POSITION) as i32).abs() > 4096);
    assert_eq!(host.write(1, at::OPERATING_MODE, 3), Some(0));
    assert!(host.read(1, at::PRESENT_POSITION) < 4096);
}

#[test]
fn torque_comes_on_after_a_restart_if_startup_says_so() {
    let mut host = dynamixels();
    assert_eq!(host.write(1, at::STARTUP, 1), Some(0));
    host.ask(1, code::REBOOT, &[]);
    host.sim.advance(1.0);
    assert_eq!(host.read(1, at::TORQUE), 1);
    assert_eq!(host.read(2, at::TORQUE), 0);
}

#[test]
fn moving_status_tells_that_a_goal_is_reached() {
    let mut host = dynamixels();
    assert_eq!(host.write(1, at::PROFILE_VELOCITY, 50), Some(0));
    assert_eq!(host.write(1, at::TORQUE, 1), Some(0));
    assert_eq!(host.read(1, at::MOVING_STATUS) & 3, 1, "there, and no profile");
    assert_eq!(host.write(1, at::GOAL_POSITION, 2500), Some(0));
    host.sim.advance(0.1);
    assert_eq!(host.read(1, at::MOVING_STATUS), 0b1_0010, "on its way, rectangular");
    host.sim.advance(3.0);
    assert_eq!(host.read(1, at::MOVING_STATUS) & 3, 1);
}

/// Feetech STS: mode, acceleration, goal position, time and speed, present position and speed.
mod sts {
    use super::Register;
    pub const MODE: Register = Register::byte(33, "");
    pub const TORQUE: Register = Register::byte(40, "");
    pub const ACCELERATION: Register = Register::byte(41, "");
    pub const GOAL: Register = Register::word(42, "");
    pub const TIME: Register = Register::word(44, "");
    pub const SPEED: Register = Register::word(46, "");
    pub const POSITION: Register = Register::word(56, "");
    pub const PRESENT_SPEED: Register = Register::word(58, "");
}

#[test]
fn a_feetech_wheel_turns_at_its_goal_speed_and_counts_each_turn_anew() {
    let mut host = host(&robot_of("STS3215", 1), Framing::Protocol1, 1_000_000);
    host.ask(1, code::WRITE, &[55, 0]); // the lock
    assert_eq!(host.write(1, sts::MODE, 1), Some(0));
    assert_eq!(host.write(1, sts::TORQUE, 1), Some(0));
    for (goal, sign) in [(1500u64, 0u64), (1500, 1 << 15)] {
        assert_eq!(host.write(1, sts::SPEED, (goal | sign) as i64), Some(0));
        host.sim.advance(4.0);
        let speed = host.read(1, sts::PRESENT_SPEED);
        assert_eq!(speed & 1 << 15, sign, "bit 15 is the direction");
        assert!((speed & 0x7FFF).abs_diff(goal) < 60, "{speed}");
        assert!(host.read(1, sts::POSITION) < 4096);
    }
    // 10 units are 1000 ticks a second each second.
    assert_eq!(host.write(1, sts::SPEED, 0), Some(0));
    host.sim.advance(2.0);
    assert_eq!(host.write(1, sts::ACCELERATION, 10), Some(0));
    assert_eq!(host.write(1, sts::SPEED, 1500), Some(0));
    host.sim.advance(0.75);
    let half = host.read(1, sts::PRESENT_SPEED);
    assert!((600..900).contains(&half), "{half} after half of the ramp");
    assert_eq!(host.write(1, sts::TORQUE, 0), Some(0));
}

#[test]
fn a_feetech_servo_in_open_loop_takes_the_time_register_for_a_duty() {
    let mut host = host(&robot_of("STS3215", 1), Framing::Protocol1, 1_000_000);
    host.ask(1, code::WRITE, &[55, 0]);
    assert_eq!(host.write(1, sts::MODE, 2), Some(0));
    assert_eq!(host.write(1, sts::TORQUE, 1), Some(0));
    let mut speeds = Vec::new();
    for duty in [400, 800, 400 | 1 << 10] {
        assert_eq!(host.write(1, sts::TIME, duty), Some(0));
        host.sim.advance(2.0);
        speeds.push(host.read(1, sts::PRESENT_SPEED));
    }
    let [slow, fast, back] = speeds[..] else { panic!("{speeds:?}") };
    assert!(slow > 300 && fast > 3 * slow / 2, "{speeds:?}");
    assert!(back & 1 << 15 != 0 && (back & 0x7FFF).abs_diff(slow) < 30, "{speeds:?}");
}

#[test]
fn a_feetech_move_takes_its_distance_over_its_speed_and_the_ramp() {
    // The vendor's example: (P1 - P0) / V + V / (A * 100) seconds.
    let mut host = host(&robot_of("STS3215", 1), Framing::Protocol1, 1_000_000);
    assert_eq!(host.write(1, sts::TORQUE, 1), Some(0));
    assert_eq!(host.write(1, sts::GOAL, 1500), Some(0));
    host.sim.advance(1.0);
    assert_eq!(host.write(1, sts::ACCELERATION, 20), Some(0));
    assert_eq!(host.write(1, sts::SPEED, 1000), Some(0));
    assert_eq!(host.write(1, sts::GOAL, 2500), Some(0));
    let due_s = 1000.0 / 1000.0 + 1000.0 / 2000.0;
    host.sim.advance(due_s - 0.25);
    assert!(host.read(1, sts::POSITION) < 2480, "{}", host.read(1, sts::POSITION));
    host.sim.advance(0.35);
    assert!(host.read(1, sts::POSITION).abs_diff(2500) < 12, "{}", host.read(1, sts::POSITION));
}

#[test]
fn feetech_servos_answer_a_ping_of_everyone_and_forget_what_was_written_locked() {
    let servos = robot_of("STS3215", 3);
    assert_eq!(servos[0].model.kind, BusKind::Feetech);
    let mut host = host(&servos, Framing::Protocol1, 1_000_000);
    let ids: Vec<u8> = host.ask(0xFE, code::PING, &[]).iter().map(|answer| answer.0).collect();
    assert_eq!(ids, [1, 2, 3]);
    const LOCK: u8 = 55;
    for (locked, id_after) in [(1, 1), (0, 9)] {
        host.ask(1, code::WRITE, &[LOCK, locked]);
        let answers = host.ask(1, code::WRITE, &[5, 9]);
        assert_eq!(answers, [(1, 0, vec![])], "confirmed by the old id");
        host.ask(9, code::REBOOT, &[]);
        host.sim.advance(2.0);
        assert_eq!(host.ask(id_after, code::PING, &[]).len(), 1, "locked {locked}");
    }
}
