//! Reads numbers and numpy arrays out of a Python pickle; runs nothing of it.
//!
//! Only what dictionaries of arrays are made of has a meaning here; any other
//! object is passed over. Arrays of f32 and f64, little-endian, C order.
//!
//! Hand-written because `serde-pickle` cannot rebuild numpy arrays: it refuses calls
//! (`REDUCE`) of numpy's functions, or puts None in their place.

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

use servodance_model::motion::numpy::Array;

/// Deepest tuple or list that is looked into.
const MOST_STACK: usize = 100_000;

#[derive(Clone, Debug)]
enum PickleValue {
    Int(i64),
    Float(f64),
    Text(Rc<str>),
    Bytes(Rc<[u8]>),
    Tuple(Rc<[PickleValue]>),
    Dict(Rc<RefCell<Vec<(PickleValue, PickleValue)>>>),
    Global(Rc<str>),
    /// Size of an item in bytes; big-endian or not of numbers: 0.
    Dtype(Rc<RefCell<usize>>),
    Array(Rc<RefCell<Array>>),
    Other,
}

/// Arrays and numbers of the pickled dictionary by key. Fails where it cannot be read.
pub(super) fn arrays(bytes: &[u8]) -> Result<HashMap<String, Array>, String> {
    let mut machine =
        PickleMachine { rest: bytes, stack: Vec::new(), marks: Vec::new(), memo: HashMap::new() };
    let PickleValue::Dict(items) = machine.run()? else {
        return Err("the pickle holds no dictionary".into());
    };
    let mut out = HashMap::new();
    for (key, value) in items.borrow().iter() {
        let PickleValue::Text(key) = key else {
            continue;
        };
        let number = |value: f64| Array { shape: Vec::new(), values: vec![value] };
        let array = match value {
            PickleValue::Array(array) => array.borrow().clone(),
            PickleValue::Int(value) => number(*value as f64),
            PickleValue::Float(value) => number(*value),
            _ => continue,
        };
        out.insert(key.to_string(), array);
    }
    Ok(out)
}

struct PickleMachine<'a> {
    rest: &'a [u8],
    stack: Vec<PickleValue>,
    marks: Vec<usize>,
    memo: HashMap<usize, PickleValue>,
}

impl<'a> PickleMachine<'a> {
    fn run(&mut self) -> Result<PickleValue, String> {
        loop {
            let [code] = *self.take(1)?.first_chunk::<1>().ok_or("no code")?;
            if code == b'.' {
                return self.pop();
            }
            self.step(code)?;
            if self.stack.len() > MOST_STACK || self.marks.len() > MOST_STACK {
                return Err("the pickle is nested too deep".into());
            }
        }
    }

    fn step(&mut self, code: u8) -> Result<(), String> {
        match code {
            0x80 => drop(self.take(1)?),
            0x95 => drop(self.take(8)?),
            b'(' => self.marks.push(self.stack.len()),
            b'0' => drop(self.pop()?),
            b'}' => self.push(PickleValue::Dict(Rc::default())),
            b']' | b'N' | 0x88 | 0x89 => self.push(PickleValue::Other),
            b')' => self.push(PickleValue::Tuple(Rc::from([]))),
            0x94 => self.remember(self.memo.len())?,
            b'q' | b'r' => {
                let at = self.length(if code == b'q' { 1 } else { 4 })?;
                self.remember(at)?;
            }
            b'h' | b'j' => {
                let at = self.length(if code == b'h' { 1 } else { 4 })?;
                self.recall(at)?;
            }
            b'X' | b'T' => self.text(4)?,
            0x8c | b'U' => self.text(1)?,
            0x8d => self.text(8)?,
            b'B' => self.bytes(4)?,
            b'C' => self.bytes(1)?,
            0x8e | 0x96 => self.bytes(8)?,
            b'J' | b'K' | b'M' | 0x8a => self.int(code)?,
            b'G' => {
                let bytes = self.take(8)?.first_chunk::<8>().ok_or("short")?;
                self.push(PickleValue::Float(f64::from_be_bytes(*bytes)));
            }
            b'c' => {
                let (module, name) = (self.line()?, self.line()?);
                self.push(PickleValue::Global(format!("{module} {name}").into()));
            }
            0x93 => {
                let (name, module) = (self.pop()?, self.pop()?);
                let global = match (module, name) {
                    (PickleValue::Text(module), PickleValue::Text(name)) => {
                        format!("{module} {name}").into()
                    }
                    _ => "".into(),
                };
                self.push(PickleValue::Global(global));
            }
            0x85..=0x87 => {
                let at = self.stack.len().checked_sub(usize::from(code - 0x84));
                self.tuple(at.ok_or("an empty stack")?);
            }
            b't' => {
                let at = self.mark()?;
                self.tuple(at);
            }
            b'R' | 0x81 => {
                let (arguments, function) = (self.pop()?, self.pop()?);
                let made = reduce(&function, &arguments)?;
                self.push(made);
            }
            b'b' => {
                let state = self.pop()?;
                build(self.stack.last().ok_or("an empty stack")?, &state)?;
            }
            b's' => {
                let (value, key) = (self.pop()?, self.pop()?);
                self.set(vec![key, value])?;
            }
            b'u' => {
                let at = self.mark()?;
                let items = self.stack.split_off(at.min(self.stack.len()));
                self.set(items)?;
            }
            b'a' => drop(self.pop()?),
            b'e' => {
                let at = self.mark()?;
                self.stack.truncate(at);
            }
            other => return Err(format!("pickle code {other:#04x} is not known here")),
        }
        Ok(())
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        if count > self.rest.len() {
            return Err("the pickle ends too soon".into());
        }
        let (taken, rest) = self.rest.split_at(count);
        self.rest = rest;
        Ok(taken)
    }

