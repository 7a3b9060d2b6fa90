//! The two ends of the link between a leader and the page of its stage.
//!
//! News go out through a bounded queue and are left out where it is full; requests come in
//! through another one. The leader waits for neither.

use super::snapshot::{MusicStatus, rounded};
use super::songs::Songs;
use crate::show::SongOutline;
use crate::show::{Show, TimedCue};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use servodance_stage::messages::Role;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::time::Instant;

/// News that may wait for the viewer thread: a second of eight robots.
const WAITING: usize = 256;
/// A robot with more links, or shapes, is not shown.
const MOST_LINKS: usize = 256;
const MOST_SHAPES: usize = 1024;
/// Numbers of poses, shapes and colours are no larger.
const LARGEST: f64 = 1e4;
/// Bytes of the name of a press of STOP.
const LONGEST_PRESS: usize = 64;

/// What the page learns.
#[derive(Debug)]
pub enum StageNews {
    Now(Box<StageNow>),
    /// What a follower tells of its robot.
    Robot(u64, RobotNews),
    /// What is known of the song beforehand.
    Outline(SongOutline),
}

/// The stage at one moment.
#[derive(Clone, Debug)]
pub struct StageNow {
    pub published: Instant,
    /// Seconds of the music that are shown now; none before it begins.
    pub music_s: Option<f64>,
    pub music: MusicStatus,
    pub followers: Vec<FollowerNow>,
    pub show: Show,
}

/// A follower, as its leader knows it.
#[derive(Clone, Debug, Serialize)]
pub struct FollowerNow {
    #[serde(serialize_with = "hexadecimal")]
    pub id: u64,
    pub name: String,
    /// Longest way of a frame of late, milliseconds.
    #[serde(serialize_with = "rounded")]
    pub way_ms: f64,
    /// Frames that never came.
    pub lost: u32,
    pub mirror: Option<bool>,
    pub amplitude: Option<f32>,
    pub canon: Option<f32>,
    pub style: Option<String>,
}

fn hexadecimal<S: serde::Serializer>(id: &u64, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(&format_args!("{id:016x}"))
}

/// What a follower tells of its robot, as JSON on the network.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RobotNews {
    /// What does not change.
    Look(RobotLook),
    Pose(RobotPose),
}

/// A robot's shapes, as in the scene of its own page. Meshes are not sent: a stick stands
/// for each.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotLook {
    pub robot: String,
    pub links: usize,
    pub shapes: Vec<Value>,
}

/// Where a robot's links are, and how it is.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotPose {
    /// x, y, z and the quaternion x, y, z, w of each link in the world.
    pub links: Vec<[f32; 7]>,
    pub activity: String,
    pub safety: String,
    /// Whether its emergency stop has turned torque off.
    pub stopped: bool,
    /// How late its latest control cycle of the last second was, milliseconds.
    pub late_ms: f64,
    /// Cycles without the motion that they needed.
    pub late_frames: u64,
    /// Limits broken at simulated servos; none on real ones.
    pub violations: Option<u64>,
}

impl RobotNews {
    /// What bytes of the network say, if a page can show it.
    pub fn parse(json: &[u8]) -> Option<Self> {
        let news: Self = serde_json::from_slice(json).ok()?;
        let is_sound = match &news {
            Self::Look(look) => {
                let shapes = look.shapes.len() <= MOST_SHAPES && look.links <= MOST_LINKS;
                shapes && look.shapes.iter().all(|shape| is_shape(shape, look.links))
            }
            Self::Pose(pose) => {
                let number = |value: &f32| f64::from(value.abs()) <= LARGEST;
                pose.links.len() <= MOST_LINKS && pose.links.iter().flatten().all(number)
            }
        };
        is_sound.then_some(news)
    }
}

/// Numbers, and lists of them, alone; of a link that there is.
fn is_shape(shape: &Value, links: usize) -> bool {
    fn is_plain(value: &Value) -> bool {
        match value {
            Value::Number(number) => number.as_f64().is_some_and(|n| n.abs() <= LARGEST),
            Value::Array(list) => list.len() <= 8 && list.iter().all(is_plain),
            _ => false,
        }
    }
    let Some(parts) = shape.as_object() else { return false };
    let link = parts.get("link").and_then(Value::as_u64);
    link.is_some_and(|link| (link as usize) < links) && parts.values().all(is_plain)
}

/// What an operator asks the leader for.
#[derive(Clone, Debug, PartialEq)]
pub enum StageRequest {
    /// A cue: now, or at a moment of the music.
    Cue(TimedCue),
    /// Takes the cue at this place of the show away.
    Remove(usize),
    /// The last frame is the last: followers idle.
    End,
    /// Torque off on every follower, by the name of the press; each without a name is another.
    Stop(String),
}

/// The page's end.
pub struct StageEnd {
    pub stage: String,
    pub styles: Vec<String>,
    /// The song that the page plays, where it is a recording.
    pub songs: Songs,
    pub news: Receiver<StageNews>,
    pub requests: Sender<StageRequest>,
}

/// The leader's end.
#[derive(Debug)]
pub struct LeaderEnd {
    pub news: SyncSender<StageNews>,
    pub requests: Receiver<StageRequest>,
}

