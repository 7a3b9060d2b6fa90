//! A matrix packed once, and its products with the vectors of an [`Input`].

use std::ops::RangeInclusive;

use half::f16;

use super::dtype::{BLOCK, CHUNK, CHUNK_WORDS, Dtype, q4_block, q6_chunk, q8_block};
use super::input::{Input, padded, scales_width};
use super::kernels::{self, Cpu};
use super::pool::Team;
use super::slab::{self, Held, Piece};

/// Bytes of weights that a thread takes at a time: at last few, so that all
/// threads are done at nearly the same time, and at first many, since each piece
/// starts cold.
const PIECE_BYTES: RangeInclusive<usize> = 6 * 1024..=128 * 1024;

/// Rows of one width in one number format.
#[derive(Clone, Debug)]
pub(crate) struct Matrix {
    rows: usize,
    width: usize,
    store: Store,
}

/// Rows one after another, each filled up with zeros to whole blocks; scales as
/// f16, a row of them filled up to whole eights.
#[derive(Clone, Debug)]
enum Store {
    F32(Held<f32>),
    F16(Held<u16>),
    Q8(Held<i8>, Held<u16>),
    Q6(Held<u16>, Held<u16>),
    Q4(Held<u8>, Held<u16>),
}

impl Matrix {
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

    /// Without rows yet.
    pub fn empty(width: usize, dtype: Dtype) -> Self {
        let store = match dtype {
            Dtype::F32 => Store::F32(Held::default()),
            Dtype::F16 => Store::F16(Held::default()),
            Dtype::Q8_0 => Store::Q8(Held::default(), Held::default()),
            Dtype::Q6 => Store::Q6(Held::default(), Held::default()),
            Dtype::Q4_0 => Store::Q4(Held::default(), Held::default()),
        };
        Self {
            rows: 0,
            width,
            store,
        }
    }

    /// `q8_0` blocks as they are in a file, of a width that is whole blocks.
    pub fn from_q8(width: usize, quants: Vec<i8>, scales: &[u16]) -> Self {
        let rows = quants.len() / width;
        let store = Store::Q8(Held::Own(quants), Held::Own(spread(scales, width)));
        Self { rows, width, store }
    }

    /// Likewise rows of `q6` chunks.
    pub fn from_q6(width: usize, words: Vec<u16>, scales: &[u16]) -> Self {
        let rows = words.len() / (padded(width, Dtype::Q6) / CHUNK * CHUNK_WORDS);
        let store = Store::Q6(Held::Own(words), Held::Own(spread(scales, width)));
        Self { rows, width, store }
    }

    /// Likewise `q4_0`.
    pub fn from_q4(width: usize, quants: Vec<u8>, scales: &[u16]) -> Self {
        let rows = 2 * quants.len() / width;
        let store = Store::Q4(Held::Own(quants), Held::Own(spread(scales, width)));
        Self { rows, width, store }
    }

    /// The rows of several matrices of one width and format.
    pub fn stack(matrices: impl IntoIterator<Item = Self>, width: usize, dtype: Dtype) -> Self {
        let mut all = Self::empty(width, dtype);
        for matrix in matrices {
            all.rows += matrix.rows;
            match (&mut all.store, matrix.store) {
                (Store::F32(all), Store::F32(more)) => all.extend(more.iter().copied()),
                (Store::F16(all), Store::F16(more)) => all.extend(more.iter().copied()),
                (Store::Q8(all, scales), Store::Q8(more, more_scales)) => {
                    all.extend(more.iter().copied());
                    scales.extend(more_scales.iter().copied());
                }
                (Store::Q4(all, scales), Store::Q4(more, more_scales)) => {
                    all.extend(more.iter().copied());
                    scales.extend(more_scales.iter().copied());
                }
                (Store::Q6(all, scales), Store::Q6(more, more_scales)) => {
                    all.extend(more.iter().copied());
                    scales.extend(more_scales.iter().copied());
                }
                _ => unreachable!("stacked matrices are packed by the same loader"),
            }
        }
        all
    }

