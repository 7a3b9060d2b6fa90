//! What a robot's body did in a world, summed step by step: lean, slip, load of the
//! feet, energy, and whether it fell.

use super::World;

/// A robot has fallen when its root link leans by more than this, or is below this
/// share of its height at the start.
const FALLEN_RAD: f64 = 50.0 * std::f64::consts::PI / 180.0;
const FALLEN_HEIGHT: f64 = 0.5;
/// A foot carries load from this share of the weight on.
const LOADED_SHARE: f64 = 0.02;
/// Slip slower than this is the creep of a soft contact, m/s.
const CREEP_M_S: f64 = 2e-3;

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
        let height_m = world.start_m()[2];
        self.fell = stands && (lean_rad > FALLEN_RAD || root.at_m[2] < FALLEN_HEIGHT * height_m);
        if self.steps == 0 {
            self.work_before_j = world.work_j();
        }
        self.steps += 1;
        self.tilt2 += lean_rad * lean_rad;
        let slip_m_s = world.slip_m_s();
        if slip_m_s > CREEP_M_S {
            self.slip_m += slip_m_s * world.dt_s();
        }
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
