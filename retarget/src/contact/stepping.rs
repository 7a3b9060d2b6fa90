//! When the feet of a stepping robot leave the floor, and where they land.
//!
//! A foot follows the dancer's: it lifts when that lifts, stays up while that
//! is up, and lands where that lands against the pelvis, scaled to the robot's
//! legs, near its place at rest: the robot steps on the spot. Balance comes
//! before contact:
//!
//! ```text
//! both feet down -- dancer's foot will lift --> weight goes over the other foot
//!      ^                                          | rests there, body steady    | too late
//!      +-- both firm <-- landed <-- in the air <--+                             v
//!      +------------------------------------------------------------------ step refused
//! ```
//!
//! The dancer's feet are known ahead, so that the weight is on the other foot in
//! time. Metres, seconds; the world has its floor at z = 0.

use std::collections::VecDeque;

use crate::dancer::PoseTarget;
use crate::solver::Feet;
use k::nalgebra::Vector3;

/// Shortest and longest time in the air, seconds.
const SHORTEST_S: f64 = 0.4;
const LONGEST_S: f64 = 1.2;
/// A step that has not begun this long after the dancer's foot landed is refused.
const TOO_LATE_S: f64 = 0.15;
/// Height of a step, its mean speed upward in leg lengths a second, and its
/// longest reach, leg lengths: forward, outward, inward.
const LIFT: f64 = 0.09;
const LIFT_SPEED: f64 = 0.15;
const REACH: [f64; 3] = [0.12, 0.10, 0.0];
/// A foot this near to its place has landed, metres.
const LANDED_M: f64 = 0.0015;
/// How firmly a foot in the air is held to its way, against one that carries:
/// less than the pelvis, so that it never pulls the body; and how long after
/// landing it takes to become firm, seconds.
const LOOSE: f64 = 0.05;
const FIRM_S: f64 = 0.1;
/// Before a foot lifts, centre of mass and zero-moment point are within these shares of
/// the way from the middle of the standing sole to its edges, and the centre of mass is
/// slower than this, m/s.
const CENTRED: f64 = 0.35;
const ZMP_INSIDE: f64 = 0.6;
const SETTLED_M_S: f64 = 0.05;
/// Share of the pelvis's shift that the centre of mass makes: feet do not move with it.
const COM_SHARE: f64 = 0.85;

#[derive(Clone, Copy, Debug, PartialEq)]
enum FootPhase {
    Down,
    Swing(SwingPhase),
}

/// A foot in the air, from its old place to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
struct SwingPhase {
    from: Vector3<f64>,
    to: Vector3<f64>,
    /// How long the way takes, and since when it takes, seconds.
    way_s: f64,
    air_s: f64,
    /// How long the foot has been coming down, seconds.
    falling_s: f64,
    height_m: f64,
}

impl SwingPhase {
    fn place(&self) -> Vector3<f64> {
        let half_s = self.way_s / 2.0;
        let raised = smooth(self.air_s / half_s) - smooth(self.falling_s / half_s);
        let mut place = self.from + (self.to - self.from) * smooth(self.air_s / self.way_s);
        place.z += self.height_m * raised;
        place
    }
}

/// What the dancer's feet do in one cycle: up, and place against usual.
#[derive(Clone, Copy, Debug, Default)]
struct FootPreview {
    up: [bool; 2],
    place: [[f64; 2]; 2],
}

/// The weight goes over one foot so that the other can lift.
#[derive(Clone, Copy, Debug)]
struct WeightShift {
    /// The foot that is to lift, and whether it has.
    lifts: usize,
    has_lifted: bool,
    /// Whether the dancer's foot has left the floor, and since when it is down again.
    is_due: bool,
    late_s: f64,
}

pub(crate) struct StepContext<'a> {
    pub soles: [Vector3<f64>; 2],
    /// Centre of mass of the last output, and its zero-moment point.
    pub weight: Vector3<f64>,
    pub zmp: Vector3<f64>,
    /// Whether the robot leans as planned, by its sensor.
    pub is_steady: bool,
    pub gain: f64,
    pub aim: &'a PoseTarget,
}

