//! `servodance lead`: makes the dance from music and sends it to all followers.
//!
//! Two threads: the dancer thread computes motion ahead of time; the leader loop
//! sends frames when it is their time, answers followers and keeps the roles.

use super::stage_show::StageShow;
use super::timeline::{Timeline, nanoseconds};
use super::{keys, open};
use crate::pipeline::audio_input::{AudioChoice, AudioInput};
use crate::pipeline::dance_step::{DanceChange, DanceStep, EXTRA_STYLES, Polled};
use crate::pipeline::dancer::Dancer;
use crate::pipeline::dancer_thread::DancerThread;
use crate::pipeline::model_args::GeneratorArgs;
use crate::pipeline::stage_source::LocalClock;
use crate::process::progress::Progress;
use crate::process::realtime::{OrdinaryAfterwards, ThreadRole, raise};
use crate::process::speed::Speed;
use crate::session::dance::open_generator;
use crate::show::{Show, ShowFile, SongOutline, TimedCue};
use crate::telemetry::pending_file::{PendingFile, write_whole};
use crate::viewer::stage_link::{LeaderEnd, RobotNews, StageNews, stage_link};
use crate::viewer::{Server, Songs};
use anyhow::bail;
use serde::{Deserialize, Serialize};
use servodance_audio::capture::CaptureEvent;
use servodance_drivers::EStop;
use servodance_retarget::PostureReader;
use servodance_stage::messages::{MAX_LOOK_BYTES, StageFrame};
use servodance_stage::net::{
    NetConfig, NetPublisher, NetSession, StageKeys, Subscription, deduplicated,
};
use servodance_stage::{Leader, Outgoing};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// How long other leaders are looked for.
const LOOK: Duration = Duration::from_millis(1200);
/// Messages that may wait for the leader loop.
const WAITING: usize = 4096;
/// The leader loop waits for messages at most this long.
const LONGEST_WAIT: Duration = Duration::from_millis(5);
/// Roles are sent again, and wanted styles collected, this often.
const ROLE_INTERVAL: Duration = Duration::from_secs(1);
/// How often a stop is sent while followers may not have heard of it.
const STOP_INTERVAL: Duration = Duration::from_millis(50);
/// After the last frame the leader stays for this, seconds.
const TAIL_S: f64 = 0.5;

/// The dance to lead, and the network.
#[derive(Clone, Debug)]
#[allow(missing_docs)] // the other names say it
pub struct StageLead {
    pub audio: AudioChoice,
    pub generator: GeneratorArgs,
    /// Network addresses at which followers connect.
    pub place: NetConfig,
    pub stage: String,
    pub take_over: bool,
    pub report: Option<PathBuf>,
    pub quiet: bool,
    /// Where a page shows the stage, if one shall.
    pub view: Option<SocketAddr>,
    /// The show to play.
    pub show: Option<ShowFile>,
}

/// The figures of a led dance.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[allow(missing_docs)] // the other names say it
pub struct LeadReport {
    pub version: String,
    /// Frames that were sent, without those of other styles.
    pub frames: u64,
    /// Frames that were sent later than the lead asked for, by more than a frame.
    pub late_frames: u64,
    /// The last lead, milliseconds.
    pub lead_ms: f64,
    /// The longest lead, milliseconds.
    pub lead_ms_max: f64,
    pub followers: usize,
    pub dropped: u64,
    pub taken_over: bool,
    /// Whether the user stopped it.
    pub interrupted: bool,
}

