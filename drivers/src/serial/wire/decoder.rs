//! From received bytes to status packets.
//!
//! The `dynamixel2` crate gives the instruction numbers and the CRC; the decoder is
//! our own: it takes any bytes without a panic, finds the next header after
//! damage, refuses a length beyond what was asked for at once instead of waiting
//! for it, and knows Protocol 1 and Fast Sync Read replies (status packets from
//! the broadcast id, never stuffed), which that crate lacks.

use dynamixel2::checksum::calculate_checksum;
use dynamixel2::instructions::instruction_id::STATUS;
use dynamixel2::instructions::packet_id::BROADCAST;

use crate::serial::wire::framing::Framing;
use crate::serial::wire::protocol1::{self, ErrorFlags};
use crate::serial::wire::protocol2;

/// A status packet that came in sound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Packet<'a> {
    /// Who sent it; the broadcast id for a Fast Sync Read reply.
    pub id: u8,
    /// The error byte and the parameters (unstuffed); in a fast reply the
    /// blocks `ERR ID DATA CRC`, the last one without its CRC. Never empty.
    body: &'a [u8],
    flags: u8,
}

impl<'a> Packet<'a> {
    /// The error number, without the alert bit; 0 is success.
    pub fn error(&self) -> u8 {
        self.body[0] & 0x7F
    }

    /// The servo has a hardware error to report.
    pub fn alert(&self) -> bool {
        self.body[0] & 0x80 != 0
    }

    /// The error byte as it came: in Protocol 1 flags, not a number.
    pub fn flags(&self) -> u8 {
        self.flags
    }

    /// The parameters after the error byte.
    pub fn params(&self) -> &'a [u8] {
        &self.body[1..]
    }

    /// The blocks of a fast reply that carries `size` bytes a servo: error byte, id, data.
    pub fn blocks(&self, size: usize) -> impl Iterator<Item = (u8, u8, &'a [u8])> + use<'a> {
        self.body
            .chunks(size + 4)
            .filter(move |block| block.len() >= size + 2)
            .map(move |block| (block[0], block[1], &block[2..size + 2]))
    }
}

/// What the decoder made of the bytes so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decoded {
    /// A sound packet: see [`Decoder::packet`].
    Packet,
    /// Something that began like a packet and was damaged; it has been skipped.
    Corrupt,
    /// More bytes are needed.
    Incomplete,
}

/// Turns a stream of bytes into status packets.
#[derive(Clone, Debug, Default)]
pub struct Decoder {
    framing: Framing,
    /// How the error flags of Protocol 1 are read.
    error_flags: ErrorFlags,
    buffer: Vec<u8>,
    longest: usize,
    id: u8,
    body: Vec<u8>,
    flags: u8,
    echo: Vec<u8>,
    /// The echo of what was sent before, which nobody answers: it may still come.
    earlier_echo: Vec<u8>,
}

impl Decoder {
    /// A decoder of status packets in this framing.
    pub fn new(framing: Framing) -> Self {
        Self { framing, ..Self::default() }
    }

    /// How the error flags of Protocol 1 are read from now on: as Dynamixel's without this.
    pub fn read_flags_as(&mut self, error_flags: ErrorFlags) {
        self.error_flags = error_flags;
    }

    /// Forgets all bytes, and from now on takes a packet whose length field
    /// says more than `longest` for damaged.
    pub fn reset(&mut self, longest: usize) {
        self.buffer.clear();
        self.longest = longest;
    }

    /// The instructions just sent, which an adapter may echo: their echo may be
    /// longer than any answer, and in Protocol 1 it looks like one. That of a ping
    /// of Protocol 1 cannot be told from its answer, and is not looked for. After
    /// instructions that nobody answers (`after_goals`) their echo may still come.
    pub fn expect_echo(&mut self, sent: &[u8], after_goals: bool) {
        const PING_BYTES: usize = 6;
        std::mem::swap(&mut self.echo, &mut self.earlier_echo);
        if !after_goals {
            self.earlier_echo.clear();
        }
        self.echo.clear();
        if self.framing == Framing::Protocol2 || sent.len() > PING_BYTES {
            self.echo.extend_from_slice(sent);
        }
    }

    /// Adds bytes as they were received.
    pub fn push(&mut self, bytes: &[u8]) {
        self.buffer.extend_from_slice(bytes);
    }

    /// Looks for the next packet in the bytes so far.
    pub fn advance(&mut self) -> Decoded {
        match self.framing {
            Framing::Protocol2 => self.advance_protocol2(),
            Framing::Protocol1 => self.advance_protocol1(),
        }
    }

