//! 22 human joints to any robot's joints, inside every limit.
//!
//! [`Retargeter`] takes [`servodance_types::MotionFrame`]s at 20 Hz and gives
//! joint positions every control cycle; [`RobotModel`] is the robot's tree for
//! pictures and figures. Radians, metres, seconds; robot axes are x forward,
//! y left, z up.
//!
//! Real-time promise: [`Retargeter::next`] neither allocates nor blocks. What
//! it refuses: see [`RetargetError`]; nothing here panics on any robot
//! description or motion. Talking to servos is the `drivers` crate's work.

mod arm_search;
mod balance;
mod body;
mod body_solver;
mod collision;
mod columns;
mod config;
mod counts;
mod draft;
mod effort;
mod envelope;
mod error;
mod finding;
mod guard;
mod guess;
mod human;
mod likeness;
mod limb;
mod lint;
mod mjcf;
mod model;
mod pelvis;
mod preview;
mod retargeter;
mod solver;
mod stepper;
mod stream;
mod tracker;
mod urdf;
mod usual;

pub use config::{
    BodyLinks, CapsuleConfig, Couple, Gains, Limb, RetargetConfig, Stance, Tip, TorqueConfig,
    Weights,
};
pub use counts::Counts;
pub use draft::{Draft, DraftJoint, Role, draft, rest_deg};
pub use effort::EffortReport;
pub use error::RetargetError;
pub use finding::{Code, Finding, Severity};
pub use k::nalgebra;
pub use likeness::{Likeness, Segment};
pub use lint::{lint, lint_limits};
pub use mjcf::{is_mjcf, urdf_from_mjcf};
pub use model::{MeshVisual, RobotModel, Shape, Visual};
pub use retargeter::Retargeter;
pub use stream::Points;
pub use usual::PostureReader;
