//! A moving picture of a dance: the dancer and the robot beside it, as GIF; the pictures of a
//! film are the same, larger.
//!
//! One palette for all frames, made from some of them, so that a colour is the same from
//! frame to frame; after the first frame only what changed is written.

use super::canvas::{Canvas, TextSize};
use super::gif_palette::{GifPalette, TRANSPARENT};
use super::stick_figure::{StickFigure, draw_figure};
use super::style::{BEAT, INK, PAPER};
use gif::{Encoder, Frame, Repeat};
use std::borrow::Cow;
use std::io::Write;

/// Frames a second: GIF counts in hundredths.
pub const FRAMES_HZ: f64 = 25.0;
pub const WIDTH: u32 = 480;
pub const HEIGHT: u32 = 320;
const FIGURE_HEIGHT: f32 = 250.0;
/// Frames that the palette is made from.
const SAMPLED: usize = 12;

#[derive(Clone, Debug)]
pub struct AnimationFrame {
    pub time_s: f64,
    pub since_beat_s: Option<f64>,
    pub human: Option<StickFigure>,
    pub robot: StickFigure,
}

/// Writes the moments as one GIF that begins anew at its end.
pub fn write_animation<W: Write>(
    writer: W,
    title: &str,
    moments: &[AnimationFrame],
) -> anyhow::Result<W> {
    let step = moments.len().div_ceil(SAMPLED).max(1);
    let sampled: anyhow::Result<Vec<_>> =
        moments.iter().step_by(step).map(|moment| draw(title, moment, 1)).collect();
    let mut palette = GifPalette::new(&sampled?.concat());
    let mut encoder = Encoder::new(writer, WIDTH as u16, HEIGHT as u16, &palette.colours())?;
    encoder.set_repeat(Repeat::Infinite)?;
    let mut last = None;
    for moment in moments {
        let pixels = palette.indices(&draw(title, moment, 1)?);
        encoder.write_frame(&frame(&pixels, last.as_deref()))?;
        last = Some(pixels);
    }
    Ok(encoder.into_inner()?)
}

/// What differs from the frame before.
fn frame(pixels: &[u8], last: Option<&[u8]>) -> Frame<'static> {
    let (left, top, width, height) = match last {
        Some(last) => changed(last, pixels),
        None => (0, 0, WIDTH as usize, HEIGHT as usize),
    };
    let shown = |at: usize| match last {
        Some(last) if last[at] == pixels[at] => TRANSPARENT,
        _ => pixels[at],
    };
    let rows = (top..top + height).map(|y| y * WIDTH as usize + left);
    Frame {
        delay: (100.0 / FRAMES_HZ).round() as u16,
        left: left as u16,
        top: top as u16,
        width: width as u16,
        height: height as u16,
        transparent: Some(TRANSPARENT),
        buffer: Cow::Owned(rows.flat_map(|row| (row..row + width).map(shown)).collect()),
        ..Frame::default()
    }
}

