//! A world that the servos of one robot move together, on however many buses.
//!
//! Time is counted in steps of at most 2 ms, each a whole number of steps of a bus,
//! of which a whole number makes a control period. Whichever bus is the first to
//! reach the end of a step moves the world on, with what the servos of the others
//! did last.
//!
//! Until every servo has had torque at once, a hand holds the robot where it was
//! put: that time passes without motion.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use servodance_types::{ImuState, Placement, RigidLink};

use super::figures::{BodyFigures, BodySums};
use super::hand::Hand;
use super::shaft::{ShaftDrive, ShaftState};
use super::{
    GRAVITY_M_S2, JointDrive, JointMechanics, Push, RootSupport, StepSize, World, WorldOptions,
};
use crate::error::SimError;

/// How long the force of a push acts, seconds.
const PUSH_S: f64 = 0.05;

/// A handle on a world; clones are handles on the same one.
#[derive(Clone, Debug)]
pub struct SharedWorld(Arc<Mutex<Inhabited>>);

#[derive(Debug)]
struct Inhabited {
    world: World,
    support: RootSupport,
    /// Where the robot was put.
    start: (Option<Placement>, Vec<f64>),
    drives: Vec<JointDrive>,
    has_torque: Vec<bool>,
    /// A hand holds the robot.
    is_held: bool,
    /// A hand that picked it up later.
    hand: Option<Hand>,
    steps: u64,
    pushed_until: u64,
    sums: BodySums,
}

impl SharedWorld {
    /// A robot of `links` whose servos have these mechanics, in steps that fit the
    /// control rate in place of those of `options`. It is put at `root` (or upright on
    /// the floor) with its joints at `positions`.
    pub fn new(
        links: &[RigidLink],
        mechanics: &[JointMechanics],
        options: WorldOptions,
        control_hz: f64,
        (root, positions): (Option<&Placement>, &[f64]),
    ) -> Result<Self, SimError> {
        let hz = SimError::checked("control_hz", control_hz, 1.0..=10_000.0, "1 to 10000")?;
        let options = WorldOptions { dt_s: StepSize::of(1.0 / hz).world_s(), ..options };
        let mut world = World::new(links, mechanics, options)?;
        world.place(root, positions);
        Ok(Self(Arc::new(Mutex::new(Inhabited {
            world,
            support: options.support,
            start: (root.copied(), positions.to_vec()),
            drives: vec![JointDrive::default(); mechanics.len()],
            has_torque: vec![false; mechanics.len()],
            is_held: true,
            hand: None,
            steps: 0,
            pushed_until: 0,
            sums: BodySums::default(),
        }))))
    }

    fn inhabited(&self) -> MutexGuard<'_, Inhabited> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// One step, seconds.
    pub fn step_s(&self) -> f64 {
        self.inhabited().world.dt_s()
    }

    /// Where the root link is in the world.
    pub fn root(&self) -> Placement {
        self.inhabited().world.root()
    }

    /// What the motion sensor on the root link reads.
    pub fn imu(&self) -> ImuState {
        let inhabited = self.inhabited();
        inhabited.world.imu().unwrap_or_else(|| at_rest(&inhabited.world.root()))
    }

    /// What the body did since it was let go.
    pub fn figures(&self) -> BodyFigures {
        let inhabited = self.inhabited();
        inhabited.sums.figures(inhabited.world.dt_s())
    }

    /// Whether the robot has fallen.
    pub fn fell(&self) -> bool {
        self.inhabited().sums.fell
    }

    /// Pushes the root link for 50 ms: newton seconds towards x and y of the world.
    pub fn push(&self, impulse_ns: [f64; 2]) {
        let mut inhabited = self.inhabited();
        let force_n = impulse_ns.map(|impulse| impulse / PUSH_S);
        let until_s = inhabited.world.time_s() + PUSH_S;
        inhabited.world.push(Push { force_n: [force_n[0], force_n[1], 0.0], until_s });
        let steps = (PUSH_S / inhabited.world.dt_s()).ceil() as u64;
        inhabited.pushed_until = inhabited.steps + steps;
    }

    /// A hand puts the robot back where it was at the start and holds it until every
    /// servo has torque; what it has done so far is forgotten.
    pub fn lift(&self) {
        let mut inhabited = self.inhabited();
        let (root, positions) = inhabited.start.clone();
        inhabited.world.place(root.as_ref(), &positions);
        inhabited.sums = BodySums::default();
        inhabited.is_held = true;
        inhabited.hand = None;
        inhabited.world.carry(None);
    }

    /// A hand picks the robot up by its root link: so many metres above where it is now.
    pub fn pick_up(&self, height_m: f64) {
        let mut inhabited = self.inhabited();
        inhabited.hand = Some(Hand::raising(&inhabited.world, height_m));
    }

    /// The hand lowers the robot and lets go once the feet carry half of it.
    pub fn set_down(&self) {
        let mut inhabited = self.inhabited();
        inhabited.hand = inhabited.hand.map(|_| Hand::Lowering);
    }

    /// The shafts of these joints after so many steps.
    pub(crate) fn reach(&self, step: u64, joints: &[usize], shafts: &mut [ShaftState]) {
        let mut inhabited = self.inhabited();
        while inhabited.steps < step {
            inhabited.step();
        }
        let is_pushed = inhabited.sums.fell
            || inhabited.hand.is_some()
            || inhabited.steps < inhabited.pushed_until;
        for (&joint, shaft) in joints.iter().zip(shafts) {
            let (position_rad, velocity_rad_s) = inhabited.world.joint(joint);
            *shaft = ShaftState { position_rad, velocity_rad_s, is_pushed };
        }
    }

    /// What the servos of these joints do from now on.
    pub(crate) fn tell(&self, joints: &[usize], drives: &[ShaftDrive]) {
        let mut inhabited = self.inhabited();
        for (&joint, told) in joints.iter().zip(drives) {
            inhabited.has_torque[joint] = told.drive.is_some();
            inhabited.drives[joint] = told.drive.unwrap_or_default();
            if let Some(position) = told.put_at_rad {
                inhabited.world.put_joint(joint, position);
            }
        }
    }
}

impl PartialEq for SharedWorld {
    /// Handles on the same world.
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Inhabited {
    fn step(&mut self) {
        self.steps += 1;
        self.is_held &= !self.has_torque.iter().all(|has| *has);
        if self.is_held {
            return;
        }
        self.world.step(&self.drives);
        match self.hand {
            None => self.sums.step(&self.world, self.support == RootSupport::Free),
            Some(hand) => {
                self.hand = hand.after_step(&self.world);
                self.world.carry(self.hand.map(Hand::speed_m_s));
            }
        }
    }
}

/// What a sensor reads on a root link that does not move.
fn at_rest(root: &Placement) -> ImuState {
    let up = root.rotation[2];
    ImuState { rate_rad_s: [0.0; 3], force_m_s2: up.map(|part| part * GRAVITY_M_S2), up }
}
