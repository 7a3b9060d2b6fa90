//! The page of a whole stage: every follower's robot, the timeline, cues.

use super::shown::{Answer, RequestRefusal, ServerNow, Shown};
use crate::show::SongOutline;
use crate::show::{Show, TimedCue};
use crate::viewer::snapshot::{MusicStatus, rounded};
use crate::viewer::songs::Songs;
use crate::viewer::stage_link::{
    FollowerNow, RobotLook, RobotNews, RobotPose, StageEnd, StageNews, StageNow, StageRequest,
    parse_stage_request,
};
use axum::http::StatusCode;
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Robots that the page keeps, of followers that the leader knows or not yet.
const MOST_ROBOTS: usize = 64;

/// A stage, and the song that it dances to.
pub struct StagePage {
    stage: String,
    styles: Vec<String>,
    songs: Songs,
    view: Mutex<StageView>,
}

struct StageView {
    end: StageEnd,
    now: Option<Box<StageNow>>,
    robots: BTreeMap<u64, RobotView>,
    outline: SongOutline,
    /// Counts what `part` gives, so that pages know when to fetch it again.
    outlines: u32,
    shown: bool,
    stop: Option<StagePress>,
}

/// A press of STOP, and the robots that have not said that their torque is off. A follower
/// that was stopped has ended: one that comes again is another.
struct StagePress {
    name: String,
    waiting: BTreeMap<u64, String>,
}

#[derive(Default)]
struct RobotView {
    look: Option<RobotLook>,
    looks: u32,
    pose: Option<RobotPose>,
}

#[derive(Serialize)]
struct FrameJson<'a> {
    #[serde(serialize_with = "rounded")]
    clock_s: f64,
    #[serde(serialize_with = "rounded")]
    age_s: f64,
    #[serde(serialize_with = "rounded")]
    music_s: f64,
    viewers: usize,
    song: Option<u32>,
    beat: MusicStatus,
    outline: u32,
    cues: &'a [TimedCue],
    /// A stop that not all robots have confirmed.
    estop: bool,
    /// All robots say that their torque is off by a stop.
    stopped: bool,
    /// The name of the newest press, once all robots have confirmed it.
    confirmed: Option<&'a str>,
    /// Robots that have not.
    unconfirmed: Vec<&'a str>,
    robots: Vec<RobotJson<'a>>,
}

#[derive(Serialize)]
struct RobotJson<'a> {
    #[serde(flatten)]
    follower: &'a FollowerNow,
    /// Which look, none where none has come yet.
    look: u32,
    #[serde(flatten)]
    pose: Option<&'a RobotPose>,
}

impl StagePage {
    pub fn new(end: StageEnd) -> Self {
        Self {
            stage: end.stage.clone(),
            styles: end.styles.clone(),
            songs: end.songs.clone(),
            view: Mutex::new(StageView {
                end,
                now: None,
                robots: BTreeMap::new(),
                outline: SongOutline::default(),
                outlines: 0,
                shown: true,
                stop: None,
            }),
        }
    }

    /// What there is, the newest news taken in.
    fn view(&self) -> MutexGuard<'_, StageView> {
        let mut view = self.view.lock().unwrap_or_else(PoisonError::into_inner);
        while let Ok(news) = view.end.news.try_recv() {
            view.take(news);
        }
        view
    }
}

impl StageView {
    fn take(&mut self, news: StageNews) {
        self.shown = false;
        match news {
            StageNews::Now(now) => {
                let there = |id: &u64| now.followers.iter().any(|follower| follower.id == *id);
                self.robots.retain(|id, _| there(id));
                self.now = Some(now);
            }
            StageNews::Outline(outline) => {
                self.outline = outline;
                self.outlines += 1;
            }
            StageNews::Robot(id, news) => {
                if self.robots.len() == MOST_ROBOTS && !self.robots.contains_key(&id) {
                    return;
                }
                let robot = self.robots.entry(id).or_default();
                match news {
                    RobotNews::Pose(pose) => {
                        if let (true, Some(stop)) = (pose.stopped, &mut self.stop) {
                            stop.waiting.remove(&id);
                        }
                        robot.pose = Some(pose);
                    }
                    RobotNews::Look(look) if robot.look.as_ref() == Some(&look) => {}
                    RobotNews::Look(look) => {
                        robot.look = Some(look);
                        robot.looks += 1;
                    }
                }
            }
        }
    }

