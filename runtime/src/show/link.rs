//! The ends of the line between the control loop and those who watch.
//!
//! - Snapshots go out through a **triple buffer**: the newest is all that
//!   counts, so nobody waits for anybody. The writer copies into one of three
//!   snapshots (no allocation) and swaps it in with one atomic operation,
//!   whether the reader is fast, slow or gone.
//! - Requests come in through a bounded **ring**: each one counts, none may be
//!   skipped, and taking from an empty ring is one atomic load. When it is full
//!   the asker is told so.
//! - The emergency stop goes past both ([`EStop`]): a flag that the safety layer
//!   reads in every tick.

use super::request::{Request, Settings};
use super::snapshot::Snapshot;
use servodance_drivers::EStop;

/// Requests that may wait: far more than people can press in one cycle.
const WAITING: usize = 64;

/// The control loop's end: one, with a seat for each viewer.
pub struct RobotEnd {
    draft: Snapshot,
    seats: Vec<Seat>,
    /// The emergency stop of the robot.
    pub estop: EStop,
    /// What was asked for last; kept from one dance to the next.
    pub settings: Settings,
}

/// What one viewer is shown, and asks.
struct Seat {
    snapshots: triple_buffer::Input<Snapshot>,
    requests: rtrb::Consumer<Request>,
}

/// A viewer's end.
pub struct ViewerEnd {
    snapshots: triple_buffer::Output<Snapshot>,
    requests: rtrb::Producer<Request>,
    /// The emergency stop of the robot.
    pub estop: EStop,
}

/// A line for a robot with so many joints and one viewer.
pub fn link(joints: usize, settings: Settings) -> (RobotEnd, ViewerEnd) {
    let mut robot = RobotEnd::new(joints, settings);
    let viewer = robot.seat();
    (robot, viewer)
}

impl RobotEnd {
    /// An end that nobody watches yet.
    pub fn new(joints: usize, settings: Settings) -> Self {
        Self {
            draft: Snapshot::new(joints, settings),
            seats: Vec::new(),
            estop: EStop::default(),
            settings,
        }
    }

    /// A seat for one viewer more: each has a slot and a ring of their own, so
    /// that none can delay another. To be taken before torque is on.
    pub fn seat(&mut self) -> ViewerEnd {
        let (input, output) = triple_buffer::triple_buffer(&self.draft);
        let (producer, consumer) = rtrb::RingBuffer::new(WAITING);
        self.seats.push(Seat {
            snapshots: input,
            requests: consumer,
        });
        ViewerEnd {
            snapshots: output,
            requests: producer,
            estop: self.estop.clone(),
        }
    }

    /// The next request, if there is one. Never waits.
    pub fn request(&mut self) -> Option<Request> {
        let mut seats = self.seats.iter_mut();
        seats.find_map(|seat| seat.requests.pop().ok())
    }

    /// Lets `change` change the last snapshot, and shows it. Never waits.
    pub fn publish(&mut self, change: impl FnOnce(&mut Snapshot)) {
        change(&mut self.draft);
        self.draft.now.settings = self.settings;
        for seat in &mut self.seats {
            seat.snapshots.input_buffer_mut().copy_from(&self.draft);
            seat.snapshots.publish();
        }
    }

    /// Whether all viewers are gone.
    pub fn is_alone(&self) -> bool {
        self.seats.iter().all(|seat| seat.requests.is_abandoned())
    }
}

impl ViewerEnd {
    /// The newest snapshot.
    pub fn newest(&mut self) -> &Snapshot {
        self.snapshots.read()
    }

    /// Whether there is one newer than the last that was read.
    pub fn has_news(&self) -> bool {
        self.snapshots.updated()
    }

    /// Asks the control loop, if there is room for all that is asked.
    pub fn ask(&mut self, requests: &[Request]) -> bool {
        let room = self.requests.slots() >= requests.len();
        if room {
            for request in requests {
                // There is room: nobody else asks at this end.
                let _ = self.requests.push(*request);
            }
        }
        room
    }

    /// Whether the control loop's end is gone.
    pub fn is_alone(&self) -> bool {
        self.requests.is_abandoned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dance::IdleStyle;

    fn settings() -> Settings {
        Settings {
            amplitude: 1.0,
            mirror: false,
            idle: IdleStyle::Sway,
            style: 0,
            seed: 1,
        }
    }

    #[test]
    fn the_newest_snapshot_is_seen_and_publishing_allocates_nothing() {
        let (mut robot, mut viewer) = link(20, settings());
        let counted = allocation_counter::measure(|| {
            for i in 0..1000 {
                robot.publish(|snapshot| snapshot.now.music_s = f64::from(i));
                assert!(robot.request().is_none());
            }
        });
        assert_eq!(counted.count_total, 0);
        assert!(viewer.has_news());
        assert_eq!(viewer.newest().now.music_s, 999.0);
        assert!(!viewer.has_news());
    }

    #[test]
    fn requests_keep_their_order_and_a_full_line_says_so() {
        let (mut robot, mut viewer) = link(1, settings());
        assert!(viewer.ask(&[Request::Hold, Request::Amplitude(0.5)]));
        assert_eq!(robot.request(), Some(Request::Hold));
        assert_eq!(robot.request(), Some(Request::Amplitude(0.5)));
        assert_eq!(robot.request(), None);
        assert!((0..WAITING).all(|_| viewer.ask(&[Request::Resume])));
        assert!(!viewer.ask(&[Request::Stop]));
        drop(robot);
        assert!(viewer.is_alone());
    }

    #[test]
    fn two_viewers_see_the_same_and_ask_side_by_side() {
        let (mut robot, mut one) = link(1, settings());
        let mut other = robot.seat();
        robot.publish(|snapshot| snapshot.now.music_s = 7.0);
        assert_eq!(one.newest().now.music_s, 7.0);
        assert_eq!(other.newest().now.music_s, 7.0);
        assert!(other.ask(&[Request::Hold]) && one.ask(&[Request::Resume]));
        let asked = [robot.request(), robot.request(), robot.request()];
        assert_eq!(asked, [Some(Request::Resume), Some(Request::Hold), None]);
        drop(one);
        assert!(!robot.is_alone());
        drop(other);
        assert!(robot.is_alone());
    }
}