/// A link between a leader and its page.
pub fn stage_link(stage: &str, styles: Vec<String>, songs: Songs) -> (LeaderEnd, StageEnd) {
    let (news, heard) = sync_channel(WAITING);
    let (ask, requests) = channel();
    let leader = LeaderEnd { news, requests };
    (leader, StageEnd { stage: stage.to_owned(), styles, songs, news: heard, requests: ask })
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RequestText {
    #[serde(rename = "do")]
    action: Option<ActionText>,
    press: Option<String>,
    cue: Option<CueText>,
    remove: Option<usize>,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum ActionText {
    Alive,
    End,
    EStop,
    /// A page has seen its stop confirmed.
    Seen,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CueText {
    follower: String,
    at_s: Option<f64>,
    mirror: Option<bool>,
    amplitude: Option<f32>,
    canon: Option<f32>,
    style: Option<String>,
}

/// A request of the page: none if it only says that it is there. The error is one line for
/// the viewer.
pub fn parse_stage_request(json: &str, styles: &[String]) -> Result<Option<StageRequest>, String> {
    let text: RequestText = serde_json::from_str(json).map_err(|error| error.to_string())?;
    let press = text.press.filter(|press| press.len() <= LONGEST_PRESS);
    match (text.action, press, text.cue, text.remove) {
        (Some(ActionText::EStop), press, None, None) => {
            Ok(Some(StageRequest::Stop(press.unwrap_or_default())))
        }
        (Some(ActionText::Alive), None, None, None) | (Some(ActionText::Seen), _, None, None) => {
            Ok(None)
        }
        (Some(ActionText::End), None, None, None) => Ok(Some(StageRequest::End)),
        (None, None, Some(cue), None) => {
            cue.checked(styles).map(|cue| Some(StageRequest::Cue(cue)))
        }
        (None, None, None, Some(place)) => Ok(Some(StageRequest::Remove(place))),
        _ => Err("expected one of \"do\", \"cue\" and \"remove\"".into()),
    }
}

impl CueText {
    fn checked(self, styles: &[String]) -> Result<TimedCue, String> {
        if let Some(style) = self.style.as_ref().filter(|style| !styles.contains(style)) {
            return Err(format!("unknown style \"{style}\"; known: {}", styles.join(", ")));
        }
        let role = Role {
            mirror: self.mirror,
            amplitude: self.amplitude,
            canon_beats: self.canon,
            style: self.style,
        };
        TimedCue::checked(self.at_s, self.follower, role)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_a_page_can_show_comes_in() {
        let look =
            |shape: &str| format!(r#"{{"look":{{"robot":"r","links":2,"shapes":[{shape}]}}}}"#);
        let good =
            look(r#"{"link":1,"box":[0.1,0.1,0.1],"pose":[0,0,0,0,0,0,1],"rgba":[0,0,0,1]}"#);
        assert!(RobotNews::parse(good.as_bytes()).is_some());
        for bad in [
            look(r#"{"link":2,"box":[1,1,1]}"#),
            look(r#"{"link":1,"box":"<script>"}"#),
            look(r#"{"link":1,"sphere":1e9}"#),
            look(r#"{"box":[1,1,1]}"#),
            r#"{"pose":{"links":[[0,0,0,0,0,0]]}}"#.into(),
            r#"{"pose":{"links":[[0,0,0,0,0,0,1e30]],"activity":"","safety":"","stopped":false,
                "late_ms":0,"late_frames":0,"violations":null}}"#
                .into(),
            "[".repeat(100_000),
        ] {
            assert!(RobotNews::parse(bad.as_bytes()).is_none(), "{}", &bad[..bad.len().min(80)]);
        }
    }

    #[test]
    fn requests_of_the_page_are_understood_and_others_refused() {
        let styles = ["salsa".to_owned()];
        let parse = |json| parse_stage_request(json, &styles);
        assert_eq!(parse(r#"{"do":"alive"}"#), Ok(None));
        assert_eq!(parse(r#"{"do":"end"}"#), Ok(Some(StageRequest::End)));
        let stop = |press: &str| Ok(Some(StageRequest::Stop(press.into())));
        assert_eq!(parse(r#"{"do":"estop","press":"x7"}"#), stop("x7"));
        assert_eq!(parse(r#"{"do":"estop"}"#), stop(""));
        assert_eq!(parse(r#"{"do":"seen","press":"x7"}"#), Ok(None));
        assert_eq!(parse(r#"{"remove":3}"#), Ok(Some(StageRequest::Remove(3))));
        let cue = parse(r#"{"cue":{"follower":"all","canon":2,"at_s":7.5}}"#);
        let Ok(Some(StageRequest::Cue(cue))) = cue else { panic!("{cue:?}") };
        assert_eq!((cue.at_s, cue.role.canon_beats), (Some(7.5), Some(2.0)));
        for (bad, word) in [
            (r#"{"cue":{"follower":"all"}}"#, "nothing"),
            (r#"{"cue":{"follower":"a b","mirror":true}}"#, "a b"),
            (r#"{"cue":{"follower":"all","style":"polka"}}"#, "salsa"),
            (r#"{"cue":{"follower":"all","amplitude":2}}"#, "0 to 1"),
            (r#"{"cue":{"follower":"all","mirror":true,"at_s":-1}}"#, "-1"),
            (r#"{"do":"jump"}"#, "estop"),
            ("{}", "expected"),
        ] {
            let error = parse(bad).unwrap_err();
            assert!(error.contains(word), "{bad}: {error}");
        }
    }
}
