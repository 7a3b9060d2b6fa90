//! A sheet of many motions at a glance: a row of poses each, and a histogram.

use super::canvas::{Canvas, Point, TextSize};
use super::stick_figure::{StickFigure, draw_figure};
use super::style::{FAINT, HEADER, INK, MARGIN, PANEL, TRACK};

const WIDTH: u32 = 1800;
const ROW_HEIGHT: f32 = 150.0;
const LABEL_WIDTH: f32 = 300.0;
const BARS_HEIGHT: f32 = 150.0;

#[derive(Clone, Debug)]
#[allow(missing_docs)] // the names say it
pub struct PoseRow {
    pub label: Vec<String>,
    pub figures: Vec<StickFigure>,
}

#[derive(Clone, Debug)]
#[allow(missing_docs)] // the names say it
pub struct ContactSheet {
    pub title: String,
    pub subtitle: String,
    /// What the bars count, and each bar's name and height; `None` for none.
    pub bars: Option<(String, Vec<(String, f64)>)>,
    pub rows: Vec<PoseRow>,
}

impl ContactSheet {
    /// The sheet as PNG bytes.
    pub fn png(&self) -> anyhow::Result<Vec<u8>> {
        let rows = self.rows.len() as f32;
        let bars = self.bars.as_ref().map_or(0.0, |_| BARS_HEIGHT + 60.0);
        let height = HEADER + bars + rows * (ROW_HEIGHT + 8.0) + MARGIN;
        let mut canvas = Canvas::page(WIDTH, height, &self.title, &self.subtitle)?;
        let mut top = self.bars(&mut canvas, HEADER);
        for row in &self.rows {
            row.draw(&mut canvas, top);
            top += ROW_HEIGHT + 8.0;
        }
        canvas.png()
    }

    fn bars(&self, canvas: &mut Canvas, top: f32) -> f32 {
        let Some((title, bars)) = &self.bars else { return top };
        canvas.text((MARGIN, top), TextSize::Medium, INK, title);
        let (left, width) = (MARGIN, WIDTH as f32 - 2.0 * MARGIN);
        let panel = top + 24.0;
        canvas.rectangle(left, panel, width, BARS_HEIGHT, PANEL);
        let highest = bars.iter().map(|bar| bar.1).fold(1e-9, f64::max);
        let step = width / bars.len().max(1) as f32;
        for (i, (name, value)) in bars.iter().enumerate() {
            let x = left + step * i as f32;
            let tall = (BARS_HEIGHT - 40.0) * (value / highest) as f32;
            let foot = panel + BARS_HEIGHT - 22.0;
            canvas.rectangle(x + 4.0, foot - tall, step - 8.0, tall, TRACK);
            let mut centred = |text: &str, y: f32| {
                let half = Canvas::text_width(TextSize::Small, text) / 2.0;
                let at: Point = (x + step / 2.0 - half, y);
                canvas.caption(at, text);
            };
            centred(name, foot + 2.0);
            if *value > 0.0 {
                centred(&format!("{value:.1}"), foot - tall - 18.0);
            }
        }
        panel + BARS_HEIGHT + 16.0
    }
}

impl PoseRow {
    fn draw(&self, canvas: &mut Canvas, top: f32) {
        let width = WIDTH as f32 - 2.0 * MARGIN;
        canvas.rectangle(MARGIN, top, width, ROW_HEIGHT, PANEL);
        for (i, line) in self.label.iter().enumerate() {
            let (size, rgba) = match i {
                0 => (TextSize::Medium, INK),
                _ => (TextSize::Small, FAINT),
            };
            let at = (MARGIN + 8.0, top + 8.0 + 20.0 * i as f32);
            canvas.text(at, size, rgba, line);
        }
        let cell = (width - LABEL_WIDTH) / self.figures.len().max(1) as f32;
        for (i, figure) in self.figures.iter().enumerate() {
            let center = MARGIN + LABEL_WIDTH + cell * (i as f32 + 0.5);
            draw_figure(canvas, figure, center, top + 4.0, ROW_HEIGHT - 8.0);
        }
    }
}