/// Leads until the music is over, another takes over, or `stop` is set; `on_page` learns
/// where the page is.
pub fn lead(
    options: &StageLead,
    stop: &AtomicBool,
    on_page: impl FnOnce(&Server),
) -> anyhow::Result<LeadReport> {
    let report = options.report.as_deref().map(PendingFile::create);
    drop(report.transpose()?); // only to learn early whether it can be written
    let keys = keys(&options.stage)?;
    let progress = Progress::new(None, options.quiet);
    let afterwards = OrdinaryAfterwards;
    let _ = raise(ThreadRole::Capture);
    let audio = AudioInput::open(&options.audio, Speed::Realtime)?;
    let _ = raise(ThreadRole::Model);
    let asked = &options.generator;
    let generator = open_generator(asked.model.as_deref(), asked.engine)?;
    let encodec = asked.conditioning.encodec(&generator)?;
    let style = asked.style.clone().unwrap_or_else(|| generator.default_style().to_owned());
    generator.style_index(&style)?;
    let styles = generator.styles().to_vec();
    let (show, outline) = prepared_show(options, &styles)?;
    let dance = generator.start(asked.options(&generator)?)?;
    let notes = progress.clone();
    let on_notice = Box::new(move |notice: &CaptureEvent| notes.note(&notice.to_string()));
    let mut dancer = Dancer::new(audio, dance, encodec.as_ref(), on_notice)?;
    dancer.prime(stop, &EStop::default())?;

    let net = open(&options.place)?;
    let term = term(&net, &keys, options)?;
    let songs = Songs::new(&options.audio);
    let (end, server) = match options.view {
        Some(bind) => {
            let (end, page) = stage_link(&options.stage, styles.clone(), songs);
            (Some(end), Some(Server::start_stage(bind, page)?))
        }
        None => (None, None),
    };
    if let Some(server) = &server {
        on_page(server);
    }
    let clock = LocalClock::start(0.0, 0.0);
    let leader = Leader::new(term, rand::random());
    let (sender, inbox) = sync_channel(WAITING);
    let mut subscribers = subscribe(&net, &keys, clock, &sender)?;
    if let Some(end) = &end {
        subscribers.push(hear_robots(&net, &keys, end)?);
        outline_song(outline, &options.audio, end)?;
    }
    let _token = net.declare_liveliness(&keys.leader(leader.instance(), term))?;
    let frames = (0..=EXTRA_STYLES as u8).map(|voice| net.publisher(&keys.frames(Some(voice))));
    let mut leading = LeaderLoop {
        frames: frames.collect::<Result<_, _>>()?,
        postures: Default::default(),
        roles: net.publisher(&keys.roles())?,
        net,
        keys,
        leader,
        clock,
        inbox,
        styles,
        style,
        extra_styles: [None; EXTRA_STYLES],
        dancer: DancerThread::start(dancer)?,
        timeline: Timeline::default(),
        show: StageShow::new(show, end),
        report: LeadReport {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            ..LeadReport::default()
        },
        roles_sent: Instant::now(),
        stop_sent: Instant::now(),
        rival: None,
    };
    progress.note(&format!(
        "leading the stage \"{}\" as {:016x}",
        options.stage,
        leading.leader.instance()
    ));
    let led = leading.run(stop, &progress);
    drop(subscribers);
    drop(afterwards);
    progress.done();
    leading.report.dropped = leading.leader.dropped;
    let report = leading.report.clone();
    led?;
    leading.dancer.finish()?;
    if let Some(path) = &options.report {
        let text = serde_json::to_string_pretty(&report)? + "\n";
        write_whole(path, text.as_bytes())?;
    }
    Ok(report)
}

/// The show, and what its file knows of the song; a show without cues if none is played.
fn prepared_show(
    options: &StageLead,
    styles: &[String],
) -> anyhow::Result<(Show, Option<SongOutline>)> {
    let Some(file) = &options.show else {
        let song = match &options.audio {
            AudioChoice::File(path) => Some(path.display().to_string()),
            _ => None,
        };
        return Ok((Show::new(song, options.generator.style.clone()), None));
    };
    let outline = match file.outline() {
        Some(outline) => Some(outline),
        None if file.counts_bars() => Some(SongOutline::find(&options.audio)?),
        None => None,
    };
    let show = file.show(&outline.clone().unwrap_or_default())?;
    let wanted = show.cues().iter().filter_map(|cue| cue.role.style.as_ref());
    if let Some(style) = wanted.into_iter().find(|style| !styles.contains(style)) {
        bail!("{}: unknown style \"{style}\"; known: {}", file.name(), styles.join(", "));
    }
    Ok((show, outline))
}