pub(crate) struct FootStepper {
    home: Feet,
    leg_m: f64,
    sole_m: [f64; 2],
    dt_s: f64,
    feet: [FootPhase; 2],
    /// Since when each foot has been down, seconds.
    down_s: [f64; 2],
    /// Whether the dancer's lift was answered, by a step or a refusal.
    spent: [bool; 2],
    was_up: [bool; 2],
    shift: Option<WeightShift>,
    last_weight: Option<Vector3<f64>>,
    ahead: VecDeque<FootPreview>,
    pub steps: u64,
    pub refused: u64,
}

impl FootStepper {
    /// Standing at `home`; the dancer's feet are known `cycles` ahead.
    pub fn new(home: Feet, leg_m: f64, sole_m: [f64; 2], dt_s: f64, cycles: usize) -> Self {
        let mut ahead = VecDeque::with_capacity(cycles + 2);
        ahead.resize(cycles + 1, FootPreview::default());
        Self {
            home,
            leg_m,
            sole_m,
            dt_s,
            feet: [FootPhase::Down; 2],
            down_s: [FIRM_S; 2],
            spent: [false; 2],
            was_up: [false; 2],
            shift: None,
            last_weight: None,
            ahead,
            steps: 0,
            refused: 0,
        }
    }

    pub fn down(&self) -> [bool; 2] {
        self.feet.map(|foot| foot == FootPhase::Down)
    }

    pub fn firmness(&self) -> [f64; 2] {
        std::array::from_fn(|side| match self.feet[side] {
            FootPhase::Down => LOOSE.powf(1.0 - (self.down_s[side] / FIRM_S).min(1.0)),
            FootPhase::Swing(_) => LOOSE,
        })
    }

    pub fn restart(&mut self, feet: &mut Feet) {
        *feet = self.home;
        self.feet = [FootPhase::Down; 2];
        self.down_s = [FIRM_S; 2];
        (self.shift, self.last_weight) = (None, None);
        self.ahead.iter_mut().for_each(|seen| *seen = FootPreview::default());
    }

    /// Moves the sway of the pelvis (leg lengths, due when the preview ends) over the feet
    /// that stand: the middle of both, or the one that carries while the other steps.
    pub fn shift_sway(&self, feet: &Feet, sway: &mut [f64; 6]) {
        let middle = |feet: &Feet| (feet[0].translation.vector + feet[1].translation.vector) * 0.5;
        let home = middle(&self.home);
        sway[2] = sway[2].min(0.0);
        let over = match self.shift {
            None => middle(feet) - home,
            Some(shift) => {
                (sway[0], sway[1]) = (0.0, 0.0);
                (feet[1 - shift.lifts].translation.vector - home) / COM_SHARE
            }
        };
        sway[0] += over.x / self.leg_m;
        sway[1] += over.y / self.leg_m;
    }

    pub fn step(&mut self, context: &StepContext, feet: &mut Feet) {
        self.ahead.pop_front();
        self.ahead.push_back(FootPreview {
            up: context.aim.feet.map(|foot| foot.up),
            place: context.aim.feet.map(|foot| foot.place),
        });
        self.refuse_missed();
        for side in 0..2 {
            // A lift is used up until the dancer's foot has come down.
            self.spent[side] &= self.up_soon(side);
            match self.feet[side] {
                FootPhase::Down => self.down_s[side] += self.dt_s,
                FootPhase::Swing(swing) => self.swing(side, swing, context, feet),
            }
        }
        let speed_m_s = self.weight_speed(context);
        match self.shift {
            None => self.shift = self.begin_shift(context),
            Some(shift) if shift.has_lifted => {
                let firm = self.down() == [true; 2] && self.down_s[shift.lifts] >= FIRM_S;
                self.shift = self.shift.filter(|_| !firm);
            }
            Some(shift) => self.lift_when_settled(shift, speed_m_s, context, feet),
        }
    }

    /// Counts lifts of the dancer that are over and came while another step was under way.
    fn refuse_missed(&mut self) {
        for side in 0..2 {
            let up = self.ahead[0].up[side];
            let ended = std::mem::replace(&mut self.was_up[side], up) && !up;
            let answered = self.spent[side] || self.shift.is_some_and(|shift| shift.lifts == side);
            self.refused += u64::from(ended && !answered);
        }
    }

    fn weight_speed(&mut self, context: &StepContext) -> f64 {
        let last = self.last_weight.replace(context.weight).unwrap_or(context.weight);
        (context.weight - last).xy().norm() / self.dt_s
    }

