//! A matrix in one of the number formats, as a step reads it and as a file
//! keeps it.

use half::f16;

use super::dtype::{
    BLOCK, CHUNK, CHUNK_WORDS, Dtype, q4_block, q4_values, q6_chunk, q6_values, q8_block,
};
use super::slab::{self, Held, Piece};

/// Numbers in a row filled up to whole chunks.
pub(crate) fn padded(width: usize, dtype: Dtype) -> usize {
    width.next_multiple_of(dtype.chunk())
}

/// Scales kept for a row of this width: whole eights.
pub(crate) fn scales_width(width: usize) -> usize {
    8 * width.div_ceil(8 * BLOCK)
}

/// Bytes of a row of `q6` chunks.
pub(crate) fn q6_bytes(width: usize) -> usize {
    width.div_ceil(CHUNK).saturating_mul(2 * CHUNK_WORDS)
}

/// Rows of one width in one number format, one after another, each filled up
/// with zeros to whole blocks.
#[derive(Clone, Debug)]
pub(crate) struct PackedMatrix {
    pub rows: usize,
    pub width: usize,
    pub numbers: PackedNumbers,
    /// Of quantised formats, f16: a row of them filled up to whole eights.
    pub scales: Held<u16>,
}

/// The numbers of a matrix without their scales.
#[derive(Clone, Debug)]
pub(crate) enum PackedNumbers {
    F32(Held<f32>),
    F16(Held<u16>),
    Q8(Held<i8>),
    Q6(Held<u16>),
    Q4(Held<u8>),
}

impl PackedMatrix {
    /// Packs `rows` times `width` numbers.
    pub fn pack(values: &[f32], width: usize, dtype: Dtype) -> Self {
        let mut packed = Self::empty(width, dtype);
        let mut row = vec![0.0; padded(width, dtype)];
        for values in values.chunks_exact(width) {
            row[..width].copy_from_slice(values);
            packed.push(&row);
        }
        packed
    }

    fn empty(width: usize, dtype: Dtype) -> Self {
        Self {
            rows: 0,
            width,
            numbers: match dtype {
                Dtype::F32 => PackedNumbers::F32(Held::default()),
                Dtype::F16 => PackedNumbers::F16(Held::default()),
                Dtype::Q8_0 => PackedNumbers::Q8(Held::default()),
                Dtype::Q6 => PackedNumbers::Q6(Held::default()),
                Dtype::Q4_0 => PackedNumbers::Q4(Held::default()),
            },
            scales: Held::default(),
        }
    }

    /// A quantised matrix out of a file; its width is whole blocks.
    pub fn from_file(
        rows: usize,
        width: usize,
        dtype: Dtype,
        bytes: &[u8],
        scales: &[u16],
    ) -> Self {
        let (blocks, wide) = (width / BLOCK, scales_width(width));
        let mut spread = vec![0; rows * wide];
        for (to, from) in spread.chunks_exact_mut(wide).zip(scales.chunks_exact(blocks)) {
            to[..blocks].copy_from_slice(from);
        }
        let numbers = match dtype {
            Dtype::Q8_0 => PackedNumbers::Q8(Held::Own(bytes.iter().map(|b| *b as i8).collect())),
            Dtype::Q6 => {
                let words = bytes.as_chunks().0.iter().copied();
                PackedNumbers::Q6(Held::Own(words.map(u16::from_le_bytes).collect()))
            }
            _ => PackedNumbers::Q4(Held::Own(bytes.to_vec())),
        };
        Self { rows, width, numbers, scales: Held::Own(spread) }
    }

    /// The bytes of a quantised matrix for a file, and its scales.
    pub fn to_file(&self) -> (Vec<u8>, Vec<u16>) {
        let bytes = match &self.numbers {
            PackedNumbers::Q8(all) => all.iter().map(|q| *q as u8).collect(),
            PackedNumbers::F16(all) | PackedNumbers::Q6(all) => {
                all.iter().flat_map(|word| word.to_le_bytes()).collect()
            }
            PackedNumbers::Q4(all) => all.to_vec(),
            PackedNumbers::F32(all) => all.iter().flat_map(|v| v.to_le_bytes()).collect(),
        };
        let rows = self.scales.chunks_exact(scales_width(self.width));
        let blocks = self.width / BLOCK;
        let scales = rows.flat_map(|row| row[..blocks].iter().copied());
        (bytes, scales.collect())
    }

