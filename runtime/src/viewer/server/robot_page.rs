//! The page of one robot: frames from its control loop, requests to it.

use super::shown::{Answer, RequestRefusal, ServerNow, Shown};
use super::stop_presses::StopPresses;
use crate::viewer::frame::{FrameSurroundings, frame};
use crate::viewer::link::ViewerEnd;
use crate::viewer::request::{ParsedRequest, ViewerRequest, parse_request};
use crate::viewer::scene::Scene;
use crate::viewer::snapshot::Snapshot;
use crate::viewer::songs::Songs;
use axum::body::Bytes;
use axum::http::StatusCode;
use serde_json::Value;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A robot, and the songs that it dances to.
pub struct RobotPage {
    scene: Scene,
    scene_json: Value,
    songs: Songs,
    robot: Mutex<RobotView>,
}

/// What the page knows of the robot.
struct RobotView {
    end: ViewerEnd,
    /// Whether a frame has shown the newest snapshot.
    shown: bool,
    presses: StopPresses,
}

impl RobotView {
    fn newest(&mut self) -> &Snapshot {
        if self.end.has_news() {
            self.shown = false;
        }
        self.end.newest()
    }
}

impl RobotPage {
    pub fn new(scene: Scene, end: ViewerEnd, songs: Songs) -> Self {
        let robot = RobotView { end, shown: false, presses: StopPresses::default() };
        Self { scene_json: scene.json(), scene, songs, robot: Mutex::new(robot) }
    }

    fn robot(&self) -> MutexGuard<'_, RobotView> {
        self.robot.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether this press has stopped the robot, as the control loop says.
    fn is_confirmed(&self, press: &str) -> bool {
        let mut robot = self.robot();
        let stopped = robot.newest().now.stopped;
        robot.presses.confirmed(stopped).any(|name| name == press)
    }

    fn press_stop(&self, press: Option<String>) -> Answer {
        let mut robot = self.robot();
        robot.end.estop.press("the page");
        let Some(press) = press else {
            return Answer::Taken;
        };
        let releases = robot.end.estop.releases();
        robot.presses.push(press.clone(), releases);
        drop(robot);
        match self.is_confirmed(&press) {
            true => Answer::Stopped,
            false => Answer::Taken,
        }
    }

    fn pass_on(&self, requests: &[ViewerRequest]) -> Result<Answer, RequestRefusal> {
        let mut robot = self.robot();
        let pressed = robot.end.estop.is_pressed();
        let activity = robot.newest().now.activity;
        for request in requests {
            request.possible(activity, pressed).map_err(|why| (StatusCode::CONFLICT, why))?;
        }
        match robot.end.ask(requests) {
            true => Ok(Answer::Taken),
            false => Err((StatusCode::SERVICE_UNAVAILABLE, "too many requests".into())),
        }
    }
}

impl Shown for RobotPage {
    fn index(&self) -> &'static str {
        "index.html"
    }

    fn scene(&self) -> Value {
        self.scene_json.clone()
    }

    fn has_news(&self) -> bool {
        let mut robot = self.robot();
        robot.newest();
        !robot.shown
    }

    fn frame(&self, now: ServerNow) -> String {
        let mut robot = self.robot();
        robot.newest();
        robot.shown = true;
        let RobotView { end, presses, .. } = &mut *robot;
        let estop = end.estop.is_pressed();
        let snapshot = end.newest();
        let surroundings = FrameSurroundings {
            estop,
            clock_s: now.clock_s,
            age_s: snapshot.now.published.elapsed().as_secs_f64(),
            confirmed: presses.confirmed(snapshot.now.stopped).collect(),
            viewers: now.viewers,
            song: self.songs.now().map(|(number, _)| number),
            queue: self.songs.waiting(),
        };
        frame(&self.scene, snapshot, &surroundings)
    }

    fn ask(&self, json: &str) -> Result<Answer, RequestRefusal> {
        match parse_request(json, &self.scene.styles) {
            Ok(ParsedRequest::EStop(press)) => Ok(self.press_stop(press)),
            Ok(ParsedRequest::Seen(press)) => {
                self.robot().presses.see(&press);
                Ok(Answer::Taken)
            }
            Ok(ParsedRequest::Alive) => {
                self.robot().end.operators.hear();
                Ok(Answer::Alive)
            }
            Ok(ParsedRequest::Requests(requests)) => self.pass_on(&requests),
            Err(error) => Err((StatusCode::BAD_REQUEST, error)),
        }
    }

    fn songs(&self) -> &Songs {
        &self.songs
    }

    fn takes_songs(&self) -> bool {
        self.scene.takes_songs
    }

    /// Kept once, however many fetch it.
    fn mesh(&self, part: usize) -> Option<Bytes> {
        let corners = self.scene.meshes.parts.get(part)?;
        Some(Bytes::from_owner(Arc::clone(corners)))
    }

    fn is_stop_awaited(&self) -> bool {
        self.robot().presses.is_awaited()
    }

    fn operator_lost(&self) {
        // A full queue has more urgent things in it.
        let _ = self.robot().end.ask(&[ViewerRequest::OperatorLost]);
    }
}
