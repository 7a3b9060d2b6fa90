//! The joint-space mass matrix and its factors `M = L' D L`, sparse along the
//! tree (Featherstone 2008, section 6.5): an entry is only where one degree of
//! freedom is above the other.

#[derive(Clone, Debug)]
pub(super) struct MassMatrix {
    size: usize,
    parents: Vec<Option<usize>>,
    entries: Vec<f64>,
    /// The first degree of freedom that moves: those before it are held.
    pub first: usize,
}

impl MassMatrix {
    pub fn new(parents: Vec<Option<usize>>) -> Self {
        let size = parents.len();
        Self { size, parents, entries: vec![0.0; size * size], first: 0 }
    }

    pub fn clear(&mut self) {
        self.entries.fill(0.0);
    }

    /// Sets the entry of a degree of freedom and one above it (or itself).
    pub fn set(&mut self, below: usize, above: usize, value: f64) {
        self.entries[below * self.size + above] = value;
    }

    pub fn add_diagonal(&mut self, dof: usize, value: f64) {
        self.entries[dof * self.size + dof] += value;
    }

    pub fn diagonal(&self, dof: usize) -> f64 {
        self.entries[dof * self.size + dof]
    }

    /// The next degree of freedom above that moves.
    fn above(&self, dof: usize) -> Option<usize> {
        self.parents[dof].filter(|above| *above >= self.first)
    }

    pub fn factorise(&mut self) {
        let size = self.size;
        for k in (self.first..size).rev() {
            let pivot = self.entries[k * size + k];
            let mut one = self.above(k);
            while let Some(i) = one {
                let share = self.entries[k * size + i] / pivot;
                let mut other = Some(i);
                while let Some(j) = other {
                    self.entries[i * size + j] -= share * self.entries[k * size + j];
                    other = self.above(j);
                }
                self.entries[k * size + i] = share;
                one = self.above(i);
            }
        }
    }

    /// Solves `L' y = b` in place for a vector that is zero but at `from` and above.
    pub fn solve_upper_from(&self, from: usize, b: &mut [f64]) {
        let mut at = Some(from).filter(|from| *from >= self.first);
        while let Some(i) = at {
            let value = b[i];
            let mut above = self.above(i);
            while let Some(j) = above {
                b[j] -= self.entries[i * self.size + j] * value;
                above = self.above(j);
            }
            at = self.above(i);
        }
    }

    fn solve_upper(&self, b: &mut [f64]) {
        for i in (self.first..self.size).rev() {
            let value = b[i];
            let mut above = self.above(i);
            while let Some(j) = above {
                b[j] -= self.entries[i * self.size + j] * value;
                above = self.above(j);
            }
        }
    }

    /// Solves `D L x = y` in place.
    pub fn solve_lower(&self, y: &mut [f64]) {
        y[..self.first].fill(0.0);
        for (i, value) in y.iter_mut().enumerate().skip(self.first) {
            *value /= self.diagonal(i);
        }
        for i in self.first..self.size {
            let mut above = self.above(i);
            while let Some(j) = above {
                y[i] -= self.entries[i * self.size + j] * y[j];
                above = self.above(j);
            }
        }
    }

    /// Solves `M x = b` in place.
    pub fn solve(&self, b: &mut [f64]) {
        self.solve_upper(b);
        self.solve_lower(b);
    }

    /// Degrees of freedom from `from` up to the root, as far as they move.
    pub fn path(&self, from: usize) -> impl Iterator<Item = usize> + '_ {
        std::iter::successors(Some(from).filter(|from| *from >= self.first), |dof| self.above(*dof))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_branched_tree_is_solved_as_its_dense_matrix() {
        // 0 - 1 - 2 and 1 - 3: 2 and 3 do not meet.
        let mut mass = MassMatrix::new(vec![None, Some(0), Some(1), Some(1)]);
        let dense = [
            [4.0, 1.0, 0.5, 0.25],
            [1.0, 3.0, 0.3, 0.2],
            [0.5, 0.3, 2.0, 0.0],
            [0.25, 0.2, 0.0, 1.0],
        ];
        for (below, row) in dense.iter().enumerate() {
            for (above, value) in row.iter().enumerate().take(below + 1) {
                mass.set(below, above, *value);
            }
        }
        mass.factorise();
        let wanted = [0.3, -1.2, 0.7, 2.0];
        let mut b: Vec<f64> =
            (0..4).map(|i| (0..4).map(|j| dense[i][j] * wanted[j]).sum()).collect();
        mass.solve(&mut b);
        for (got, wanted) in b.iter().zip(wanted) {
            assert!((got - wanted).abs() < 1e-12, "{got} {wanted}");
        }
    }
}
