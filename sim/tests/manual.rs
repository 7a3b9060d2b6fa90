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
    fn write(&mut self, id: u8, register: Register, value: i64) -> Option<u8> {
        let mut params = register.address.to_le_bytes().to_vec();
        params.extend(&value.to_le_bytes()[..usize::from(register.size)]);
        self.ask(id, code::WRITE, &params).first().map(|answer| answer.1)
    }

    fn read(&mut self, id: u8, register: Register) -> u64 {
        let params = [register.address.to_le_bytes(), register.size.to_le_bytes()].concat();
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