    fn advance_protocol1(&mut self) -> Decoded {
        const HEADER: &[u8] = &[0xFF, 0xFF];
        self.skip_to_header(HEADER);
        // A third FF is the last of an idle line, not an id.
        while self.buffer.starts_with(&[0xFF, 0xFF, 0xFF]) {
            self.buffer.remove(0);
        }
        let Some(&length) = self.buffer.get(protocol1::PREFIX - 1) else {
            return Decoded::Incomplete;
        };
        let end = protocol1::PREFIX + usize::from(length);
        if let Some(found) = self.pass_echo(end) {
            return found;
        }
        if length >= 2 && usize::from(length) <= self.longest && self.buffer.len() < end {
            return Decoded::Incomplete;
        }
        let sound = length >= 2
            && usize::from(length) <= self.longest
            && protocol1::checksum(&self.buffer[HEADER.len()..end - 1]) == self.buffer[end - 1];
        if !sound {
            self.buffer.drain(..HEADER.len());
            return Decoded::Corrupt;
        }
        self.id = self.buffer[2];
        self.body.clear();
        self.flags = self.buffer[protocol1::PREFIX];
        self.body.push(self.error_flags.error_of(self.flags));
        self.body.extend_from_slice(&self.buffer[protocol1::PREFIX + 1..end - 1]);
        self.buffer.drain(..end);
        Decoded::Packet
    }

    /// Goes on behind an echo of `end` bytes, if one stands in front: it may be
    /// longer than any answer.
    fn pass_echo(&mut self, end: usize) -> Option<Decoded> {
        let begun = &self.buffer[..end.min(self.buffer.len())];
        let stands = |echo: &Vec<u8>| echo.get(..end).is_some_and(|whole| whole.starts_with(begun));
        let echo = match (stands(&self.earlier_echo), stands(&self.echo)) {
            (true, _) => &mut self.earlier_echo,
            (false, true) => &mut self.echo,
            (false, false) => return None,
        };
        if self.buffer.len() < end {
            return Some(Decoded::Incomplete);
        }
        echo.drain(..end);
        self.buffer.drain(..end);
        Some(self.advance())
    }

    fn advance_protocol2(&mut self) -> Decoded {
        loop {
            self.skip_to_header(&protocol2::HEADER);
            let Some(&[low, high]) = self.buffer.get(5..protocol2::PREFIX) else {
                return Decoded::Incomplete;
            };
            let length = usize::from(u16::from_le_bytes([low, high]));
            if let Some(found) = self.pass_echo(protocol2::PREFIX + length) {
                return found;
            }
            if length < 4 || length > self.longest {
                self.buffer.drain(..protocol2::HEADER.len());
                return Decoded::Corrupt;
            }
            let end = protocol2::PREFIX + length;
            if self.buffer.len() < end {
                return Decoded::Incomplete;
            }
            let crc = u16::from_le_bytes([self.buffer[end - 2], self.buffer[end - 1]]);
            if crc != calculate_checksum(0, &self.buffer[..end - 2]) {
                self.buffer.drain(..protocol2::HEADER.len());
                return Decoded::Corrupt;
            }
            let is_status = self.buffer[protocol2::PREFIX] == STATUS;
            if is_status {
                self.id = self.buffer[4];
                self.flags = self.buffer[protocol2::PREFIX + 1];
                self.body.clear();
                let raw = &self.buffer[protocol2::PREFIX + 1..end - 2];
                if self.id == BROADCAST {
                    self.body.extend_from_slice(raw);
                } else {
                    protocol2::unstuff(raw, &mut self.body);
                }
            }
            self.buffer.drain(..end);
            // An instruction is our own echo from a half-duplex adapter.
            if is_status {
                return Decoded::Packet;
            }
        }
    }

