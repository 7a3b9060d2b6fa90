//! Dynamixel Protocol 2.0 on the servo's side: instructions in, status packets out.
//!
//! Written apart from the driver's codec, with its own CRC and stuffing, so
//! that an error in one is not hidden by the same error in the other.

const HEADER: [u8; 4] = [0xFF, 0xFF, 0xFD, 0x00];
const STATUS: u8 = 0x55;
pub const BROADCAST: u8 = 0xFE;
/// Instruction packets longer than this are noise: no servo takes more.
const LONGEST: usize = 4096;

/// CRC-16: polynomial 0x8005, start 0, most significant bit first, no final xor.
pub fn crc16(start: u16, bytes: &[u8]) -> u16 {
    bytes.iter().fold(start, |mut crc, byte| {
        crc ^= u16::from(*byte) << 8;
        for _ in 0..8 {
            let carry = crc >> 15;
            crc = (crc << 1) ^ (carry * 0x8005);
        }
        crc
    })
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Instruction {
    /// The addressed servo, or [`BROADCAST`].
    pub id: u8,
    pub code: u8,
    /// The parameters without stuffing.
    pub params: Vec<u8>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Parsed {
    Instruction(Instruction),
    BadSum(u8),
}

/// Takes bytes one by one, as a UART does, and finds instructions in them.
#[derive(Clone, Debug, Default)]
pub struct Parser {
    buffer: Vec<u8>,
}

impl Parser {
    /// Takes one byte; returns what it completed.
    pub fn push(&mut self, byte: u8) -> Option<Parsed> {
        self.buffer.push(byte);
        self.resync();
        if self.buffer.len() < 7 {
            return None;
        }
        let length = usize::from(u16::from_le_bytes([self.buffer[5], self.buffer[6]]));
        if !(3..=LONGEST).contains(&length) {
            self.buffer.remove(0);
            self.resync();
            return None;
        }
        if self.buffer.len() < 7 + length {
            return None;
        }
        let frame = std::mem::take(&mut self.buffer);
        let (body, sum) = frame.split_at(frame.len() - 2);
        if crc16(0, body).to_le_bytes() != sum {
            return Some(Parsed::BadSum(frame[4]));
        }
        // A status packet is another servo's answer, or an echo.
        (body[7] != STATUS).then(|| {
            Parsed::Instruction(Instruction {
                id: body[4],
                code: body[7],
                params: unstuffed(&body[8..]),
            })
        })
    }

    /// Drops bytes until the rest is, or may become, a header.
    fn resync(&mut self) {
        let differs = |(byte, wanted): (&u8, u8)| *byte != wanted;
        while self.buffer.iter().zip(HEADER).any(differs) {
            self.buffer.remove(0);
        }
    }
}

/// A copy without the `FD` that follows each `FF FF FD`.
fn unstuffed(bytes: &[u8]) -> Vec<u8> {
    let mut out: Vec<u8> = Vec::with_capacity(bytes.len());
    let mut run = 0usize;
    for &byte in bytes {
        if run == 3 && byte == 0xFD {
            run = 0;
            continue;
        }
        run = next_run(run, byte);
        out.push(byte);
    }
    out
}

/// How much of `FF FF FD` stands at the end, after one more byte.
fn next_run(run: usize, byte: u8) -> usize {
    match (run, byte) {
        (2, 0xFD) => 3,
        (1 | 2, 0xFF) => 2,
        (_, 0xFF) => 1,
        _ => 0,
    }
}

/// A status packet from one servo, parameters stuffed.
pub fn status(id: u8, error: u8, params: &[u8]) -> Vec<u8> {
    let mut body = vec![error];
    let mut run = 0;
    for &byte in params {
        body.push(byte);
        run = next_run(run, byte);
        if run == 3 {
            body.push(0xFD);
            run = 0;
        }
    }
    let mut packet = HEADER.to_vec();
    packet.push(id);
    packet.extend(((body.len() + 3) as u16).to_le_bytes());
    packet.push(STATUS);
    packet.extend(body);
    let crc = crc16(0, &packet);
    packet.extend(crc.to_le_bytes());
    packet
}

/// The pieces that servos send one after the other to answer a fast read:
/// the first with the header, each with a CRC over everything so far.
pub fn fast_status(blocks: &[(u8, u8, Vec<u8>)], announced: usize) -> Vec<Vec<u8>> {
    let mut pieces = Vec::with_capacity(blocks.len());
    let mut crc = 0;
    for (index, (error, id, data)) in blocks.iter().enumerate() {
        let mut piece = Vec::new();
        if index == 0 {
            piece.extend(HEADER);
            piece.push(BROADCAST);
            piece.extend((announced as u16).to_le_bytes());
            piece.push(STATUS);
        }
        piece.extend([*error, *id]);
        piece.extend(data);
        crc = crc16(crc, &piece);
        let sum = crc.to_le_bytes();
        piece.extend(sum);
        crc = crc16(crc, &sum);
        pieces.push(piece);
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn hex(text: &str) -> Vec<u8> {
        let digits: String = text.split_whitespace().collect();
        (0..digits.len() / 2)
            .map(|i| u8::from_str_radix(&digits[2 * i..2 * i + 2], 16).unwrap())
            .collect()
    }

    fn parse(bytes: &[u8]) -> Vec<Parsed> {
        let mut parser = Parser::default();
        bytes.iter().filter_map(|byte| parser.push(*byte)).collect()
    }

    #[test]
    fn published_status_packets_have_these_bytes() {
        // Ping reply of id 1, model 1030, firmware 38; read reply 166.
        assert_eq!(status(1, 0, &[6, 4, 38]), hex("FFFFFD00 01 0700 55 00 060426 655D"));
        assert_eq!(status(1, 0, &[0xA6, 0, 0, 0]), hex("FFFFFD00 01 0800 55 00 A6000000 8CC0"));
    }

    #[test]
    fn fast_sync_read_vector_has_these_bytes() {
        let block = |id, value: u32| (0, id, value.to_le_bytes().to_vec());
        let pieces = fast_status(&[block(3, 0xA6), block(7, 0x81F), block(4, 0x3FF)], 25);
        assert_eq!(
            pieces.concat(),
            hex("FFFFFD00FE190055 0003A60000008408 00071F08000016CA 0004FF030000D19E")
        );
    }

    #[test]
    fn published_instruction_parses_after_noise() {
        let bytes = hex("FF00FFFFFD FFFFFD00 01 0700 02 84000400 1D15");
        let read = Instruction { id: 1, code: 2, params: vec![0x84, 0, 4, 0] };
        assert_eq!(parse(&bytes), [Parsed::Instruction(read)]);
    }

    #[test]
    fn a_flipped_bit_is_a_bad_crc() {
        let mut bytes = hex("FFFFFD00 01 0700 02 84000400 1D15");
        bytes[9] ^= 1;
        assert_eq!(parse(&bytes), [Parsed::BadSum(1)]);
    }

    proptest! {
        #[test]
        fn what_the_driver_encodes_is_what_the_servo_reads(
            id in 0u8..253,
            code in 1u8..0x50,
            params in prop::collection::vec(prop_oneof![Just(0xFFu8), Just(0xFD), any::<u8>()], 0..300),
        ) {
            let mut wire = Vec::new();
            servodance_drivers::encode(&mut wire, id, code, &params);
            prop_assert_eq!(parse(&wire), vec![Parsed::Instruction(Instruction { id, code, params })]);
        }

        #[test]
        fn what_the_servo_encodes_is_what_the_driver_reads(
            id in 0u8..253,
            params in prop::collection::vec(prop_oneof![Just(0xFFu8), Just(0xFD), any::<u8>()], 0..300),
        ) {
            let mut decoder = servodance_drivers::Decoder::default();
            decoder.reset(1000);
            decoder.push(&status(id, 0, &params));
            prop_assert_eq!(decoder.advance(), servodance_drivers::Decoded::Packet);
            prop_assert_eq!(decoder.packet().params(), &params[..]);
        }

        #[test]
        fn any_bytes_are_taken_without_a_panic(
            noise in prop::collection::vec(prop_oneof![Just(0xFFu8), Just(0xFD), Just(0), any::<u8>()], 0..600),
        ) {
            parse(&noise);
        }
    }
}
