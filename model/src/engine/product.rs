//! Products of a packed matrix with the vectors of an [`Input`].

use std::ops::RangeInclusive;

use super::input::Input;
use super::kernels::{self, Cpu};
use super::pool::Team;
use crate::weights::{CHUNK, CHUNK_WORDS, PackedMatrix, PackedNumbers, scales_width};

/// Bytes of weights that a thread takes at a time: at first many, since each piece
/// starts cold; at last few, so that all threads are done at nearly the same time.
const PIECE_BYTES: RangeInclusive<usize> = 6 * 1024..=128 * 1024;

/// Products into `out`: for each row those of all lanes. `after` is called
/// with each finished piece of it, and the piece's first row.
pub(super) fn product(
    matrix: &PackedMatrix,
    team: &Team,
    x: &Input,
    out: &mut [f32],
    after: impl Fn(usize, &mut [f32]) + Sync,
) {
    debug_assert_eq!(x.padded().div_ceil(CHUNK), matrix.width.div_ceil(CHUNK));
    let (cpu, lanes) = (team.cpu(), x.lanes());
    let row_bytes = (matrix.bytes() / matrix.rows.max(1)).max(1);
    let rows_of = |bytes: &usize| (bytes / row_bytes).max(1);
    let rows = rows_of(PIECE_BYTES.start())..=rows_of(PIECE_BYTES.end());
    let out = &mut out[..matrix.rows * lanes];
    team.share_rows(out, lanes, rows, |first, out| {
        some_rows(matrix, cpu, first, x, out);
        after(first, out);
    });
}

fn some_rows(matrix: &PackedMatrix, cpu: Cpu, first: usize, x: &Input, out: &mut [f32]) {
    let width = x.padded();
    let from = first * width;
    let scales = || &matrix.scales[first * scales_width(matrix.width)..];
    let (quants, x_scales) = (&x.quants, &x.scales);
    match &matrix.numbers {
        PackedNumbers::F32(all) => kernels::rows_f32(cpu, out, &all[from..], &x.values, width),
        PackedNumbers::F16(all) => kernels::rows_f16(cpu, out, &all[from..], &x.values, width),
        PackedNumbers::Q8(all) => {
            kernels::rows_q8(cpu, out, &all[from..], scales(), quants, x_scales, width);
        }
        PackedNumbers::Q6(all) => {
            let all = &all[from / CHUNK * CHUNK_WORDS..];
            kernels::rows_q6(cpu, out, all, scales(), quants, x_scales, width);
        }
        PackedNumbers::Q4(all) => {
            kernels::rows_q4(cpu, out, &all[from / 2..], scales(), quants, x_scales, width);
        }
    }
}
