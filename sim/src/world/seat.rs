//! The place of one bus's servos in a world: what passes between their shafts and
//! the joints that they turn.

use super::shaft::{ShaftDrive, ShaftState};
use super::shared::SharedWorld;

/// The servos of one bus in a world.
#[derive(Clone, Debug)]
pub struct WorldSeat {
    world: SharedWorld,
    joints: Vec<usize>,
    shafts: Vec<ShaftState>,
    drives: Vec<ShaftDrive>,
}

impl WorldSeat {
    /// Servos, in the order of their bus, that turn these joints of `world`.
    pub fn new(world: SharedWorld, joints: Vec<usize>) -> Self {
        let servos = joints.len();
        Self {
            world,
            joints,
            shafts: vec![ShaftState::default(); servos],
            drives: vec![ShaftDrive::default(); servos],
        }
    }

    /// The world that they are in.
    pub fn world(&self) -> SharedWorld {
        self.world.clone()
    }

    /// The shafts when the world has made so many steps.
    pub(crate) fn reach(&mut self, step: u64) -> &[ShaftState] {
        self.world.reach(step, &self.joints, &mut self.shafts);
        &self.shafts
    }

    /// Takes in what the servos do; `fill` writes it, in the order of the bus.
    pub(crate) fn tell(&mut self, fill: impl FnOnce(&mut [ShaftDrive])) {
        fill(&mut self.drives);
        self.world.tell(&self.joints, &self.drives);
    }
}

impl PartialEq for WorldSeat {
    /// The same joints of the same world.
    fn eq(&self, other: &Self) -> bool {
        self.world == other.world && self.joints == other.joints
    }
}
