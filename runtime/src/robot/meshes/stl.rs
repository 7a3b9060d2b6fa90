//! Reads STL meshes, binary and ASCII.
//!
//! Refused: what has more triangles than a page draws, what is cut off, numbers that are no
//! numbers. Memory is
//! allocated for what the file holds, never for the count it claims; STL crates
//! have no such bounds, so this reader stays.

use super::triangles::{Triangle, bounded};

/// A binary file's header and count, and what each triangle takes.
const HEADER: usize = 84;
const RECORD: usize = 50;

/// The triangles of a file; the error says why it cannot be drawn.
pub fn read(bytes: &[u8]) -> Result<Vec<Triangle>, String> {
    match binary_count(bytes) {
        Some(count) => binary(bytes, count),
        None => ascii(bytes),
    }
}

/// The number of triangles of a binary file, else `None`. Binary files may begin
/// with "solid" as ASCII ones do, but only they fit their own count and hold zeros.
fn binary_count(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(80..HEADER)?.try_into().ok()?;
    let count = u32::from_le_bytes(count) as usize;
    let fits = count.checked_mul(RECORD)?.checked_add(HEADER)? <= bytes.len();
    let is_text = bytes.starts_with(b"solid") && !bytes.contains(&0);
    (fits && !is_text).then_some(count)
}

fn binary(bytes: &[u8], count: usize) -> Result<Vec<Triangle>, String> {
    bounded(count)?;
    let records = bytes[HEADER..].chunks_exact(RECORD).take(count);
    Ok(records
        .map(|record| {
            std::array::from_fn(|corner| {
                std::array::from_fn(|axis| {
                    // The normal comes first.
                    let at = 12 + 12 * corner + 4 * axis;
                    let bytes = [0, 1, 2, 3].map(|i| record[at + i]);
                    f32::from_le_bytes(bytes)
                })
            })
        })
        .collect())
}

fn ascii(bytes: &[u8]) -> Result<Vec<Triangle>, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| "it is no STL, or cut off")?;
    let mut words = text.split_ascii_whitespace();
    if words.next() != Some("solid") {
        return Err("it is no STL, or cut off".into());
    }
    let mut corners = Vec::new();
    let mut ended = false;
    while let Some(word) = words.next() {
        match word {
            "vertex" => {
                let mut number = || words.next()?.parse::<f32>().ok();
                let corner = (|| Some([number()?, number()?, number()?]))();
                corners.push(corner.ok_or("a corner is no point")?);
                bounded(corners.len() / 3)?;
            }
            "endsolid" => ended = true,
            _ => {}
        }
    }
    if !ended || corners.len() % 3 != 0 {
        return Err("it is cut off".into());
    }
    Ok(corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect())
}

#[cfg(test)]
mod tests {
    use super::super::triangles::{Corner, MOST_TRIANGLES, drawn};
    use super::*;

    fn shown(bytes: &[u8]) -> Result<Vec<[Corner; 3]>, String> {
        read(bytes).and_then(drawn)
    }

    const ASCII: &str = "solid one\n facet normal 0 0 0\n  outer loop\n   vertex 0 0 0\n   \
                         vertex 2 0 0\n   vertex 0 3e0 0\n  endloop\n endfacet\nendsolid one\n";

    fn binary_file(triangles: &[[[f32; 3]; 3]]) -> Vec<u8> {
        let mut bytes = b"solid but binary all the same".to_vec();
        bytes.resize(80, 0);
        bytes.extend((triangles.len() as u32).to_le_bytes());
        for triangle in triangles {
            bytes.extend([0; 12]);
            for value in triangle.iter().flatten() {
                bytes.extend(value.to_le_bytes());
            }
            bytes.extend([0; 2]);
        }
        bytes
    }

    #[test]
    fn both_kinds_are_read_and_normals_are_computed() {
        let triangle = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 3.0, 0.0]];
        let wanted = triangle.map(|[x, y, z]| [x, y, z, 0.0, 0.0, 1.0]);
        assert_eq!(shown(ASCII.as_bytes()), Ok(vec![wanted]));
        assert_eq!(shown(&binary_file(&[triangle])), Ok(vec![wanted]));
        let flat = [[0.0; 3], [1.0; 3], [2.0; 3]];
        assert_eq!(shown(&binary_file(&[triangle, flat])), Ok(vec![wanted]));
    }

    #[test]
    fn what_is_damaged_is_refused_and_nothing_panics() {
        let whole = binary_file(&[[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]);
        for length in 0..whole.len() {
            assert!(shown(&whole[..length]).is_err(), "{length}");
        }
        for length in 0..ASCII.trim_end().len() - "endsolid one".len() {
            assert!(shown(&ASCII.as_bytes()[..length]).is_err(), "{length}");
        }
        let mut boasts = whole.clone();
        boasts[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(shown(&boasts).is_err());
        let nan = binary_file(&[[[f32::NAN; 3]; 3]]);
        assert_eq!(shown(&nan), Err("a corner is no point".into()));
        assert!(shown(ASCII.replace("3e0", "much").as_bytes()).is_err());
        assert!(shown(&binary_file(&[])).is_err());
        let many = vec![[[0.0; 3]; 3]; MOST_TRIANGLES + 1];
        assert!(shown(&binary_file(&many)).unwrap_err().contains("more than"));
    }
}
