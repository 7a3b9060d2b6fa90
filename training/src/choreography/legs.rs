//! Step figures: where the feet are on every count of eight.
//!
//! A figure gives for each count the stance that is reached on that count,
//! in the dancer's frame, for a dancer who begins with the right foot. Between
//! counts feet are carried, pelvis and weight follow.

use super::body::FootPlacement;
use super::track::{bump, minimum_jerk, mix};

/// Half the distance between the toes of a dancer at rest.
const HOME_M: f64 = 0.11;
const TOES_AHEAD_M: f64 = 0.10;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StepStance {
    pub(crate) feet: [FootPlacement; 2],
    pub(crate) weight: f64,
    pub(crate) drop: f64,
    pub(crate) yaw: f64,
    /// Height of a hop on the way here: both feet leave the floor.
    pub(crate) hop: f64,
    /// When each foot moves on the way here, as shares of the time.
    pub(crate) window: [[f64; 2]; 2],
}

/// The step figures. Numbers in brackets: counts until they repeat.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Steps {
    Bounce,     // weight to and fro on both feet (2)
    Sway,       // wide stance, weight from side to side (2)
    StepTouch,  // side, touch, side, touch (4)
    TwoStep,    // side, close, side, touch, and back (8)
    Grapevine,  // side, behind, side, touch, and back (8)
    March,      // knee up, down, other knee up, down (4)
    Kick,       // kick, close, other kick, close (4)
    HeelTap,    // heel ahead, close, other heel, close (4)
    Charleston, // step, kick, step back, touch behind (4)
    Lunge,      // far to the side, deep, and back (4)
    Jack,       // feet apart, feet together, in hops (2)
    Squat,      // down and up (2)
    Twist,      // on the balls of the feet, heels and hips against each other (2)
    Salsa,      // forward and back basic of salsa on one (8)
    SalsaSide,  // side basic of salsa (8)
    Turn,       // once around in four steps, then four counts in place (8)
    Walk,       // walk four ahead, four back (8)
}

impl StepStance {
    pub(crate) fn home() -> Self {
        let foot =
            |x: f64| FootPlacement { x, z: TOES_AHEAD_M, yaw: x, ..FootPlacement::default() };
        Self {
            feet: [foot(HOME_M), foot(-HOME_M)],
            weight: 0.5,
            drop: 0.02,
            yaw: 0.0,
            hop: 0.0,
            window: [[0.0, 1.0]; 2],
        }
    }

    fn weight(mut self, right: f64, drop: f64) -> Self {
        self.weight = right;
        self.drop = drop;
        self
    }

    fn left(mut self, x: f64, z: f64) -> Self {
        self.feet[0].x = x;
        self.feet[0].z = TOES_AHEAD_M + z;
        self
    }

    fn right(mut self, x: f64, z: f64) -> Self {
        self.feet[1].x = x;
        self.feet[1].z = TOES_AHEAD_M + z;
        self
    }

    /// Both feet further out by so many metres.
    fn wider(self, out: f64) -> Self {
        self.left(HOME_M + out, 0.0).right(-HOME_M - out, 0.0)
    }

    fn heel(mut self, side: usize, heel: f64) -> Self {
        self.feet[side].heel = heel;
        self
    }

    fn lift(mut self, side: usize, lift: f64) -> Self {
        self.feet[side].lift = lift;
        self
    }

    pub(crate) fn mirrored(mut self) -> Self {
        self.feet.swap(0, 1);
        self.window.swap(0, 1);
        for foot in &mut self.feet {
            foot.x = -foot.x;
            foot.yaw = -foot.yaw;
        }
        self.weight = 1.0 - self.weight;
        self.yaw = -self.yaw;
        self
    }

    /// The stance in a frame at (x, z) that faces `yaw`.
    pub(crate) fn placed(mut self, [x, z]: [f64; 2], yaw: f64) -> Self {
        let (sin, cos) = yaw.sin_cos();
        for foot in &mut self.feet {
            let (fx, fz) = (foot.x, foot.z - TOES_AHEAD_M);
            foot.x = x + cos * fx + sin * fz + sin * TOES_AHEAD_M;
            foot.z = z + cos * fz - sin * fx + cos * TOES_AHEAD_M;
            foot.yaw += yaw;
        }
        self.yaw += yaw;
        self
    }

    /// Where the pelvis is: over the weight, not all the way.
    pub(crate) fn pelvis(&self) -> [f64; 2] {
        let share = 0.5 + 0.75 * (self.weight - 0.5);
        let [l, r] = self.feet;
        let back = [-TOES_AHEAD_M * self.yaw.sin(), -TOES_AHEAD_M * self.yaw.cos()];
        [l.x + (r.x - l.x) * share + back[0], l.z + (r.z - l.z) * share + back[1]]
    }

    fn foot_moves_m(&self, to: &Self, side: usize) -> f64 {
        let (a, b) = (self.feet[side], to.feet[side]);
        (a.x - b.x).hypot(a.z - b.z)
    }

