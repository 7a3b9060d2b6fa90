//! `servodance follow`: a robot that dances the motion of a leader.
//!
//! Two threads beside those of Zenoh: the control loop, which is that of
//! `dance`, and the follower thread, which receives from the leader, keeps its
//! clock and hands frames over when it is nearly their time. To the control loop
//! the follower thread is a viewer: it may ask for amplitude, mirror and idle
//! behaviour, and gets snapshots; neither waits for the other.

use super::robot_teller::RobotTeller;
use super::ros::Ros;
use super::{cpu_s, keys, open_twin, shared_s};
use crate::control::emergency_stop::EmergencyStopWatch;
use crate::control::idle::IdleStyle;
use crate::pipeline::stage_source::{LeaderNow, LocalClock, StageSink, stage_link};
use crate::process::progress::Progress;
use crate::process::realtime::{OrdinaryAfterwards, ThreadRole, raise};
use crate::process::speed::Speed;
use crate::session::dance::open_recorder;
use crate::session::led_dance::{self, FollowConfig, LedDanceResult};
use crate::telemetry::pending_file::{PendingFile, write_whole};
use crate::viewer::{
    RobotEnd, Scene, Server, Songs, ViewerEnd, ViewerRequest, ViewerSettings, link,
};
use anyhow::Context;
use serde::{Deserialize, Serialize};
use servodance_stage::Follower;
use servodance_stage::follower::DropCounters;
use servodance_stage::messages::{MessageError, Role};
use servodance_stage::net::{
    NetConfig, RedundantPublisher, RedundantSession, StageKeys, Subscription,
};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// Messages that may wait for the follower thread.
const WAITING: usize = 1024;
/// The follower thread waits for messages at most this long.
const LONGEST_WAIT: Duration = Duration::from_millis(10);
/// How long a robot that was stopped goes on saying so.
const CONFIRMING: Duration = Duration::from_secs(1);
/// How long a leader is waited for before the user is told.
const PATIENCE: Duration = Duration::from_millis(1500);

/// The robot that follows, and the network.
#[derive(Clone, Debug)]
#[allow(missing_docs)] // the other names say it
pub struct StageFollow {
    pub config: FollowConfig,
    pub place: NetConfig,
    pub stage: String,
    pub name: String,
    /// How it dances until the leader gives it another role.
    pub role: Role,
    /// Seconds alone after which it stands at rest.
    pub rest_after_s: f64,
    /// The domain of ROS 2, if it shall be seen there.
    pub ros_domain: Option<u32>,
    /// By how much its clock is wrong, seconds, and fast, seconds a second.
    pub skew: (f64, f64),
    pub estop_file: Option<PathBuf>,
    pub report: Option<PathBuf>,
    pub quiet: bool,
    /// Where a page shows it, if one shall.
    pub view: Option<SocketAddr>,
    /// Where the dance is recorded, if it shall be.
    pub record: Option<PathBuf>,
}

/// The figures of a follower.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[allow(missing_docs)] // the other names say it
pub struct FollowReport {
    pub version: String,
    pub name: String,
    /// The figures of its control loop.
    #[serde(flatten)]
    pub followed: LedDanceResult,
    /// Duration by the clock on the wall, seconds.
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
    /// Those that the follower refused, by cause.
    #[serde(flatten)]
    pub counted: DropCounters,
    /// Those for which there was no room.
    pub flooded: u64,
}