    fn push(&mut self, row: &[f32]) {
        self.rows += 1;
        let more = scales_width(self.width) - row.len() / BLOCK;
        match &mut self.store {
            Store::F32(all) => all.extend(row.iter().copied()),
            Store::F16(all) => all.extend(row.iter().map(|v| f16::from_f32(*v).to_bits())),
            Store::Q8(all, scales) => {
                for block in row.as_chunks().0 {
                    let (quants, scale) = q8_block(block);
                    all.extend(quants);
                    scales.extend([scale.to_bits()]);
                }
                scales.extend(std::iter::repeat_n(0, more));
            }
            Store::Q6(all, scales) => {
                for chunk in row.as_chunks().0 {
                    let (words, of_chunk) = q6_chunk(chunk);
                    all.extend(words);
                    scales.extend(of_chunk.map(f16::to_bits));
                }
                scales.extend(std::iter::repeat_n(0, more));
            }
            Store::Q4(all, scales) => {
                for block in row.as_chunks().0 {
                    let (bytes, scale) = q4_block(block);
                    all.extend(bytes);
                    scales.extend([scale.to_bits()]);
                }
                scales.extend(std::iter::repeat_n(0, more));
            }
        }
    }

    fn pieces(&mut self) -> Vec<&mut dyn Piece> {
        match &mut self.store {
            Store::F32(all) => vec![all],
            Store::F16(all) => vec![all],
            Store::Q8(all, scales) => vec![all, scales],
            Store::Q6(all, scales) => vec![all, scales],
            Store::Q4(all, scales) => vec![all, scales],
        }
    }

    /// Rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Bytes that a product reads.
    pub fn bytes(&self) -> usize {
        match &self.store {
            Store::F32(all) => 4 * all.len(),
            Store::F16(all) => 2 * all.len(),
            Store::Q8(all, scales) => all.len() + 2 * scales.len(),
            Store::Q6(all, scales) => 2 * (all.len() + scales.len()),
            Store::Q4(all, scales) => all.len() + 2 * scales.len(),
        }
    }

    /// Products into `out`: for each row those of all lanes. `after` is called
    /// with each finished piece of it, and the piece's first row.
    pub fn times(
        &self,
        team: &Team,
        x: &Input,
        out: &mut [f32],
        after: impl Fn(usize, &mut [f32]) + Sync,
    ) {
        debug_assert_eq!(x.padded().div_ceil(CHUNK), self.width.div_ceil(CHUNK));
        let (cpu, lanes) = (team.cpu(), x.lanes());
        let row_bytes = (self.bytes() / self.rows.max(1)).max(1);
        let rows_of = |bytes: &usize| (bytes / row_bytes).max(1);
        let rows = rows_of(PIECE_BYTES.start())..=rows_of(PIECE_BYTES.end());
        let out = &mut out[..self.rows * lanes];
        team.share_rows(out, lanes, rows, |first, out| {
            self.some_rows(cpu, first, x, out);
            after(first, out);
        });
    }

    fn some_rows(&self, cpu: Cpu, first: usize, x: &Input, out: &mut [f32]) {
        let width = x.padded();
        let from = first * width;
        let scale_from = first * scales_width(self.width);
        match &self.store {
            Store::F32(all) => kernels::rows_f32(cpu, out, &all[from..], &x.values, width),
            Store::F16(all) => kernels::rows_f16(cpu, out, &all[from..], &x.values, width),
            Store::Q8(all, scales) => {
                let (all, scales) = (&all[from..], &scales[scale_from..]);
                kernels::rows_q8(cpu, out, all, scales, &x.quants, &x.scales, width);
            }
            Store::Q6(all, scales) => {
                let from = from / CHUNK * CHUNK_WORDS;
                let (all, scales) = (&all[from..], &scales[scale_from..]);
                kernels::rows_q6(cpu, out, all, scales, &x.quants, &x.scales, width);
            }
            Store::Q4(all, scales) => {
                let (all, scales) = (&all[from / 2..], &scales[scale_from..]);
                kernels::rows_q4(cpu, out, all, scales, &x.quants, &x.scales, width);
            }
        }
    }
}

/// Moves matrices that are used one after another together.
pub(crate) fn gather<'a>(matrices: impl IntoIterator<Item = &'a mut Matrix>) {
    slab::gather(matrices.into_iter().flat_map(Matrix::pieces));
}

/// Scales in rows of whole eights.
fn spread(scales: &[u16], width: usize) -> Vec<u16> {
    let (blocks, wide) = (width / BLOCK, scales_width(width));
    let mut out = Vec::with_capacity(scales.len() / blocks * wide);
    for row in scales.chunks_exact(blocks) {
        out.extend(row);
        out.extend(std::iter::repeat_n(0, wide - blocks));
    }
    out
}
