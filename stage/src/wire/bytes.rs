//! Little-endian numbers and short names, written and read.

use super::{NAME_BYTES, WireError};

/// A message being written.
pub(super) struct Put(pub Vec<u8>);

macro_rules! numbers {
    ($($name:ident $type:ty),*) => {
        impl Put {
            $(pub fn $name(&mut self, value: $type) -> &mut Self {
                self.0.extend(value.to_le_bytes());
                self
            })*
        }

        impl Take<'_> {
            $(pub fn $name(&mut self) -> Result<$type, WireError> {
                self.bytes().map(<$type>::from_le_bytes)
            })*
        }
    };
}

numbers!(u8 u8, u16 u16, u32 u32, u64 u64, i64 i64, f32 f32);

impl Put {
    pub fn new(head: &[u8]) -> Self {
        Self(head.to_vec())
    }

    /// A name; what is too long is cut at a whole character.
    pub fn name(&mut self, name: &str) -> &mut Self {
        let mut end = name.len().min(NAME_BYTES);
        while !name.is_char_boundary(end) {
            end -= 1;
        }
        self.u8(end as u8);
        self.0.extend(&name.as_bytes()[..end]);
        self
    }
}

/// What is left of a message that is being read.
pub(super) struct Take<'a>(pub &'a [u8]);

impl Take<'_> {
    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], WireError> {
        let (head, rest) = self.0.split_first_chunk::<N>().ok_or(WireError::Length)?;
        self.0 = rest;
        Ok(*head)
    }

    /// A finite number no larger than `most` either way.
    pub fn within(&mut self, most: f32, what: &'static str) -> Result<f32, WireError> {
        let value = self.f32()?;
        match value.abs() <= most {
            true => Ok(value),
            false => Err(WireError::Value(what)),
        }
    }

    /// A name of letters, digits and `_.-`, which may be empty.
    pub fn name(&mut self) -> Result<String, WireError> {
        let length = usize::from(self.u8()?);
        if length > NAME_BYTES {
            return Err(WireError::Value("a name"));
        }
        let (name, rest) = self.0.split_at_checked(length).ok_or(WireError::Length)?;
        self.0 = rest;
        match std::str::from_utf8(name) {
            Ok(name) if crate::keys::is_plain(name) || name.is_empty() => Ok(name.to_owned()),
            _ => Err(WireError::Value("a name")),
        }
    }
}