/// One moment as red, green, blue and alpha, `scale` times as large as in a GIF.
pub fn draw(title: &str, moment: &AnimationFrame, scale: u32) -> anyhow::Result<Vec<u8>> {
    let (width, height) = (WIDTH * scale, HEIGHT * scale);
    let canvas = Canvas::new(width, height, PAPER);
    let mut canvas = canvas.ok_or_else(|| anyhow::anyhow!("no room for a picture"))?;
    let by = |length: f32| length * scale as f32;
    let large = if scale > 1 { TextSize::Large } else { TextSize::Medium };
    canvas.text((by(16.0), by(10.0)), large, INK, title);
    let clock = format!("{:.1} s", moment.time_s);
    let right = width as f32 - by(16.0);
    let at = right - Canvas::text_width(TextSize::Small, &clock);
    canvas.caption((at, height as f32 - 26.0), &clock);
    if let Some(since_s) = moment.since_beat_s {
        let radius = by(3.0 + 6.0 * (-since_s / 0.15).exp() as f32);
        canvas.dot((right - by(8.0), by(18.0)), radius, [BEAT[0], BEAT[1], BEAT[2], 255]);
    }
    let (top, tall) = (by(36.0), by(FIGURE_HEIGHT));
    if let Some(human) = &moment.human {
        draw_figure(&mut canvas, human, width as f32 * 0.3, top, tall);
    }
    let beside = if moment.human.is_some() { 0.7 } else { 0.5 };
    draw_figure(&mut canvas, &moment.robot, width as f32 * beside, top, tall);
    Ok(canvas.rgba().to_vec())
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::telemetry::picture::stick_figure::{Limb, Side};

    fn moments(count: usize) -> Vec<AnimationFrame> {
        let limb = |side, y: f64, tilt: f64| Limb {
            from: [0.0, y, 0.1],
            to: [0.2 * tilt, y + 0.3 * tilt, 0.9],
            radius_m: 0.06,
            side,
        };
        let moment = |i: usize| {
            let tilt = (i as f64 / 3.0).sin();
            let sides = [(Side::Left, 0.3), (Side::Middle, 0.0), (Side::Right, -0.3)];
            let limbs = sides.map(|(side, y)| limb(side, y, tilt)).to_vec();
            let robot = StickFigure { limbs, height_m: 1.0, ..StickFigure::default() };
            let since_beat_s = Some(i as f64 * 0.04 % 0.5);
            AnimationFrame { time_s: i as f64, since_beat_s, human: Some(robot.clone()), robot }
        };
        (0..count).map(moment).collect()
    }

    /// What a viewer shows, frame after frame: red, green, blue, alpha.
    fn shown(gif: &[u8]) -> Vec<Vec<u8>> {
        let mut options = gif::DecodeOptions::new();
        options.set_color_output(gif::ColorOutput::RGBA);
        let mut decoder = options.read_info(gif).unwrap();
        assert_eq!((decoder.width(), decoder.height()), (WIDTH as u16, HEIGHT as u16));
        let mut screen = vec![0; (WIDTH * HEIGHT * 4) as usize];
        let mut screens = Vec::new();
        while let Some(frame) = decoder.read_next_frame().unwrap() {
            for (n, pixel) in frame.buffer.chunks_exact(4).enumerate().filter(|(_, p)| p[3] > 0) {
                let (x, y) = (n % usize::from(frame.width), n / usize::from(frame.width));
                let row = (usize::from(frame.top) + y) * WIDTH as usize;
                let at = 4 * (row + usize::from(frame.left) + x);
                screen[at..at + 4].copy_from_slice(pixel);
            }
            screens.push(screen.clone());
        }
        screens
    }

    #[test]
    fn every_pixel_of_every_frame_has_nearly_its_colour_and_no_grey_turns_green() {
        let moments = moments(50);
        let screens = shown(&write_animation(Vec::new(), "title", &moments).unwrap());
        assert_eq!(screens.len(), moments.len());
        let (mut worst, mut greenest) = (0, 0);
        for (moment, screen) in moments.iter().zip(&screens) {
            let wanted = draw("title", moment, 1).unwrap();
            for (shown, wanted) in screen.chunks_exact(4).zip(wanted.chunks_exact(4)) {
                let off = |n: usize| shown[n].abs_diff(wanted[n]);
                worst = worst.max(off(0).max(off(1)).max(off(2)));
                let green = |p: &[u8]| i16::from(p[1]) - i16::from(p[0].max(p[2]));
                greenest = greenest.max(green(shown) - green(wanted).max(0));
            }
        }
        assert!(worst <= 16, "{worst} of 255 off");
        assert!(greenest <= 3, "{greenest} of 255 greener than drawn");
    }

    #[test]
    fn only_what_changes_is_written() {
        let still: Vec<_> = moments(5).iter().map(|_| moments(1).remove(0)).collect();
        let gif = write_animation(Vec::new(), "title", &still).unwrap();
        let mut decoder = gif::DecodeOptions::new().read_info(&gif[..]).unwrap();
        let mut sizes = Vec::new();
        while let Some(frame) = decoder.read_next_frame().unwrap() {
            sizes.push((frame.width, frame.height));
        }
        assert_eq!((sizes.len(), sizes[0]), (5, (WIDTH as u16, HEIGHT as u16)));
        assert!(sizes[1..].iter().all(|size| *size == (1, 1)), "{sizes:?}");
    }
}
