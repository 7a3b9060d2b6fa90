//! 22 human joints to any robot's joints, inside every limit.
//!
//! [`Retargeter`] takes [`servodance_types::MotionFrame`]s at 20 Hz and gives
//! joint positions every control cycle; [`RobotModel`] is the robot's tree for
//! pictures and figures. Radians, metres, seconds; robot axes are x forward,
//! y left, z up.
//!
//! | folder | what is in it |
//! |---|---|
//! | `description/` | URDF and MJCF: one parse, one repair; body parts guessed, oddities found, a first configuration |
//! | `kinematics/` | the chain (forward kinematics), the Jacobian, which link is which body part |
//! | `dancer/` | frames as a spline, baseline posture, what a pose asks of the robot |
//! | `solver/` | whole-body inverse kinematics as boxed least squares, search for better arms |
//! | `limits/` | position, velocity, acceleration and jerk limits of every cycle; arms kept off the body |
//! | `contact/` | planted stance, steps, pelvis, balance, capsules |
//! | `dynamics/` | torque and heat of the motors, estimated |
//! | `evaluation/` | angles between the limbs of robot and dancer |
//! | `retargeter/` | all of it, one control cycle at a time |
//!
//! ```
//! use servodance_retarget::{RetargetConfig, Retargeter};
//! use servodance_types::{BodyJoint::*, JointLimits, MotionFrame};
//!
//! let urdf = r#"<robot name="arm"><link name="base"/><link name="upper"/><link name="elbow"/>
//!     <joint name="lift" type="revolute"><parent link="base"/><child link="upper"/>
//!     <axis xyz="1 0 0"/><limit lower="0" upper="2" effort="1" velocity="3"/></joint>
//!     <joint name="tube" type="fixed"><origin xyz="0 0 -0.3"/>
//!     <parent link="upper"/><child link="elbow"/></joint></robot>"#;
//! let mut config = RetargetConfig::default();
//! config.body.left_shoulder = Some("upper".into());
//! config.body.left_elbow = Some("elbow".into());
//! let limits = JointLimits { lower_rad: 0.0, upper_rad: 2.0, velocity_rad_s: 3.0, acceleration_rad_s2: 20.0 };
//! let mut robot = Retargeter::new(urdf, &config, &[("lift".into(), limits)], 100.0)?;
//!
//! let mut t_pose = MotionFrame { time_s: 0.0, positions: [[0.0; 3]; 22], contacts: Default::default() };
//! for (joint, left_m) in [(LeftShoulder, 0.2), (LeftElbow, 0.5), (RightShoulder, -0.2), (RightElbow, -0.5)] {
//!     t_pose.positions[joint as usize] = [left_m, 1.4, 0.0]; // x to the left, y up
//! }
//! let mut angles_rad = robot.rest().to_vec();
//! for cycle in 0..300 {
//!     t_pose.time_s = f64::from(cycle) / 20.0;
//!     robot.push(&t_pose);
//!     robot.next(f64::from(cycle) / 100.0, &mut angles_rad)?;
//! }
//! assert!((angles_rad[0] - std::f64::consts::FRAC_PI_2).abs() < 0.1, "{angles_rad:?}");
//! # Ok::<(), servodance_retarget::RetargetError>(())
//! ```
//!
//! Real-time promise: [`Retargeter::next`] neither allocates nor blocks. What
//! is refused: see [`RetargetError`]; nothing here panics on any robot
//! description or motion. `k` gives the joint tree and the forward kinematics
//! that ours is checked against, `nalgebra` (through `k`) vectors and rotations.
//! Talking to servos is the `drivers` crate's work.

mod balance;
mod config;
mod contact;
mod dancer;
mod description;
mod dynamics;
mod evaluation;
mod kinematics;
mod limits;
mod retargeter;
mod solver;

pub use balance::{BalanceFeedback, LegServo};
pub use config::{
    BodyKind, BodyLinks, CapsuleConfig, Gains, JointCoupling, Limb, RetargetConfig, RetargetError,
    RodConfig, Stance, TaskWeights, Tip, TorqueConfig, WheelConfig,
};
pub use dancer::{BodyPoints, PostureReader, surrounding_postures};
pub use description::body_guess::{BodyGuess, guess_body};
pub use description::diagnostic::{Diagnostic, DiagnosticCode, DiagnosticSeverity};
pub use description::draft::{
    ConfigDraft, DraftOptions, JointDraft, JointUse, draft_config, rest_deg,
};
pub use description::guess::words::link_sides;
pub use description::guess::{MeshReader, no_meshes};
pub use description::lint::{lint, lint_limits};
pub use description::mjcf::{is_mjcf, urdf_from_mjcf, with_includes};
pub use dynamics::{JointLoad, TorqueReport};
pub use evaluation::{LimbDirectionError, LimbSegment};
pub use k::nalgebra;
pub use kinematics::{MeshVisual, RobotModel, Shape, Visual};
pub use retargeter::Retargeter;
pub use retargeter::counts::RetargetCounts;
