//! Encoding of message fields: little-endian numbers and short names.

use super::error::MessageError;

/// Longest name of a follower or a style, bytes.
const NAME_BYTES: usize = 48;
/// Times are within a hundred years of zero, nanoseconds.
const FARTHEST_NS: u64 = 3_200_000_000_000_000_000;

/// Whether a word may be the name of a stage, a follower or a style, and stand in
/// a key: letters, digits and `_-.`, not empty.
pub fn is_valid_name(word: &str) -> bool {
    let plain = |c: char| c.is_alphanumeric() || matches!(c, '_' | '-' | '.');
    !word.is_empty() && word.chars().all(plain)
}

pub(super) struct ByteReader<'a>(pub &'a [u8]);

impl ByteReader<'_> {
    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], MessageError> {
        let first = self.0.split_first_chunk::<N>();
        let (head, rest) = first.ok_or(MessageError::Length)?;
        self.0 = rest;
        Ok(*head)
    }

    pub(super) fn get<T: Field>(&mut self) -> Result<T, MessageError> {
        T::read(self)
    }

    /// A finite number no larger than `most` either way.
    pub(super) fn within(&mut self, most: f32, what: &'static str) -> Result<f32, MessageError> {
        let value: f32 = self.get()?;
        match value.abs() <= most {
            true => Ok(value),
            false => Err(MessageError::Value(what)),
        }
    }
}

pub(super) trait Field: Sized {
    fn write(&self, out: &mut Vec<u8>);
    fn read(input: &mut ByteReader) -> Result<Self, MessageError>;
}

macro_rules! numbers {
    ($($type:ty),*) => {
        $(impl Field for $type {
            fn write(&self, out: &mut Vec<u8>) {
                out.extend(self.to_le_bytes());
            }

            fn read(input: &mut ByteReader) -> Result<Self, MessageError> {
                input.bytes().map(<$type>::from_le_bytes)
            }
        })*
    };
}

numbers!(u8, u16, u32, u64, f32);

/// A time in nanoseconds.
impl Field for i64 {
    fn write(&self, out: &mut Vec<u8>) {
        out.extend(self.to_le_bytes());
    }

    fn read(input: &mut ByteReader) -> Result<Self, MessageError> {
        let time_ns = input.bytes().map(i64::from_le_bytes)?;
        match time_ns.unsigned_abs() <= FARTHEST_NS {
            true => Ok(time_ns),
            false => Err(MessageError::Value("a time")),
        }
    }
}

/// A name, which may be empty: its length in one byte, then UTF-8. A name that is
/// too long is cut at a whole character.
impl Field for String {
    fn write(&self, out: &mut Vec<u8>) {
        let mut end = self.len().min(NAME_BYTES);
        while !self.is_char_boundary(end) {
            end -= 1;
        }
        out.push(end as u8);
        out.extend(&self.as_bytes()[..end]);
    }

    fn read(input: &mut ByteReader) -> Result<Self, MessageError> {
        let length = usize::from(input.get::<u8>()?);
        if length > NAME_BYTES {
            return Err(MessageError::Value("a name"));
        }
        let split = input.0.split_at_checked(length);
        let (name, rest) = split.ok_or(MessageError::Length)?;
        input.0 = rest;
        match std::str::from_utf8(name) {
            Ok(name) if is_valid_name(name) || name.is_empty() => Ok(name.to_owned()),
            _ => Err(MessageError::Value("a name")),
        }
    }
}

/// Declares a message whose bytes are those of its fields, in order.
macro_rules! message_struct {
    ($(#[$meta:meta])* pub struct $name:ident {
        $($(#[$doc:meta])* pub $field:ident: $type:ty,)*
    }) => {
        $(#[$meta])*
        pub struct $name {
            $($(#[$doc])* pub $field: $type,)*
        }

        impl Field for $name {
            fn write(&self, out: &mut Vec<u8>) {
                $(self.$field.write(out);)*
            }

            fn read(input: &mut ByteReader) -> Result<Self, MessageError> {
                Ok(Self { $($field: Field::read(input)?,)* })
            }
        }
    };
}

pub(super) use message_struct;
