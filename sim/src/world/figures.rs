//! What a robot's body did in a world, summed step by step: lean, slip, load of the
//! feet, energy, and whether it fell.

use super::World;

/// A foot carries load from this share of the weight on.
const LOADED_SHARE: f64 = 0.02;

/// A robot's body from when it was let go to now, or to its fall.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BodyFigures {
    /// Seconds that these figures are of.
    pub seconds: f64,
    /// Whether it has fallen.
    pub fell: bool,
    /// Root mean square lean of the root link, radians.
    pub tilt_rms_rad: f64,
    /// How far loaded soles slid, metres.
    pub slip_m: f64,
    /// Share of the time in which each foot carried load, left and right.
    pub load_share: [f64; 2],
    /// Mechanical work of the servos, joules; what they brake does not count.
    pub work_j: f64,
}

#[derive(Clone, Debug, Default)]
pub(super) struct BodySums {
    steps: u64,
    tilt2: f64,
    slip_m: f64,
    loaded: [u64; 2],
    work_before_j: f64,
    work_j: f64,
    pub fell: bool,
}

impl BodySums {
    /// Takes in one step of a robot that stands by itself, or hangs.
    pub fn step(&mut self, world: &World, stands: bool) {
        if self.fell {
            return;
        }
        let root = world.root();
        let lean_rad = libm::acos(root.rotation[2][2].clamp(-1.0, 1.0));
        self.fell = stands && world.has_fallen();
        if self.steps == 0 {
            self.work_before_j = world.work_j();
        }
        self.steps += 1;
        self.tilt2 += lean_rad * lean_rad;
        self.slip_m += world.slip_m_s() * world.dt_s();
        for (loaded, force_n) in self.loaded.iter_mut().zip(world.foot_force_n()) {
            *loaded += u64::from(force_n > LOADED_SHARE * world.weight_n());
        }
        self.work_j = world.work_j() - self.work_before_j;
    }

    pub fn figures(&self, dt_s: f64) -> BodyFigures {
        let steps = self.steps.max(1) as f64;
        BodyFigures {
            seconds: self.steps as f64 * dt_s,
            fell: self.fell,
            tilt_rms_rad: libm::sqrt(self.tilt2 / steps),
            slip_m: self.slip_m,
            load_share: self.loaded.map(|loaded| loaded as f64 / steps),
            work_j: self.work_j,
        }
    }
}
