//! A robot's body in a world with a floor: rigid bodies in reduced coordinates.
//!
//! The mass matrix comes from composite rigid bodies, the bias forces from
//! recursive Newton-Euler (Featherstone, Rigid Body Dynamics Algorithms, 2008), in
//! world axes about the root link's origin. Semi-implicit Euler steps; the damping
//! of servos is taken implicitly. The law of the floor is in `contact.rs`.
//!
//! Bits are the same on every processor: plain f64, no fused operations, functions
//! of `libm`, fixed orders. Metres, seconds, radians, kilograms, newtons; the world
//! has its floor at z = 0, z up.

mod contact;
mod figures;
mod gear_play;
mod hand;
mod imu;
mod mass_matrix;
mod seat;
mod shaft;
mod shared;
mod spatial;
mod state;
mod step_size;
mod tree;

use servodance_types::{ImuState, Placement, RigidLink};

use crate::error::SimError;
use contact::{ContactSolver, FloorFrame, PointMotion, Touch};
use gear_play::{GearPlay, ShaftPush};
use imu::Imu;
use mass_matrix::MassMatrix;
use spatial::{Vec3, Wrench};
use state::{Posed, WorldState};
use tree::{ROOT_DOFS, Tree};

pub use figures::BodyFigures;
pub use imu::ImuErrors;
pub use seat::WorldSeat;
pub(crate) use shaft::{ShaftDrive, ShaftState};
pub use shared::SharedWorld;
pub(crate) use step_size::StepSize;

pub(crate) const GRAVITY_M_S2: f64 = 9.81;
/// Longest step, seconds.
pub const LONGEST_STEP_S: f64 = 2e-3;
/// A robot has fallen when its root link leans by more than this, or its centre of mass is
/// below this share of its height at the start (a root link's origin may be on the floor).
const FALLEN_RAD: f64 = 50.0 * std::f64::consts::PI / 180.0;
const FALLEN_HEIGHT: f64 = 0.5;
/// Slip slower than this is the creep of a soft contact, m/s.
const CREEP_M_S: f64 = 2e-3;
/// Speed below which dry friction fades to a viscous one, radians a second.
const FRICTION_SPEED: f64 = 0.02;
/// Natural frequency of the spring that couples a joint to the one it follows, 1/s.
const COUPLING_PER_S: f64 = 200.0;
/// The least inertia of a degree of freedom, kg m2: links without mass do not fly off.
const LEAST_INERTIA: f64 = 1e-6;

/// What holds the root link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RootSupport {
    /// Nothing: the robot stands or falls.
    #[default]
    Free,
    /// A stand: the root link stays where it is.
    Held,
}

/// The world around a robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorldOptions {
    /// What holds the robot.
    pub support: RootSupport,
    /// Coefficient of friction of soles on the floor.
    pub friction: f64,
    /// How far the floor leans about world x and y, radians.
    pub tilt_rad: [f64; 2],
    /// Time step, seconds, above 0 and at most 5 ms.
    pub dt_s: f64,
    /// Errors of the sensor on the root link.
    pub imu: ImuErrors,
}

impl Default for WorldOptions {
    fn default() -> Self {
        Self {
            support: RootSupport::Free,
            friction: 0.8,
            tilt_rad: [0.0; 2],
            dt_s: LONGEST_STEP_S,
            imu: ImuErrors::default(),
        }
    }
}

/// What a servo adds to its joint besides torque.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointMechanics {
    /// Inertia of the rotor behind the gear, kg m2.
    pub armature_kg_m2: f64,
    /// Dry friction, newton metres.
    pub friction_nm: f64,
    /// Play of the gear, radians.
    pub play_rad: f64,
}

/// What a servo does in one step: `torque - damping * velocity`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointDrive {
    /// Torque towards higher positions, newton metres (newtons where it slides).
    pub torque_nm: f64,
    /// Newton metres for one radian a second.
    pub damping_nm_s: f64,
}

/// A force from outside on the root link's origin, world axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Push {
    /// Newtons along world axes.
    pub force_n: [f64; 3],
    /// When it ends, seconds of the world's time.
    pub until_s: f64,
}

/// Load of the feet, summed until somebody asks.
#[derive(Clone, Debug, Default)]
struct MeanLoad(std::cell::Cell<([f64; 2], u32)>);