    /// The next stance after `before`: two feet that move without a hop go one by one.
    pub(crate) fn following(mut self, before: &Self) -> Self {
        let [l, r] = [0, 1].map(|side| before.foot_moves_m(&self, side));
        if self.hop == 0.0 && l > 0.03 && r > 0.03 {
            // The foot that bears less weight goes first.
            let first = usize::from(before.weight < 0.5);
            self.window[first] = [0.0, 0.55];
            self.window[1 - first] = [0.45, 1.0];
        }
        self
    }

    /// The stance on the way from `self` to `to`: feet, pelvis, drop, yaw.
    pub(crate) fn towards(
        &self,
        to: &Self,
        u: f64,
        snap: f64,
    ) -> ([FootPlacement; 2], [f64; 2], f64, f64) {
        let feet = std::array::from_fn(|side| {
            let [from, until] = to.window[side];
            let share = (u - from) / (until - from);
            let t = minimum_jerk(share, 1.0);
            let (a, b) = (self.feet[side], to.feet[side]);
            let way = self.foot_moves_m(to, side);
            let carried = if way > 0.02 { (0.03 + 0.16 * way).min(0.11) } else { 0.0 };
            let [x, z, yaw, heel, lift] =
                mix(&[a.x, a.z, a.yaw, a.heel, a.lift], &[b.x, b.z, b.yaw, b.heel, b.lift], t);
            FootPlacement { x, z, yaw, heel, lift: lift + carried * bump(share) + to.hop * bump(u) }
        });
        let t = minimum_jerk(u, snap);
        let pelvis = mix(&self.pelvis(), &to.pelvis(), t);
        let [drop, yaw] = mix(&[self.drop, self.yaw], &[to.drop, to.yaw], t);
        (feet, pelvis, drop - to.hop * bump(u), yaw)
    }
}

impl Steps {
    /// The stance arrived at on `count`, for steps of `size` (1 is usual).
    pub(crate) fn stance(self, count: usize, size: f64) -> StepStance {
        let home = StepStance::home();
        let even = count.is_multiple_of(2);
        match self {
            Self::Bounce => of_side(count, home.weight(0.68, 0.05 * size).heel(0, 0.25 * size)),
            Self::Sway => {
                let wide = home.wider(0.12 * size);
                of_side(count, wide.weight(0.92, 0.06 * size).heel(0, 0.35 * size))
            }
            Self::StepTouch => step_touch(count, size),
            Self::TwoStep => two_steps(count, size, 0.0, 0.0),
            Self::Grapevine => two_steps(count, size, -0.14, 0.10),
            Self::March => {
                let up = home.right(-HOME_M, 0.10).lift(1, 0.24 * size).weight(0.06, 0.0);
                of_side(count / 2, if even { up } else { home.weight(0.55, 0.05) })
            }
            Self::Kick => {
                let out = home.right(-HOME_M + 0.03, 0.42 * size);
                let kick = out.lift(1, 0.26 * size).weight(0.02, 0.03);
                of_side(count / 2, if even { kick } else { home.weight(0.6, 0.05) })
            }
            Self::HeelTap => {
                let tap = home.right(-HOME_M - 0.04, 0.24 * size).heel(1, -0.45).weight(0.1, 0.08);
                of_side(count / 2, if even { tap } else { home.weight(0.6, 0.02) })
            }
            Self::Charleston => charleston(count, size),
            Self::Lunge => {
                let out = home.right(-HOME_M - 0.42 * size, 0.06);
                let lunge = out.weight(0.82, 0.12 * size).heel(0, 0.4);
                of_side(count / 2, if even { lunge } else { home.weight(0.45, 0.0) })
            }
            Self::Jack => {
                let apart = home.wider(0.20 * size).weight(0.5, 0.09);
                let stance = if even { apart } else { home.weight(0.5, 0.05) };
                StepStance { hop: 0.05 * size, ..stance }
            }
            Self::Squat => home.wider(0.08).weight(0.5, if even { 0.20 * size } else { 0.0 }),
            Self::Twist => of_side(count, twist(size)),
            Self::Salsa => salsa(count, [0.0, 0.24 * size], [0.0, -0.24 * size]),
            Self::SalsaSide => salsa(count, [0.24 * size, 0.0], [-0.24 * size, 0.0]),
            Self::Turn => turn(count, size),
            Self::Walk => walk(count, size),
        }
    }

    /// Turned by this angle after eight counts, radians.
    pub(crate) fn turns_rad(self) -> f64 {
        if self == Self::Turn { -std::f64::consts::TAU } else { 0.0 }
    }
}

/// Steps begin with one side and go on with the other.
fn of_side(count: usize, stance: StepStance) -> StepStance {
    if count.is_multiple_of(2) { stance } else { stance.mirrored() }
}

fn step_touch(count: usize, size: f64) -> StepStance {
    let (home, h, out) = (StepStance::home(), HOME_M, 0.30 * size);
    let apart = home.right(-h - out, 0.0);
    let stance = match count % 4 {
        0 => apart.weight(0.9, 0.05),
        1 => apart.left(-out + 0.04, 0.02).heel(0, 0.5).weight(0.97, 0.02),
        2 => apart.weight(0.1, 0.05),
        _ => home.right(0.04 - h, 0.02).heel(1, 0.5).weight(0.03, 0.02),
    };
    stance.placed([0.5 * out, 0.0], 0.0)
}

