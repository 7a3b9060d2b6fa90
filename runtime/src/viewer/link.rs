//! The two ends of the link between the control loop and its viewers.
//!
//! - Snapshots go out through a **triple buffer**, because only the newest counts.
//!   The writer copies into one of three snapshots (no allocation) and swaps it in
//!   with one atomic operation, whether the reader is fast, slow or gone.
//! - Requests come in through a bounded **ring**, because each one counts. Taking
//!   from an empty ring is one atomic load; a full ring refuses the request.
//! - The emergency stop bypasses both ([`EStop`]): a flag that the safety layer
//!   reads in every tick.

use super::operator_watch::OperatorWatch;
use super::request::ViewerRequest;
use super::snapshot::{Snapshot, ViewerSettings};
use servodance_drivers::{EStop, State};
use std::time::Instant;

/// Requests that may wait: far more than people can press in one cycle.
const WAITING: usize = 64;

/// The control loop's end: one for all viewers.
pub struct RobotEnd {
    draft: Snapshot,
    viewers: Vec<ViewerChannel>,
    /// The emergency stop of the robot.
    pub estop: EStop,
    /// What was asked for last; kept from one dance to the next.
    pub settings: ViewerSettings,
    /// When an operator's page was heard last.
    pub operators: OperatorWatch,
    /// Dead-man mode: how long the robot dances on without an operator, seconds.
    pub dead_man_s: Option<f64>,
    /// Somebody began the next dance, rather than the end of the one before.
    pub begins_row: bool,
}

struct ViewerChannel {
    snapshots: triple_buffer::Input<Snapshot>,
    requests: rtrb::Consumer<ViewerRequest>,
}

/// A viewer's end of the line to the control loop.
pub struct ViewerEnd {
    snapshots: triple_buffer::Output<Snapshot>,
    requests: rtrb::Producer<ViewerRequest>,
    /// The emergency stop of the robot.
    pub estop: EStop,
    /// When an operator's page was heard last.
    pub operators: OperatorWatch,
}

/// A line for a robot with so many joints and one viewer.
pub fn link(joints: usize, settings: ViewerSettings) -> (RobotEnd, ViewerEnd) {
    let mut robot = RobotEnd::new(joints, settings);
    let viewer = robot.add_viewer();
    (robot, viewer)
}

impl RobotEnd {
    /// The end of a robot without viewers.
    pub fn new(joints: usize, settings: ViewerSettings) -> Self {
        Self {
            draft: Snapshot::new(joints, settings),
            viewers: Vec::new(),
            estop: EStop::default(),
            settings,
            operators: OperatorWatch::default(),
            dead_man_s: None,
            begins_row: true,
        }
    }

    /// One viewer more, with its own slot and ring: none delays another. Before torque on.
    pub fn add_viewer(&mut self) -> ViewerEnd {
        let (input, output) = triple_buffer::triple_buffer(&self.draft);
        let (producer, consumer) = rtrb::RingBuffer::new(WAITING);
        self.viewers.push(ViewerChannel { snapshots: input, requests: consumer });
        let (estop, operators) = (self.estop.clone(), self.operators.clone());
        ViewerEnd { snapshots: output, requests: producer, estop, operators }
    }

    /// The next request, if there is one. Never waits.
    pub fn request(&mut self) -> Option<ViewerRequest> {
        let mut viewers = self.viewers.iter_mut();
        viewers.find_map(|viewer| viewer.requests.pop().ok())
    }

    /// Lets `change` change the last snapshot, and shows it. Never waits.
    pub fn publish(&mut self, change: impl FnOnce(&mut Snapshot)) {
        change(&mut self.draft);
        self.draft.now.settings = self.settings;
        self.draft.now.published = Instant::now();
        for viewer in &mut self.viewers {
            viewer.snapshots.input_buffer_mut().copy_from(&self.draft);
            viewer.snapshots.publish();
        }
    }

    /// Whether dead-man mode lets a dance begin: somebody has just asked for it, or an
    /// operator was heard lately, or need not be.
    pub fn is_attended(&self) -> bool {
        let is_silent = |allowed_s| self.operators.silent_s() > allowed_s;
        self.begins_row || !self.dead_man_s.is_some_and(is_silent)
    }

    /// Tells viewers whether the emergency stop has stopped the robot: for the thread that
    /// drives the servos, which says whether every torque is verified to be off.
    pub fn confirm_stop(&mut self, torque_is_off: bool) {
        let stopped = torque_is_off && self.estop.is_pressed();
        let stopped = stopped.then(|| self.estop.releases());
        self.publish(|snapshot| snapshot.now.stopped = stopped);
    }

    /// Whether torque was off, as verified, when viewers were told last.
    pub(crate) fn torque_was_off(&self) -> bool {
        self.draft.now.safety == State::Disarmed
    }

    pub(crate) fn is_alone(&self) -> bool {
        let mut viewers = self.viewers.iter();
        viewers.all(|viewer| viewer.requests.is_abandoned())
    }
}

impl ViewerEnd {
    /// The newest snapshot; the same one again if there is no newer.
    pub fn newest(&mut self) -> &Snapshot {
        self.snapshots.read()
    }

    /// Whether there is one newer than the last that was read.
    pub fn has_news(&self) -> bool {
        self.snapshots.updated()
    }

    /// Asks the control loop, if there is room for all that is asked.
    pub fn ask(&mut self, requests: &[ViewerRequest]) -> bool {
        let room = self.requests.slots() >= requests.len();
        if room {
            for request in requests {
                // There is room: nobody else asks at this end.
                let _ = self.requests.push(*request);
            }
        }
        room
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::idle::IdleStyle;

    fn settings() -> ViewerSettings {
        ViewerSettings { amplitude: 1.0, mirror: false, idle: IdleStyle::Sway, style: 0, seed: 1 }
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
        assert!(viewer.ask(&[ViewerRequest::Hold, ViewerRequest::Amplitude(0.5)]));
        assert_eq!(robot.request(), Some(ViewerRequest::Hold));
        assert_eq!(robot.request(), Some(ViewerRequest::Amplitude(0.5)));
        assert_eq!(robot.request(), None);
        assert!((0..WAITING).all(|_| viewer.ask(&[ViewerRequest::Resume])));
        assert!(!viewer.ask(&[ViewerRequest::Stop]));
        drop(robot);
        assert!(viewer.requests.is_abandoned());
    }

    #[test]
    fn two_viewers_see_the_same_and_ask_side_by_side() {
        let (mut robot, mut one) = link(1, settings());
        let mut other = robot.add_viewer();
        robot.publish(|snapshot| snapshot.now.music_s = 7.0);
        assert_eq!(one.newest().now.music_s, 7.0);
        assert_eq!(other.newest().now.music_s, 7.0);
        assert!(other.ask(&[ViewerRequest::Hold]) && one.ask(&[ViewerRequest::Resume]));
        let asked = [robot.request(), robot.request(), robot.request()];
        assert_eq!(asked, [Some(ViewerRequest::Resume), Some(ViewerRequest::Hold), None]);
        drop(one);
        assert!(!robot.is_alone());
        drop(other);
        assert!(robot.is_alone());
    }
}
