//! Motion data in, MAGMA weights out: what a researcher needs beside the robot.
//!
//! - [`motion`]: importers of AIST++, HumanML3D, SMPL (AMASS), BVH, Acclaim and
//!   npz onto the 22-joint skeleton, with checks and the tempo of a motion.
//! - [`choreography`]: dance by rule on given beats, for data that nobody has to
//!   license.
//! - `dataset`: a folder of clips with its index, and the training file that
//!   joins motion and music.
//! - `train`: training of both networks, VQ-VAE and MotionSeq, on an own
//!   autodiff tape; `runs` adds settings files, folders, curves and resuming.
//! - `metrics`: figures of motion as the literature defines them; `evaluate`
//!   and `ablate` apply them to a generator, `weights` to number formats.
//!
//! Without the feature `candle` there are [`motion`], [`choreography`] and [`song_file`]: what
//! a program that only dances needs.
//!
//! Units: metres, seconds and radians, y up, 20 frames a second. Networks that
//! dance are in `servodance_model`; that crate reads the weights written here.
//! No crate of the product depends on this one.
//!
//! ```
//! use servodance_training::choreography::{DanceBeat, DanceStyle, choreograph};
//!
//! // Sixteen seconds of disco at 120 beats a minute, seed 1.
//! let beat = |i| DanceBeat { time_s: 0.5 * f64::from(i), downbeat: i % 4 == 0 };
//! let beats: Vec<DanceBeat> = (2..32).map(beat).collect();
//! let clip = choreograph(&beats, 16.0, DanceStyle::Disco, 1);
//! assert_eq!((clip.fps, clip.poses.len()), (20.0, 321));
//! ```

#[cfg(feature = "candle")]
pub mod ablate;
pub mod choreography;
#[cfg(feature = "candle")]
pub mod dataset;
#[cfg(feature = "candle")]
pub mod evaluate;
#[cfg(all(test, feature = "candle"))]
#[path = "../../model/src/conditioning/golden.rs"]
mod golden;
#[cfg(feature = "candle")]
pub mod metrics;
pub mod motion;
#[cfg(feature = "candle")]
pub mod runs;
pub mod song_file;
#[cfg(feature = "candle")]
pub mod train;
#[cfg(feature = "candle")]
pub mod weights;
