//! Scores of a query against keys, and values weighted by them.

use super::super::lanes::Lanes;
use super::products::Stored;

/// Keys that are scored together: each has its running sum.
const KEYS: usize = 8;
/// Bytes that are fetched at once.
const LINE: usize = 64;
/// How far ahead they are fetched, bytes.
const AHEAD: usize = 2048;

#[inline(always)]
pub(super) fn scores<L: Lanes, S: Stored>(scores: &mut [f32], keys: &[S], query: &[f32]) {
    let width = query.len();
    let (eights, rest) = scores.as_chunks_mut::<KEYS>();
    let (keys, rest_keys) = keys.split_at(eights.len() * KEYS * width);
    let query = query.as_chunks::<8>().0;
    for (scores, keys) in eights.iter_mut().zip(keys.chunks_exact(KEYS * width)) {
        fetch_behind::<L, S>(keys);
        L::sums(dots::<L, S, KEYS>(keys, query, width)).store(scores);
    }
    for (score, key) in rest.iter_mut().zip(rest_keys.chunks_exact(width)) {
        *score = dots::<L, S, 1>(key, query, width)[0].sum();
    }
}

/// Fetches what lies behind numbers that are being read.
#[inline(always)]
fn fetch_behind<L: Lanes, S: Stored>(read: &[S]) {
    for line in read.chunks(LINE / size_of::<S>()) {
        L::fetch(&line[0], AHEAD);
    }
}

/// The products of `N` keys with a query, summed to eight each.
#[inline(always)]
fn dots<L: Lanes, S: Stored, const N: usize>(
    keys: &[S],
    query: &[[f32; 8]],
    width: usize,
) -> [L; N] {
    let mut sums = [L::splat(0.0); N];
    let rows: [&[[S; 8]]; N] = std::array::from_fn(|k| keys[k * width..][..width].as_chunks().0);
    for (column, query) in query.iter().enumerate() {
        let query = L::load(query);
        for (sum, row) in sums.iter_mut().zip(rows) {
            *sum = S::load::<L>(&row[column]).fma(query, *sum);
        }
    }
    sums
}

#[inline(always)]
pub(super) fn mix<L: Lanes, S: Stored>(out: &mut [f32], weights: &[f32], values: &[S]) {
    let mut column = 0;
    while out.len() - column >= 64 {
        mix_columns::<L, S, 8>(out, weights, values, column);
        column += 64;
    }
    while out.len() - column >= 32 {
        mix_columns::<L, S, 4>(out, weights, values, column);
        column += 32;
    }
    while out.len() - column >= 8 {
        mix_columns::<L, S, 1>(out, weights, values, column);
        column += 8;
    }
}

/// `N` times eight columns from `column` on.
#[inline(always)]
fn mix_columns<L: Lanes, S: Stored, const N: usize>(
    out: &mut [f32],
    weights: &[f32],
    values: &[S],
    column: usize,
) {
    let mut sums = [L::splat(0.0); N];
    for (weight, row) in weights.iter().zip(values.chunks_exact(out.len())) {
        let weight = L::splat(*weight);
        let row = &row[column..column + 8 * N];
        fetch_behind::<L, S>(row);
        let row = row.as_chunks::<8>().0;
        for (sum, v) in sums.iter_mut().zip(row) {
            *sum = S::load::<L>(v).fma(weight, *sum);
        }
    }
    let out = out[column..column + 8 * N].as_chunks_mut::<8>().0;
    for (sum, out) in sums.iter().zip(out) {
        sum.store(out);
    }
}