/// Two steps to a side and back. The foot that closes goes `behind` the other and `past` it.
fn two_steps(count: usize, size: f64, behind: f64, past: f64) -> StepStance {
    let out = 0.30 * size;
    let at = |left: [f64; 2], right: [f64; 2], weight: f64| {
        let stance = StepStance::home().left(HOME_M + left[0], left[1]);
        stance.right(-HOME_M + right[0], right[1]).weight(weight, 0.045)
    };
    let stance = match count % 8 {
        0 => at([0.0, 0.0], [-out, 0.0], 0.85),
        1 => at([-out - past, behind], [-out, 0.0], 0.2),
        2 => at([-out - past, behind], [-2.0 * out, 0.0], 0.85),
        3 => at([-2.0 * out + 0.04, 0.02], [-2.0 * out, 0.0], 0.97).heel(0, 0.5),
        4 => at([-out, 0.0], [-2.0 * out, 0.0], 0.15),
        5 => at([-out, 0.0], [-out + past, behind], 0.8),
        6 => at([0.0, 0.0], [-out + past, behind], 0.15),
        _ => at([0.0, 0.0], [-0.04, 0.02], 0.03).heel(1, 0.5),
    };
    stance.placed([out, 0.0], 0.0)
}

fn charleston(count: usize, size: f64) -> StepStance {
    let (home, h, z) = (StepStance::home(), HOME_M, 0.22 * size);
    let (ahead, back) = (home.right(-h, z), home.left(h, -0.18 * size));
    match count % 4 {
        0 => ahead.weight(0.9, 0.05),
        1 => ahead.left(h, z + 0.34 * size).lift(0, 0.22 * size).weight(1.0, 0.02),
        2 => back.right(-h, z).weight(0.1, 0.06),
        _ => back.right(-h, -0.44 * size).heel(1, 0.6).weight(0.05, 0.06),
    }
}

fn twist(size: f64) -> StepStance {
    let feet = StepStance::home().wider(0.03).heel(0, 0.22).heel(1, 0.22);
    let mut twist = feet.weight(0.62, 0.07);
    for foot in &mut twist.feet {
        foot.yaw += 0.55 * size;
    }
    twist.yaw = 0.35 * size;
    twist
}

/// A break of the left foot to one place (x, z) and of the right foot to another.
fn salsa(count: usize, left: [f64; 2], right: [f64; 2]) -> StepStance {
    let home = StepStance::home();
    let broken_left = home.left(HOME_M + left[0], left[1]);
    let broken_right = home.right(-HOME_M + right[0], right[1]);
    match count % 8 {
        0 => broken_left.weight(0.2, 0.04),
        1 => broken_left.weight(0.9, 0.02).heel(0, 0.35),
        2 => home.weight(0.2, 0.03),
        3 => home.weight(0.1, 0.02).heel(1, 0.4),
        4 => broken_right.weight(0.8, 0.04),
        5 => broken_right.weight(0.1, 0.02).heel(1, 0.35),
        6 => home.weight(0.8, 0.03),
        _ => home.weight(0.9, 0.02).heel(0, 0.4),
    }
}

/// A quarter on each of four counts, then four of rest.
fn turn(count: usize, size: f64) -> StepStance {
    let home = StepStance::home();
    let quarter = std::f64::consts::FRAC_PI_2;
    let yaw = |k: usize| -quarter * k.min(4) as f64;
    if count % 8 >= 4 {
        let rest = of_side(count, home.weight(0.68, 0.05 * size).heel(0, 0.25));
        return rest.placed([0.0; 2], yaw(4));
    }
    let k = count % 8 + 1;
    let mut stance = home.placed([0.0; 2], yaw(k));
    let before = home.placed([0.0; 2], yaw(k - 1));
    let stays = k % 2; // the right foot begins
    if k < 4 {
        stance.feet[stays] = before.feet[stays];
        stance.feet[stays].yaw -= quarter / 2.0;
    }
    stance.weight(if stays == 0 { 0.8 } else { 0.2 }, 0.04)
}

/// Four steps ahead, four back.
fn walk(count: usize, size: f64) -> StepStance {
    const PLACES: [f64; 8] = [1.0, 2.0, 3.0, 4.0, 3.0, 2.0, 1.0, 0.0];
    let place = PLACES[count % 8] * 0.2 * size;
    let before = PLACES[(count + 7) % 8] * 0.2 * size;
    let home = StepStance::home();
    let stance = match count.is_multiple_of(2) {
        true => home.right(-HOME_M, place).left(HOME_M, before).weight(0.88, 0.04).heel(0, 0.3),
        false => home.left(HOME_M, place).right(-HOME_M, before).weight(0.12, 0.04).heel(1, 0.3),
    };
    stance.placed([0.0, -0.4 * size], 0.0)
}