    /// Notes a press; whether all robots have confirmed it.
    fn press_stop(&mut self, name: &str) -> bool {
        if self.stop.as_ref().is_none_or(|stop| name.is_empty() || stop.name != name) {
            let moving = self.followers().iter().filter(|follower| !self.is_stopped(follower));
            let waiting = moving.map(|follower| (follower.id, follower.name.clone())).collect();
            self.stop = Some(StagePress { name: name.to_owned(), waiting });
        }
        self.stop.as_ref().is_some_and(|stop| stop.waiting.is_empty())
    }

    fn followers(&self) -> &[FollowerNow] {
        self.now.as_ref().map_or(&[], |now| &now.followers)
    }

    fn is_stopped(&self, follower: &FollowerNow) -> bool {
        let pose = self.robots.get(&follower.id).and_then(|robot| robot.pose.as_ref());
        pose.is_some_and(|pose| pose.stopped)
    }

    fn all_stopped(&self) -> bool {
        let followers = self.followers();
        !followers.is_empty() && followers.iter().all(|follower| self.is_stopped(follower))
    }

    fn show(&self) -> Show {
        self.now.as_ref().map(|now| now.show.clone()).unwrap_or_default()
    }
}

impl Shown for StagePage {
    fn index(&self) -> &'static str {
        "whole_stage.html"
    }

    fn scene(&self) -> Value {
        json!({ "stage": self.stage, "styles": self.styles, "version": env!("CARGO_PKG_VERSION") })
    }

    fn has_news(&self) -> bool {
        !self.view().shown
    }

    fn frame(&self, server: ServerNow) -> String {
        let mut view = self.view();
        view.shown = true;
        let now = view.now.as_deref();
        let robots = view.followers().iter().map(|follower| {
            let robot = view.robots.get(&follower.id);
            let links = |robot: &RobotView| robot.look.as_ref().map(|look| look.links);
            let pose = robot.and_then(|robot| {
                robot.pose.as_ref().filter(|pose| links(robot) == Some(pose.links.len()))
            });
            RobotJson { follower, look: robot.map_or(0, |robot| robot.looks), pose }
        });
        let confirmed = view.stop.as_ref().filter(|stop| stop.waiting.is_empty());
        let unconfirmed = view.stop.iter().flat_map(|stop| stop.waiting.values());
        let frame = FrameJson {
            clock_s: server.clock_s,
            age_s: now.map_or(0.0, |now| now.published.elapsed().as_secs_f64()),
            music_s: now.and_then(|now| now.music_s).unwrap_or(f64::NAN),
            viewers: server.viewers,
            song: self.songs.now().map(|(number, _)| number),
            beat: now.map(|now| now.music).unwrap_or_default(),
            outline: view.outlines,
            cues: now.map(|now| now.show.cues()).unwrap_or_default(),
            estop: view.stop.as_ref().is_some_and(|stop| !stop.waiting.is_empty()),
            stopped: view.all_stopped(),
            confirmed: confirmed.map(|stop| stop.name.as_str()),
            unconfirmed: unconfirmed.map(String::as_str).collect(),
            robots: robots.collect(),
        };
        // Numbers and text only: nothing here can fail.
        serde_json::to_string(&frame).unwrap_or_default()
    }

    fn ask(&self, json: &str) -> Result<Answer, RequestRefusal> {
        let asked = parse_stage_request(json, &self.styles);
        let Some(request) = asked.map_err(|why| (StatusCode::BAD_REQUEST, why))? else {
            return Ok(Answer::Alive);
        };
        let gone = |_| (StatusCode::SERVICE_UNAVAILABLE, "nobody leads any more".into());
        let mut view = self.view();
        let press = match &request {
            StageRequest::Stop(press) => Some(press.clone()),
            _ => None,
        };
        view.end.requests.send(request).map_err(gone)?;
        match press.is_some_and(|press| view.press_stop(&press)) {
            true => Ok(Answer::Stopped),
            false => Ok(Answer::Taken),
        }
    }

    fn songs(&self) -> &Songs {
        &self.songs
    }

    fn takes_songs(&self) -> bool {
        false
    }

    fn part(&self, name: &str) -> Option<String> {
        let view = self.view();
        if name == "outline" {
            return serde_json::to_string(&view.outline).ok();
        }
        let id = u64::from_str_radix(name, 16).ok()?;
        serde_json::to_string(view.robots.get(&id)?.look.as_ref()?).ok()
    }

    fn document(&self) -> Option<(&'static str, String)> {
        let view = self.view();
        Some(("show.toml", view.show().to_text(&view.outline)))
    }
}
