//! How much of the dance the feet can carry: keeps the planned zero-moment point
//! (Vukobratovic) inside the soles.
//!
//! The plan is looked at where the preview ends, so that the pelvis gives way before
//! the moment comes. Links are point masses. The point is linear enough in the
//! pelvis's movement: that is scaled first, and for steps the upper body when its own
//! movement already leaves the sole. Down at once, up slowly, as a compressor does.
//!
//! On feet that stay the upper body gives way for seconds, not for a beat: `arm_share`.

use k::nalgebra::{Isometry3, Point3, Vector3};

use super::arm_share::ArmShare;
use super::counterweight::Counterweight;
use crate::contact::SupportPolygon;
use crate::dynamics::GRAVITY_M_S2;
use crate::kinematics::RobotModel;

const ATTACK_S: f64 = 0.01;
/// Share of the pelvis's shift that a leg's mass takes part in.
pub(super) const LEG_SHARE: f64 = 0.5;

/// How a plan is judged.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GovernorSettings {
    /// Time over which accelerations are measured, seconds.
    measured_s: f64,
    /// Share of the way from the middle to the sole's edge that is used: the servos' give
    /// and their lag take the rest.
    used: f64,
    /// Short enough that a robot which joins a dance late soon moves like the others.
    release_s: f64,
}

/// Which of the two plans is looked at.
#[derive(Clone, Copy)]
enum Plan {
    PelvisAtRest,
    All,
}

impl GovernorSettings {
    /// Feet that stay, with accelerations that they carry (`carried_acceleration`).
    pub const PLANTED: Self = Self { measured_s: 0.06, used: 0.5, release_s: 0.8 };
    /// Feet that step: each peak counts on one sole.
    pub const STEPPING: Self = Self { measured_s: 0.04, used: 0.5, release_s: 1.0 };
}

pub(crate) struct GovernorInput<'a> {
    pub model: &'a RobotModel,
    /// Joint positions of the upper body where the preview ends; of the legs now.
    pub positions: &'a [f64],
    /// The root link's pose for all of the dance, and at rest.
    pub root: Isometry3<f64>,
    pub rest: Isometry3<f64>,
    pub support: &'a SupportPolygon,
}

pub(crate) struct ZmpGovernor {
    settings: GovernorSettings,
    dt_s: f64,
    is_leg: Vec<bool>,
    in_root: Vec<Isometry3<f64>>,
    /// Centres of mass in the last cycles: with the pelvis at rest, and moving.
    past: Vec<[Vec<Vector3<f64>>; 2]>,
    next: usize,
    seen: usize,
    /// Cycles between the centres of mass by which accelerations are measured.
    step: usize,
    /// Feet that stay: how the upper body gives way.
    arms: Option<ArmShare>,
    /// Share of the pelvis's and of the upper body's movement.
    pub pelvis: f64,
    upper: f64,
    pub lowest: f64,
    counterweight: Counterweight,
}

impl ZmpGovernor {
    /// `is_leg` by link: those that stand. `arms`: for feet that stay.
    pub fn new(
        is_leg: Vec<bool>,
        settings: GovernorSettings,
        arms: Option<ArmShare>,
        dt_s: f64,
    ) -> Self {
        let links = is_leg.len();
        let step = ((settings.measured_s / dt_s).round() as usize).max(1);
        let kept = arms.as_ref().map_or(step, |arms| arms.step.max(step));
        let still = || vec![Vector3::zeros(); links];
        Self {
            settings,
            dt_s,
            in_root: vec![Isometry3::identity(); links],
            is_leg,
            past: (0..2 * kept + 1).map(|_| [still(), still()]).collect(),
            next: 0,
            seen: 0,
            step,
            arms,
            pelvis: 1.0,
            upper: 1.0,
            lowest: 1.0,
            counterweight: Counterweight::new(dt_s),
        }
    }

    pub fn restart(&mut self) {
        self.seen = 0;
        self.counterweight.restart();
        if let Some(arms) = &mut self.arms {
            arms.restart();
        }
    }

    /// Share of the movement of a joint of the upper body.
    pub fn upper(&self, joint: usize) -> f64 {
        self.arms.as_ref().map_or(self.upper, |arms| arms.of_joint(joint, self.upper))
    }

    /// How far the pelvis goes against the weight of the arms, metres.
    pub fn counterweight(&self) -> Vector3<f64> {
        self.counterweight.shift()
    }

