//! Box-constrained damped least squares, small and dense.
//!
//! Rows are gathered straight into the normal equations `H x = -g`: a row
//! touches only the columns of its own limb, which is most of the speed. The
//! step minimises `x'Hx/2 + g'x` inside a box by an active-set method. Nothing
//! allocates after [`BoxLeastSquares::new`].

use k::nalgebra::Vector3;

/// Rounds of the active set; far more than are needed from a warm start.
const MOST_ROUNDS_PER_COLUMN: usize = 4;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum BoundState {
    Free,
    Low,
    High,
}

/// One aim's dependence on one column: a derivative of three residual rows.
pub(crate) type JacobianColumn = (usize, Vector3<f64>);

pub(crate) struct BoxLeastSquares {
    size: usize,
    /// Row-major, lower triangle only.
    h: Vec<f64>,
    g: Vec<f64>,
    factor: Vec<f64>,
    free: Vec<usize>,
    held: Vec<BoundState>,
    step: Vec<f64>,
    /// Solution for the free columns: packed, then in its places.
    packed: Vec<f64>,
    right: Vec<f64>,
    /// Multiplications of all factorisations so far, roughly: what solving
    /// costs, whatever else runs on the machine.
    pub work: u64,
}

impl BoxLeastSquares {
    pub fn new(size: usize) -> Self {
        Self {
            size,
            h: vec![0.0; size * size],
            g: vec![0.0; size],
            factor: vec![0.0; size * size],
            free: Vec::with_capacity(size),
            held: vec![BoundState::Free; size],
            step: vec![0.0; size],
            packed: vec![0.0; size],
            right: vec![0.0; size],
            work: 0,
        }
    }

    pub fn clear(&mut self) {
        self.h.fill(0.0);
        self.g.fill(0.0);
    }

    /// Adds `weight^2 / 2 * |residual + columns * x|^2`.
    pub fn add(&mut self, weight: f64, residual: &Vector3<f64>, columns: &[JacobianColumn]) {
        let square = weight * weight;
        for (index, (i, a)) in columns.iter().enumerate() {
            self.g[*i] += square * a.dot(residual);
            for (j, b) in &columns[..=index] {
                let (row, column) = if i >= j { (*i, *j) } else { (*j, *i) };
                let both = square * a.dot(b);
                // Off the diagonal of one column met twice counts twice.
                let twice = i == j && !std::ptr::eq(a, b);
                self.h[row * self.size + column] += if twice { 2.0 * both } else { both };
            }
        }
    }

    /// Adds `weight^2 / 2 * (row . x)^2`.
    pub fn add_row(&mut self, weight: f64, row: &[f64]) {
        for (i, a) in row.iter().enumerate() {
            for (j, b) in row[..=i].iter().enumerate() {
                self.h[i * self.size + j] += weight * weight * a * b;
            }
        }
    }

    pub fn set_gradient(&mut self, slope: &[f64]) {
        self.g.copy_from_slice(slope);
    }

    /// Adds `weight^2 / 2 * (residual + x[column])^2`.
    pub fn add_scalar(&mut self, weight: f64, residual: f64, column: usize) {
        let square = weight * weight;
        self.h[column * self.size + column] += square;
        self.g[column] += square * residual;
    }

    /// The step inside `low..=high` that minimises the sum.
    ///
    /// A primal active-set method (Nocedal and Wright 2006, 16.5), which begins
    /// with the bounds that held the last solution. One bound enters or leaves
    /// at a time: feet that stay tie the legs' columns together so stiffly that
    /// holding several at once would tear them apart.
    pub fn solve(&mut self, low: &[f64], high: &[f64]) -> &[f64] {
        for index in 0..self.size {
            self.step[index] = match self.held[index] {
                BoundState::Low => low[index],
                BoundState::High => high[index],
                BoundState::Free => 0.0_f64.clamp(low[index], high[index]),
            };
        }
        for _ in 0..MOST_ROUNDS_PER_COLUMN * self.size {
            self.solve_free();
            match self.first_block(low, high) {
                Some((index, side, share)) => {
                    for &free in &self.free {
                        self.step[free] += share * (self.right[free] - self.step[free]);
                    }
                    self.held[index] = side;
                    self.step[index] = match side {
                        BoundState::Low => low[index],
                        _ => high[index],
                    };
                }
                None => {
                    for &free in &self.free {
                        self.step[free] = self.right[free];
                    }
                    match self.most_wrongly_held() {
                        Some(index) => self.held[index] = BoundState::Free,
                        None => break,
                    }
                }
            }
        }
        for index in 0..self.size {
            self.step[index] = self.step[index].clamp(low[index], high[index]);
        }
        &self.step
    }

    /// The bound that the way to the free solution meets first, and how
    /// far along that is.
    fn first_block(&self, low: &[f64], high: &[f64]) -> Option<(usize, BoundState, f64)> {
        let mut first: Option<(usize, BoundState, f64)> = None;
        for &index in &self.free {
            let (from, to) = (self.step[index], self.right[index]);
            let (side, bound) = match to {
                to if to < low[index] => (BoundState::Low, low[index]),
                to if to > high[index] => (BoundState::High, high[index]),
                _ => continue,
            };
            let share = ((bound - from) / (to - from)).clamp(0.0, 1.0);
            if first.is_none_or(|(_, _, least)| share < least) {
                first = Some((index, side, share));
            }
        }
        first
    }