    /// The weight begins to go over one foot when the dancer is seen to lift the other.
    fn begin_shift(&self, context: &StepContext) -> Option<WeightShift> {
        let up = context.aim.feet.map(|foot| foot.up);
        let lifts = match up {
            [true, false] => 0,
            [false, true] => 1,
            _ => return None,
        };
        let firm = self.down_s.iter().all(|down_s| *down_s >= FIRM_S);
        let begins = firm && !self.spent[lifts] && context.gain >= 0.1;
        begins.then_some(WeightShift { lifts, has_lifted: false, is_due: false, late_s: 0.0 })
    }

    /// Lifts the foot once the other one carries and all is quiet, or refuses the step.
    fn lift_when_settled(
        &mut self,
        mut shift: WeightShift,
        speed_m_s: f64,
        context: &StepContext,
        feet: &Feet,
    ) {
        let side = shift.lifts;
        let stands = feet[1 - side].translation.vector;
        let inside = |point: &Vector3<f64>, share: f64| {
            let over = point - stands;
            (0..2).all(|axis| over[axis].abs() < share * self.sole_m[axis] / 2.0)
        };
        let settled = inside(&context.weight, CENTRED)
            && inside(&context.zmp, ZMP_INSIDE)
            && speed_m_s < SETTLED_M_S
            && context.is_steady;
        let (is_up, will_be) = (self.ahead[0].up[side], self.up_soon(side));
        shift.is_due |= is_up;
        if !is_up && (shift.is_due || !will_be) {
            shift.late_s += self.dt_s;
        }
        if shift.is_due && settled {
            let way_s = self.up_s(side).max(SHORTEST_S);
            self.feet[side] = FootPhase::Swing(SwingPhase {
                from: feet[side].translation.vector,
                to: self.landing(side, context.gain),
                way_s,
                air_s: 0.0,
                falling_s: 0.0,
                height_m: self.leg_m * LIFT.min(LIFT_SPEED * way_s / 2.0),
            });
            shift.has_lifted = true;
            self.spent[side] = true;
            self.steps += 1;
        } else if shift.late_s > TOO_LATE_S {
            self.spent[side] = true;
            self.refused += 1;
            self.shift = None;
            return;
        }
        self.shift = Some(shift);
    }

    /// Whether the dancer's foot is up, or will be when the preview ends or before.
    fn up_soon(&self, side: usize) -> bool {
        self.ahead.iter().any(|seen| seen.up[side])
    }

    /// Seconds until the dancer's foot is down again, as far as is known.
    fn up_s(&self, side: usize) -> f64 {
        let cycles = self.ahead.iter().take_while(|seen| seen.up[side]).count();
        cycles as f64 * self.dt_s
    }

    /// Where the dancer's foot lands next, on the robot's floor.
    fn landing(&self, side: usize, gain: f64) -> Vector3<f64> {
        let seen = self.ahead.iter().find(|seen| !seen.up[side]);
        let [x, y] = seen.or(self.ahead.back()).map_or([0.0; 2], |s| s.place[side]);
        let outward = if side == 0 { 1.0 } else { -1.0 };
        let [ahead, out, inward] = REACH;
        let x = (x * gain).clamp(-ahead, ahead);
        let y = (y * gain * outward).clamp(-inward, out) * outward;
        self.home[side].translation.vector + Vector3::new(x, y, 0.0) * self.leg_m
    }

    fn swing(
        &mut self,
        side: usize,
        mut swing: SwingPhase,
        context: &StepContext,
        feet: &mut Feet,
    ) {
        swing.air_s += self.dt_s;
        let half_s = swing.way_s / 2.0;
        // At the top the foot waits for the dancer's to come down.
        let falls = swing.falling_s > 0.0
            || swing.air_s >= half_s && (self.up_s(side) <= half_s || swing.air_s > LONGEST_S);
        swing.falling_s += if falls { self.dt_s } else { 0.0 };
        feet[side].translation.vector = swing.place();
        let sole = context.soles[side];
        let landed = (sole - swing.to).norm() < LANDED_M;
        self.feet[side] = match swing.falling_s >= half_s && landed {
            true => {
                self.down_s[side] = 0.0;
                FootPhase::Down
            }
            false => FootPhase::Swing(swing),
        };
    }
}

/// Minimum-jerk way from 0 to 1 (Flash and Hogan 1985).
fn smooth(share: f64) -> f64 {
    let share = share.clamp(0.0, 1.0);
    share.powi(3) * (10.0 + share * (-15.0 + share * 6.0))
}
