//! A body drawn as limbs, seen from the front, a little from the side and above.

use super::canvas::{Canvas, Point};
use super::style::Rgba;

/// Which side of the body a limb belongs to; left and right differ in colour,
/// so that crossed arms can be told apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    Left,
    Right,
    Middle,
}

impl From<Option<usize>> for Side {
    /// 0 left, 1 right.
    fn from(side: Option<usize>) -> Self {
        match side {
            Some(0) => Self::Left,
            Some(_) => Self::Right,
            None => Self::Middle,
        }
    }
}

/// A straight piece of the body, in metres: x forward, y left, z up.
#[derive(Clone, Copy, Debug)]
pub struct Limb {
    pub from: [f64; 3],
    pub to: [f64; 3],
    pub radius_m: f64,
    pub side: Side,
}

/// A point of the body's surface, metres, and the way out of it.
#[derive(Clone, Copy, Debug)]
pub struct Dot {
    pub at: [f64; 3],
    pub normal: [f64; 3],
    pub side: Side,
}

#[derive(Clone, Debug, Default)]
#[allow(missing_docs)] // the names say it
pub struct StickFigure {
    pub limbs: Vec<Limb>,
    /// What is drawn of meshes.
    pub dots: Vec<Dot>,
    /// Height of the standing body, metres: every pose is drawn to one scale.
    pub height_m: f64,
    /// Where the floor is, metres (z).
    pub floor_m: f64,
    /// The point of the ground plane that is drawn in the middle, metres (x, y).
    pub center: [f64; 2],
}

impl StickFigure {
    /// Height over the floor and width from side to side, metres.
    pub fn extent_m(&self) -> [f64; 2] {
        let dots = self.dots.iter().map(|dot| dot.at);
        let ends = self.limbs.iter().flat_map(|limb| [limb.from, limb.to]).chain(dots);
        let ends = || ends.clone();
        let top = ends().map(|end| end[2]).fold(self.floor_m, f64::max);
        let half = ends().map(|end| (end[1] - self.center[1]).abs()).fold(0.0, f64::max);
        [top - self.floor_m, 2.0 * half]
    }

    /// The height of `draw_figure`, at most `most`, at which the figure is as wide as
    /// `width`; in pixels.
    pub fn height_that_fits(&self, width: f32, most: f32) -> f32 {
        let (sin, cos) = YAW_RAD.sin_cos();
        let ends = self
            .limbs
            .iter()
            .flat_map(|limb| [(limb.from, limb.radius_m), (limb.to, limb.radius_m)]);
        let aside = |(at, radius): ([f64; 3], f64)| {
            let (x, y) = (at[0] - self.center[0], at[1] - self.center[1]);
            (x * sin + y * cos).abs() + radius
        };
        let half_m = ends.map(aside).fold(1e-6, f64::max);
        most.min(HEADROOM + (f64::from(width) / (2.0 * half_m) * self.standing_m()) as f32)
    }

    /// What the drawn height stands for, metres.
    fn standing_m(&self) -> f64 {
        (self.height_m * 1.15).max(1e-6)
    }
}

/// Pixels of the height that are left free.
const HEADROOM: f32 = 30.0;

const LEFT: [f64; 3] = [232.0, 126.0, 44.0];
const RIGHT: [f64; 3] = [42.0, 110.0, 178.0];
const MIDDLE: [f64; 3] = [84.0, 90.0, 102.0];
const FLOOR: Rgba = [206, 208, 214, 255];
/// Radius of a dot, pixels, and where light comes from.
const DOT: f32 = 1.5;
const LIGHT: [f64; 3] = [0.48, 0.36, 0.8];
const YAW_RAD: f64 = 0.38;
const PITCH_RAD: f64 = 0.12;

/// Draws the figure with its feet on a floor line, centred on `center_x`.
pub fn draw_figure(
    canvas: &mut Canvas,
    figure: &StickFigure,
    center_x: f32,
    top: f32,
    height: f32,
) {
    let floor_y = top + height - 8.0;
    let scale = f64::from(height - HEADROOM) / figure.standing_m();
    canvas.line(&[(center_x - 44.0, floor_y), (center_x + 44.0, floor_y)], 1.5, FLOOR);
    let view = |p: [f64; 3]| -> (Point, f64) {
        let (x, y, z) = (p[0] - figure.center[0], p[1] - figure.center[1], p[2] - figure.floor_m);
        let (sin, cos) = YAW_RAD.sin_cos();
        let (near, side) = (x * cos - y * sin, x * sin + y * cos);
        let up = z * PITCH_RAD.cos() - near * PITCH_RAD.sin();
        let at = (center_x + (side * scale) as f32, floor_y - (up * scale) as f32);
        (at, near)
    };

    let limbs = figure.limbs.iter().map(|limb| {
        let near = (view(limb.from).1 + view(limb.to).1) / 2.0;
        (near, Piece::Limb(limb))
    });
    let dots = figure.dots.iter().map(|dot| (view(dot.at).1, Piece::Dot(dot)));
    let mut pieces: Vec<(f64, Piece)> = limbs.chain(dots).collect();
    pieces.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (near, piece) in pieces {
        let nearness = near / figure.height_m.max(1e-6);
        match piece {
            Piece::Limb(limb) => {
                let width = ((2.0 * limb.radius_m * scale) as f32).max(2.0);
                let ends = [view(limb.from).0, view(limb.to).0];
                canvas.line(&ends, width, shade(limb.side, nearness));
            }
            Piece::Dot(dot) => {
                canvas.dot(view(dot.at).0, DOT, lit(shade(dot.side, nearness), dot.normal));
            }
        }
    }
}

enum Piece<'a> {
    Limb(&'a Limb),
    Dot(&'a Dot),
}

/// Light from above, ahead and the left.
fn lit([r, g, b, a]: Rgba, normal: [f64; 3]) -> Rgba {
    let toward: f64 = normal.iter().zip(LIGHT).map(|(part, light)| part * light).sum();
    let share = 0.85 + 0.35 * toward.clamp(-1.0, 1.0);
    let channel = |value: u8| (f64::from(value) * share).min(255.0) as u8;
    [channel(r), channel(g), channel(b), a]
}

fn shade(side: Side, nearness: f64) -> Rgba {
    let base = match side {
        Side::Left => LEFT,
        Side::Right => RIGHT,
        Side::Middle => MIDDLE,
    };
    let fade = (0.25 - nearness).clamp(0.0, 0.5);
    let channel = |value: f64| (value + (235.0 - value) * fade) as u8;
    [channel(base[0]), channel(base[1]), channel(base[2]), 255]
}
