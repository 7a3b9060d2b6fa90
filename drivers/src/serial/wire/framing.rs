//! How packets are framed on a serial bus: what the two protocols do differently.

use crate::serial::register::Register;
use crate::serial::wire::{protocol1, protocol2};

/// Which framing a bus has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Framing {
    /// Dynamixel Protocol 2.0: 16-bit addresses, a CRC.
    #[default]
    Protocol2,
    /// Dynamixel Protocol 1 framing, which Feetech servos speak.
    Protocol1,
}

impl Framing {
    /// Appends an instruction packet to `out`.
    pub fn encode(self, out: &mut Vec<u8>, id: u8, instruction: u8, params: &[u8]) {
        match self {
            Self::Protocol2 => protocol2::encode(out, id, instruction, params),
            Self::Protocol1 => protocol1::encode(out, id, instruction, params),
        }
    }

    fn put_number(self, out: &mut Vec<u8>, number: u16) {
        let bytes = number.to_le_bytes();
        let count = if self == Self::Protocol2 { 2 } else { 1 };
        out.extend_from_slice(&bytes[..count]);
    }

    /// Appends a register's address and size as parameters hold them.
    pub(crate) fn put_place(self, out: &mut Vec<u8>, register: Register) {
        self.put_number(out, register.address);
        self.put_number(out, register.size);
    }

    pub(crate) fn read_params(self, register: Register) -> Vec<u8> {
        let mut params = Vec::with_capacity(4);
        self.put_place(&mut params, register);
        params
    }

    pub(crate) fn write_params(self, register: Register, value: u64) -> Vec<u8> {
        let mut params = Vec::with_capacity(6);
        self.put_number(&mut params, register.address);
        params.extend(&value.to_le_bytes()[..usize::from(register.size)]);
        params
    }

    /// The length field of a status packet without parameters.
    pub(crate) fn status_length(self) -> usize {
        match self {
            Self::Protocol2 => 4,
            Self::Protocol1 => 2,
        }
    }

    /// The bytes of a status packet without parameters.
    pub(crate) fn status_bytes(self) -> usize {
        match self {
            Self::Protocol2 => 11,
            Self::Protocol1 => 6,
        }
    }

    /// The parameters that answer a ping: model and firmware, or nothing.
    pub(crate) fn ping_params(self) -> usize {
        match self {
            Self::Protocol2 => 3,
            Self::Protocol1 => 0,
        }
    }
}