    /// The packet that the last [`Decoded::Packet`] meant.
    pub fn packet(&self) -> Packet<'_> {
        const NOTHING: &[u8] = &[0];
        Packet {
            id: self.id,
            flags: self.flags,
            body: if self.body.is_empty() { NOTHING } else { &self.body },
        }
    }

    /// Drops bytes in front of the next header, or of what may become one.
    fn skip_to_header(&mut self, header: &[u8]) {
        let begins = |rest: &[u8]| {
            let known = rest.len().min(header.len());
            rest[..known] == header[..known]
        };
        let start = (0..self.buffer.len()).find(|&at| begins(&self.buffer[at..]));
        self.buffer.drain(..start.unwrap_or(self.buffer.len()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::serial::wire::protocol2::encode;
    use proptest::prelude::*;

    fn bytes(hex: &str) -> Vec<u8> {
        let digits: Vec<u8> = hex.bytes().filter(|b| !b.is_ascii_whitespace()).collect();
        digits
            .chunks(2)
            .map(|pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap())
            .collect()
    }

    #[test]
    fn an_echo_longer_than_any_answer_is_passed_over() {
        for framing in [Framing::Protocol2, Framing::Protocol1] {
            let mut sent = Vec::new();
            framing.encode(&mut sent, BROADCAST, 0x83, &[116; 90]);
            framing.encode(&mut sent, 7, 0x02, &[132, 4]);
            let mut wire = sent.clone();
            framing.encode(&mut wire, 7, STATUS, &[0, 9]);
            let mut decoder = Decoder::new(framing);
            decoder.reset(8);
            decoder.expect_echo(&sent, false);
            let mut found = Vec::new();
            for byte in wire {
                decoder.push(&[byte]);
                match decoder.advance() {
                    Decoded::Incomplete => {}
                    decoded => found.push((decoded, decoder.packet().id)),
                }
            }
            assert_eq!(found, [(Decoded::Packet, 7)], "{framing:?}");
        }
    }

    #[test]
    fn fast_sync_read_vector_gives_three_blocks() {
        let reply = bytes("FFFFFD00FE190055 0003A60000008408 00071F08000016CA 0004FF030000D19E");
        let mut decoder = Decoder::default();
        decoder.reset(25);
        decoder.push(&reply);
        assert_eq!(decoder.advance(), Decoded::Packet);
        let packet = decoder.packet();
        let blocks: Vec<_> = packet.blocks(4).collect();
        assert_eq!(packet.id, BROADCAST);
        assert_eq!(blocks[0], (0, 3, &bytes("A6000000")[..]));
        assert_eq!(blocks[1], (0, 7, &bytes("1F080000")[..]));
        assert_eq!(blocks[2], (0, 4, &bytes("FF030000")[..]));
        assert_eq!(blocks.len(), 3);
    }

    #[test]
    fn the_echo_of_goals_may_come_after_the_next_question() {
        for framing in [Framing::Protocol2, Framing::Protocol1] {
            let (mut goals, mut question) = (Vec::new(), Vec::new());
            framing.encode(&mut goals, BROADCAST, 0x83, &[116; 90]);
            framing.encode(&mut question, 7, 0x02, &[132, 4]);
            let mut decoder = Decoder::new(framing);
            decoder.expect_echo(&goals, false);
            decoder.reset(8);
            decoder.expect_echo(&question, true);
            let mut wire = [goals, question].concat();
            framing.encode(&mut wire, 7, STATUS, &[0, 9]);
            decoder.push(&wire);
            assert_eq!(decoder.advance(), Decoded::Packet, "{framing:?}");
            assert_eq!(decoder.packet().id, 7);
        }
    }

    #[test]
    fn a_sound_packet_is_found_after_noise_echo_and_damage() {
        let mut wire = bytes("00FFFFFD");
        encode(&mut wire, 7, 0x02, &[1, 2, 3, 4]); // our own echo
        let mut damaged = Vec::new();
        encode(&mut damaged, 7, 0x55, &[0, 9]);
        damaged[8] ^= 0x10;
        wire.extend(&damaged);
        encode(&mut wire, 8, 0x55, &[0x80, 0xFF, 0xFF, 0xFD, 0x01]);
        let mut decoder = Decoder::default();
        decoder.reset(64);
        for byte in wire {
            decoder.push(&[byte]);
            match decoder.advance() {
                Decoded::Incomplete => {}
                Decoded::Corrupt => damaged.clear(),
                Decoded::Packet => break,
            }
        }
        assert!(damaged.is_empty(), "the damaged packet was not noticed");
        let packet = decoder.packet();
        assert_eq!((packet.id, packet.error(), packet.alert()), (8, 0, true));
        assert_eq!(packet.params(), bytes("FFFFFD01"));
    }

    #[test]
    fn a_length_beyond_the_question_is_damage_at_once() {
        let mut decoder = Decoder::default();
        decoder.reset(8);
        decoder.push(&bytes("FFFFFD00 01 FF7F 55"));
        assert_eq!(decoder.advance(), Decoded::Corrupt);
        decoder.reset(8);
        decoder.push(&bytes("FFFFFD00 01 0000 55"));
        assert_eq!(decoder.advance(), Decoded::Corrupt);
    }

    proptest! {
        #[test]
        fn any_parameters_survive_the_wire(id in 0u8..253, params in prop::collection::vec(prop_oneof![Just(0xFFu8), Just(0xFD), any::<u8>()], 0..200)) {
            let mut body = vec![0];
            body.extend(&params);
            let mut wire = Vec::new();
            encode(&mut wire, id, STATUS, &body);
            let mut decoder = Decoder::default();
            decoder.reset(wire.len());
            decoder.push(&wire);
            prop_assert_eq!(decoder.advance(), Decoded::Packet);
            prop_assert_eq!(decoder.packet().id, id);
            prop_assert_eq!(decoder.packet().params(), &params[..]);
        }

        #[test]
        fn any_bytes_are_taken_without_a_panic(noise in prop::collection::vec(prop_oneof![Just(0xFFu8), Just(0xFD), Just(0), Just(0x55), any::<u8>()], 0..400)) {
            for framing in [Framing::Protocol2, Framing::Protocol1] {
                let mut decoder = Decoder::new(framing);
                decoder.reset(64);
                for part in noise.chunks(7) {
                    decoder.push(part);
                    while decoder.advance() != Decoded::Incomplete {
                        let _ = decoder.packet().blocks(10).count();
                    }
                }
            }
        }
    }
}