/// What followers tell of their robots, for the page.
fn hear_robots(
    net: &NetSession,
    keys: &StageKeys,
    end: &LeaderEnd,
) -> anyhow::Result<Subscription> {
    let news = end.news.clone();
    Ok(net.subscribe_up_to(&keys.robot(None), MAX_LOOK_BYTES, move |bytes| {
        let Some((id, json)) = bytes.split_first_chunk() else { return };
        if let Some(robot) = RobotNews::parse(json) {
            // What the page has no room for is left out.
            let _ = news.try_send(StageNews::Robot(u64::from_le_bytes(*id), robot));
        }
    })?)
}

/// Hears the song once for the page's timeline, beside all else.
fn outline_song(
    known: Option<SongOutline>,
    song: &AudioChoice,
    end: &LeaderEnd,
) -> anyhow::Result<()> {
    let (news, song) = (end.news.clone(), song.clone());
    if !song.is_recording() {
        return Ok(());
    }
    std::thread::Builder::new().name("outline".into()).spawn(move || {
        drop(OrdinaryAfterwards); // whoever started it may be urgent
        // A song that cannot be read has been refused by then.
        if let Ok(found) = SongOutline::find(&song) {
            let outline = known.map_or(found.clone(), |known| known.completed(found));
            let _ = news.send(StageNews::Outline(outline));
        }
    })?;
    Ok(())
}

/// The term to lead in; refused where somebody leads.
fn term(net: &NetSession, keys: &StageKeys, options: &StageLead) -> anyhow::Result<u32> {
    // Connections come up in the background.
    let began = Instant::now();
    let mut there = Vec::new();
    while there.is_empty() && began.elapsed() < LOOK {
        there = net.live_keys(&keys.leaders(), LOOK / 4)?;
        std::thread::sleep(LOOK / 20);
    }
    let leaders = there.iter().filter_map(|key| keys.parse_leader(key));
    let Some((instance, term)) = leaders.max_by_key(|(_, term)| *term) else {
        return Ok(0);
    };
    if !options.take_over {
        bail!(
            "the stage \"{}\" has a leader already ({instance:016x}): end it first, or give --take-over",
            options.stage
        );
    }
    Ok(term.saturating_add(1))
}

/// Something that came over the network, with its time by the local clock.
enum LeaderEvent {
    Heard(i64, Vec<u8>),
    Leader(u64, u32),
}

fn subscribe(
    net: &NetSession,
    keys: &StageKeys,
    clock: LocalClock,
    inbox: &SyncSender<LeaderEvent>,
) -> anyhow::Result<Vec<Subscription>> {
    let mut subscribers = Vec::new();
    for key in [keys.from_follower(None), keys.cue()] {
        let inbox = inbox.clone();
        // Followers say everything by two connections.
        let each = deduplicated(move |bytes| {
            // A full inbox is a flood: the message is dropped.
            let _ = inbox.try_send(LeaderEvent::Heard(clock.now_ns(), bytes.to_vec()));
        });
        subscribers.push(net.subscribe(&key, each)?);
    }
    let (inbox, own) = (inbox.clone(), keys.clone());
    subscribers.push(net.watch_liveliness(&keys.leaders(), move |key, lives| {
        if let (Some((instance, term)), true) = (own.parse_leader(key), lives) {
            let _ = inbox.try_send(LeaderEvent::Leader(instance, term));
        }
    })?);
    Ok(subscribers)
}

