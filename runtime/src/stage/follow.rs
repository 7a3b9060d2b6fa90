//! `servodance follow`: a robot that dances what somebody else leads.
//!
//! Two threads beside those of Zenoh: the control loop, which is that of
//! `dance`, and the seat, which hears the leader, keeps its clock and hands
//! frames over when it is nearly their turn. The seat is to the control loop what
//! viewers are: it may ask for amplitude, mirror and idle behaviour, and sees
//! snapshots; it can neither wait for the loop nor be waited for.

use super::ros::Ros;
use super::{cpu_s, keys, open_twin, shared_s};
use crate::control::emergency_stop::EStopWatch;
use crate::control::idle::IdleStyle;
use crate::pipeline::stage_source::LeaderNow;
use crate::pipeline::stage_source::LocalClock;
use crate::pipeline::stage_source::StageEnd;
use crate::pipeline::stage_source::stage_line;
use crate::process::progress::Progress;
use crate::process::realtime::{OrdinaryAfterwards, Role as Urgency, raise};
use crate::session::led_dance::FollowConfig;
use crate::session::led_dance::Followed;
use crate::session::led_dance::follow as dance;
use crate::telemetry::pending_file::{PendingFile, write_whole};
use crate::viewer::{ViewerEnd, ViewerRequest, ViewerSettings, link};
use anyhow::Context;
use serde::{Deserialize, Serialize};
use servodance_stage::Follower;
use servodance_stage::follower::DropCounters;
use servodance_stage::messages::{MessageError, Role};
use servodance_stage::net::{
    NetConfig, RedundantPublisher, RedundantSession, StageKeys, Subscription,
};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// Messages that may wait for the seat.
const WAITING: usize = 1024;
/// The seat looks around this often.
const EVERY: Duration = Duration::from_millis(10);

/// Who follows whom.
#[derive(Clone, Debug)]
pub struct StageFollow {
    /// The robot and its buses.
    pub config: FollowConfig,
    /// Where the leader is.
    pub place: NetConfig,
    /// Name of the stage.
    pub stage: String,
    /// Name of the follower.
    pub name: String,
    /// How it dances unless it is told otherwise.
    pub role: Role,
    /// Seconds alone after which it stands at rest.
    pub rest_after_s: f64,
    /// The domain of ROS 2, if it shall be seen there.
    pub ros_domain: Option<u32>,
    /// By how much its clock is wrong, seconds, and fast, seconds a second.
    pub skew: (f64, f64),
    /// An emergency stop.
    pub estop_file: Option<PathBuf>,
    /// Where the figures go.
    pub report: Option<PathBuf>,
    /// Print only errors.
    pub quiet: bool,
}

/// What came of it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FollowReport {
    /// Version of servodance.
    pub version: String,
    /// Name of the follower.
    pub name: String,
    /// What the robot did.
    #[serde(flatten)]
    pub followed: Followed,
    /// Seconds on the clock.
    pub wall_s: f64,
    /// Processor time of the whole program over that, 1 being a core.
    pub cpu_cores: f64,
    /// How long before their time the leader sent frames, milliseconds.
    pub lead_ms: f64,
    /// How long before their time this follower needs them, milliseconds.
    pub needed_ms: f64,
    /// Longest way of a frame in the last half minute, milliseconds.
    pub way_ms: f64,
    /// Shortest way there and back, milliseconds; half of it bounds the error.
    pub delay_ms: f64,
    /// By how much the leader's clock is faster, millionths.
    pub drift_ppm: f64,
    /// Frames that never came.
    pub lost_frames: u64,
    /// How often a leader was followed.
    pub joined: u64,
    /// How often the same leader was left and joined again.
    pub rejoined: u64,
    /// The role at the end: beats after the leader.
    pub canon_beats: f64,
    /// The role at the end: whether it was the mirror image.
    pub mirror: bool,
    /// The role at the end: share of the movement.
    pub amplitude: f64,
    /// The role at the end: style that was wanted, if any.
    pub style: Option<String>,
    /// Messages that were dropped, by cause.
    pub dropped: Dropped,
}

/// Messages that were dropped, by cause.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Dropped {
    /// By the follower, and why.
    #[serde(flatten)]
    pub counted: DropCounters,
    /// There was no room for them.
    pub flooded: u64,
}

