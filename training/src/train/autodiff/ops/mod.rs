//! The operations of the tape, each forward and backward in one file.

mod affine;
mod attention;
mod lookup;
mod norm;
mod pointwise;
#[cfg(test)]
mod tests;

pub(crate) use attention::{AttentionInputs, AttentionMask};

/// Rows that one thread takes at a time. Sums over rows are made piece by piece
/// and joined in order, so that the number of threads changes no bit.
const PIECE_ROWS: usize = 128;

/// Sums a per-row contribution over all rows: `of_piece` adds the rows of one
/// piece to its own sums.
fn sum_over_rows(
    into: &mut [f32],
    rows: usize,
    of_piece: impl Fn(std::ops::Range<usize>, &mut [f32]) + Sync,
) {
    use rayon::prelude::*;
    let width = into.len();
    let pieces: Vec<Vec<f32>> = (0..rows.div_ceil(PIECE_ROWS))
        .into_par_iter()
        .map(|piece| {
            let first = piece * PIECE_ROWS;
            let mut sums = vec![0.0; width];
            of_piece(first..rows.min(first + PIECE_ROWS), &mut sums);
            sums
        })
        .collect();
    for piece in pieces {
        super::lanes::add(into, &piece);
    }
}