impl MeanLoad {
    fn add(&self, load_n: [f64; 2]) {
        let ([left, right], count) = self.0.get();
        self.0.set(([left + load_n[0], right + load_n[1]], count + 1));
    }

    fn take(&self) -> [f64; 2] {
        let (sum, count) = self.0.take();
        sum.map(|load_n| load_n / f64::from(count.max(1)))
    }
}

/// One robot in a world.
#[derive(Clone, Debug)]
pub struct World {
    tree: Tree,
    options: WorldOptions,
    floor: FloorFrame,
    mechanics: Vec<JointMechanics>,
    play: Vec<GearPlay>,
    shaft_push: Vec<ShaftPush>,
    /// The body whose joint each of the robot's joints is.
    bodies: Vec<usize>,
    state: WorldState,
    posed: Posed,
    mass: MassMatrix,
    contact: ContactSolver,
    mobility: Vec<f64>,
    imu: Imu,
    push: Option<Push>,
    start: Vec3,
    start_height_m: f64,
    load_n: MeanLoad,
    steps: u64,
    work_j: f64,
}

impl World {
    /// A robot of `links` whose driven joints have these mechanics, at rest with all
    /// joints at zero. Fails, by link, where a figure cannot be simulated.
    pub fn new(
        links: &[RigidLink],
        mechanics: &[JointMechanics],
        options: WorldOptions,
    ) -> Result<Self, SimError> {
        let tree = Tree::new(links)?;
        SimError::checked("world step", options.dt_s, 1e-5..=5e-3, "10 us to 5 ms")?;
        SimError::checked("floor friction", options.friction, 0.0..=10.0, "0 to 10")?;
        for tilt in options.tilt_rad {
            SimError::checked("floor tilt", tilt, -0.5..=0.5, "-0.5 to 0.5 rad")?;
        }
        let joints = mechanics.len();
        if let Some(beyond) = tree.bodies[1..].iter().find(|body| body.drive.joint >= joints) {
            let joint = beyond.drive.joint;
            return Err(SimError::World(format!("a link has joint {joint} of {joints}")));
        }
        let mut bodies = vec![0; mechanics.len()];
        for (index, body) in tree.bodies.iter().enumerate().skip(1).rev() {
            if body.drive.scale == 1.0 && body.drive.offset == 0.0 {
                bodies[body.drive.joint] = index;
            }
        }
        let mut mass = MassMatrix::new(tree.dof_parents());
        mass.first = match options.support {
            RootSupport::Free => 0,
            RootSupport::Held => ROOT_DOFS,
        };
        let mut world = Self {
            floor: FloorFrame::tilted(options.tilt_rad[0], options.tilt_rad[1]),
            play: mechanics.iter().map(|joint| GearPlay::new(joint.play_rad)).collect(),
            shaft_push: vec![ShaftPush::default(); mechanics.len()],
            mechanics: mechanics.to_vec(),
            bodies,
            state: WorldState::new(tree.bodies.len()),
            posed: Posed::new(tree.bodies.len()),
            mass,
            contact: ContactSolver::new(tree.points.len()),
            mobility: vec![0.0; tree.points.len()],
            imu: Imu::new(options.imu, options.dt_s),
            push: None,
            start: Vec3::zeros(),
            start_height_m: 0.0,
            load_n: MeanLoad::default(),
            steps: 0,
            work_j: 0.0,
            tree,
            options,
        };
        world.place(None, &vec![0.0; mechanics.len()]);
        Ok(world)
    }

    /// Puts the robot, at rest, with its joints at `positions`: its root link at `root`,
    /// or upright with its lowest point on the floor below the origin.
    pub fn place(&mut self, root: Option<&Placement>, positions: &[f64]) {
        self.state.rest();
        for (index, body) in self.tree.bodies.iter().enumerate().skip(1) {
            let position = positions.get(body.drive.joint).copied().unwrap_or(0.0);
            self.state.angle[index] = body.drive.scale * position + body.drive.offset;
        }
        if let Some(root) = root {
            self.state.root_at = Vec3::from(root.at_m);
            self.state.root = spatial::Mat3::from_fn(|row, column| root.rotation[row][column]);
        }
        self.posed.pose(&self.tree, &self.state);
        if root.is_none() || self.options.tilt_rad != [0.0; 2] {
            let lowest = (0..self.tree.points.len())
                .map(|point| -self.depth_m(point))
                .fold(f64::INFINITY, f64::min);
            if lowest.is_finite() {
                self.state.root_at.z -= lowest / self.floor.normal.z;
            }
            self.posed.pose(&self.tree, &self.state);
        }
        self.start = self.state.root_at;
        self.start_height_m = self.centre_of_mass()[2];
        self.contact.forces.fill(Vec3::zeros());
        self.play.iter_mut().for_each(GearPlay::rest);
        self.factorise(&vec![JointDrive::default(); self.mechanics.len()]);
        self.measure_mobility();
    }