struct LeaderLoop {
    net: NetSession,
    keys: StageKeys,
    leader: Leader,
    clock: LocalClock,
    inbox: Receiver<LeaderEvent>,
    /// One publisher a voice.
    frames: Vec<NetPublisher>,
    /// Baseline posture of each voice.
    postures: [PostureReader; 1 + EXTRA_STYLES],
    roles: NetPublisher,
    styles: Vec<String>,
    /// The stage's own style.
    style: String,
    /// Styles of the other voices, by their places in `styles`.
    extra_styles: [Option<usize>; EXTRA_STYLES],
    dancer: DancerThread,
    timeline: Timeline,
    show: StageShow,
    report: LeadReport,
    roles_sent: Instant,
    stop_sent: Instant,
    /// Another leader: its instance and term.
    rival: Option<(u64, u32)>,
}

impl LeaderLoop {
    fn run(&mut self, stop: &AtomicBool, progress: &Progress) -> anyhow::Result<()> {
        let mut next: Option<(i64, Box<DanceStep>)> = None;
        let mut ended = false;
        loop {
            if stop.load(Ordering::Relaxed) {
                self.report.interrupted = true;
                return Ok(());
            }
            if self.is_replaced(progress)? {
                self.report.taken_over = true;
                return Ok(());
            }
            let now_ns = self.clock.now_ns();
            if self.play_show(now_ns, progress)? {
                return Ok(());
            }
            let lead_s = self.leader.lead_s(now_ns);
            self.report.lead_ms = lead_s * 1e3;
            self.report.lead_ms_max = self.report.lead_ms_max.max(lead_s * 1e3);
            while next.is_none() && !ended {
                match self.dancer.poll()? {
                    Polled::Step(step) => {
                        let at_ns = self.timeline.place(&step, self.clock, lead_s);
                        next = Some((at_ns, step));
                    }
                    Polled::Ended => ended = true,
                    Polled::Late | Polled::Away => break,
                }
            }
            if ended && next.is_none() && now_ns > self.timeline.newest_ns + nanoseconds(TAIL_S) {
                return Ok(());
            }
            if let Some((at_ns, step)) =
                next.take_if(|(at_ns, _)| *at_ns - nanoseconds(lead_s) <= now_ns)
            {
                self.send(now_ns, at_ns, lead_s, &step)?;
                progress.at(step.motion.time_s);
                continue; // the next one may be due as well
            }
            let until_ns = next.as_ref().map(|(at_ns, _)| at_ns - nanoseconds(lead_s));
            let wait =
                until_ns.map_or(LONGEST_WAIT, |at_ns| self.clock.until(at_ns).min(LONGEST_WAIT));
            if let Ok(event) = self.inbox.recv_timeout(wait) {
                self.handle(event)?;
                while let Ok(event) = self.inbox.try_recv() {
                    self.handle(event)?;
                }
            }
            if self.roles_sent.elapsed() >= ROLE_INTERVAL {
                self.roles_sent = Instant::now();
                let roles = self.leader.roles();
                self.roles.put(roles)?;
                self.assign_styles();
            }
        }
    }

    /// Gives the cues whose moment has come and those of the page; `true` if it ends the show.
    fn play_show(&mut self, now_ns: i64, progress: &Progress) -> anyhow::Result<bool> {
        let music_s = self.timeline.music_s(now_ns);
        let mut cues: Vec<TimedCue> = self.show.due(music_s);
        let asked = self.show.requests(music_s);
        cues.extend(asked.cues);
        if asked.stops {
            self.leader.stop();
            progress.note("STOP on the stage's page: every robot turns torque off");
        }
        if asked.stops || (self.show.is_stopping() && self.stop_sent.elapsed() >= STOP_INTERVAL) {
            self.stop_sent = Instant::now();
            self.roles.put(self.leader.stop_message())?;
        }
        for cue in &cues {
            match self.leader.give(&cue.follower, &cue.role) {
                Some(1..) => {}
                Some(0) => progress.note(&format!("nobody is there for the cue {}", cue.words())),
                None => progress.note(&format!("too many roles for the cue {}", cue.words())),
            }
        }
        if !cues.is_empty() {
            let roles = self.leader.roles();
            self.roles.put(roles)?;
            self.assign_styles();
        }
        self.show.tell(&self.leader, &self.timeline, now_ns);
        Ok(asked.ends)
    }

