//! The two ends of the line between the control loop and whoever watches.
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

/// The control loop's end.
pub struct RobotEnd {
    draft: Snapshot,
    snapshots: triple_buffer::Input<Snapshot>,
    requests: rtrb::Consumer<Request>,
    /// The emergency stop of the robot.
    pub estop: EStop,
    /// What was asked for last; kept from one dance to the next.
    pub settings: Settings,
}

/// The viewers' end.
pub struct ViewerEnd {
    snapshots: triple_buffer::Output<Snapshot>,
    requests: rtrb::Producer<Request>,
    /// The emergency stop of the robot.
    pub estop: EStop,
}

/// A line for a robot with so many joints.
pub fn link(joints: usize, settings: Settings) -> (RobotEnd, ViewerEnd) {
    let draft = Snapshot::new(joints, settings);
    let (input, output) = triple_buffer::triple_buffer(&draft);
    let (producer, consumer) = rtrb::RingBuffer::new(WAITING);
    let estop = EStop::default();
    let robot = RobotEnd {
        draft,
        snapshots: input,
        requests: consumer,
        estop: estop.clone(),
        settings,
    };
    let viewer = ViewerEnd {
        snapshots: output,
        requests: producer,
        estop,
    };
    (robot, viewer)
}

impl RobotEnd {
    /// The next request, if there is one. Never waits.
    pub fn request(&mut self) -> Option<Request> {
        self.requests.pop().ok()
    }

    /// Lets `change` change the last snapshot, and shows it. Never waits.
    pub fn publish(&mut self, change: impl FnOnce(&mut Snapshot)) {
        change(&mut self.draft);
        self.draft.now.settings = self.settings;
        self.snapshots.input_buffer_mut().copy_from(&self.draft);
        self.snapshots.publish();
    }

    /// Whether the viewers' end is gone.
    pub fn is_alone(&self) -> bool {
        self.requests.is_abandoned()
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
}
