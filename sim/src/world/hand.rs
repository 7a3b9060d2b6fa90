//! A hand that picks a robot up by its root link and sets it down again.

use super::World;

/// How fast it moves, m/s.
const RAISED_M_S: f64 = 0.2;
const LOWERED_M_S: f64 = 0.05;
/// It lets go once the feet carry this share of the weight.
const LET_GO_SHARE: f64 = 0.5;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Hand {
    /// Up to this height of the root link, metres.
    Raising(f64),
    Waiting,
    Lowering,
}

impl Hand {
    pub fn raising(world: &World, height_m: f64) -> Self {
        Self::Raising(world.root().at_m[2] + height_m)
    }

    /// What the hand does next; `None` once it has let go.
    pub fn after_step(self, world: &World) -> Option<Self> {
        let carried_n: f64 = world.foot_force_n().iter().sum();
        match self {
            Self::Raising(to_m) if world.root().at_m[2] >= to_m => Some(Self::Waiting),
            Self::Lowering if carried_n >= LET_GO_SHARE * world.weight_n() => None,
            hand => Some(hand),
        }
    }

    pub fn speed_m_s(self) -> f64 {
        match self {
            Self::Waiting => 0.0,
            Self::Raising(_) => RAISED_M_S,
            Self::Lowering => -LOWERED_M_S,
        }
    }
}
