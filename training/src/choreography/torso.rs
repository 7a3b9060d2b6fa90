//! Torso and head figures: bends, twists and circles on every count.

use super::body::Torso;

/// The torso figures. Numbers in brackets: counts until they repeat.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Trunk {
    Groove,    // a small forward groove (2)
    Sway,      // ribs to the side, hips against them (2)
    Twist,     // shoulders turn against the hips (2)
    ChestPop,  // chest out, chest in (2)
    BodyRoll,  // a roll from the hips up to the chest (2)
    HipCircle, // hips around (4)
    HipSide,   // hips from side to side, the salsa way (2)
    Lean,      // a long lean, held, and the other side (4)
    Robot,     // stiff: turn, straighten, turn, straighten (4)
    Shoulders, // shoulders up in turn (2)
    DownUp,    // bent far down, up tall (4)
}

impl Trunk {
    /// The torso on `count`, figures `size` large (1 is usual).
    pub(crate) fn torso(self, count: usize, size: f64) -> Torso {
        let sign = if count.is_multiple_of(2) { 1.0 } else { -1.0 };
        let even = sign > 0.0;
        let quarter = count % 4;
        let mut t = Torso { spine: [0.06, 0.0, 0.0], ..Torso::default() };
        let s = size;
        match self {
            Self::Groove => {
                t.spine = [if even { 0.20 * s } else { 0.02 }, 0.05 * s * sign, 0.10 * s * sign];
                t.pelvis = [if even { -0.10 * s } else { 0.04 }, 0.0, 0.0];
                t.head[0] = if even { 0.12 * s } else { -0.05 };
            }
            Self::Sway => {
                t.spine[1] = -0.22 * s * sign;
                t.pelvis[1] = 0.13 * s * sign;
                t.hips[0] = -0.03 * s * sign;
                t.head[1] = 0.12 * s * sign;
            }
            Self::Twist => {
                t.spine[2] = 0.45 * s * sign;
                t.pelvis[2] = -0.18 * s * sign;
                t.head[2] = -0.25 * s * sign;
            }
            Self::ChestPop => {
                t.spine[0] = if even { -0.20 * s } else { 0.20 * s };
                t.shrug = [if even { -0.05 } else { 0.12 * s }; 2];
                t.head[0] = if even { 0.10 * s } else { -0.10 * s };
            }
            Self::BodyRoll => {
                t.spine[0] = if even { 0.38 * s } else { -0.20 * s };
                t.pelvis[0] = if even { -0.22 * s } else { 0.18 * s };
                t.hips[1] = if even { 0.05 * s } else { -0.05 * s };
                t.head[0] = if even { -0.15 * s } else { 0.12 * s };
            }
            Self::HipCircle => {
                let (sin, cos) = (quarter as f64 * std::f64::consts::FRAC_PI_2).sin_cos();
                t.hips = [-0.08 * s * cos, 0.06 * s * sin];
                t.pelvis = [-0.10 * s * sin, 0.12 * s * cos, 0.0];
                t.spine[1] = -0.12 * s * cos;
                t.spine[0] += 0.08 * s * sin;
            }
            Self::HipSide => {
                t.hips[0] = -0.045 * s * sign;
                t.pelvis = [0.0, 0.16 * s * sign, 0.12 * s * sign];
                t.spine[1] = -0.20 * s * sign;
                t.spine[2] = -0.16 * s * sign;
            }
            Self::Lean => {
                let side = if quarter < 2 { 1.0 } else { -1.0 };
                let depth = if even { 0.30 } else { 0.20 };
                t.spine[1] = -depth * s * side;
                t.spine[2] = 0.15 * s * side;
                t.head[1] = 0.15 * s * side;
                t.head[2] = -0.2 * s * side;
            }
            Self::Robot => {
                let twist = [0.5, 0.0, -0.5, 0.0][quarter];
                t.spine = [if even { 0.02 } else { 0.12 * s }, 0.0, twist * s];
                t.head = [0.0, 0.0, [0.3, -0.5, -0.3, 0.5][quarter] * s];
            }
            Self::Shoulders => {
                t.shrug = if even { [0.35 * s, -0.1] } else { [-0.1, 0.35 * s] };
                t.spine[1] = 0.10 * s * sign;
                t.head[1] = -0.10 * s * sign;
            }
            Self::DownUp => {
                t.spine[0] = [0.55, 0.30, -0.05, -0.12][quarter] * s;
                t.pelvis[0] = [0.25, 0.12, 0.0, 0.0][quarter] * s;
                t.hips[1] = [-0.07, -0.03, 0.0, 0.0][quarter] * s;
                t.head[0] = [-0.2, 0.0, -0.1, 0.1][quarter] * s;
            }
        }
        t
    }
}

pub(crate) fn mirrored(mut torso: Torso) -> Torso {
    for angles in [&mut torso.pelvis, &mut torso.spine, &mut torso.head] {
        angles[1] = -angles[1];
        angles[2] = -angles[2];
    }
    torso.hips[0] = -torso.hips[0];
    torso.shrug.swap(0, 1);
    torso
}
