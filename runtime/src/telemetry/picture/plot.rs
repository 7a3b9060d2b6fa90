//! A panel with a time axis, in pixels.

use super::canvas::{Canvas, Point};
use super::style::Rgba;

/// Where a plot lies on the canvas and what part of the data it shows.
#[derive(Clone, Copy, Debug)]
pub struct Plot {
    pub left: f32,
    pub top: f32,
    pub width: f32,
    pub height: f32,
    pub x_range: (f64, f64),
    pub y_range: (f64, f64),
}

impl Plot {
    pub fn panel(&self, canvas: &mut Canvas, rgba: Rgba) {
        canvas.rectangle(self.left, self.top, self.width, self.height, rgba);
    }

    pub fn curve(&self, canvas: &mut Canvas, samples: &[(f64, f64)], width: f32, rgba: Rgba) {
        let points: Vec<Point> = samples
            .iter()
            .filter(|(x, _)| self.shows(*x))
            .map(|&(x, y)| self.point(x, y))
            .collect();
        canvas.line(&points, width, rgba);
    }

    pub fn verticals(&self, canvas: &mut Canvas, times: &[f64], width: f32, rgba: Rgba) {
        for &time in times.iter().filter(|t| self.shows(**t)) {
            let (x, _) = self.point(time, self.y_range.0);
            canvas.line(&[(x, self.top), (x, self.top + self.height)], width, rgba);
        }
    }

    pub fn horizontal(&self, canvas: &mut Canvas, value: f64, width: f32, rgba: Rgba) {
        let (_, y) = self.point(self.x_range.0, value);
        canvas.line(&[(self.left, y), (self.left + self.width, y)], width, rgba);
    }

    /// A dot on the curve at each time.
    pub fn marks(
        &self,
        canvas: &mut Canvas,
        samples: &[(f64, f64)],
        times: &[f64],
        radius: f32,
        rgba: Rgba,
    ) {
        for &time in times.iter().filter(|t| self.shows(**t)) {
            let after = samples.partition_point(|(x, _)| *x < time);
            if let Some(&(_, value)) = samples.get(after) {
                canvas.dot(self.point(time, value), radius, rgba);
            }
        }
    }

    fn shows(&self, time: f64) -> bool {
        (self.x_range.0..=self.x_range.1).contains(&time)
    }

    fn point(&self, x: f64, y: f64) -> Point {
        let share = |value: f64, (low, high): (f64, f64)| {
            ((value - low) / (high - low).max(1e-9)).clamp(0.0, 1.0) as f32
        };
        (
            self.left + self.width * share(x, self.x_range),
            self.top + self.height * (1.0 - share(y, self.y_range)),
        )
    }
}
