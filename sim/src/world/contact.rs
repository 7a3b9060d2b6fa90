//! Soft contact with the floor, by the law that MuJoCo documents ("Computation",
//! soft constraints): a reference acceleration of a damped spring, regularised by
//! an impedance that grows with the depth; friction inside an elliptic cone. Solved
//! by projected Gauss-Seidel from the last step's forces.

use super::mass_matrix::MassMatrix;
use super::spatial::Vec3;

/// Time constant of the contact's spring, seconds; it is critically damped.
const TIME_S: f64 = 0.02;
const IMPEDANCE: [f64; 2] = [0.9, 0.95];
/// Depth over which the impedance grows, metres.
const WIDTH_M: f64 = 0.001;
const SWEEPS: usize = 30;
/// Sweeps end when no force changes by more than this share of the weight.
const SETTLED: f64 = 1e-7;
pub(super) const ROWS: usize = 3;

/// One point that touches: along the floor's normal, and two directions in the floor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Touch {
    pub point: usize,
    /// The degree of freedom that moves the point first, and its place from the
    /// common point, metres.
    pub dof: usize,
    pub at: Vec3,
    pub depth_m: f64,
    pub velocity: Vec3,
    /// Mobility by which the softness is scaled, 1/kg.
    pub mobility: f64,
}

/// The floor's frame: normal and two tangents.
#[derive(Clone, Copy, Debug)]
pub(super) struct FloorFrame {
    pub normal: Vec3,
    pub tangents: [Vec3; 2],
}

impl FloorFrame {
    /// A floor whose normal leans by these radians about world x and y.
    pub fn tilted(about_x: f64, about_y: f64) -> Self {
        let normal = Vec3::new(libm::sin(about_y), -libm::sin(about_x), 1.0).normalize();
        let x = (Vec3::x() - normal * normal.x).normalize();
        Self { normal, tangents: [x, normal.cross(&x)] }
    }

    pub fn axes(&self) -> [Vec3; ROWS] {
        [self.normal, self.tangents[0], self.tangents[1]]
    }
}

/// Stiffness, damping and softness of one contact at its depth.
struct SoftLaw {
    aref: Vec3,
    softness: f64,
}

impl SoftLaw {
    fn of(touch: &Touch, axes: &[Vec3; ROWS]) -> Self {
        let [low, high] = IMPEDANCE;
        let share = (touch.depth_m / WIDTH_M).clamp(0.0, 1.0);
        let eased = match share < 0.5 {
            true => 2.0 * share * share,
            false => 1.0 - 2.0 * (1.0 - share) * (1.0 - share),
        };
        let impedance = low + (high - low) * eased;
        let damping = 2.0 / (high * TIME_S);
        let stiffness = 1.0 / (high * high * TIME_S * TIME_S);
        let speed = axes.map(|axis| axis.dot(&touch.velocity));
        let push = stiffness * impedance * touch.depth_m;
        Self {
            aref: Vec3::new(push - damping * speed[0], -damping * speed[1], -damping * speed[2]),
            softness: (1.0 - impedance) / impedance * touch.mobility,
        }
    }
}

/// The forces of the floor on a robot, newtons.
#[derive(Clone, Debug, Default)]
pub(super) struct ContactSolver {
    pub touches: Vec<Touch>,
    /// Force on every point of the robot (normal, tangents), as the next warm start.
    pub forces: Vec<Vec3>,
    /// `L'^-1 J'` of each row.
    rows: Vec<f64>,
    /// `A + R`, row by row, and what is left to be reached without force.
    matrix: Vec<f64>,
    right: Vec<f64>,
    force: Vec<f64>,
}

/// What a contact row does to the robot: a force along `axis`, `at` from the common point.
pub(super) trait PointMotion {
    /// How fast the point moves along `axis` by degree of freedom `dof`.
    fn along(&self, dof: usize, axis: &Vec3, at: &Vec3) -> f64;
}

impl ContactSolver {
    pub fn new(points: usize) -> Self {
        Self { forces: vec![Vec3::zeros(); points], ..Self::default() }
    }

