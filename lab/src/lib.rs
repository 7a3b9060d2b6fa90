//! What judges servodance: [`mod@bench`] measures its parts, [`soak`] dances for
//! hours in simulation under a random fault plan.
//!
//! No crate of the product depends on this one; the command line calls it. All
//! verdicts come from outside the code that is judged: the simulated servos'
//! own counts, the clock, the allocator, resident memory.
//!
//! ```
//! use servodance_lab::bench::retarget;
//! use servodance_runtime::robot::Robot;
//!
//! let robot = Robot::load("neck")?;
//! let clip = retarget::motion(None, 5.0)?; // five seconds of choreography
//! let report = retarget::run(&robot, &clip)?;
//! assert!(report.us_p50 <= report.us_p99);
//! assert_eq!(report.allocations, 0);
//! # Ok::<(), anyhow::Error>(())
//! ```

pub mod bench;
pub mod soak;
