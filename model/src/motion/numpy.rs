//! Arrays of numbers out of `.npy` files and `.npz` archives, and into archives.
//!
//! Everything becomes f64. A header that promises more than the file holds is
//! refused before memory is taken for it; so are objects, texts and big-endian
//! numbers.
//!
//! Hand-written because the crate `npyz` brings a second `zip` (0.6) and a parser
//! generator, and candle's reader has neither the limits nor all number kinds.

use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

use super::error::MotionError;

/// Numbers that are kept at most: an hour of 100 joints at 60 frames a second.
const MOST_NUMBERS: usize = 64_000_000;
/// Longest header that is looked at, bytes.
const LONGEST_HEADER: usize = 65_536;

/// An array of numbers, the last index running fastest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Array {
    /// Length of each dimension.
    pub shape: Vec<usize>,
    /// All numbers, `shape` multiplied.
    pub values: Vec<f64>,
}

impl Array {
    /// The values as rows of `N`, if the array is `[rows, ..]` of that width;
    /// refused are other widths, no rows, and numbers that are not finite.
    pub fn rows<const N: usize>(&self, key: &str) -> Result<&[[f64; N]], String> {
        let frames = self.shape.first().copied().unwrap_or(0);
        if frames == 0 || self.values.len() != frames * N {
            let shape = &self.shape;
            return Err(format!(
                "`{key}` is {shape:?}, expected {N} numbers a frame and at least 1 frame"
            ));
        }
        match self.values.iter().position(|v| !v.is_finite()) {
            Some(at) => {
                Err(format!("frame {}, number {} of `{key}` is not finite", at / N, at % N))
            }
            None => Ok(self.values.as_chunks::<N>().0),
        }
    }
}

/// Reads a `.npy` file.
pub fn read_npy(path: &Path) -> Result<Array, MotionError> {
    let file = File::open(path).map_err(|error| MotionError::read(path, error))?;
    array(BufReader::new(file)).map_err(|reason| MotionError::read(path, reason))
}

/// An open `.npz` archive of arrays.
pub struct Npz {
    path: PathBuf,
    archive: ZipArchive<BufReader<File>>,
}

impl Npz {
    /// Opens an archive; arrays are read when they are asked for.
    pub fn open(path: &Path) -> Result<Self, MotionError> {
        let file = File::open(path).map_err(|error| MotionError::read(path, error))?;
        let archive = ZipArchive::new(BufReader::new(file));
        Ok(Self {
            path: path.to_owned(),
            archive: archive.map_err(|error| MotionError::read(path, error))?,
        })
    }

    /// The names of the arrays, sorted.
    pub fn names(&self) -> Vec<String> {
        let plain = |name: &str| name.strip_suffix(".npy").unwrap_or(name).to_owned();
        let names = self.archive.file_names().flatten();
        let mut names: Vec<String> = names.map(|name| plain(&name)).collect();
        names.sort();
        names
    }

    /// An array; `None` if the archive has none of that name.
    pub fn get(&mut self, key: &str) -> Result<Option<Array>, MotionError> {
        if !self.names().iter().any(|name| name == key) {
            return Ok(None);
        }
        let entry = self.archive.by_name(&format!("{key}.npy"));
        let read = entry.map_err(|error| error.to_string());
        let read = read.and_then(array).map(Some);
        read.map_err(|reason| MotionError::read(&self.path, format!("array `{key}`: {reason}")))
    }

    /// An array that must be there; the error lists those that are.
    pub fn need(&mut self, key: &str) -> Result<Array, MotionError> {
        self.get(key)?.ok_or_else(|| {
            let reason = format!("no array `{key}`; the file has {:?}", self.names());
            MotionError::content(&self.path, reason)
        })
    }
}

/// Writes an archive of float32 arrays: name, shape, numbers with the last index running
/// fastest. Nothing is compressed, and no time of day is noted.
pub(super) fn write_npz(
    path: &Path,
    arrays: &[(&str, Vec<usize>, &[f32])],
) -> Result<(), zip::result::ZipError> {
    let mut archive = ZipWriter::new(BufWriter::new(File::create(path)?));
    let plain = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .last_modified_time(DateTime::default());
    for (name, shape, numbers) in arrays {
        archive.start_file(format!("{name}.npy"), plain)?;
        archive.write_all(&header_of_floats(shape))?;
        for number in *numbers {
            archive.write_all(&number.to_le_bytes())?;
        }
    }
    archive.finish()?.flush()?;
    Ok(())
}