/// Follows until `stop` is set.
///
/// # Errors
/// What cannot be used, what failed on the way; torque is off by then.
pub fn follow(options: &StageFollow, stop: &AtomicBool) -> anyhow::Result<FollowReport> {
    let robot = &options.config.robot;
    let report = options.report.as_deref().map(PendingFile::create);
    drop(report.transpose()?); // only to learn early whether it can be written
    let keys = keys(&options.stage)?;
    let role = options.role.clone().checked()?;
    let reach_s = robot.retargeter()?.lookahead_s() + robot.servo_lag_s;
    let follower = Follower::new(&options.name, role.clone(), reach_s, rand::random());
    let clock = LocalClock::start(options.skew.0, options.skew.1);
    let (source, end) = stage_line(robot.period_s(), clock);
    let mut settings = ViewerSettings {
        amplitude: robot.retarget.amplitude,
        mirror: robot.retarget.mirror,
        idle: options.config.idle,
        style: 0,
        seed: 0,
    };
    let usual = settings;
    dress(&mut settings, &role);
    let (mut robot_end, viewers) = link(robot.servos.len(), settings);
    let _watch = EStopWatch::start(&robot_end.estop, options.estop_file.clone(), true)?;
    let progress = Progress::new(None, options.quiet);
    let afterwards = OrdinaryAfterwards;
    // For the network's threads too: they stamp what comes. The control loop
    // says whether it is allowed.
    let _ = raise(Urgency::Capture);
    let net = open_twin(&options.place)?;
    let joints = robot.servos.iter().map(|s| s.name.clone()).collect();
    let ros = options
        .ros_domain
        .map(|domain| Ros::start(net.first(), domain, &options.stage, &options.name, joints))
        .transpose()?;
    let (sender, inbox) = sync_channel(WAITING);
    let flooded = Arc::new(AtomicU64::new(0));
    let _ears = listen(&net, &keys, follower.id(), clock, &sender, &flooded)?;
    let seat = Seat {
        ask: net.publisher(&keys.from_follower(Some(follower.id())))?,
        follower,
        clock,
        end,
        viewers,
        inbox,
        ros,
        usual,
        settings,
        rest_after: Duration::from_secs_f64(options.rest_after_s),
        heard: Instant::now(),
        alone: true,
        told_version: false,
        notes: progress.clone(),
    };
    let (began, cpu) = (Instant::now(), cpu_s());
    let seat = std::thread::Builder::new()
        .name("seat".into())
        .spawn(move || seat.run())?;
    let tell = |text: &str| progress.note(text);
    let followed = dance(
        &options.config,
        source,
        &mut robot_end,
        stop,
        shared_s,
        tell,
    );
    drop(afterwards);
    let wall_s = began.elapsed().as_secs_f64();
    let cpu_cores = (cpu_s() - cpu) / wall_s;
    progress.done();
    let seat = seat
        .join()
        .map_err(|_| anyhow::anyhow!("the thread that hears the leader broke down"));
    let (followed, seat) = (followed?, seat?.context("the network")?);
    let (figures, role) = (seat.follower.stats(), seat.follower.role().clone());
    let report = FollowReport {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        name: options.name.clone(),
        followed,
        wall_s,
        cpu_cores,
        lead_ms: figures.lead_s * 1e3,
        needed_ms: figures.needed_s * 1e3,
        way_ms: figures.transit_s * 1e3,
        delay_ms: figures.clock.map_or(0.0, |clock| clock.delay_s * 1e3),
        drift_ppm: figures.clock.map_or(0.0, |clock| clock.drift * 1e6),
        lost_frames: figures.lost,
        joined: figures.joined,
        rejoined: figures.left,
        canon_beats: role.canon_beats.unwrap_or_default().into(),
        mirror: seat.settings.mirror,
        amplitude: seat.settings.amplitude,
        style: role.style,
        dropped: Dropped {
            counted: figures.dropped,
            flooded: flooded.load(Ordering::Relaxed),
        },
    };
    if let Some(path) = &options.report {
        let text = serde_json::to_string_pretty(&report)? + "\n";
        write_whole(path, text.as_bytes())?;
    }
    Ok(report)
}

/// Something that came over the network.
enum News {
    /// A message, and when it came.
    Heard(i64, Vec<u8>),
    /// A leader's sign of life went away.
    Gone(u64),
}