/// Follows until `stop` is set; `on_page` learns where the page is.
pub fn follow(
    options: &StageFollow,
    stop: &AtomicBool,
    on_page: impl FnOnce(&Server),
) -> anyhow::Result<FollowReport> {
    let robot = &options.config.robot;
    let report = options.report.as_deref().map(PendingFile::create);
    drop(report.transpose()?); // only to learn early whether it can be written
    let keys = keys(&options.stage)?;
    let role = options.role.clone().checked()?;
    let reach_s = robot.retargeter()?.lookahead_s() + robot.servo_lag_s;
    let follower = Follower::new(&options.name, role.clone(), reach_s, rand::random());
    let clock = LocalClock::start(options.skew.0, options.skew.1);
    let (source, sink) = stage_link(robot.period_s(), clock);
    let mut settings = ViewerSettings {
        amplitude: robot.retarget.amplitude,
        mirror: robot.retarget.mirror,
        idle: options.config.idle,
        style: 0,
        seed: 0,
    };
    let base_settings = settings;
    apply_role(&mut settings, &role);
    let (mut robot_end, viewers) = link(robot.servos.len(), settings);
    let plain = Scene::of_robot(robot, Vec::new(), false)?;
    let page = start_page(options, &mut robot_end)?;
    if let Some(page) = &page {
        on_page(page);
    }
    let _watch = EmergencyStopWatch::start(&robot_end.estop, options.estop_file.clone(), true)?;
    let progress = Progress::new(None, options.quiet);
    let record = options.record.as_deref();
    let recorder = open_recorder(record, robot, Speed::Realtime, &progress)?;
    let afterwards = OrdinaryAfterwards;
    // For the network's threads too: they stamp what comes. The control loop
    // says whether it is allowed.
    let _ = raise(ThreadRole::Capture);
    let net = open_twin(&options.place)?;
    let joints = robot.servos.iter().map(|s| s.name.clone()).collect();
    let ros = options
        .ros_domain
        .map(|domain| Ros::start(net.first(), domain, &options.stage, &options.name, joints))
        .transpose()?;
    let teller = RobotTeller::new(net.first(), &keys, follower.id(), plain)?;
    let (sender, inbox) = sync_channel(WAITING);
    let flooded = Arc::new(AtomicU64::new(0));
    let _subscribers = subscribe(&net, &keys, follower.id(), clock, &sender, &flooded)?;
    let follower = FollowerThread {
        ask: net.publisher(&keys.from_follower(Some(follower.id())))?,
        follower,
        clock,
        sink,
        viewers,
        inbox,
        ros,
        teller,
        base_settings,
        settings,
        rest_after: Duration::from_secs_f64(options.rest_after_s),
        led: Instant::now(),
        alone: true,
        unheard: Some(format!(
            "nobody leads the stage \"{}\" at {}: torque stays off until a leader is heard",
            options.stage, options.place
        )),
        noted_version: false,
        stops: 0,
        notes: progress.clone(),
    };
    let (began, cpu) = (Instant::now(), cpu_s());
    let follower = std::thread::Builder::new().name("seat".into()).spawn(move || follower.run())?;
    let note = |text: &str| progress.note(text);
    let (config, end) = (&options.config, &mut robot_end);
    let followed = led_dance::follow(config, source, recorder, end, stop, shared_s, note);
    drop(afterwards);
    let wall_s = began.elapsed().as_secs_f64();
    let cpu_cores = (cpu_s() - cpu) / wall_s;
    progress.done();
    let joined =
        follower.join().map_err(|_| anyhow::anyhow!("the thread that hears the leader broke down"));
    let (followed, thread) = (followed?, joined?.context("the network")?);
    let flooded = flooded.load(Ordering::Relaxed);
    let report = thread.report(&options.name, followed, (wall_s, cpu_cores), flooded);
    if let Some(path) = &options.report {
        let text = serde_json::to_string_pretty(&report)? + "\n";
        write_whole(path, text.as_bytes())?;
    }
    Ok(report)
}

/// The page that shows the robot, if one shall.
fn start_page(options: &StageFollow, end: &mut RobotEnd) -> anyhow::Result<Option<Server>> {
    let Some(bind) = options.view else { return Ok(None) };
    let scene = Scene::of_robot(&options.config.robot, Vec::new(), true)?;
    let scene = Scene { takes_songs: false, ..scene };
    Ok(Some(Server::start(bind, scene, end.add_viewer(), Songs::default())?))
}

/// Something that came over the network.
enum FollowerEvent {
    /// A message, and when it came.
    Heard(i64, Vec<u8>),
    /// A leader's sign of life went away.
    Gone(u64),
}

/// Subscribes to all that a follower receives, as long as the result lives.
fn subscribe(
    net: &RedundantSession,
    keys: &StageKeys,
    id: u64,
    clock: LocalClock,
    inbox: &SyncSender<FollowerEvent>,
    flooded: &Arc<AtomicU64>,
) -> anyhow::Result<Vec<Subscription>> {
    let mut subscribers = Vec::new();
    for key in [keys.frames(None), keys.roles(), keys.to_follower(id)] {
        let (inbox, flooded) = (inbox.clone(), Arc::clone(flooded));
        subscribers.extend(net.subscribe(&key, move |bytes| {
            let event = FollowerEvent::Heard(clock.now_ns(), bytes.to_vec());
            if inbox.try_send(event).is_err() {
                flooded.fetch_add(1, Ordering::Relaxed);
            }
        })?);
    }
    let (inbox, own) = (inbox.clone(), keys.clone());
    subscribers.extend(net.watch_liveliness(&keys.leaders(), move |key, lives| {
        if let (Some((instance, _)), false) = (own.parse_leader(key), lives) {
            let _ = inbox.try_send(FollowerEvent::Gone(instance));
        }
    })?);
    Ok(subscribers)
}