    /// All numbers as f32, without what rows were filled up with.
    pub fn floats(&self) -> Vec<f32> {
        let half = |bits: &u16| f16::from_bits(*bits);
        let mut out = Vec::with_capacity(self.rows * self.width);
        for row in 0..self.rows {
            let of_row = |length: usize| row * length..(row + 1) * length;
            let scales = || {
                let range = of_row(scales_width(self.width));
                self.scales[range].iter().map(half)
            };
            let end = out.len() + self.width;
            match &self.numbers {
                PackedNumbers::F32(all) => {
                    out.extend(&all[of_row(padded(self.width, Dtype::F32))]);
                }
                PackedNumbers::F16(all) => {
                    let row = &all[of_row(padded(self.width, Dtype::F16))];
                    out.extend(row.iter().map(|bits| half(bits).to_f32()));
                }
                PackedNumbers::Q8(all) => {
                    let blocks = all[of_row(padded(self.width, Dtype::Q8_0))].chunks(BLOCK);
                    for (block, scale) in blocks.zip(scales()) {
                        out.extend(block.iter().map(|q| f32::from(*q) * scale.to_f32()));
                    }
                }
                PackedNumbers::Q6(all) => {
                    let chunks = all[of_row(q6_bytes(self.width) / 2)].as_chunks().0;
                    let scales: Vec<f16> = scales().collect();
                    for (words, scales) in chunks.iter().zip(scales.as_chunks().0) {
                        out.extend(q6_values(words, *scales));
                    }
                }
                PackedNumbers::Q4(all) => {
                    let bytes = &all[of_row(padded(self.width, Dtype::Q4_0) / 2)];
                    for (block, scale) in bytes.chunks(BLOCK / 2).zip(scales()) {
                        out.extend(q4_values(block, scale));
                    }
                }
            }
            out.truncate(end);
        }
        out
    }

    /// The rows of several matrices of one width and format.
    pub fn stack(matrices: impl IntoIterator<Item = Self>, width: usize, dtype: Dtype) -> Self {
        use PackedNumbers::{F16, F32, Q4, Q6, Q8};
        let mut all = Self::empty(width, dtype);
        for matrix in matrices {
            all.rows += matrix.rows;
            all.scales.extend(matrix.scales.iter().copied());
            match (&mut all.numbers, &matrix.numbers) {
                (F32(all), F32(more)) => all.extend(more.iter().copied()),
                (F16(all), F16(more)) | (Q6(all), Q6(more)) => all.extend(more.iter().copied()),
                (Q8(all), Q8(more)) => all.extend(more.iter().copied()),
                (Q4(all), Q4(more)) => all.extend(more.iter().copied()),
                _ => unreachable!("stacked matrices are packed by the same loader"),
            }
        }
        all
    }

    fn push(&mut self, row: &[f32]) {
        self.rows += 1;
        let mut scales = Vec::new();
        let blocks = row.as_chunks().0;
        match &mut self.numbers {
            PackedNumbers::F32(all) => all.extend(row.iter().copied()),
            PackedNumbers::F16(all) => all.extend(row.iter().map(|v| f16::from_f32(*v).to_bits())),
            PackedNumbers::Q8(all) => {
                for (quants, scale) in blocks.iter().map(q8_block) {
                    all.extend(quants);
                    scales.push(scale);
                }
            }
            PackedNumbers::Q6(all) => {
                for (words, of_chunk) in row.as_chunks().0.iter().map(q6_chunk) {
                    all.extend(words);
                    scales.extend(of_chunk);
                }
            }
            PackedNumbers::Q4(all) => {
                for (bytes, scale) in blocks.iter().map(q4_block) {
                    all.extend(bytes);
                    scales.push(scale);
                }
            }
        }
        if !scales.is_empty() {
            scales.resize(scales_width(self.width), f16::ZERO);
            self.scales.extend(scales.iter().map(|s| s.to_bits()));
        }
    }

    pub fn bytes(&self) -> usize {
        self.numbers().size() + self.scales.size()
    }

    fn numbers(&self) -> &dyn Piece {
        match &self.numbers {
            PackedNumbers::F32(all) => all,
            PackedNumbers::F16(all) | PackedNumbers::Q6(all) => all,
            PackedNumbers::Q8(all) => all,
            PackedNumbers::Q4(all) => all,
        }
    }

    fn pieces(&mut self) -> [&mut dyn Piece; 2] {
        let numbers: &mut dyn Piece = match &mut self.numbers {
            PackedNumbers::F32(all) => all,
            PackedNumbers::F16(all) | PackedNumbers::Q6(all) => all,
            PackedNumbers::Q8(all) => all,
            PackedNumbers::Q4(all) => all,
        };
        [numbers, &mut self.scales]
    }
}

/// Moves matrices that are used one after another together.
pub(crate) fn gather<'a>(matrices: impl IntoIterator<Item = &'a mut PackedMatrix>) {
    slab::gather(matrices.into_iter().flat_map(PackedMatrix::pieces));
}
