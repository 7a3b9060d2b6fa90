//! Dynamixel Protocol 2.0 framing, the host's side.
//!
//! Instruction: `FF FF FD 00 ID LEN_L LEN_H INST params CRC_L CRC_H`; a status
//! packet has `55 ERR` in place of `INST`. The CRC is the `dynamixel2` crate's.

use dynamixel2::checksum::calculate_checksum;

pub(super) const HEADER: [u8; 4] = [0xFF, 0xFF, 0xFD, 0x00];
/// Header, id and length: what stands before the bytes that the length counts.
pub(super) const PREFIX: usize = 7;

/// Appends an instruction packet to `out`.
pub fn encode(out: &mut Vec<u8>, id: u8, instruction: u8, params: &[u8]) {
    let start = out.len();
    out.extend_from_slice(&HEADER);
    out.extend_from_slice(&[id, 0, 0, instruction]);
    // How much of FF FF FD the last bytes are.
    let mut matched = 0;
    for &byte in params {
        out.push(byte);
        matched = match (matched, byte) {
            (0, 0xFF) => 1,
            (1 | 2, 0xFF) => 2,
            (2, 0xFD) => {
                out.push(0xFD);
                0
            }
            _ => 0,
        };
    }
    let length = (out.len() - start - PREFIX + 2) as u16;
    out[start + 5..start + 7].copy_from_slice(&length.to_le_bytes());
    let crc = calculate_checksum(0, &out[start..]);
    out.extend_from_slice(&crc.to_le_bytes());
}

/// Removes the `FD` that follows every `FF FF FD`.
pub(super) fn unstuff(stuffed: &[u8], out: &mut Vec<u8>) {
    let mut at = 0;
    while at < stuffed.len() {
        if stuffed[at..].starts_with(&[0xFF, 0xFF, 0xFD, 0xFD]) {
            out.extend_from_slice(&[0xFF, 0xFF, 0xFD]);
            at += 4;
        } else {
            out.push(stuffed[at]);
            at += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_instructions_encode_to_their_bytes() {
        for (instruction, params, wanted) in [
            (0x01, &[][..], "FFFFFD00 01 0300 01 194E"),
            (0x02, &[0x84, 0, 4, 0], "FFFFFD00 01 0700 02 84000400 1D15"),
            (0x03, &[0x74, 0, 0, 2, 0, 0], "FFFFFD00 01 0900 03 740000020000 CA89"),
        ] {
            let mut out = Vec::new();
            encode(&mut out, 1, instruction, params);
            let hex: String = out.iter().map(|byte| format!("{byte:02X}")).collect();
            assert_eq!(hex, wanted.replace(' ', ""));
        }
    }
}