    /// Finds the forces of the present touches. `acceleration` is the robot's without
    /// them, by degree of freedom; afterwards it is with them.
    pub fn solve(
        &mut self,
        floor: &FloorFrame,
        friction: f64,
        mass: &MassMatrix,
        jacobian: &impl PointMotion,
        acceleration: &mut [f64],
        weight_n: f64,
    ) {
        let (dofs, size) = (acceleration.len(), self.touches.len() * ROWS);
        self.rows.clear();
        self.rows.resize(size * dofs, 0.0);
        self.right.clear();
        self.force.clear();
        let axes = floor.axes();
        let mut softness = Vec::with_capacity(self.touches.len());
        for touch in &self.touches {
            let law = SoftLaw::of(touch, &axes);
            for (axis, direction) in axes.iter().enumerate() {
                let row = self.right.len();
                let entries = &mut self.rows[row * dofs..(row + 1) * dofs];
                let mut free = 0.0;
                for dof in mass.path(touch.dof) {
                    entries[dof] = jacobian.along(dof, direction, &touch.at);
                    free += entries[dof] * acceleration[dof];
                }
                mass.solve_upper_from(touch.dof, entries);
                self.right.push(free - law.aref[axis]);
                self.force.push(self.forces[touch.point][axis]);
            }
            softness.push(law.softness);
        }
        self.gather(mass, dofs, &softness);
        self.sweep(friction, weight_n);
        self.apply(mass, acceleration);
    }

    /// `A = J M^-1 J'` plus the softness on its diagonal.
    fn gather(&mut self, mass: &MassMatrix, dofs: usize, softness: &[f64]) {
        let size = self.right.len();
        self.matrix.clear();
        self.matrix.resize(size * size, 0.0);
        for (touch, soft) in softness.iter().enumerate() {
            let path = || mass.path(self.touches[touch].dof);
            for row in touch * ROWS..(touch + 1) * ROWS {
                for other in 0..(touch + 1) * ROWS {
                    let product = |dof: usize| {
                        self.rows[row * dofs + dof] * self.rows[other * dofs + dof]
                            / mass.diagonal(dof)
                    };
                    let sum: f64 = path().map(product).sum();
                    self.matrix[row * size + other] = sum;
                    self.matrix[other * size + row] = sum;
                }
                self.matrix[row * size + row] += soft;
            }
        }
    }

    fn sweep(&mut self, friction: f64, weight_n: f64) {
        let size = self.right.len();
        for _ in 0..SWEEPS {
            let mut changed = 0.0_f64;
            for first in (0..size).step_by(ROWS) {
                let before = [self.force[first], self.force[first + 1], self.force[first + 2]];
                for row in first..first + ROWS {
                    let entries = &self.matrix[row * size..(row + 1) * size];
                    let product: f64 =
                        entries.iter().zip(&self.force).map(|(entry, force)| entry * force).sum();
                    let moved = self.force[row] - (self.right[row] + product) / entries[row];
                    self.force[row] = if row == first { moved.max(0.0) } else { moved };
                }
                let most = friction * self.force[first];
                let [x, y] = [self.force[first + 1], self.force[first + 2]];
                let across = libm::sqrt(x * x + y * y);
                if across > most {
                    self.force[first + 1] = x * most / across;
                    self.force[first + 2] = y * most / across;
                }
                for (now, before) in self.force[first..first + ROWS].iter().zip(before) {
                    changed = changed.max((now - before).abs());
                }
            }
            if changed < SETTLED * weight_n {
                break;
            }
        }
    }

    /// Adds what the forces accelerate, and keeps them for the next step.
    fn apply(&mut self, mass: &MassMatrix, acceleration: &mut [f64]) {
        let dofs = acceleration.len();
        let mut sum = vec![0.0; dofs];
        self.forces.fill(Vec3::zeros());
        for (index, touch) in self.touches.iter().enumerate() {
            for axis in 0..ROWS {
                let row = index * ROWS + axis;
                let force = self.force[row];
                self.forces[touch.point][axis] = force;
                for dof in mass.path(touch.dof) {
                    sum[dof] += self.rows[row * dofs + dof] * force;
                }
            }
        }
        mass.solve_lower(&mut sum);
        for (acceleration, added) in acceleration.iter_mut().zip(sum) {
            *acceleration += added;
        }
    }
}
