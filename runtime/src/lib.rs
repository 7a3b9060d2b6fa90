//! A whole dance: audio in, servo commands out, with everything around it.
//!
//! ```text
//! audio -> pipeline (features, generator) -> control (retargeter, limits, bus) -> servos
//!                                               |-> telemetry, viewer
//! ```
//!
//! [`session`] wires one dance after another from a configuration, [`pipeline`]
//! makes motion from sound, [`control`] runs the fixed-rate loop, [`offline`] does
//! what needs no moving robot, [`bus_tools`] and [`doctor`] look at buses and at the
//! machine. Seconds, radians, metres; 20 motion frames a second; control cycles at
//! the rate of the robot file. The parts are crates of their own: for the model
//! alone use `servodance-model`, for a bus alone `servodance-drivers`.
//!
//! Four seconds of the built-in song, danced by a pan-tilt neck on simulated servos,
//! which count every broken limit:
//!
//! ```
//! use servodance_runtime::{robot::Robot, session::fault_run::FaultRun};
//!
//! let robot = Robot::load("neck")?;
//! let generator = servodance_model::Generator::built_in()?;
//! let mut song = servodance_audio::song::Song::demo();
//! song.samples.truncate(4 * song.sample_rate_hz as usize);
//! let result = FaultRun::new(&robot, &generator, song).run(&false.into(), |_| ())?;
//! assert_eq!(result.stopped_by, None);
//! assert_eq!(result.violations, Default::default());
//! # anyhow::Ok(())
//! ```

// A reader that goes away is no reason to panic: see `process::console`.
#![deny(clippy::print_stdout, clippy::print_stderr)]

pub mod bus_tools;
pub mod control;
pub mod doctor;
pub mod offline;
pub mod physics;
pub mod pipeline;
pub mod process;
pub mod robot;
pub mod session;
#[cfg(feature = "stage")]
pub mod show;
#[cfg(feature = "stage")]
pub mod stage;
pub mod telemetry;
pub mod viewer;
pub mod world;