    /// A little-endian length of so many bytes.
    fn length(&mut self, bytes: usize) -> Result<usize, String> {
        let mut wide = [0; 8];
        wide[..bytes].copy_from_slice(self.take(bytes)?);
        usize::try_from(u64::from_le_bytes(wide)).map_err(|_| "a length is too large".into())
    }

    fn line(&mut self) -> Result<String, String> {
        let end = self.rest.iter().position(|b| *b == b'\n').ok_or("a line does not end")?;
        let line = self.take(end + 1)?;
        Ok(String::from_utf8_lossy(&line[..end]).into_owned())
    }

    fn text(&mut self, bytes: usize) -> Result<(), String> {
        let length = self.length(bytes)?;
        let text = self.take(length)?;
        match std::str::from_utf8(text) {
            Ok(text) => self.push(PickleValue::Text(text.into())),
            // Python 2 wrote bytes as text.
            Err(_) => self.push(PickleValue::Bytes(text.into())),
        }
        Ok(())
    }

    fn bytes(&mut self, bytes: usize) -> Result<(), String> {
        let length = self.length(bytes)?;
        let taken = self.take(length)?;
        self.push(PickleValue::Bytes(taken.into()));
        Ok(())
    }

    fn int(&mut self, code: u8) -> Result<(), String> {
        let count = match code {
            b'J' => 4,
            b'M' => 2,
            b'K' => 1,
            _ => self.length(1)?,
        };
        if count > 8 {
            return Err("a whole number is too large".into());
        }
        let bytes = self.take(count)?;
        let negative = matches!(code, b'J' | 0x8a) && bytes.last().is_some_and(|b| *b >= 0x80);
        let mut wide = if negative { [0xff; 8] } else { [0; 8] };
        wide[..count].copy_from_slice(bytes);
        self.push(PickleValue::Int(i64::from_le_bytes(wide)));
        Ok(())
    }

    fn push(&mut self, value: PickleValue) {
        self.stack.push(value);
    }

    fn pop(&mut self) -> Result<PickleValue, String> {
        self.stack.pop().ok_or_else(|| "an empty stack".into())
    }

    fn mark(&mut self) -> Result<usize, String> {
        self.marks.pop().ok_or_else(|| "no mark".into())
    }

    fn tuple(&mut self, at: usize) {
        let items = self.stack.split_off(at.min(self.stack.len()));
        self.push(PickleValue::Tuple(items.into()));
    }

    fn remember(&mut self, at: usize) -> Result<(), String> {
        let value = self.stack.last().ok_or("an empty stack")?.clone();
        self.memo.insert(at, value);
        Ok(())
    }

    fn recall(&mut self, at: usize) -> Result<(), String> {
        let value = self.memo.get(&at).ok_or("nothing is remembered there")?.clone();
        self.push(value);
        Ok(())
    }

