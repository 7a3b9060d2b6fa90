//! A moving picture of a dance: the dancer and the robot beside it, as GIF.
//!
//! Colours are those of a fixed cube of 252, so that every machine writes the
//! same bytes; after the first frame only what changed is written.

use super::canvas::{Canvas, TextSize};
use super::stick_figure::{StickFigure, draw_figure};
use super::style::{BEAT, INK, PAPER};
use gif::{Encoder, Frame, Repeat};
use std::borrow::Cow;
use std::io::Write;

/// Frames a second: GIF counts in hundredths.
pub const FRAMES_HZ: f64 = 12.5;
const WIDTH: u32 = 480;
const HEIGHT: u32 = 320;
const FIGURE_HEIGHT: f32 = 250.0;
const CUBE: [u32; 3] = [6, 7, 6];

#[derive(Clone, Debug)]
pub struct AnimationFrame {
    pub time_s: f64,
    pub since_beat_s: Option<f64>,
    pub human: Option<StickFigure>,
    pub robot: StickFigure,
}

pub struct Animation<W: Write> {
    encoder: Encoder<W>,
    title: String,
    last: Option<Vec<u8>>,
}

impl<W: Write> Animation<W> {
    pub fn new(writer: W, title: &str) -> anyhow::Result<Self> {
        let mut encoder = Encoder::new(writer, WIDTH as u16, HEIGHT as u16, &palette())?;
        encoder.set_repeat(Repeat::Infinite)?;
        Ok(Self { encoder, title: title.to_owned(), last: None })
    }

    pub fn push(&mut self, moment: &AnimationFrame) -> anyhow::Result<()> {
        let pixels = self.draw(moment)?;
        let (left, top, width, height) = match &self.last {
            Some(last) => changed(last, &pixels),
            None => (0, 0, WIDTH as usize, HEIGHT as usize),
        };
        let rows = (top..top + height).map(|y| &pixels[y * WIDTH as usize + left..][..width]);
        let frame = Frame {
            delay: (100.0 / FRAMES_HZ).round() as u16,
            left: left as u16,
            top: top as u16,
            width: width as u16,
            height: height as u16,
            buffer: Cow::Owned(rows.flatten().copied().collect()),
            ..Frame::default()
        };
        self.encoder.write_frame(&frame)?;
        self.last = Some(pixels);
        Ok(())
    }

    pub fn finish(self) -> anyhow::Result<W> {
        Ok(self.encoder.into_inner()?)
    }

    fn draw(&self, moment: &AnimationFrame) -> anyhow::Result<Vec<u8>> {
        let canvas = Canvas::new(WIDTH, HEIGHT, PAPER);
        let mut canvas = canvas.ok_or_else(|| anyhow::anyhow!("no room for a picture"))?;
        canvas.text((16.0, 10.0), TextSize::Medium, INK, &self.title);
        let clock = format!("{:.1} s", moment.time_s);
        let right = WIDTH as f32 - 16.0;
        let at = right - Canvas::text_width(TextSize::Small, &clock);
        canvas.caption((at, HEIGHT as f32 - 26.0), &clock);
        if let Some(since_s) = moment.since_beat_s {
            let radius = 3.0 + 6.0 * (-since_s / 0.15).exp() as f32;
            canvas.dot((right - 8.0, 18.0), radius, [BEAT[0], BEAT[1], BEAT[2], 255]);
        }
        let top = 36.0;
        if let Some(human) = &moment.human {
            draw_figure(&mut canvas, human, WIDTH as f32 * 0.3, top, FIGURE_HEIGHT);
        }
        let beside = if moment.human.is_some() { 0.7 } else { 0.5 };
        let robot = &moment.robot;
        draw_figure(&mut canvas, robot, WIDTH as f32 * beside, top, FIGURE_HEIGHT);
        Ok(canvas.rgba().chunks_exact(4).map(nearest).collect())
    }
}

/// Left, top, width and height of what differs; one pixel where nothing does.
fn changed(before: &[u8], now: &[u8]) -> (usize, usize, usize, usize) {
    let width = WIDTH as usize;
    let differing = (0..now.len()).filter(|i| before[*i] != now[*i]);
    let (mut low, mut high) = ([usize::MAX; 2], [0; 2]);
    for i in differing {
        for (axis, value) in [i % width, i / width].into_iter().enumerate() {
            low[axis] = low[axis].min(value);
            high[axis] = high[axis].max(value);
        }
    }
    match low[0] == usize::MAX {
        true => (0, 0, 1, 1),
        false => (low[0], low[1], high[0] - low[0] + 1, high[1] - low[1] + 1),
    }
}

fn palette() -> Vec<u8> {
    let [reds, greens, blues] = CUBE;
    let level = |step: u32, steps: u32| (step * 255 / (steps - 1)) as u8;
    let mut palette = Vec::new();
    for r in 0..reds {
        for g in 0..greens {
            for b in 0..blues {
                palette.extend([level(r, reds), level(g, greens), level(b, blues)]);
            }
        }
    }
    palette
}

fn nearest(rgba: &[u8]) -> u8 {
    let step = |channel: usize| {
        let steps = CUBE[channel] - 1;
        (u32::from(rgba[channel]) * steps + 127) / 255
    };
    ((step(0) * CUBE[1] + step(1)) * CUBE[2] + step(2)) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::telemetry::picture::style::FAINT;

    #[test]
    fn the_nearest_colour_is_near() {
        let palette = palette();
        assert_eq!(palette.len(), 252 * 3);
        for rgba in [PAPER, INK, FAINT, [0, 0, 0, 255], [255, 255, 255, 255]] {
            let place = usize::from(nearest(&rgba)) * 3;
            let found = &palette[place..place + 3];
            let off = |(a, b): (&u8, &u8)| a.abs_diff(*b);
            let worst = found.iter().zip(&rgba).map(off).max();
            assert!(worst <= Some(26), "{rgba:?} {found:?}");
        }
    }

    #[test]
    fn a_decoder_sees_every_moment() {
        let robot = StickFigure { height_m: 1.0, ..StickFigure::default() };
        let mut animation = Animation::new(Vec::new(), "title").unwrap();
        for i in 0..5 {
            let moment = AnimationFrame {
                time_s: f64::from(i),
                since_beat_s: Some(0.0),
                human: None,
                robot: robot.clone(),
            };
            animation.push(&moment).unwrap();
        }
        let bytes = animation.finish().unwrap();
        let mut decoder = gif::DecodeOptions::new().read_info(&bytes[..]).unwrap();
        assert_eq!((decoder.width(), decoder.height()), (480, 320));
        let mut sizes = Vec::new();
        while let Some(frame) = decoder.read_next_frame().unwrap() {
            sizes.push(usize::from(frame.width) * usize::from(frame.height));
        }
        assert_eq!((sizes.len(), sizes[0]), (5, 480 * 320));
        assert!(sizes[1] < 2000, "only the clock changes: {sizes:?}");
    }
}
