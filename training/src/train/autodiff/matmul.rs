//! Matrix products over slices: the one place where training calls the `gemm`
//! crate, which splits a product between the threads of the current pool.
//!
//! Every number of a product is summed in an order that does not depend on the
//! number of threads. Bounds are checked before each product; nothing else here
//! is trusted to.

#![allow(unsafe_code)]

use gemm::Parallelism;

#[derive(Clone, Copy, Debug)]
pub(crate) struct MatrixView<'a> {
    data: &'a [f32],
    rows: usize,
    columns: usize,
    row_stride: usize,
    column_stride: usize,
}

impl<'a> MatrixView<'a> {
    /// A matrix whose rows lie one after another.
    pub fn of(data: &'a [f32], rows: usize, columns: usize) -> Self {
        Self::strided(data, rows, columns, columns)
    }

    /// A matrix whose rows begin `stride` numbers apart.
    pub fn strided(data: &'a [f32], rows: usize, columns: usize, stride: usize) -> Self {
        Self { data, rows, columns, row_stride: stride, column_stride: 1 }
    }

    pub fn t(self) -> Self {
        Self {
            rows: self.columns,
            columns: self.rows,
            row_stride: self.column_stride,
            column_stride: self.row_stride,
            ..self
        }
    }

    fn last(&self) -> usize {
        (self.rows - 1) * self.row_stride + (self.columns - 1) * self.column_stride
    }
}

/// A matrix to write to, whose rows begin `stride` numbers apart.
#[derive(Debug)]
pub(crate) struct MatrixViewMut<'a> {
    data: &'a mut [f32],
    rows: usize,
    columns: usize,
    stride: usize,
}

impl<'a> MatrixViewMut<'a> {
    /// A matrix whose rows lie one after another.
    pub fn of(data: &'a mut [f32], rows: usize, columns: usize) -> Self {
        Self::strided(data, rows, columns, columns)
    }

    /// A matrix whose rows begin `stride` numbers apart.
    pub fn strided(data: &'a mut [f32], rows: usize, columns: usize, stride: usize) -> Self {
        Self { data, rows, columns, stride }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Threads {
    One,
    All,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WriteMode {
    Nothing,
    Sum,
}

/// `out = lhs rhs` or `out += lhs rhs`. Panics when shapes do not fit each other or their slices.
pub(crate) fn product(
    out: MatrixViewMut,
    onto: WriteMode,
    lhs: MatrixView,
    rhs: MatrixView,
    threads: Threads,
) {
    let (m, n, k) = (out.rows, out.columns, lhs.columns);
    assert!(lhs.rows == m && rhs.columns == n && rhs.rows == k, "shapes");
    if m == 0 || n == 0 || k == 0 {
        if onto == WriteMode::Nothing {
            (0..m).for_each(|r| out.data[r * out.stride..][..n].fill(0.0));
        }
        return;
    }
    assert!(out.stride >= n && (m - 1) * out.stride + n <= out.data.len());
    assert!(lhs.last() < lhs.data.len() && rhs.last() < rhs.data.len());
    let add = onto == WriteMode::Sum;
    let parallelism = match threads {
        Threads::One => Parallelism::None,
        Threads::All => Parallelism::Rayon(rayon::current_num_threads()),
    };
    // SAFETY: the asserts above hold every index of the three matrices inside
    // its slice; `out` is borrowed mutably, so nothing else reads or writes it,
    // and rows of `out` do not overlap because its stride is at least a row.
    unsafe {
        gemm::gemm(
            m,
            n,
            k,
            out.data.as_mut_ptr(),
            1,
            out.stride as isize,
            add,
            lhs.data.as_ptr(),
            lhs.column_stride as isize,
            lhs.row_stride as isize,
            rhs.data.as_ptr(),
            rhs.column_stride as isize,
            rhs.row_stride as isize,
            1.0,
            1.0,
            false,
            false,
            false,
            parallelism,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(count: usize, seed: usize) -> Vec<f32> {
        let number = |i| ((i * 7919 + seed) % 1009) as f32 / 504.5 - 1.0;
        (0..count).map(number).collect()
    }

    /// The definition, in f64.
    fn plain(out: &mut [f32], stride: usize, add: bool, lhs: MatrixView, rhs: MatrixView) {
        for i in 0..lhs.rows {
            for j in 0..rhs.columns {
                let at = |v: MatrixView, r: usize, c: usize| {
                    f64::from(v.data[r * v.row_stride + c * v.column_stride])
                };
                let sum: f64 = (0..lhs.columns).map(|k| at(lhs, i, k) * at(rhs, k, j)).sum();
                let before = if add { out[i * stride + j] } else { 0.0 };
                out[i * stride + j] = before + sum as f32;
            }
        }
    }

    #[test]
    fn products_are_those_of_the_definition() {
        for (m, n, k) in [(1, 1, 1), (3, 5, 7), (64, 33, 40), (7, 120, 1), (130, 64, 257)] {
            for (transposed, onto) in [(false, WriteMode::Nothing), (true, WriteMode::Sum)] {
                let (a, b) = (numbers(m * (k + 3), 1), numbers(k * n, 2));
                let lhs = MatrixView::strided(&a, m, k, k + 3);
                let rhs = match transposed {
                    true => MatrixView::of(&b, n, k).t(),
                    false => MatrixView::of(&b, k, n),
                };
                let stride = n + 2;
                let mut expected = numbers(m * stride, 3);
                for threads in [Threads::One, Threads::All] {
                    let mut found = numbers(m * stride, 3);
                    let out = MatrixViewMut::strided(&mut found, m, n, stride);
                    product(out, onto, lhs, rhs, threads);
                    if threads == Threads::One {
                        plain(&mut expected, stride, onto == WriteMode::Sum, lhs, rhs);
                    }
                    for (f, e) in found.iter().zip(&expected) {
                        assert!((f - e).abs() < 1e-4, "{m} {n} {k}: {f} and {e}");
                    }
                }
            }
        }
    }

    #[test]
    fn the_number_of_threads_changes_no_bit() {
        let (m, n, k) = (300, 200, 512);
        let (a, b) = (numbers(m * k, 1), numbers(k * n, 2));
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let mut out = vec![0.0; m * n];
            pool.unwrap().install(|| {
                let (lhs, rhs) = (MatrixView::of(&a, m, k), MatrixView::of(&b, k, n));
                product(
                    MatrixViewMut::of(&mut out, m, n),
                    WriteMode::Nothing,
                    lhs,
                    rhs,
                    Threads::All,
                );
            });
            out
        };
        assert!(run(1) == run(2) && run(2) == run(3));
    }

    #[test]
    #[should_panic(expected = "last")]
    fn a_slice_that_is_too_short_is_refused() {
        let (a, b) = (numbers(5, 1), numbers(6, 2));
        let mut out = [0.0; 4];
        let (lhs, rhs) = (MatrixView::of(&a, 2, 3), MatrixView::of(&b, 3, 2));
        product(MatrixViewMut::of(&mut out, 2, 2), WriteMode::Nothing, lhs, rhs, Threads::One);
    }
}
