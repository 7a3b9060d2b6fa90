//! Curves over the steps of a training run: panels below each other, a few
//! curves in each.

use super::canvas::{Canvas, TextSize};
use super::plot::{Plot, span};
use super::style::{FAINT, HEADER, INK, KINEMATIC, LIMIT, MARGIN, PANEL, Rgba, TRACK};

const WIDTH: u32 = 1200;
const PANEL_HEIGHT: f32 = 220.0;
const TITLE_HEIGHT: f32 = 28.0;
const LABEL_WIDTH: f32 = 90.0;
const COLOURS: [Rgba; 4] = [TRACK, LIMIT, KINEMATIC, FAINT];

#[derive(Clone, Debug)]
#[allow(missing_docs)] // the names say it
pub struct Curve {
    pub name: String,
    /// Step and value; what is not finite is left out.
    pub samples: Vec<(f64, f64)>,
}

#[derive(Clone, Debug)]
#[allow(missing_docs)] // the names say it
pub struct CurvePanel {
    pub title: String,
    pub curves: Vec<Curve>,
}

#[derive(Clone, Debug)]
#[allow(missing_docs)] // the names say it
pub struct CurveChart {
    pub title: String,
    pub subtitle: String,
    pub panels: Vec<CurvePanel>,
}

impl CurveChart {
    /// The picture as PNG bytes.
    pub fn png(&self) -> anyhow::Result<Vec<u8>> {
        let each = TITLE_HEIGHT + PANEL_HEIGHT + 16.0;
        let height = HEADER + each * self.panels.len() as f32 + MARGIN;
        let mut canvas = Canvas::page(WIDTH, height, &self.title, &self.subtitle)?;
        for (i, panel) in self.panels.iter().enumerate() {
            panel.draw(&mut canvas, HEADER + each * i as f32);
        }
        canvas.png()
    }
}

impl CurvePanel {
    fn draw(&self, canvas: &mut Canvas, top: f32) {
        canvas.text((MARGIN, top), TextSize::Medium, INK, &self.title);
        let curves: Vec<Vec<(f64, f64)>> = self.curves.iter().map(Curve::finite).collect();
        let all = || curves.iter().flatten();
        if all().next().is_none() {
            return canvas.caption((MARGIN, top + TITLE_HEIGHT), "nothing yet");
        }
        let plot = Plot {
            left: MARGIN + LABEL_WIDTH,
            top: top + TITLE_HEIGHT,
            width: WIDTH as f32 - 2.0 * MARGIN - LABEL_WIDTH,
            height: PANEL_HEIGHT - 20.0,
            x_range: span(all().map(|s| s.0)),
            y_range: span(all().map(|s| s.1)),
        };
        plot.panel(canvas, PANEL);
        let mut name_at = plot.left + 160.0;
        for ((curve, samples), rgba) in self.curves.iter().zip(&curves).zip(COLOURS) {
            plot.curve(canvas, samples, 2.0, rgba);
            canvas.text((name_at, top), TextSize::Small, rgba, &curve.name);
            name_at += Canvas::text_width(TextSize::Small, &curve.name) + 24.0;
        }
        let foot = plot.top + plot.height;
        for (value, y) in [(plot.y_range.1, plot.top), (plot.y_range.0, foot - 16.0)] {
            canvas.caption((MARGIN, y), &short(value));
        }
        canvas.caption((plot.left, foot + 2.0), &short(plot.x_range.0));
        let last = short(plot.x_range.1);
        let x = plot.left + plot.width - Canvas::text_width(TextSize::Small, &last);
        canvas.caption((x, foot + 2.0), &last);
    }
}

impl Curve {
    fn finite(&self) -> Vec<(f64, f64)> {
        let finite = self.samples.iter().filter(|s| s.1.is_finite());
        finite.copied().collect()
    }
}

fn short(value: f64) -> String {
    match value.abs() {
        0.0 => "0".into(),
        size if !(1e-3..1e5).contains(&size) => format!("{value:.2e}"),
        size if size >= 100.0 => format!("{value:.0}"),
        _ => format!("{value:.4}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(samples: Vec<(f64, f64)>) -> Vec<u8> {
        let curve = Curve { name: "loss".into(), samples };
        let panel = CurvePanel { title: "Loss".into(), curves: vec![curve] };
        let curves =
            CurveChart { title: "Training".into(), subtitle: String::new(), panels: vec![panel] };
        curves.png().unwrap()
    }

    #[test]
    fn a_curve_is_drawn_and_gaps_are_left_out() {
        let falling: Vec<(f64, f64)> =
            (0..20).map(|i| (f64::from(i), 1.0 / f64::from(i + 1))).collect();
        let mut with_gap = falling.clone();
        with_gap.push((7.5, f64::NAN));
        assert_eq!(picture(falling.clone())[1..4], *b"PNG");
        assert_ne!(picture(falling.clone()), picture(vec![(0.0, 1.0), (19.0, 0.05)]));
        assert_eq!(picture(falling), {
            with_gap.sort_by(|a, b| a.0.total_cmp(&b.0));
            picture(with_gap)
        });
        assert_eq!(picture(Vec::new())[1..4], *b"PNG");
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!([0.0, 0.5, 1200.0, 2e-5].map(short), ["0", "0.5000", "1200", "2.00e-5"]);
    }
}
