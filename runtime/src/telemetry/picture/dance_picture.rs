//! The picture of a dance: the dancer and the robot on successive beats, how
//! fast the servos moved against the beats, and the joint tracks between their
//! limits. It shows whether the robot dances, on the beat, inside the limits.

use super::canvas::{Canvas, TextSize};
use super::plot::Plot;
use super::stick_figure::{StickFigure, draw_figure};
use super::style::{BEAT, HEADER, INK, KINEMATIC, LIMIT, MARGIN, PANEL, TRACK};

const WIDTH: u32 = 1800;
const FIGURE_HEIGHT: f32 = 210.0;
const SPEED_HEIGHT: f32 = 130.0;
const TRACK_HEIGHT: f32 = 84.0;
const TRACK_COLUMNS: usize = 2;
const LABEL_WIDTH: f32 = 170.0;

#[derive(Clone, Debug)]
pub struct BeatPose {
    pub time_s: f64,
    pub dancer: StickFigure,
    pub robot: StickFigure,
}

#[derive(Clone, Debug)]
pub struct JointTrack {
    pub name: String,
    pub lower_rad: f64,
    pub upper_rad: f64,
    /// Time in seconds and position in radians.
    pub samples: Vec<(f64, f64)>,
}

#[derive(Clone, Debug)]
pub struct DancePicture {
    pub title: String,
    pub subtitle: String,
    /// Start and end of the part of the song that is shown, seconds.
    pub window_s: (f64, f64),
    pub poses: Vec<BeatPose>,
    pub beats_s: Vec<f64>,
    pub kinematic_beats_s: Vec<f64>,
    /// Mean joint speed at the servos: seconds, radians a second.
    pub speed: Vec<(f64, f64)>,
    pub tracks: Vec<JointTrack>,
}

impl DancePicture {
    /// The picture as PNG bytes.
    pub fn png(&self) -> anyhow::Result<Vec<u8>> {
        let track_rows = self.tracks.len().div_ceil(TRACK_COLUMNS) as f32;
        let height = HEADER
            + 2.0 * (FIGURE_HEIGHT + 30.0)
            + SPEED_HEIGHT
            + 60.0
            + track_rows * (TRACK_HEIGHT + 14.0)
            + MARGIN;
        let mut canvas = Canvas::page(WIDTH, height, &self.title, &self.subtitle)?;

        let mut top = HEADER;
        top = self.figures(&mut canvas, top, "dancer, on the beat", |p| &p.dancer);
        top = self.figures(&mut canvas, top, "robot, at the servos", |p| &p.robot);
        top = self.speed(&mut canvas, top + 8.0);
        self.tracks(&mut canvas, top + 16.0);
        canvas.png()
    }

    fn figures(
        &self,
        canvas: &mut Canvas,
        top: f32,
        label: &str,
        pick: impl Fn(&BeatPose) -> &StickFigure,
    ) -> f32 {
        let width = WIDTH as f32 - 2.0 * MARGIN;
        canvas.rectangle(MARGIN, top, width, FIGURE_HEIGHT, PANEL);
        canvas.text((MARGIN + 8.0, top + 4.0), TextSize::Medium, INK, label);
        let cell = width / self.poses.len().max(1) as f32;
        // One size for all, in which the widest keeps to its cell.
        let most = FIGURE_HEIGHT - 36.0;
        let fits = |pose: &BeatPose| pick(pose).height_that_fits(cell, most);
        let height = self.poses.iter().map(fits).fold(most, f32::min);
        for (i, pose) in self.poses.iter().enumerate() {
            let center = MARGIN + cell * (i as f32 + 0.5);
            draw_figure(canvas, pick(pose), center, top + 24.0 + most - height, height);
            let time = format!("{:.1} s", pose.time_s);
            let x = center - Canvas::text_width(TextSize::Small, &time) / 2.0;
            canvas.caption((x, top + FIGURE_HEIGHT + 2.0), &time);
        }
        top + FIGURE_HEIGHT + 30.0
    }

    fn speed(&self, canvas: &mut Canvas, top: f32) -> f32 {
        let fastest = self.speed.iter().map(|s| s.1).fold(0.1, f64::max);
        let plot = Plot {
            left: MARGIN + LABEL_WIDTH,
            top,
            width: WIDTH as f32 - 2.0 * MARGIN - LABEL_WIDTH,
            height: SPEED_HEIGHT,
            x_range: self.window_s,
            y_range: (0.0, fastest * 1.1),
        };
        plot.panel(canvas, PANEL);
        plot.verticals(canvas, &self.beats_s, 2.0, BEAT);
        plot.curve(canvas, &self.speed, 2.0, TRACK);
        plot.marks(canvas, &self.speed, &self.kinematic_beats_s, 5.0, KINEMATIC);
        canvas.text((MARGIN, top), TextSize::Medium, INK, "mean joint speed");
        let legend = [("red: music beat", LIMIT), ("green: the robot's", KINEMATIC)];
        for (i, (text, rgba)) in legend.into_iter().enumerate() {
            let y = top + 22.0 * (i as f32 + 1.0);
            canvas.text((MARGIN, y), TextSize::Small, rgba, text);
        }
        let peak = format!("peak {fastest:.1} rad/s");
        canvas.caption((MARGIN, top + 66.0), &peak);
        top + SPEED_HEIGHT
    }

    fn tracks(&self, canvas: &mut Canvas, top: f32) {
        canvas.text(
            (MARGIN, top),
            TextSize::Medium,
            INK,
            "joint positions at the servos, between their limits (red)",
        );
        let column_width = (WIDTH as f32 - 2.0 * MARGIN) / TRACK_COLUMNS as f32;
        for (i, track) in self.tracks.iter().enumerate() {
            let left = MARGIN + column_width * (i % TRACK_COLUMNS) as f32;
            let row = (i / TRACK_COLUMNS) as f32;
            let y = top + 26.0 + row * (TRACK_HEIGHT + 14.0);
            self.track(canvas, track, left, y, column_width - 16.0);
        }
    }

    fn track(&self, canvas: &mut Canvas, track: &JointTrack, left: f32, top: f32, width: f32) {
        let room = 0.06 * (track.upper_rad - track.lower_rad);
        let plot = Plot {
            left: left + LABEL_WIDTH,
            top,
            width: width - LABEL_WIDTH,
            height: TRACK_HEIGHT,
            x_range: self.window_s,
            y_range: (track.lower_rad - room, track.upper_rad + room),
        };
        plot.panel(canvas, PANEL);
        plot.verticals(canvas, &self.beats_s, 1.0, BEAT);
        for limit in [track.lower_rad, track.upper_rad] {
            plot.horizontal(canvas, limit, 2.0, LIMIT);
        }
        plot.curve(canvas, &track.samples, 2.0, TRACK);
        canvas.text((left, top), TextSize::Medium, INK, &track.name);
        let range =
            format!("{:.0}..{:.0} deg", track.lower_rad.to_degrees(), track.upper_rad.to_degrees());
        canvas.caption((left, top + 20.0), &range);
    }
}