/// What stands before float32 numbers, filled up with spaces to a multiple of 64 bytes.
fn header_of_floats(shape: &[usize]) -> Vec<u8> {
    let sides: String = shape.iter().map(|side| format!("{side}, ")).collect();
    let text =
        format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}), }}", sides.trim_end());
    let length = (10 + text.len() + 1).next_multiple_of(64) - 10;
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((length as u16).to_le_bytes());
    bytes.extend(format!("{text:<width$}\n", width = length - 1).bytes());
    bytes
}

fn array(mut file: impl Read) -> Result<Array, String> {
    let mut start = [0; 8];
    let short = |_| "the array ends too soon".to_owned();
    file.read_exact(&mut start).map_err(short)?;
    if &start[..6] != b"\x93NUMPY" {
        return Err("not a numpy array".into());
    }
    let mut length = [0; 4];
    let wide = if start[6] >= 2 { 4 } else { 2 };
    file.read_exact(&mut length[..wide]).map_err(short)?;
    let length = u32::from_le_bytes(length) as usize;
    if length > LONGEST_HEADER {
        return Err(format!("a header of {length} bytes"));
    }
    let mut header = vec![0; length];
    file.read_exact(&mut header).map_err(short)?;
    let header = String::from_utf8_lossy(&header);
    let Header { kind, shape, by_columns } = Header::parse(&header)?;
    let count = shape
        .iter()
        .try_fold(1_usize, |product, side| product.checked_mul(*side))
        .filter(|count| *count <= MOST_NUMBERS)
        .ok_or_else(|| format!("an array of {shape:?} numbers, at most {MOST_NUMBERS} are read"))?;
    let wanted = count * kind.bytes();
    let mut bytes = Vec::new();
    let taken = file.take(wanted as u64).read_to_end(&mut bytes);
    taken.map_err(|error| error.to_string())?;
    if bytes.len() < wanted {
        return Err(format!("the array ends too soon: {} of {wanted} bytes", bytes.len()));
    }
    let values: Vec<f64> = bytes.chunks_exact(kind.bytes()).map(|b| kind.value(b)).collect();
    let values = if by_columns { transposed(&shape, &values) } else { values };
    Ok(Array { shape, values })
}

#[derive(Clone, Copy)]
enum Kind {
    F16,
    F32,
    F64,
    Signed(usize),
    Unsigned(usize),
}

