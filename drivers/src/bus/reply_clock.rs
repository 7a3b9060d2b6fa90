//! By whose clock a reply is late: the one thing that a driver is told of a simulation.
//!
//! Real servos live by the clock on the wall, and so do simulated ones in real
//! time: then the driver knows nothing. In simulated time that clock says nothing,
//! because how long a reply takes depends on how busy the machine is. There the
//! simulation hands the driver a [`ReplyClock`] that says when nothing more will
//! come, and a reply is lost if and only if it was not given.

use std::fmt;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

const LOOK_EVERY: Duration = Duration::from_millis(1);

/// The far end of a line in simulated time.
pub trait FarEnd: Send + Sync {
    /// Whether all that was sent to it has been carried out, and all that it
    /// has to say is on the line.
    fn is_idle(&self) -> bool;

    /// The simulated time, seconds.
    fn time_s(&self) -> f64;
}

/// By whose clock a reply is late.
#[derive(Clone, Default)]
pub enum ReplyClock {
    /// The wall's: when the deadline has passed.
    #[default]
    Wall,
    /// The far end's: when it is idle.
    FarEnd(Arc<dyn FarEnd>),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Patience {
    pub until: Instant,
    /// Whether what does not come by then never will.
    pub last: bool,
}

impl ReplyClock {
    /// Seconds since some moment in the past: on the wall, or in the simulation.
    pub(crate) fn now_s(&self) -> f64 {
        static BEGAN: OnceLock<Instant> = OnceLock::new();
        match self {
            Self::Wall => BEGAN.get_or_init(Instant::now).elapsed().as_secs_f64(),
            Self::FarEnd(far_end) => far_end.time_s(),
        }
    }

    /// To be asked before each look at the port, so that whatever was said
    /// until it was asked is found there.
    pub fn patience(&self, deadline: Instant) -> Patience {
        match self {
            Self::Wall => Patience { until: deadline, last: true },
            Self::FarEnd(far_end) => {
                let last = far_end.is_idle();
                let now = Instant::now();
                Patience { until: if last { now } else { now + LOOK_EVERY }, last }
            }
        }
    }
}

impl PartialEq for ReplyClock {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Wall, Self::Wall) => true,
            (Self::FarEnd(one), Self::FarEnd(other)) => Arc::ptr_eq(one, other),
            _ => false,
        }
    }
}

impl fmt::Debug for ReplyClock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Wall => "Wall",
            Self::FarEnd(_) => "FarEnd",
        })
    }
}