    /// Takes in one cycle of the plan.
    pub fn observe(&mut self, input: &GovernorInput) {
        input.model.place(&Isometry3::identity(), input.positions, &mut self.in_root);
        let shift = input.root.translation.vector - input.rest.translation.vector;
        let counter = self.counterweight.shift();
        let (mut weight, mut moved_kg, mut mass_kg) = (Vector3::zeros(), 0.0, 0.0);
        let [resting, moving] = &mut self.past[self.next];
        for (index, link) in input.model.links.iter().enumerate() {
            let com = self.in_root[index] * link.com;
            let at_rest = (input.rest * com).coords;
            let (share, moved) = match self.is_leg[index] {
                true => (LEG_SHARE, shift * LEG_SHARE),
                false => (1.0, (input.root * com).coords - at_rest),
            };
            resting[index] = at_rest + counter * share;
            moving[index] = resting[index] + moved;
            weight += at_rest * link.mass_kg;
            mass_kg += link.mass_kg;
            moved_kg += share * link.mass_kg;
        }
        if self.arms.is_some() && moved_kg > 0.0 {
            let away = input.support.middle() * mass_kg - weight;
            self.counterweight.step(away / moved_kg);
        }
        self.next = (self.next + 1) % self.past.len();
        self.seen += 1;
        if self.seen >= self.past.len() {
            self.judge(input);
        }
    }

    fn judge(&mut self, input: &GovernorInput) {
        let [resting, moving] = [Plan::PelvisAtRest, Plan::All]
            .map(|plan| self.zero_moment_point(input.model, plan, self.step));
        let support = input.support;
        let inside = |from: &Vector3<f64>, to: &Vector3<f64>| {
            let edges = support.edges.iter();
            let shares = edges.map(|edge| {
                let middle = support.middle();
                let reach = self.settings.used * (edge.offset_m - edge.normal.dot(&middle));
                let room = reach - edge.normal.dot(&(from - middle));
                let way = edge.normal.dot(&(to - from));
                if way > 1e-9 { (room / way).clamp(0.0, 1.0) } else { 1.0 }
            });
            shares.fold(1.0, f64::min)
        };
        let pelvis = inside(&resting, &moving);
        self.pelvis = self.eased(self.pelvis, pelvis);
        let swing = self.arms.as_ref().map(|arms| self.swing(input.model, arms.step));
        self.upper = match self.arms.as_mut().zip(swing) {
            Some((arms, swing)) => arms.share(&swing, support),
            None => self.eased(self.upper, inside(&support.middle(), &resting)),
        };
        self.lowest = self.lowest.min(self.pelvis);
    }

    fn eased(&self, now: f64, wanted: f64) -> f64 {
        let time_s = if wanted < now { ATTACK_S } else { self.settings.release_s };
        now + (wanted - now) * self.dt_s / (time_s + self.dt_s)
    }

    /// The links' centres of mass so many cycles before the newest.
    fn centres(&self, plan: Plan, back: usize) -> &[Vector3<f64>] {
        let count = self.past.len();
        &self.past[(self.next + count - 1 - back) % count][plan as usize]
    }

    /// From the centre of mass to the zero-moment point, with the pelvis at rest.
    fn swing(&self, model: &RobotModel, step: usize) -> Vector3<f64> {
        let middle = self.centres(Plan::PelvisAtRest, step);
        let mut com = Vector3::zeros();
        let mut mass_kg = 0.0;
        for (link, at) in model.links.iter().zip(middle) {
            com += at * link.mass_kg;
            mass_kg += link.mass_kg;
        }
        self.zero_moment_point(model, Plan::PelvisAtRest, step) - com / mass_kg
    }

    /// From the newest centres of mass and those `step` and twice as many cycles before; all z
    /// are against the floor.
    fn zero_moment_point(&self, model: &RobotModel, plan: Plan, step: usize) -> Vector3<f64> {
        let apart_s = step as f64 * self.dt_s;
        let [newest, middle, oldest] = [0, step, 2 * step].map(|back| self.centres(plan, back));
        let (mut force, mut moment) = (Vector3::zeros(), Vector3::zeros());
        for (index, link) in model.links.iter().enumerate().filter(|(_, link)| link.mass_kg > 0.0) {
            let change = newest[index] - middle[index] * 2.0 + oldest[index];
            let pull = change / (apart_s * apart_s) + Vector3::z() * GRAVITY_M_S2;
            force += pull * link.mass_kg;
            moment += middle[index].cross(&(pull * link.mass_kg));
        }
        let lift = force.z.max(0.1 * GRAVITY_M_S2);
        Point3::new(-moment.y / lift, moment.x / lift, 0.0).coords
    }
}