    /// Puts one joint, at rest, where a hand turns it; the rest of the robot stays.
    pub fn put_joint(&mut self, joint: usize, position: f64) {
        let body = self.bodies[joint];
        self.state.angle[body] = position;
        self.state.rate[body] = 0.0;
        self.posed.pose(&self.tree, &self.state);
    }

    /// Simulated seconds since the start.
    pub fn time_s(&self) -> f64 {
        self.steps as f64 * self.options.dt_s
    }

    /// Length of a step, seconds.
    pub fn dt_s(&self) -> f64 {
        self.options.dt_s
    }

    /// Mass of the robot, kilograms.
    pub fn mass_kg(&self) -> f64 {
        self.tree.mass
    }

    /// Position and velocity of a joint: radians and radians a second.
    pub fn joint(&self, joint: usize) -> (f64, f64) {
        let body = self.bodies[joint];
        (self.state.angle[body], self.state.rate[body])
    }

    /// Where the root link is in the world.
    pub fn root(&self) -> Placement {
        let root = &self.state.root;
        let rotation = [0, 1, 2].map(|row| [0, 1, 2].map(|column| root[(row, column)]));
        Placement { rotation, at_m: self.state.root_at.into() }
    }

    /// Velocity of the root link's origin, m/s, world axes.
    pub fn root_velocity(&self) -> [f64; 3] {
        self.state.twist.linear.into()
    }

    /// Centre of mass of the whole robot, world, metres.
    pub fn centre_of_mass(&self) -> [f64; 3] {
        let sum: Vec3 = self.posed.inertia.iter().map(|inertia| inertia.first).sum();
        (self.state.root_at + sum / self.tree.mass).into()
    }

    /// The floor's push along its normal on the soles, left and right, newtons.
    pub fn foot_force_n(&self) -> [f64; 2] {
        [0, 1].map(|foot| {
            let points = self.tree.points.iter().zip(&self.contact.forces);
            points.filter(|(point, _)| point.foot == Some(foot)).map(|(_, force)| force.x).sum()
        })
    }

    /// The same, averaged since it was asked for last.
    pub fn mean_foot_force_n(&self) -> [f64; 2] {
        self.load_n.take()
    }

    /// Where the root link was placed, metres.
    pub fn start_m(&self) -> [f64; 3] {
        self.start.into()
    }

    /// Whether the root link leans by more than 50 degrees, or the centre of mass is below
    /// half the height at which it was placed.
    pub fn has_fallen(&self) -> bool {
        let lean_rad = libm::acos(self.state.root[(2, 2)].clamp(-1.0, 1.0));
        lean_rad > FALLEN_RAD || self.centre_of_mass()[2] < FALLEN_HEIGHT * self.start_height_m
    }

    /// How fast the loaded points of the soles slide, m/s: the fastest; 0 where they
    /// only creep.
    pub fn slip_m_s(&self) -> f64 {
        let touches = self.contact.touches.iter();
        let loaded = touches.filter(|touch| {
            let is_sole = self.tree.points[touch.point].foot.is_some();
            is_sole && self.contact.forces[touch.point].x > 0.02 * self.weight_n()
        });
        let across = loaded.map(|touch| {
            let [_, x, y] = self.floor.axes().map(|axis| axis.dot(&touch.velocity));
            libm::sqrt(x * x + y * y)
        });
        let fastest = across.fold(0.0, f64::max);
        if fastest > CREEP_M_S { fastest } else { 0.0 }
    }

    /// Whether anything but the soles touches the floor.
    pub fn lies(&self) -> bool {
        let touches = self.contact.touches.iter();
        touches.clone().any(|touch| self.tree.points[touch.point].foot.is_none())
    }

    /// Mechanical work of the servos so far, joules; what they brake does not count.
    pub fn work_j(&self) -> f64 {
        self.work_j
    }

    /// What the sensor on the root link reads; `None` before the first step.
    pub fn imu(&self) -> Option<ImuState> {
        self.imu.reading()
    }