    fn set(&mut self, items: Vec<PickleValue>) -> Result<(), String> {
        let Some(PickleValue::Dict(dict)) = self.stack.last() else {
            return Ok(());
        };
        let mut items = items.into_iter();
        while let (Some(key), Some(value)) = (items.next(), items.next()) {
            // A dictionary in itself would never be freed, and holds no array.
            if !matches!(value, PickleValue::Dict(_)) {
                dict.borrow_mut().push((key, value));
            }
        }
        Ok(())
    }
}

/// What a call that makes arrays makes; `Other` for any other call.
fn reduce(function: &PickleValue, arguments: &PickleValue) -> Result<PickleValue, String> {
    let (PickleValue::Global(name), PickleValue::Tuple(arguments)) = (function, arguments) else {
        return Ok(PickleValue::Other);
    };
    let name = name.rsplit(['.', ' ']).next().unwrap_or_default();
    Ok(match (name, &arguments[..]) {
        ("_reconstruct", _) => PickleValue::Array(Rc::default()),
        ("dtype", [PickleValue::Text(kind), ..]) => {
            let size = match &**kind {
                "f4" | "<f4" | "float32" => 4,
                "f8" | "<f8" | "float64" => 8,
                _ => 0,
            };
            PickleValue::Dtype(Rc::new(RefCell::new(size)))
        }
        ("encode", [PickleValue::Text(text), ..]) => {
            let bytes: Vec<u8> = text.chars().map(|c| c as u32 as u8).collect();
            PickleValue::Bytes(bytes.into())
        }
        (
            "_frombuffer",
            [PickleValue::Bytes(bytes), PickleValue::Dtype(size), PickleValue::Tuple(shape), ..],
        ) => {
            let array = array(bytes, *size.borrow(), shape)?;
            PickleValue::Array(Rc::new(RefCell::new(array)))
        }
        ("scalar", [PickleValue::Dtype(size), PickleValue::Bytes(bytes)]) => {
            let array = array(bytes, *size.borrow(), &[])?;
            PickleValue::Array(Rc::new(RefCell::new(array)))
        }
        _ => PickleValue::Other,
    })
}

fn build(object: &PickleValue, state: &PickleValue) -> Result<(), String> {
    match (object, state) {
        (PickleValue::Array(made), PickleValue::Tuple(state)) => {
            if let [
                _,
                PickleValue::Tuple(shape),
                PickleValue::Dtype(size),
                _,
                PickleValue::Bytes(bytes),
            ] = &state[..]
            {
                *made.borrow_mut() = array(bytes, *size.borrow(), shape)?;
            } else if let [
                _,
                PickleValue::Tuple(shape),
                PickleValue::Dtype(size),
                _,
                PickleValue::Text(text),
            ] = &state[..]
            {
                *made.borrow_mut() = array(text.as_bytes(), *size.borrow(), shape)?;
            }
        }
        (PickleValue::Dtype(size), PickleValue::Tuple(state)) => {
            if let [_, PickleValue::Text(order), ..] = &state[..]
                && &**order == ">"
            {
                *size.borrow_mut() = 0;
            }
        }
        _ => {}
    }
    Ok(())
}

fn array(bytes: &[u8], item: usize, shape: &[PickleValue]) -> Result<Array, String> {
    if item == 0 {
        // Of something else than numbers: not looked at.
        return Ok(Array::default());
    }
    let sides: Option<Vec<usize>> = shape
        .iter()
        .map(|side| match side {
            PickleValue::Int(side) => usize::try_from(*side).ok(),
            _ => None,
        })
        .collect();
    let shape = sides.ok_or("an array has no shape")?;
    let count = shape.iter().try_fold(1_usize, |product, side| product.checked_mul(*side));
    if count.and_then(|count| count.checked_mul(item)) != Some(bytes.len()) {
        return Err(format!("an array of shape {shape:?} has {} bytes", bytes.len()));
    }
    let values = match item {
        4 => bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b).into()).collect(),
        _ => bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect(),
    };
    Ok(Array { shape, values })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            let _ = arrays(&bytes);
        }

        #[test]
        fn no_change_of_a_good_file_makes_it_panic(
            at in any::<prop::sample::Index>(),
            byte in any::<u8>(),
        ) {
            let mut bytes = include_bytes!("golden/aist.pkl").to_vec();
            let at = at.index(bytes.len());
            bytes[at] = byte;
            let _ = arrays(&bytes);
        }
    }
}