impl Kind {
    fn parse(text: &str) -> Option<Self> {
        Some(match text.trim_start_matches(['<', '|', '=']) {
            "f2" => Kind::F16,
            "f4" => Kind::F32,
            "f8" => Kind::F64,
            "i1" => Kind::Signed(1),
            "i2" => Kind::Signed(2),
            "i4" => Kind::Signed(4),
            "i8" => Kind::Signed(8),
            "u1" | "b1" => Kind::Unsigned(1),
            "u2" => Kind::Unsigned(2),
            "u4" => Kind::Unsigned(4),
            "u8" => Kind::Unsigned(8),
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Kind::F16 => 2,
            Kind::F32 => 4,
            Kind::F64 => 8,
            Kind::Signed(bytes) | Kind::Unsigned(bytes) => bytes,
        }
    }

    /// The number in so many little-endian bytes.
    fn value(self, bytes: &[u8]) -> f64 {
        let mut wide = [0; 8];
        wide[..bytes.len()].copy_from_slice(bytes);
        let bits = u64::from_le_bytes(wide);
        match self {
            Kind::F16 => half::f16::from_bits(bits as u16).to_f64(),
            Kind::F32 => f64::from(f32::from_bits(bits as u32)),
            Kind::F64 => f64::from_bits(bits),
            Kind::Unsigned(_) => bits as f64,
            Kind::Signed(bytes) => {
                let unused = 64 - 8 * bytes as u32;
                ((bits << unused) as i64 >> unused) as f64
            }
        }
    }
}

struct Header {
    kind: Kind,
    shape: Vec<usize>,
    by_columns: bool,
}

impl Header {
    /// Of `{'descr': '<f4', 'fortran_order': False, 'shape': (3, 22), }`.
    fn parse(text: &str) -> Result<Self, String> {
        let after = |key: &str| {
            let rest = text.split_once(&format!("'{key}':"));
            rest.map(|(_, rest)| rest.trim_start())
                .ok_or_else(|| format!("the header has no `{key}`"))
        };
        let kind = after("descr")?;
        let kind = kind.strip_prefix('\'').and_then(|rest| rest.split('\'').next());
        let kind = kind.ok_or("the array holds records, not numbers")?;
        let sides = after("shape")?.strip_prefix('(');
        let sides = sides.and_then(|rest| rest.split(')').next());
        let sides = sides.ok_or("the header has no shape")?.split(',');
        let sides = sides.map(str::trim).filter(|side| !side.is_empty());
        let shape: Result<Vec<usize>, _> = sides.map(str::parse).collect();
        Ok(Self {
            kind: Kind::parse(kind)
                .ok_or_else(|| format!("numbers of kind `{kind}` are not read"))?,
            shape: shape.map_err(|_| "the header has no shape".to_owned())?,
            by_columns: after("fortran_order")?.starts_with("True"),
        })
    }
}

/// Numbers with the first index running fastest, in the usual order.
fn transposed(shape: &[usize], values: &[f64]) -> Vec<f64> {
    let place = |mut at: usize| {
        // Indices of the usual order, last first; each weighs its column stride.
        let mut stride = values.len();
        shape.iter().rev().fold(0, |sum, side| {
            stride /= side;
            let index = at % side;
            at /= side;
            sum + index * stride
        })
    };
    (0..values.len()).map(|at| values[place(at)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn npy(descr: &str, order: &str, shape: &str, numbers: &[u8]) -> Vec<u8> {
        let header =
            format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}\n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(numbers);
        bytes
    }

    #[test]
    fn numbers_of_every_kind_are_read() {
        for (descr, bytes, value) in [
            ("<f8", 1.5f64.to_le_bytes().to_vec(), 1.5),
            ("<f4", (-2.25f32).to_le_bytes().to_vec(), -2.25),
            ("<f2", vec![0x00, 0x3e], 1.5),
            ("<i8", (-7i64).to_le_bytes().to_vec(), -7.0),
            ("<i2", (-7i16).to_le_bytes().to_vec(), -7.0),
            ("|u1", vec![200], 200.0),
        ] {
            let read = array(&npy(descr, "False", "()", &bytes)[..]).unwrap();
            assert_eq!((read.shape.len(), read.values), (0, vec![value]), "{descr}");
        }
    }

    #[test]
    fn what_is_written_is_read() {
        for shape in [vec![], vec![1], vec![2, 3]] {
            let numbers: Vec<f32> = (0..shape.iter().product()).map(|n| n as f32 - 0.5).collect();
            let mut bytes = header_of_floats(&shape);
            assert_eq!((bytes.len() % 64, bytes.last()), (0, Some(&b'\n')));
            bytes.extend(numbers.iter().flat_map(|n| n.to_le_bytes()));
            let read = array(&bytes[..]).unwrap();
            let values = numbers.iter().map(|n| f64::from(*n)).collect();
            assert_eq!(read, Array { shape, values });
        }
    }

    #[test]
    fn columns_first_becomes_rows_first() {
        let read = array(&npy("|u1", "True", "(2, 3)", &[1, 4, 2, 5, 3, 6])[..]).unwrap();
        assert_eq!(read.values, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    }

    #[test]
    fn what_is_no_array_of_numbers_is_refused() {
        for (bytes, says) in [
            (b"PK\x03\x04 and more".to_vec(), "not a numpy array"),
            (npy("<f4", "False", "(3,)", &[0; 8]), "8 of 12 bytes"),
            (npy("<f4", "False", "(99999999999,)", &[]), "at most"),
            (npy("<U5", "False", "(1,)", &[0; 20]), "kind `<U5`"),
            (npy(">f4", "False", "(1,)", &[0; 4]), "kind `>f4`"),
            (npy("<f4", "False", "(x,)", &[0; 4]), "no shape"),
        ] {
            let error = array(&bytes[..]).unwrap_err();
            assert!(error.contains(says), "{error}");
        }
    }
}
