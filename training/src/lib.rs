//! Motion data in, MAGMA weights out: what a researcher needs beside the robot.
//!
//! - [`motion`]: importers of AIST++, HumanML3D, SMPL (AMASS), BVH, Acclaim and
//!   npz onto the 22-joint skeleton, with checks and the tempo of a motion.
//! - [`choreography`]: dance by rule on given beats, for data that nobody has to
//!   license.
//! - [`dataset`]: a folder of clips with its index, and the training file that
//!   joins motion and music.
//! - [`train`]: training of both networks, VQ-VAE and MotionSeq, on an own
//!   autodiff tape; [`runs`] adds settings files, folders, curves and resuming.
//! - [`metrics`]: figures of motion as the literature defines them; [`evaluate`]
//!   and [`ablate`] apply them to a generator, [`weights`] to number formats.
//!
//! Units: metres, seconds and radians, y up, 20 frames a second. Networks that
//! dance are in `servodance_model`; that crate reads the weights written here.
//! No crate of the product depends on this one.
//!
//! ```
//! use servodance_training::choreography::{DanceBeat, DanceStyle, choreograph};
//! use servodance_training::metrics::quality::foot_skate_ratio;
//!
//! // Sixteen seconds of disco at 120 beats a minute, seed 1.
//! let beat = |i| DanceBeat { time_s: 0.5 * f64::from(i), downbeat: i % 4 == 0 };
//! let beats: Vec<DanceBeat> = (2..32).map(beat).collect();
//! let clip = choreograph(&beats, 16.0, DanceStyle::Disco, 1);
//! assert_eq!((clip.fps, clip.poses.len()), (20.0, 321));
//!
//! let skating = foot_skate_ratio(&clip).expect("the feet touch the floor");
//! assert!(skating < 0.1, "planted toes do not slide");
//! ```

pub mod ablate;
pub mod choreography;
pub mod dataset;
pub mod evaluate;
#[cfg(test)]
#[path = "../../model/src/conditioning/golden.rs"]
mod golden;
pub mod metrics;
pub mod motion;
pub mod runs;
pub mod train;
pub mod weights;
