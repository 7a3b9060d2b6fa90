//! The leader's side of its page and of its show: cues at their moments, news for viewers.

use super::timeline::Timeline;
use crate::show::{Show, TimedCue};
use crate::viewer::music_track::MusicTrack;
use crate::viewer::stage_link::{FollowerNow, LeaderEnd, StageNews, StageNow, StageRequest};
use servodance_stage::Leader;
use servodance_types::MusicFrame;
use std::time::{Duration, Instant};

/// How often viewers are told.
const TELL: Duration = Duration::from_millis(40);
/// How long a stop is sent after a page has asked for it the last time.
const STOPPING: Duration = Duration::from_secs(3);

/// A show that is played, and the page that watches and changes it.
pub struct StageShow {
    pub show: Show,
    page: Option<LeaderEnd>,
    music: MusicTrack,
    /// Cues up to this moment of the music were given, seconds.
    given_s: f64,
    told: Instant,
    /// The newest press of STOP, and when a page named it last.
    stop: Option<(String, Instant)>,
}

/// What operators have asked for.
#[derive(Default)]
pub struct Asked {
    /// Cues to give now.
    pub cues: Vec<TimedCue>,
    /// The show shall end.
    pub ends: bool,
    /// STOP was pressed.
    pub stops: bool,
}

impl StageShow {
    pub fn new(show: Show, page: Option<LeaderEnd>) -> Self {
        Self {
            show,
            page,
            music: MusicTrack::default(),
            given_s: f64::NEG_INFINITY,
            told: Instant::now(),
            stop: None,
        }
    }

    /// Takes in the music of a frame that is sent.
    pub fn hear(&mut self, music: &MusicFrame) {
        if self.page.is_some() {
            self.music.push(music);
        }
    }

    /// The cues whose moment has come since the last call.
    pub fn due(&mut self, music_s: Option<f64>) -> Vec<TimedCue> {
        let Some(music_s) = music_s.filter(|music_s| *music_s > self.given_s) else {
            return Vec::new();
        };
        let from_s = std::mem::replace(&mut self.given_s, music_s);
        self.show.due(from_s, music_s).cloned().collect()
    }

    /// Whether followers may not have heard of a stop yet.
    pub fn is_stopping(&self) -> bool {
        self.stop.as_ref().is_some_and(|(_, asked)| asked.elapsed() < STOPPING)
    }

    /// What operators have asked for since the last call. Cues become part of the show.
    pub fn requests(&mut self, music_s: Option<f64>) -> Asked {
        let mut asked = Asked::default();
        let Some(page) = &self.page else { return asked };
        while let Ok(request) = page.requests.try_recv() {
            match request {
                StageRequest::End => asked.ends = true,
                StageRequest::Stop(press) => {
                    asked.stops |= self
                        .stop
                        .as_ref()
                        .is_none_or(|(known, _)| press.is_empty() || *known != press);
                    self.stop = Some((press, Instant::now()));
                }
                StageRequest::Remove(place) => self.show.remove(place),
                StageRequest::Cue(mut cue) => {
                    let heard_s = music_s.unwrap_or(0.0).max(0.0);
                    if cue.at_s.is_none_or(|at_s| at_s <= heard_s) {
                        asked.cues.push(cue.clone());
                        cue.at_s = cue.at_s.or(Some(heard_s));
                    }
                    self.show.add(cue);
                }
            }
        }
        asked
    }

    /// Tells viewers how it stands, if it is time; what they have no room for is left out.
    pub fn tell(&mut self, leader: &Leader, timeline: &Timeline, now_ns: i64) {
        let Some(page) = &self.page else { return };
        if self.told.elapsed() < TELL {
            return;
        }
        self.told = Instant::now();
        let music_s = timeline.music_s(now_ns);
        let now = StageNow {
            published: Instant::now(),
            music_s,
            music: self.music.at(music_s.unwrap_or(f64::NEG_INFINITY)),
            followers: leader.followers().map(|follower| shown(leader, follower)).collect(),
            show: self.show.clone(),
        };
        let _ = page.news.try_send(StageNews::Now(Box::new(now)));
    }
}

fn shown(leader: &Leader, follower: &servodance_stage::leader::FollowerStatus) -> FollowerNow {
    let role = leader.role_of(&follower.name);
    FollowerNow {
        id: follower.id,
        name: follower.name.clone(),
        way_ms: follower.transit_s * 1e3,
        lost: follower.lost,
        mirror: role.mirror,
        amplitude: role.amplitude,
        canon: role.canon_beats,
        style: role.style,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::viewer::Songs;
    use crate::viewer::stage_link::stage_link;
    use servodance_stage::messages::Role;

    fn cue(at_s: Option<f64>, follower: &str) -> TimedCue {
        let role = Role { mirror: Some(true), ..Role::default() };
        TimedCue::checked(at_s, follower.into(), role).unwrap()
    }

    #[test]
    fn cues_come_once_at_their_moment_and_pressed_ones_are_written_down() {
        let mut show = Show::default();
        for at_s in [0.0, 2.0, 2.5] {
            assert!(show.add(cue(Some(at_s), "all")));
        }
        let (end, page) = stage_link("main", Vec::new(), Songs::default());
        let mut playing = StageShow::new(show, Some(end));
        let times = |cues: Vec<TimedCue>| cues.iter().map(TimedCue::time_s).collect::<Vec<_>>();
        assert!(playing.due(None).is_empty());
        assert_eq!(times(playing.due(Some(0.01))), [0.0]);
        assert_eq!(times(playing.due(Some(2.2))), [2.0]);
        page.requests.send(StageRequest::Cue(cue(None, "op3"))).unwrap();
        page.requests.send(StageRequest::Cue(cue(Some(9.0), "op3"))).unwrap();
        let asked = playing.requests(Some(2.2));
        assert!(asked.cues.len() == 1 && !asked.ends && !asked.stops);
        assert_eq!(times(playing.show.cues().to_vec()), [0.0, 2.0, 2.2, 2.5, 9.0]);
        assert_eq!(times(playing.due(Some(3.0))), [2.5], "what was pressed is not given twice");
        page.requests.send(StageRequest::Remove(4)).unwrap();
        page.requests.send(StageRequest::End).unwrap();
        assert!(playing.requests(Some(3.0)).ends);
        assert!(playing.due(Some(60.0)).is_empty());
    }

    #[test]
    fn a_press_that_is_named_again_is_one_stop() {
        let (end, page) = stage_link("main", Vec::new(), Songs::default());
        let mut playing = StageShow::new(Show::default(), Some(end));
        let mut press = |name: &str| {
            page.requests.send(StageRequest::Stop(name.into())).unwrap();
            playing.requests(None).stops
        };
        assert_eq!(["a", "a", "b", "", ""].map(&mut press), [true, false, true, true, true]);
        assert!(playing.is_stopping());
    }
}
