//! The kinds of numbers that registers travel as.

/// The kind of a number on the wire.
#[allow(missing_docs)] // the names say it
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    I8,
    I16,
    I32,
    F32,
}

impl Kind {
    /// The kind that a subframe's code has in two bits.
    pub(super) fn of(code: u8) -> Self {
        [Self::I8, Self::I16, Self::I32, Self::F32][usize::from(code & 3)]
    }

    /// How many bytes such a number has.
    pub(super) fn size(self) -> usize {
        [1, 2, 4, 4][self as usize]
    }
}
