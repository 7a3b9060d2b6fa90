//! Pictures: of a dance, moving ones, charts and sheets of poses.

pub(crate) mod animation;
mod canvas;
mod contact_sheet;
mod curve_chart;
mod dance_picture;
mod dot_chart;
mod gif_palette;
mod human_figure;
mod plot;
pub(crate) mod robot_figure;
mod stick_figure;
mod style;

pub use contact_sheet::{ContactSheet, PoseRow};
pub use curve_chart::{Curve, CurveChart, CurvePanel};
pub(crate) use dance_picture::{BeatPose, DancePicture, JointTrack};
pub use dot_chart::{Dot, DotChart, DotPanel};
pub use stick_figure::StickFigure;