    /// Begins a push; one that has begun ends.
    pub fn push(&mut self, push: Push) {
        self.push = Some(push);
    }

    /// A hand takes the root link, as it leans, and moves it up at this speed (down if
    /// negative), m/s; with `None` it lets go.
    pub fn carry(&mut self, up_m_s: Option<f64>) {
        let held = up_m_s.is_some() || self.options.support == RootSupport::Held;
        self.mass.first = if held { ROOT_DOFS } else { 0 };
        if let Some(up_m_s) = up_m_s {
            let linear = Vec3::z() * up_m_s;
            self.state.twist = spatial::Twist { angular: Vec3::zeros(), linear };
            self.posed.pose(&self.tree, &self.state);
        }
    }

    pub(crate) fn weight_n(&self) -> f64 {
        self.tree.mass * GRAVITY_M_S2
    }

    /// How deep a point is in the floor, metres; negative above.
    fn depth_m(&self, point: usize) -> f64 {
        let radius = self.tree.points[point].radius;
        let at = self.state.root_at + self.posed.point(&self.tree, point);
        radius - self.floor.normal.dot(&at)
    }

    /// One step with what the servos do in it, by joint.
    pub fn step(&mut self, drives: &[JointDrive]) {
        let dt_s = self.options.dt_s;
        let wrench = self.push_wrench();
        let mut force = self.posed.bias(&self.tree, wrench);
        for value in &mut force {
            *value = -*value;
        }
        self.factorise(drives);
        self.add_drives(drives, &mut force);
        self.mass.solve(&mut force);
        let mut acceleration = force;
        self.find_touches();
        self.contact.solve(
            &self.floor,
            self.options.friction,
            &self.mass,
            &self.posed,
            &mut acceleration,
            self.tree.mass * GRAVITY_M_S2,
        );
        self.load_n.add(self.foot_force_n());
        self.move_gears(&acceleration);
        let before = self.state.twist;
        self.state.advance(&acceleration, dt_s, &self.tree);
        self.posed.pose(&self.tree, &self.state);
        self.steps += 1;
        let change = (self.state.twist.linear - before.linear) / dt_s;
        self.imu.observe(&self.state.root, &self.state.twist.angular, &change);
    }

    fn push_wrench(&mut self) -> Wrench {
        let now_s = self.time_s();
        self.push = self.push.filter(|push| now_s < push.until_s - 1e-9);
        let force = self.push.map_or(Vec3::zeros(), |push| Vec3::from(push.force_n));
        Wrench::of_force(force, Vec3::zeros())
    }

    /// Mass matrix with rotors and implicit damping, factorised.
    fn factorise(&mut self, drives: &[JointDrive]) {
        let dt_s = self.options.dt_s;
        self.posed.mass_matrix(&self.tree, &mut self.mass);
        self.push_shafts(drives);
        for body in 1..self.tree.bodies.len() {
            let joint = self.tree.bodies[body].drive.joint;
            let dof = Tree::dof(body);
            let added = match self.bodies[joint] == body {
                true => self.joint_inertia(joint, &drives[joint], self.state.rate[body]),
                // Taken implicitly: damping at twice the frequency, and the spring.
                false => {
                    let inertia = self.mass.diagonal(dof) + LEAST_INERTIA;
                    inertia * COUPLING_PER_S * dt_s * (2.0 + COUPLING_PER_S * dt_s)
                }
            };
            self.mass.add_diagonal(dof, LEAST_INERTIA + added);
        }
        self.mass.factorise();
    }

    /// What a servo adds to its joint's inertia, damping taken implicitly.
    fn joint_inertia(&self, joint: usize, drive: &JointDrive, rate: f64) -> f64 {
        let (mechanics, dt_s) = (&self.mechanics[joint], self.options.dt_s);
        match self.play[joint].is_there() {
            true => dt_s * self.shaft_push[joint].damping_nm_s,
            false => {
                mechanics.armature_kg_m2
                    + dt_s * (drive.damping_nm_s + friction_nm_s(mechanics, rate))
            }
        }
    }