/// Everything a follower hears; it lasts as long as what comes back.
fn listen(
    net: &RedundantSession,
    keys: &StageKeys,
    id: u64,
    clock: LocalClock,
    inbox: &SyncSender<News>,
    flooded: &Arc<AtomicU64>,
) -> anyhow::Result<Vec<Subscription>> {
    let mut ears = Vec::new();
    for key in [keys.frames(None), keys.roles(), keys.to_follower(id)] {
        let (inbox, flooded) = (inbox.clone(), Arc::clone(flooded));
        ears.extend(net.subscribe(&key, move |bytes| {
            let news = News::Heard(clock.now_ns(), bytes.to_vec());
            if inbox.try_send(news).is_err() {
                flooded.fetch_add(1, Ordering::Relaxed);
            }
        })?);
    }
    let (inbox, own) = (inbox.clone(), keys.clone());
    ears.extend(net.watch_liveliness(&keys.leaders(), move |key, lives| {
        if let (Some((instance, _)), false) = (own.parse_leader(key), lives) {
            let _ = inbox.try_send(News::Gone(instance));
        }
    })?);
    Ok(ears)
}

/// What the network does for one robot.
struct Seat {
    follower: Follower,
    clock: LocalClock,
    end: StageEnd,
    viewers: ViewerEnd,
    inbox: Receiver<News>,
    ask: RedundantPublisher,
    ros: Option<Ros>,
    /// What is danced without a role, and what the control loop was told last.
    usual: ViewerSettings,
    settings: ViewerSettings,
    rest_after: Duration,
    /// When somebody led last.
    heard: Instant,
    alone: bool,
    told_version: bool,
    notes: Progress,
}

impl Seat {
    /// Until the control loop is gone.
    fn run(mut self) -> anyhow::Result<Self> {
        while !self.end.is_alone() {
            match self.inbox.recv_timeout(EVERY) {
                Ok(news) => {
                    self.take(news);
                    while let Ok(news) = self.inbox.try_recv() {
                        self.take(news);
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            self.look_around()?;
        }
        Ok(self)
    }

    fn take(&mut self, news: News) {
        match news {
            News::Gone(instance) => self.follower.note_leader_gone(instance),
            News::Heard(at_ns, bytes) => {
                let heard = self.follower.receive(at_ns, &bytes);
                if let (Err(error @ MessageError::Version(_)), false) = (heard, self.told_version) {
                    self.told_version = true;
                    self.notes.note(&error.to_string());
                }
            }
        }
    }

    fn look_around(&mut self) -> anyhow::Result<()> {
        let now_ns = self.clock.now_ns();
        for question in self.follower.time_requests(now_ns) {
            self.ask.put(question)?;
        }
        if let Some(report) = self.follower.report(now_ns) {
            self.ask.put(report)?;
        }
        let (shown_s, hidden) = self.end.shown();
        while self.end.has_room() {
            let frame = self.follower.next_frame(now_ns, Some(shown_s), hidden);
            match frame {
                Some(frame) => self.end.hand_over(frame),
                None => break,
            };
        }
        self.end.tell(LeaderNow {
            due: self.follower.due(now_ns),
            away: self.follower.is_leaving(now_ns),
        });
        self.tell_changes(now_ns);
        self.play_role();
        if let Some(ros) = self.ros.as_mut().filter(|ros| ros.is_due()) {
            ros.publish(self.viewers.newest())?;
        }
        Ok(())
    }

    /// Says who leads, when that changes.
    fn tell_changes(&mut self, now_ns: i64) {
        let alone = self.follower.is_alone(now_ns);
        if !alone {
            self.heard = Instant::now();
        }
        if alone == self.alone {
            return;
        }
        self.alone = alone;
        if alone {
            self.notes.note("nobody leads any more: idling");
            return;
        }
        let figures = self.follower.stats();
        let clock = figures.clock.map_or(0.0, |clock| clock.bound_s());
        self.notes.note(&format!(
            "following {:016x}: frames come {:.0} ms ahead, its clock is known to {:.1} ms at worst",
            self.follower.leader().unwrap_or_default(),
            figures.lead_s * 1e3,
            clock * 1e3
        ));
    }

    /// Asks the control loop for what the role says, and for rest when it is
    /// alone for long.
    fn play_role(&mut self) {
        let mut wanted = self.usual;
        dress(&mut wanted, self.follower.role());
        if self.alone && self.heard.elapsed() > self.rest_after {
            wanted.idle = IdleStyle::Rest;
        }
        if wanted == self.settings {
            return;
        }
        let asked = [
            ViewerRequest::Amplitude(wanted.amplitude),
            ViewerRequest::Mirror(wanted.mirror),
            ViewerRequest::Idle(wanted.idle),
        ];
        if self.viewers.ask(&asked) {
            self.settings = wanted;
        }
    }
}

/// Takes over what a role says of a robot's settings.
fn dress(settings: &mut ViewerSettings, role: &Role) {
    settings.mirror = role.mirror.unwrap_or(settings.mirror);
    settings.amplitude = role.amplitude.map_or(settings.amplitude, f64::from);
}
