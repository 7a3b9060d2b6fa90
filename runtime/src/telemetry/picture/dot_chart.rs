//! Figures of several candidates beside each other: a panel a figure, a row a
//! candidate, a dot with its interval.

use super::canvas::{Canvas, TextSize};
use super::plot::span;
use super::style::{FAINT, HEADER, INK, MARGIN, PANEL, TRACK};

const WIDTH: u32 = 1200;
const TITLE_HEIGHT: f32 = 28.0;
const ROW_HEIGHT: f32 = 26.0;
const GAP: f32 = 24.0;
const NAME_WIDTH: f32 = 190.0;
const VALUE_WIDTH: f32 = 110.0;

#[derive(Clone, Debug)]
#[allow(missing_docs)] // the names say it
pub struct Dot {
    pub name: String,
    /// Mean and half the width of the interval, if it was measured.
    pub figure: Option<(f64, f64)>,
}

#[derive(Clone, Debug)]
#[allow(missing_docs)] // the names say it
pub struct DotPanel {
    pub title: String,
    /// The candidates, from top to bottom; the first is drawn as the yardstick.
    pub dots: Vec<Dot>,
}

#[derive(Clone, Debug)]
#[allow(missing_docs)] // the names say it
pub struct DotChart {
    pub title: String,
    pub subtitle: String,
    pub panels: Vec<DotPanel>,
}

impl DotChart {
    /// The picture as PNG bytes.
    pub fn png(&self) -> anyhow::Result<Vec<u8>> {
        let heights = self.panels.iter().map(DotPanel::height);
        let height = HEADER + heights.sum::<f32>() + MARGIN;
        let mut canvas = Canvas::page(WIDTH, height, &self.title, &self.subtitle)?;
        let mut top = HEADER;
        for panel in &self.panels {
            panel.draw(&mut canvas, top);
            top += panel.height();
        }
        canvas.png()
    }
}

impl DotPanel {
    fn height(&self) -> f32 {
        TITLE_HEIGHT + ROW_HEIGHT * self.dots.len() as f32 + GAP
    }

    fn draw(&self, canvas: &mut Canvas, top: f32) {
        canvas.text((MARGIN, top), TextSize::Medium, INK, &self.title);
        let (left, top) = (MARGIN + NAME_WIDTH, top + TITLE_HEIGHT);
        let width = WIDTH as f32 - 2.0 * MARGIN - NAME_WIDTH - VALUE_WIDTH;
        let rows = ROW_HEIGHT * self.dots.len() as f32;
        canvas.rectangle(left, top, width, rows, PANEL);
        let (low, high) = self.range();
        let x = |value: f64| left + width * ((value - low) / (high - low)) as f32;
        if let Some((yardstick, _)) = self.dots.first().and_then(|dot| dot.figure) {
            let x = x(yardstick);
            canvas.line(&[(x, top), (x, top + rows)], 1.0, FAINT);
        }
        for (i, dot) in self.dots.iter().enumerate() {
            let middle = top + ROW_HEIGHT * (i as f32 + 0.5);
            canvas.text((MARGIN, middle - 9.0), TextSize::Small, INK, &dot.name);
            let Some((mean, ci95)) = dot.figure else {
                canvas.caption((left + 8.0, middle - 9.0), "-");
                continue;
            };
            let ends = [(x(mean - ci95), middle), (x(mean + ci95), middle)];
            canvas.line(&ends, 3.0, TRACK);
            canvas.dot((x(mean), middle), 5.0, TRACK);
            let value = match mean.abs() {
                size if size >= 10.0 => format!("{mean:.1}"),
                _ => format!("{mean:.3}"),
            };
            let at = (left + width + 12.0, middle - 9.0);
            canvas.text(at, TextSize::Small, INK, &value);
        }
    }

    fn range(&self) -> (f64, f64) {
        let figures = self.dots.iter().filter_map(|dot| dot.figure);
        let (low, high) = span(figures.flat_map(|(mean, ci95)| [mean - ci95, mean + ci95]));
        match low < high {
            true => (low - 0.05 * (high - low), high + 0.05 * (high - low)),
            false if low.is_finite() => (low - 1.0, low + 1.0),
            false => (0.0, 1.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(figures: &[Option<(f64, f64)>]) -> Vec<u8> {
        let dots = figures.iter().map(|figure| Dot { name: "variant".into(), figure: *figure });
        let panel = DotPanel { title: "error".into(), dots: dots.collect() };
        let dots =
            DotChart { title: "Variants".into(), subtitle: String::new(), panels: vec![panel] };
        dots.png().unwrap()
    }

    #[test]
    fn intervals_show_and_what_was_not_measured_leaves_a_gap() {
        let narrow = picture(&[Some((1.0, 0.1)), Some((3.0, 0.1))]);
        assert_ne!(narrow, picture(&[Some((1.0, 0.8)), Some((3.0, 0.1))]));
        assert_ne!(narrow, picture(&[Some((1.0, 0.1)), None]));
        assert_eq!(picture(&[None])[1..4], *b"PNG");
        assert_eq!(picture(&[Some((2.0, 0.0))])[1..4], *b"PNG");
    }
}
