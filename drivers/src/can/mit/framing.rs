//! Commands and replies of MIT mode: each quantity is a code over a range.
//!
//! ```text
//! command  p[16] v[12] kp[12] kd[12] t[12], big-endian
//! reply    id (Damiao: id | error << 4), p[16] v[12] t[12], temperatures or error
//! ```

use crate::can::rounding::whole_range;
use crate::servo::Servo;

/// `value` as an unsigned code of `bits` over +- `range`, the nearest.
pub(crate) fn to_code(value: f64, range: f64, bits: u32) -> u32 {
    span_code(value + range, 2.0 * range, bits)
}

/// The value of a code of `bits` over +- `range`.
pub fn from_code(code: u32, range: f64, bits: u32) -> f64 {
    let top = f64::from((1u32 << bits) - 1);
    f64::from(code) * 2.0 * range / top - range
}

/// The value of a code from 0 to `span`.
pub fn from_span_code(code: u32, span: f64, bits: u32) -> f64 {
    f64::from(code) / f64::from((1u32 << bits) - 1) * span
}

/// `value` as an unsigned code of `bits` from 0 to `span`. Not a number, or a value
/// outside, becomes an end of the range.
pub(crate) fn span_code(value: f64, span: f64, bits: u32) -> u32 {
    let top = f64::from((1u32 << bits) - 1);
    nearest(value / span * top).clamp(0.0, top) as u32
}

/// The nearest code; between two the lower one, as the vendors' own code, which
/// cuts off, has it for zero.
fn nearest(exact: f64) -> f64 {
    (exact - 0.5).ceil()
}

/// The 16-bit code of a joint position: the nearest one inside the joint's limits.
pub(crate) fn position_code(servo: &Servo, range: f64, joint_rad: f64) -> u32 {
    let exact = |joint_rad: f64| {
        let motor_rad = servo.motor_rad(joint_rad);
        (motor_rad + range) / (2.0 * range) * 65_535.0
    };
    let (lowest, highest) = whole_range(servo, exact);
    nearest(exact(joint_rad)).clamp(lowest, highest).clamp(0.0, 65_535.0) as u32
}

/// The eight bytes of a command with the codes of position (16 bits), velocity,
/// position gain, damping and torque (12 bits each).
pub(crate) fn pack_command([p, v, kp, kd, t]: [u32; 5]) -> [u8; 8] {
    let bits = [(p, 16), (v, 12), (kp, 12), (kd, 12), (t, 12)];
    let append = |sum, (code, bits)| sum << bits | u64::from(code);
    bits.into_iter().fold(0_u64, append).to_be_bytes()
}

pub fn unpack_command(data: [u8; 8]) -> [u32; 5] {
    let word = u64::from_be_bytes(data);
    let field = |shift: u32, bits: u32| (word >> shift) as u32 & ((1 << bits) - 1);
    [field(48, 16), field(36, 12), field(24, 12), field(12, 12), field(0, 12)]
}

/// Bytes 1 to 5 of a reply, with the codes of position (16 bits), velocity and
/// torque (12 bits each).
pub fn pack_reply([p, v, t]: [u32; 3]) -> [u8; 5] {
    let word = u64::from(p) << 24 | u64::from(v) << 12 | u64::from(t);
    let [_, _, _, bytes @ ..] = word.to_be_bytes();
    bytes
}

/// The codes of a reply: position, velocity, torque; `None` if it is too short.
pub(crate) fn unpack_reply(data: &[u8]) -> Option<[u32; 3]> {
    let &[_, p1, p0, v1, v0_t1, t0, ..] = data else {
        return None;
    };
    let [p1, p0, v1, v0_t1, t0] = [p1, p0, v1, v0_t1, t0].map(u32::from);
    Some([p1 << 8 | p0, v1 << 4 | v0_t1 >> 4, (v0_t1 & 0xF) << 8 | t0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_cover_their_range_and_nothing_more() {
        assert_eq!(to_code(-12.5, 12.5, 16), 0);
        assert_eq!(to_code(12.5, 12.5, 16), 65_535);
        assert_eq!(to_code(99.0, 12.5, 16), 65_535);
        assert_eq!(to_code(f64::NAN, 12.5, 16), 0);
        for code in [0, 1, 32_767, 32_768, 65_535] {
            assert_eq!(to_code(from_code(code, 12.5, 16), 12.5, 16), code);
        }
    }

    #[test]
    fn fields_survive_packing() {
        let codes = [0x1234, 0xABC, 0xDEF, 0x123, 0x456];
        let data = pack_command(codes);
        assert_eq!(data, [0x12, 0x34, 0xAB, 0xCD, 0xEF, 0x12, 0x34, 0x56]);
        assert_eq!(unpack_command(data), codes);
        let reply = [7, 0x12, 0x34, 0xAB, 0xCD, 0xEF, 0, 0];
        assert_eq!(unpack_reply(&reply), Some([0x1234, 0xABC, 0xDEF]));
        assert_eq!(pack_reply([0x1234, 0xABC, 0xDEF]), reply[1..6]);
        assert_eq!(unpack_reply(&reply[..5]), None);
    }

    #[test]
    fn zero_has_its_published_bytes() {
        let [p, v, t] =
            [(12.5, 16), (50.0, 12), (18.0, 12)].map(|(range, bits)| to_code(0.0, range, bits));
        let published = [0x7F, 0xFF, 0x7F, 0xF0, 0x00, 0x00, 0x07, 0xFF];
        assert_eq!(pack_command([p, v, 0, 0, t]), published);
    }
}