    fn add_drives(&mut self, drives: &[JointDrive], force: &mut [f64]) {
        for (body, mounted) in self.tree.bodies.iter().enumerate().skip(1) {
            let (joint, dof) = (mounted.drive.joint, Tree::dof(body));
            let rate = self.state.rate[body];
            if self.bodies[joint] != body {
                let leader = self.bodies[joint];
                let wanted = mounted.drive.scale * self.state.angle[leader] + mounted.drive.offset;
                let wanted_rate = mounted.drive.scale * self.state.rate[leader];
                let inertia = self.posed.subtree_inertia(body) + LEAST_INERTIA;
                let away = wanted - self.state.angle[body];
                let slower = wanted_rate - rate;
                force[dof] += inertia
                    * COUPLING_PER_S
                    * (COUPLING_PER_S * (away - self.options.dt_s * rate) + 2.0 * slower);
                continue;
            }
            let JointDrive { torque_nm, damping_nm_s } = drives[joint];
            let drive_nm = torque_nm - damping_nm_s * rate;
            self.work_j += (drive_nm * rate).max(0.0) * self.options.dt_s;
            force[dof] += match self.play[joint].is_there() {
                true => {
                    let push = self.shaft_push[joint];
                    push.torque_nm - push.damping_nm_s * rate
                }
                false => drive_nm - friction_nm_s(&self.mechanics[joint], rate) * rate,
            };
        }
    }

    /// What the gears with play do to their shafts in this step.
    fn push_shafts(&mut self, drives: &[JointDrive]) {
        for (joint, play) in self.play.iter_mut().enumerate() {
            let body = self.bodies[joint];
            if !play.is_there() || body == 0 {
                continue;
            }
            let (mechanics, rate) = (&self.mechanics[joint], self.state.rate[body]);
            let drive = gear_play::GearDrive {
                torque_nm: drives[joint].torque_nm,
                damping_nm_s: drives[joint].damping_nm_s + friction_nm_s(mechanics, rate),
                armature_kg_m2: mechanics.armature_kg_m2,
            };
            self.shaft_push[joint] = play.push(&drive, rate, self.options.dt_s);
        }
    }

    fn move_gears(&mut self, acceleration: &[f64]) {
        let dt_s = self.options.dt_s;
        for (joint, play) in self.play.iter_mut().enumerate() {
            let body = self.bodies[joint];
            if body > 0 && play.is_there() {
                play.advance(self.state.rate[body] + dt_s * acceleration[Tree::dof(body)], dt_s);
            }
        }
    }

    fn find_touches(&mut self) {
        self.contact.touches.clear();
        for index in 0..self.tree.points.len() {
            let depth_m = self.depth_m(index);
            if depth_m < 0.0 {
                self.contact.forces[index] = Vec3::zeros();
                continue;
            }
            let point = self.tree.points[index];
            let at = self.posed.point(&self.tree, index) - self.floor.normal * point.radius;
            let dof = match point.body {
                0 => ROOT_DOFS - 1,
                body => Tree::dof(body),
            };
            self.contact.touches.push(Touch {
                point: index,
                dof,
                at,
                depth_m,
                velocity: self.posed.velocity[point.body].at(at),
                mobility: self.mobility[index],
            });
        }
    }

    /// Mean mobility of each point's body in the present pose, 1/kg: by how much its
    /// origin gives way to a force.
    fn measure_mobility(&mut self) {
        let dofs = self.tree.dofs();
        let mut of_body = vec![None; self.tree.bodies.len()];
        for index in 0..self.tree.points.len() {
            let body = self.tree.points[index].body;
            let known = of_body[body].unwrap_or_else(|| {
                let at = self.posed.com(&self.tree, body);
                let dof = if body == 0 { ROOT_DOFS - 1 } else { Tree::dof(body) };
                let sum: f64 = [Vec3::x(), Vec3::y(), Vec3::z()]
                    .iter()
                    .map(|axis| {
                        let mut row = vec![0.0; dofs];
                        for above in self.mass.path(dof) {
                            row[above] = self.posed.along(above, axis, &at);
                        }
                        let mut moved = row.clone();
                        self.mass.solve(&mut moved);
                        row.iter().zip(&moved).map(|(row, moved)| row * moved).sum::<f64>()
                    })
                    .sum();
                sum / 3.0
            });
            of_body[body] = Some(known);
            self.mobility[index] = known.max(1e-9);
        }
    }
}

/// Dry friction as a damping that grows as the joint slows down, N m for 1 rad/s.
fn friction_nm_s(mechanics: &JointMechanics, rate: f64) -> f64 {
    mechanics.friction_nm / rate.abs().max(FRICTION_SPEED)
}
