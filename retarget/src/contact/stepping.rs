//! When the feet of a stepping robot leave the floor, and where they land.
//!
//! A foot follows the dancer's: it lifts when that lifts, stays up while that
//! is up, and lands where that lands against the pelvis, scaled to the robot's
//! legs, near its place at rest: the robot steps on the spot. Balance comes
//! before contact: a foot lifts only while the other one stands and carries the
//! weight, else it stays down and the step is counted as refused. The dancer's
//! feet are known ahead, so that the weight is on the other foot in time.
//! Metres, seconds; the world has its floor at z = 0.

use std::collections::VecDeque;

use crate::dancer::PoseTarget;
use crate::solver::Feet;
use k::nalgebra::Vector3;

/// Shortest and longest time in the air, seconds.
const SHORTEST_S: f64 = 0.4;
const LONGEST_S: f64 = 1.2;
/// Shorter lifts of the dancer are not steps, seconds.
const LEAST_LIFT_S: f64 = 0.1;
/// A step that cannot begin this long before the dancer's foot lands is refused.
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
/// The weight stays this far inside the standing sole, metres.
const SAFE_EDGE_M: f64 = 0.010;

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

pub(crate) struct StepContext<'a> {
    pub soles: [Vector3<f64>; 2],
    /// Centre of mass (or what moves with it) of the last output.
    pub weight: Vector3<f64>,
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
    spent: [bool; 2],
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
        self.ahead.iter_mut().for_each(|seen| *seen = FootPreview::default());
    }

    /// Keeps the sway of the pelvis (leg lengths, due when the preview ends)
    /// over the feet that will stand then.
    pub fn shift_sway(&self, aim: &PoseTarget, feet: &Feet, sway: &mut [f64; 6]) {
        let place = |side: usize| match self.feet[side] {
            FootPhase::Down => feet[side].translation.vector,
            FootPhase::Swing(swing) => swing.to,
        };
        let middle = |feet: &Feet| (feet[0].translation.vector + feet[1].translation.vector) * 0.5;
        let home = middle(&self.home);
        let centre = (place(0) + place(1)) * 0.5 - home;
        let stands = match aim.feet.map(|foot| foot.up) {
            [true, false] => Some(1),
            [false, true] => Some(0),
            _ => None,
        };
        sway[2] = sway[2].min(0.0);
        for axis in 0..2 {
            let shift = sway[axis] * self.leg_m + centre[axis];
            let shift = match stands {
                Some(side) => {
                    let over = place(side)[axis] - home[axis];
                    let room = (self.sole_m[axis] / 2.0 - 2.0 * SAFE_EDGE_M).max(0.0);
                    shift.clamp(over - room, over + room)
                }
                None => shift,
            };
            sway[axis] = shift / self.leg_m;
        }
    }

    pub fn step(&mut self, context: &StepContext, feet: &mut Feet) {
        self.ahead.pop_front();
        self.ahead.push_back(FootPreview {
            up: context.aim.feet.map(|foot| foot.up),
            place: context.aim.feet.map(|foot| foot.place),
        });
        for side in 0..2 {
            let up = self.ahead[0].up[side];
            self.spent[side] &= up;
            match self.feet[side] {
                FootPhase::Down if up && !self.spent[side] => self.lift(side, context, feet),
                FootPhase::Down => self.down_s[side] += self.dt_s,
                FootPhase::Swing(swing) => self.swing(side, swing, context, feet),
            }
        }
    }

    /// Begins a step, if the other foot carries the weight.
    fn lift(&mut self, side: usize, context: &StepContext, feet: &Feet) {
        let up_s = self.up_s(side);
        if up_s < LEAST_LIFT_S || context.gain < 0.1 {
            self.spent[side] = true;
            return;
        }
        let other = 1 - side;
        let over = context.weight - feet[other].translation.vector;
        let carries = (0..2).all(|axis| over[axis].abs() < self.sole_m[axis] / 2.0 - SAFE_EDGE_M);
        if self.feet[other] == FootPhase::Down && self.down_s[other] >= FIRM_S && carries {
            let way_s = up_s.max(SHORTEST_S);
            self.feet[side] = FootPhase::Swing(SwingPhase {
                from: feet[side].translation.vector,
                to: self.landing(side, context.gain),
                way_s,
                air_s: 0.0,
                falling_s: 0.0,
                height_m: self.leg_m * LIFT.min(LIFT_SPEED * way_s / 2.0),
            });
            self.spent[side] = true;
            self.steps += 1;
        } else if up_s < TOO_LATE_S {
            self.spent[side] = true;
            self.refused += 1;
        }
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