struct FollowerThread {
    follower: Follower,
    clock: LocalClock,
    sink: StageSink,
    viewers: ViewerEnd,
    inbox: Receiver<FollowerEvent>,
    ask: RedundantPublisher,
    ros: Option<Ros>,
    teller: RobotTeller,
    /// Settings without a role.
    base_settings: ViewerSettings,
    /// Settings that the control loop got last.
    settings: ViewerSettings,
    rest_after: Duration,
    /// When there was a leader last.
    led: Instant,
    alone: bool,
    /// What to say if no leader is heard soon.
    unheard: Option<String>,
    noted_version: bool,
    /// Emergency stops of the stage that were obeyed.
    stops: u64,
    notes: Progress,
}

impl FollowerThread {
    /// The figures at the end; `load` is the duration by the wall clock, seconds, and the busy cores.
    fn report(
        &self,
        name: &str,
        followed: LedDanceResult,
        load: (f64, f64),
        flooded: u64,
    ) -> FollowReport {
        let (wall_s, cpu_cores) = load;
        let (figures, role) = (self.follower.stats(), self.follower.role());
        FollowReport {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            name: name.to_owned(),
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
            mirror: self.settings.mirror,
            amplitude: self.settings.amplitude,
            style: role.style.clone(),
            dropped: Dropped { counted: figures.dropped, flooded },
        }
    }

    /// Runs until the control loop has ended.
    fn run(mut self) -> anyhow::Result<Self> {
        while !self.sink.is_abandoned() {
            match self.inbox.recv_timeout(LONGEST_WAIT) {
                Ok(event) => {
                    self.handle(event);
                    while let Ok(event) = self.inbox.try_recv() {
                        self.handle(event);
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            self.tick()?;
        }
        if self.viewers.estop.is_pressed() {
            self.confirm_stop()?;
        }
        Ok(self)
    }

    /// Goes on telling how the robot is, so that the leader's page learns that torque is off.
    fn confirm_stop(&mut self) -> anyhow::Result<()> {
        let pressed = Instant::now();
        while pressed.elapsed() < CONFIRMING {
            self.teller.tell(self.viewers.newest())?;
            std::thread::sleep(LONGEST_WAIT);
        }
        Ok(())
    }

    fn handle(&mut self, event: FollowerEvent) {
        match event {
            FollowerEvent::Gone(instance) => self.follower.note_leader_gone(instance),
            FollowerEvent::Heard(at_ns, bytes) => {
                let heard = self.follower.receive(at_ns, &bytes);
                if let (Err(error @ MessageError::Version(_)), false) = (heard, self.noted_version)
                {
                    self.noted_version = true;
                    self.notes.note(&error.to_string());
                }
                if self.follower.stops() > self.stops {
                    self.stops = self.follower.stops();
                    self.viewers.estop.press("the stage's page");
                }
            }
        }
    }

    fn tick(&mut self) -> anyhow::Result<()> {
        let now_ns = self.clock.now_ns();
        for question in self.follower.time_requests(now_ns) {
            self.ask.put(question)?;
        }
        if let Some(report) = self.follower.report(now_ns) {
            self.ask.put(report)?;
        }
        let (shown_s, hidden) = self.sink.shown();
        while self.sink.has_room() {
            let frame = self.follower.next_frame(now_ns, Some(shown_s), hidden);
            match frame {
                Some(frame) => self.sink.push(frame),
                None => break,
            };
        }
        self.sink.set_leader(LeaderNow {
            due: self.follower.due(now_ns),
            away: self.follower.is_leaving(now_ns),
        });
        self.note_changes(now_ns);
        self.apply_settings();
        if self.teller.is_due() {
            self.teller.tell(self.viewers.newest())?;
        }
        if let Some(ros) = self.ros.as_mut().filter(|ros| ros.is_due()) {
            ros.publish(self.viewers.newest())?;
        }
        Ok(())
    }

    /// Says who leads, when that changes.
    fn note_changes(&mut self, now_ns: i64) {
        let alone = self.follower.is_alone(now_ns);
        if !alone {
            self.led = Instant::now();
            self.unheard = None;
        }
        if self.led.elapsed() > PATIENCE
            && let Some(text) = self.unheard.take()
        {
            self.notes.note(&text);
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

    /// Asks the control loop for the settings of the role; for rest after
    /// long without a leader.
    fn apply_settings(&mut self) {
        let mut wanted = self.base_settings;
        apply_role(&mut wanted, self.follower.role());
        if self.alone && self.led.elapsed() > self.rest_after {
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
fn apply_role(settings: &mut ViewerSettings, role: &Role) {
    settings.mirror = role.mirror.unwrap_or(settings.mirror);
    settings.amplitude = role.amplitude.map_or(settings.amplitude, f64::from);
}
