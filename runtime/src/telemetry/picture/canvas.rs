//! A drawing surface: lines, dots and text on a pixmap, in pixels from the
//! top left.

use super::style::{FAINT, INK, MARGIN, PAPER, Rgba};
use anyhow::Context;
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};
use tiny_skia::{
    Color, FillRule, LineCap, LineJoin, Paint, PathBuilder, Pixmap, Rect, Stroke, Transform,
};

pub type Point = (f32, f32);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TextSize {
    Small,
    Medium,
    Large,
}

impl TextSize {
    const fn raster(self) -> (FontWeight, RasterHeight) {
        match self {
            TextSize::Small => (FontWeight::Regular, RasterHeight::Size16),
            TextSize::Medium => (FontWeight::Bold, RasterHeight::Size16),
            TextSize::Large => (FontWeight::Bold, RasterHeight::Size24),
        }
    }
}

pub struct Canvas {
    pixmap: Pixmap,
}

impl Canvas {
    /// A canvas of one colour; `None` if a side is zero or the whole too large.
    pub fn new(width: u32, height: u32, background: Rgba) -> Option<Self> {
        let mut pixmap = Pixmap::new(width, height)?;
        pixmap.fill(color(background));
        Some(Self { pixmap })
    }

    pub fn page(width: u32, height: f32, title: &str, subtitle: &str) -> anyhow::Result<Self> {
        let canvas = Self::new(width, height as u32, PAPER);
        let mut canvas = canvas.context("the picture is too large")?;
        canvas.text((MARGIN, 22.0), TextSize::Large, INK, title);
        canvas.caption((MARGIN, 56.0), subtitle);
        Ok(canvas)
    }

    pub fn line(&mut self, points: &[Point], width: f32, rgba: Rgba) {
        let mut builder = PathBuilder::new();
        for &(x, y) in points {
            match builder.is_empty() {
                true => builder.move_to(x, y),
                false => builder.line_to(x, y),
            }
        }
        let Some(path) = builder.finish() else { return };
        let stroke = Stroke {
            width,
            line_cap: LineCap::Round,
            line_join: LineJoin::Round,
            ..Stroke::default()
        };
        self.pixmap.stroke_path(&path, &paint(rgba), &stroke, Transform::identity(), None);
    }

    pub fn dot(&mut self, (x, y): Point, radius: f32, rgba: Rgba) {
        if let Some(path) = PathBuilder::from_circle(x, y, radius) {
            self.pixmap.fill_path(
                &path,
                &paint(rgba),
                FillRule::Winding,
                Transform::identity(),
                None,
            );
        }
    }

    pub fn rectangle(&mut self, left: f32, top: f32, width: f32, height: f32, rgba: Rgba) {
        if let Some(rect) = Rect::from_xywh(left, top, width, height) {
            self.pixmap.fill_rect(rect, &paint(rgba), Transform::identity(), None);
        }
    }

    /// Small text in the fainter colour, as below figures.
    pub fn caption(&mut self, at: Point, text: &str) {
        self.text(at, TextSize::Small, FAINT, text);
    }

    /// Text with its top left at the point. Letters outside Latin-1 become `?`.
    pub fn text(&mut self, (x, y): Point, size: TextSize, rgba: Rgba, text: &str) {
        let (weight, height) = size.raster();
        let advance = get_raster_width(weight, height);
        for (i, letter) in text.chars().enumerate() {
            let raster =
                get_raster(letter, weight, height).or_else(|| get_raster('?', weight, height));
            let Some(raster) = raster else { continue };
            for (row, line) in raster.raster().iter().enumerate() {
                for (column, &intensity) in line.iter().enumerate() {
                    let px = x as i64 + (i * advance + column) as i64;
                    self.blend(px, y as i64 + row as i64, rgba, intensity);
                }
            }
        }
    }

    pub fn text_width(size: TextSize, text: &str) -> f32 {
        let (weight, height) = size.raster();
        (get_raster_width(weight, height) * text.chars().count()) as f32
    }

    pub fn png(&self) -> anyhow::Result<Vec<u8>> {
        Ok(self.pixmap.encode_png()?)
    }

    pub fn rgba(&self) -> &[u8] {
        self.pixmap.data()
    }

    fn blend(&mut self, x: i64, y: i64, rgba: Rgba, intensity: u8) {
        let (width, height) = (self.pixmap.width() as i64, self.pixmap.height() as i64);
        if intensity == 0 || x < 0 || y < 0 || x >= width || y >= height {
            return;
        }
        let alpha = u32::from(intensity) * u32::from(rgba[3]) / 255;
        let at = ((y * width + x) * 4) as usize;
        let pixel = &mut self.pixmap.data_mut()[at..at + 4];
        for channel in 0..3 {
            let mixed =
                u32::from(rgba[channel]) * alpha + u32::from(pixel[channel]) * (255 - alpha);
            pixel[channel] = (mixed / 255) as u8;
        }
        pixel[3] = 255;
    }
}

fn color([r, g, b, a]: Rgba) -> Color {
    Color::from_rgba8(r, g, b, a)
}

fn paint(rgba: Rgba) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color(color(rgba));
    paint.anti_alias = true;
    paint
}