    /// The held column whose gradient pulls it into the box hardest.
    fn most_wrongly_held(&self) -> Option<usize> {
        let n = self.size;
        let mut worst = None;
        let mut most = 1e-9;
        for i in 0..n {
            let sign = match self.held[i] {
                BoundState::Free => continue,
                BoundState::Low => -1.0,
                BoundState::High => 1.0,
            };
            let row: f64 = (0..=i).map(|j| self.h[i * n + j] * self.step[j]).sum();
            let column: f64 = (i + 1..n).map(|j| self.h[j * n + i] * self.step[j]).sum();
            let pull = sign * (self.g[i] + row + column) / self.h[i * n + i].max(1e-12);
            if pull > most {
                most = pull;
                worst = Some(i);
            }
        }
        worst
    }

    /// Solves for the free columns into `right`, the held ones staying at `step`.
    fn solve_free(&mut self) {
        let n = self.size;
        self.free.clear();
        self.free.extend((0..n).filter(|&i| self.held[i] == BoundState::Free));
        for (a, &i) in self.free.iter().enumerate() {
            let mut value = -self.g[i];
            for j in (0..n).filter(|&j| self.held[j] != BoundState::Free) {
                let (row, column) = if i >= j { (i, j) } else { (j, i) };
                value -= self.h[row * n + column] * self.step[j];
            }
            self.packed[a] = value;
            for (b, &j) in self.free[..=a].iter().enumerate() {
                self.factor[a * n + b] = self.h[i * n + j];
            }
        }
        let m = self.free.len();
        self.work += (m * m * (m + 6) / 6) as u64;
        if !cholesky(&mut self.factor, n, m) {
            // Not positive definite: only possible if a residual was not finite.
            self.packed[..m].fill(0.0);
        } else {
            substitute(&self.factor, n, m, &mut self.packed);
        }
        for (a, &i) in self.free.iter().enumerate() {
            self.right[i] = match self.packed[a].is_finite() {
                true => self.packed[a],
                false => 0.0,
            };
        }
    }
}

/// Lower Cholesky factor of the leading `m` rows, in place.
fn cholesky(a: &mut [f64], stride: usize, m: usize) -> bool {
    for i in 0..m {
        for j in 0..=i {
            let (upper, lower) = a.split_at(i * stride);
            let row_i = &lower[..=i];
            let row_j = if j == i { row_i } else { &upper[j * stride..] };
            let sum: f64 = row_i[..j].iter().zip(&row_j[..j]).map(|(x, y)| x * y).sum();
            let value = row_i[j] - sum;
            if i == j {
                if !(value > 0.0 && value.is_finite()) {
                    return false;
                }
                a[i * stride + i] = value.sqrt();
            } else {
                a[i * stride + j] = value / a[j * stride + j];
            }
        }
    }
    true
}

/// Solves `L L' x = b` in place.
fn substitute(l: &[f64], stride: usize, m: usize, b: &mut [f64]) {
    for i in 0..m {
        let sum: f64 = (0..i).map(|j| l[i * stride + j] * b[j]).sum();
        b[i] = (b[i] - sum) / l[i * stride + i];
    }
    for i in (0..m).rev() {
        let sum: f64 = (i + 1..m).map(|j| l[j * stride + i] * b[j]).sum();
        b[i] = (b[i] - sum) / l[i * stride + i];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// At the minimum the gradient is zero where the step is free, and
        /// points out of the box where it is held.
        #[test]
        fn steps_are_minima_inside_the_box(
            values in prop::collection::vec(-1.0..1.0_f64, 5 * 4 * 3 + 5),
            bound in 0.05..2.0_f64,
        ) {
            let size = 4;
            let mut solver = BoxLeastSquares::new(size);
            solver.clear();
            for index in 0..size {
                solver.add_scalar(0.3, 0.0, index);
            }
            for row in 0..5 {
                let at = |c: usize| {
                    let from = row * 12 + c * 3;
                    Vector3::new(values[from], values[from + 1], values[from + 2])
                };
                let columns: Vec<JacobianColumn> = (0..size).map(|c| (c, at(c))).collect();
                solver.add(1.5, &Vector3::repeat(values[60 + row]), &columns);
            }
            let (h, g) = (solver.h.clone(), solver.g.clone());
            let step = solver.solve(&[-bound; 4], &[bound; 4]).to_vec();
            for i in 0..size {
                let slope: f64 = g[i] + (0..size)
                    .map(|j| h[i.max(j) * size + i.min(j)] * step[j])
                    .sum::<f64>();
                prop_assert!(step[i].abs() <= bound);
                let outward = slope * step[i].signum();
                if step[i].abs() < bound {
                    prop_assert!(slope.abs() < 1e-8, "free column {i}: {slope}");
                } else {
                    prop_assert!(outward < 1e-8, "wrongly held column {i}: {slope}");
                }
            }
        }
    }

    #[test]
    fn a_residual_that_is_not_finite_gives_no_step() {
        let mut solver = BoxLeastSquares::new(2);
        solver.add_scalar(1.0, f64::NAN, 0);
        solver.add_scalar(1.0, 0.0, 1);
        assert_eq!(solver.solve(&[-1.0; 2], &[1.0; 2]), &[0.0, 0.0]);
    }
}