    /// Sends a frame in the main style and in all extra styles.
    fn send(
        &mut self,
        now_ns: i64,
        at_ns: i64,
        lead_s: f64,
        step: &DanceStep,
    ) -> anyhow::Result<()> {
        let late_ns = now_ns - (at_ns - nanoseconds(lead_s));
        let is_late = late_ns > nanoseconds(1.0 / servodance_types::FRAME_RATE_HZ);
        self.report.late_frames += u64::from(is_late && step.captured.is_none());
        self.report.frames += 1;
        self.show.hear(&step.music);
        let own = (0, step.motion);
        for (voice, motion) in std::iter::once(own).chain(step.extra_styles.into_iter().flatten()) {
            let place = usize::from(voice);
            let style = match place.checked_sub(1) {
                None => &self.style,
                Some(other) => match self.extra_styles.get(other).copied().flatten() {
                    Some(style) => &self.styles[style],
                    None => continue, // dropped by now
                },
            };
            let posture = self.postures[place].read(&motion);
            let frame = StageFrame::new(at_ns, &step.music, &motion, posture);
            let message = self.leader.frames(now_ns, voice, style, frame);
            self.frames[place].put(message)?;
        }
        Ok(())
    }

    fn handle(&mut self, event: LeaderEvent) -> anyhow::Result<()> {
        match event {
            LeaderEvent::Leader(instance, term) if instance != self.leader.instance() => {
                self.rival = Some((instance, term));
            }
            LeaderEvent::Leader(..) => {}
            LeaderEvent::Heard(at_ns, bytes) => {
                let clock = self.clock;
                // Bad messages are counted by `receive`.
                match self.leader.receive(at_ns, &bytes, || clock.now_ns()) {
                    Ok(Outgoing::Reply(follower, messages)) => {
                        let key = self.keys.to_follower(follower);
                        for message in messages {
                            self.net.put(&key, message)?;
                        }
                    }
                    Ok(Outgoing::Cued { nonce, reply, roles }) => {
                        self.roles.put(roles)?;
                        self.net.put(&self.keys.to_follower(nonce), reply)?;
                    }
                    Ok(Outgoing::Nothing) | Err(_) => {}
                }
                let followers = self.leader.followers().count();
                self.report.followers = self.report.followers.max(followers);
            }
        }
        Ok(())
    }

    /// Whether another leader leads from now on.
    fn is_replaced(&mut self, progress: &Progress) -> anyhow::Result<bool> {
        let Some((instance, term)) = self.rival.take() else {
            return Ok(false);
        };
        if term > self.leader.term() {
            progress.note(&format!("{instance:016x} took over"));
            return Ok(true);
        }
        if term == self.leader.term() && instance < self.leader.instance() {
            bail!("two leaders began at once; {instance:016x} leads");
        }
        Ok(false)
    }

    /// Begins and ends extra dances for the styles that followers want.
    fn assign_styles(&mut self) {
        let wanted = self.leader.followers().map(|f| f.style.as_str());
        let mut wanted: Vec<usize> = wanted
            .filter(|style| *style != self.style)
            .filter_map(|style| self.styles.iter().position(|known| known == style))
            .collect();
        wanted.sort_unstable();
        wanted.dedup();
        for (number, place) in (1..).zip(&mut self.extra_styles) {
            if place.is_some_and(|style| !wanted.contains(&style)) {
                *place = None;
                self.dancer.change(DanceChange::DropExtra(number));
            }
        }
        for style in wanted {
            let known = self.extra_styles.contains(&Some(style));
            let free = self.extra_styles.iter().position(Option::is_none);
            if let (false, Some(place)) = (known, free) {
                self.extra_styles[place] = Some(style);
                self.postures[place + 1] = PostureReader::default();
                let number = place as u8 + 1;
                self.dancer.change(DanceChange::AddExtra(number, style));
            }
        }
    }
}
