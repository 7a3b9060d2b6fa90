//! Feeds damaged packets to every parser of the bus: `fuzz [INPUTS]`.
//!
//! Host side: the status decoders of both framings. Servo side: the
//! instruction parsers with whole servos behind them, so that every damaged
//! instruction that still has a sound checksum is carried out as well.

use servodance_drivers::serial::{Firmware, family_of};
use servodance_drivers::{Decoded, Decoder, Framing, ServoConfig, ServoModel, servos};
use servodance_sim::{ByteServo, Line, Protocol1Line, Protocol2Line, SimServoSpec, XServo, status};

/// SplitMix64.
struct Dice(u64);

impl Dice {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, bound: u64) -> u64 {
        self.next() % bound
    }

    /// Bytes that look like packets more often than chance would have it.
    fn byte(&mut self) -> u8 {
        const LIKELY: [u8; 12] = [0xFF, 0xFF, 0xFD, 0, 1, 2, 0xFE, 0x55, 116, 126, 64, 4];
        match self.below(3) {
            0 => self.next() as u8,
            _ => LIKELY[self.below(LIKELY.len() as u64) as usize],
        }
    }

    /// A packet with a sound checksum around arbitrary contents, often damaged
    /// afterwards.
    fn input(&mut self, protocol: Framing, to_host: bool) -> Vec<u8> {
        const CODES: [u8; 15] =
            [1, 2, 3, 4, 5, 6, 8, 0x10, 0x82, 0x83, 0x8A, 0x92, 0x93, 0x9A, 0x55];
        let params: Vec<u8> = (0..self.below(24)).map(|_| self.byte()).collect();
        let id = [1, 2, 0xFE, self.byte()][self.below(4) as usize];
        let mut bytes = Vec::new();
        if to_host && protocol == Framing::Protocol2 {
            bytes = status(id, self.byte(), &params);
        } else {
            let code = CODES[self.below(CODES.len() as u64) as usize];
            protocol.encode(&mut bytes, id, code, &params);
        }
        for _ in 0..self.below(3) {
            let at = self.below(bytes.len() as u64) as usize;
            match self.below(3) {
                0 => bytes[at] = self.byte(),
                1 => bytes.truncate(at.max(1)),
                _ => bytes.insert(at, self.byte()),
            }
        }
        bytes
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let inputs: u64 = std::env::args().nth(1).unwrap_or("1000000".into()).parse()?;
    let mut dice = Dice(1);
    for protocol in [Framing::Protocol2, Framing::Protocol1] {
        let mut decoder = Decoder::new(protocol);
        let (mut sound, mut corrupt) = (0u64, 0u64);
        for _ in 0..inputs {
            // Bytes left from the last input stay in front, as on a wire.
            if dice.below(8) == 0 {
                decoder.reset(dice.below(300) as usize);
            }
            decoder.push(&dice.input(protocol, true));
            loop {
                match decoder.advance() {
                    Decoded::Incomplete => break,
                    Decoded::Corrupt => corrupt += 1,
                    Decoded::Packet => sound += 1 + decoder.packet().blocks(10).count() as u64,
                }
            }
        }
        println!("{protocol:?} to the host: {inputs} inputs, {sound} packets, {corrupt} damaged");
    }
    for model in ["XM430-W350", "STS3215"] {
        let mut line = fresh_line(model)?;
        let mut packets = (0, 0);
        let protocol = match model {
            "STS3215" => Framing::Protocol1,
            _ => Framing::Protocol2,
        };
        let mut replies = 0;
        for k in 0..inputs {
            if k % 1000 == 0 {
                // Ids, baud rates and return levels have been overwritten by now.
                let (sound, damaged) = line.packets();
                packets = (packets.0 + sound, packets.1 + damaged);
                line = fresh_line(model)?;
            }
            for byte in dice.input(protocol, false) {
                if line.push(byte) {
                    replies += line.execute(0.0).len();
                }
            }
            if k % 64 == 0 {
                // Reboots end, watchdogs trip, motors move.
                line.step(k as f64 * 1e-3, 0.5e-3, true);
            }
        }
        let (sound, damaged) = packets;
        println!(
            "{model}: {inputs} inputs, {sound} instructions, {damaged} damaged, {replies} replies"
        );
    }
    Ok(())
}

fn fresh_line(model: &str) -> Result<Box<dyn Line>, Box<dyn std::error::Error>> {
    let joint = |id: u8| ServoConfig {
        name: format!("joint_{id}"),
        id,
        model: model.into(),
        direction: 1,
        zero_deg: 180.0,
        lower_deg: -90.0,
        upper_deg: 90.0,
        velocity_deg_s: 230.0,
        acceleration_deg_s2: 2300.0,
        ..Default::default()
    };
    let specs: Vec<SimServoSpec> = servos(&[joint(1), joint(2)])?.iter().map(Into::into).collect();
    let known = ServoModel::from_name(model).ok_or("unknown model")?;
    let family = family_of(known.kind).ok_or("no serial servo")?;
    let line: Box<dyn Line> = match family.firmware(known) {
        Firmware::Bytes(memory) => {
            let servo = |spec| ByteServo::new(spec, known, memory, 1_000_000, 12.0, 0.01);
            let servos = specs.iter().map(servo).collect();
            Box::new(Protocol1Line::new(servos, 1_000_000, 0.0))
        }
        Firmware::DynamixelX => {
            let servo = |spec| XServo::new(spec, known, 4, 12.0, 0.01);
            let servos = specs.iter().map(servo).collect();
            Box::new(Protocol2Line::new(servos, 2_000_000, 0.0))
        }
    };
    Ok(line)
}
