//! `servodance lead`: hears music, invents the dance, and sends it to whoever
//! follows.
//!
//! A recording begins [`PRELUDE_S`] after the start, so that followers are on
//! their way to the first pose; live music is shown as late as the neediest
//! follower needs, in whole beats where there is a beat. One thread hears and
//! invents ahead of time, one (this) sends frames when it is their time, answers
//! and keeps the roles.

use super::{keys, open};
use crate::pipeline::audio_input::Audio;
use crate::pipeline::conditioning::Conditioning;
use crate::pipeline::motion_source::CHORUS;
use crate::pipeline::motion_source::Change;
use crate::pipeline::motion_source::Dancer;
use crate::pipeline::motion_source::DancerThread;
use crate::pipeline::motion_source::Next;
use crate::pipeline::motion_source::Step;
use crate::pipeline::stage_source::LocalClock;
use crate::process::progress::Progress;
use crate::process::realtime::{OrdinaryAfterwards, Role as Urgency, raise};
use crate::session::config::AudioChoice;
use crate::session::config::Speed;
use crate::session::dance::open_generator;
use crate::telemetry::pending_file::{PendingFile, write_whole};
use anyhow::bail;
use serde::{Deserialize, Serialize};
use servodance_audio::capture::CaptureEvent;
use servodance_model::GeneratorOptions;
use servodance_model::engine::EngineOptions;
use servodance_retarget::PostureReader;
use servodance_stage::messages::StageFrame;
use servodance_stage::net::{
    NetConfig, NetPublisher, NetSession, StageKeys, Subscription, deduplicated,
};
use servodance_stage::{Leader, Outgoing};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// Seconds until a recording begins.
const PRELUDE_S: f64 = 4.0;
/// How long other leaders are looked for.
const LOOK: Duration = Duration::from_millis(1200);
/// Messages that may wait.
const WAITING: usize = 4096;
/// Looks around at least this often.
const EVERY: Duration = Duration::from_millis(5);
/// Roles are sent again, and wanted styles looked over, this often.
const AGAIN: Duration = Duration::from_secs(1);
/// After the last frame the leader stays for this, seconds.
const TAIL_S: f64 = 0.5;
/// Hearing and inventing live music take at most this, seconds.
const INVENTING_S: f64 = 0.15;
/// Live motion is moved to another delay by so much in a second.
const DELAY_CHANGE: f64 = 0.1;
/// The capture times of live music are followed by this share a frame.
const CAPTURE_SHARE: f64 = 0.02;

/// What is led, and where.
#[derive(Clone, Debug)]
pub struct StageLead {
    /// The music.
    pub audio: AudioChoice,
    /// Seed of the generator.
    pub seed: u64,
    /// Style, if asked for.
    pub style: Option<String>,
    /// Weights, if not the built-in ones.
    pub model: Option<PathBuf>,
    /// What those weights may need beside them.
    pub conditioning: Conditioning,
    /// How the model's steps are computed.
    pub engine: EngineOptions,
    /// Where others connect.
    pub place: NetConfig,
    /// Name of the stage.
    pub stage: String,
    /// Take the place of a leader that is there.
    pub take_over: bool,
    /// Where the figures go.
    pub report: Option<PathBuf>,
    /// Print only errors.
    pub quiet: bool,
}

/// What came of it.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct LeadReport {
    /// Version of servodance.
    pub version: String,
    /// Frames that were sent, without those of other styles.
    pub frames: u64,
    /// Frames that were sent later than the lead asked for, by more than a frame.
    pub late_frames: u64,
    /// The last lead, milliseconds.
    pub lead_ms: f64,
    /// The longest lead.
    pub lead_ms_max: f64,
    /// Followers at most.
    pub followers: usize,
    /// Messages that were dropped.
    pub dropped: u64,
    /// Another leader took over.
    pub taken_over: bool,
    /// The user stopped it.
    pub interrupted: bool,
}

/// Leads until the music is over, another takes over, or `stop` is set.
///
/// # Errors
/// What cannot be used, a stage that has a leader, what failed on the way.
pub fn lead(options: &StageLead, stop: &AtomicBool) -> anyhow::Result<LeadReport> {
    let report = options.report.as_deref().map(PendingFile::create);
    drop(report.transpose()?); // only to learn early whether it can be written
    let keys = keys(&options.stage)?;
    let progress = Progress::new(None, options.quiet);
    let afterwards = OrdinaryAfterwards;
    let _ = raise(Urgency::Capture);
    let audio = Audio::open(&options.audio, Speed::Realtime)?;
    let _ = raise(Urgency::Model);
    let generator = open_generator(options.model.as_deref(), options.engine)?;
    let encodec = options.conditioning.encodec(&generator)?;
    let style = match &options.style {
        Some(style) => generator.styles()[generator.style_index(style)?].clone(),
        None => generator.default_style().to_owned(),
    };
    let styles = generator.styles().to_vec();
    let dance = generator.start(GeneratorOptions {
        seed: options.seed,
        style: options.style.clone(),
        style_vector: options.conditioning.style_vector(&generator)?,
        ..GeneratorOptions::default()
    })?;
    let notes = progress.clone();
    let on_notice = Box::new(move |notice: &CaptureEvent| notes.note(&notice.to_string()));
    let mut dancer = Dancer::new(audio, dance, encodec.as_ref(), on_notice)?;
    dancer.prime()?;

    let net = open(&options.place)?;
    let term = term(&net, &keys, options)?;
    let clock = LocalClock::start(0.0, 0.0);
    let leader = Leader::new(term, rand::random());
    let (sender, inbox) = sync_channel(WAITING);
    let _ears = listen(&net, &keys, clock, &sender)?;
    let _token = net.declare_liveliness(&keys.leader(leader.instance(), term))?;
    let frames = (0..=CHORUS as u8).map(|voice| net.publisher(&keys.frames(Some(voice))));
    let mut desk = Desk {
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
        chorus: [None; CHORUS],
        dancer: DancerThread::start(dancer)?,
        timeline: Timeline::default(),
        report: LeadReport {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            ..LeadReport::default()
        },
        again: Instant::now(),
        rival: None,
    };
    progress.note(&format!(
        "leading the stage \"{}\" as {:016x}",
        options.stage,
        desk.leader.instance()
    ));
    let led = desk.run(stop, &progress);
    drop(afterwards);
    progress.done();
    desk.report.dropped = desk.leader.dropped;
    let report = desk.report.clone();
    led?;
    desk.dancer.heard()?;
    if let Some(path) = &options.report {
        let text = serde_json::to_string_pretty(&report)? + "\n";
        write_whole(path, text.as_bytes())?;
    }
    Ok(report)
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

/// Something that came over the network.
enum News {
    Heard(i64, Vec<u8>),
    Leader(u64, u32),
}

fn listen(
    net: &NetSession,
    keys: &StageKeys,
    clock: LocalClock,
    inbox: &SyncSender<News>,
) -> anyhow::Result<Vec<Subscription>> {
    let mut ears = Vec::new();
    for key in [keys.from_follower(None), keys.cue()] {
        let inbox = inbox.clone();
        // Followers say everything by two connections.
        let each = deduplicated(move |bytes| {
            // What there is no room for is a flood.
            let _ = inbox.try_send(News::Heard(clock.now_ns(), bytes.to_vec()));
        });
        ears.push(net.subscribe(&key, each)?);
    }
    let (inbox, own) = (inbox.clone(), keys.clone());
    ears.push(net.watch_liveliness(&keys.leaders(), move |key, lives| {
        if let (Some((instance, term)), true) = (own.parse_leader(key), lives) {
            let _ = inbox.try_send(News::Leader(instance, term));
        }
    })?);
    Ok(ears)
}

/// When the motion of which moment of the music is shown.
#[derive(Clone, Copy, Debug, Default)]
struct Timeline {
    /// The leader's clock at the beginning of the music, nanoseconds.
    start_ns: Option<i64>,
    /// How much later than it was captured live music is shown, seconds.
    delay_s: Option<f64>,
    newest_ns: i64,
}

impl Timeline {
    /// When to show a step, nanoseconds of the leader's clock.
    fn place(&mut self, step: &Step, clock: LocalClock, needed_s: f64) -> i64 {
        let music_ns = nanoseconds(step.motion.time_s);
        let present_ns = match step.captured {
            None => *self
                .start_ns
                .get_or_insert_with(|| clock.now_ns() + nanoseconds(PRELUDE_S)),
            Some(captured) => {
                let seen_ns = clock.at(captured) - music_ns;
                let start_ns = self.start_ns.get_or_insert(seen_ns);
                *start_ns += ((seen_ns - *start_ns) as f64 * CAPTURE_SHARE) as i64;
                *start_ns + nanoseconds(self.delay_s(step, needed_s))
            }
        } + music_ns;
        self.newest_ns = self.newest_ns.max(present_ns);
        present_ns
    }

    /// How late live motion is shown: as few whole beats as will do.
    fn delay_s(&mut self, step: &Step, needed_s: f64) -> f64 {
        let least_s = needed_s + INVENTING_S;
        let tempo = f64::from(step.music.beat.tempo_bpm);
        let wanted_s = match tempo > 0.0 {
            true => (least_s * tempo / 60.0).ceil() * 60.0 / tempo,
            false => least_s,
        };
        let most = DELAY_CHANGE / servodance_types::FRAME_RATE_HZ;
        let delay_s = self.delay_s.get_or_insert(wanted_s);
        *delay_s += (wanted_s - *delay_s).clamp(-most, most);
        *delay_s
    }
}

/// Everything that the leading thread keeps.
struct Desk {
    net: NetSession,
    keys: StageKeys,
    leader: Leader,
    clock: LocalClock,
    inbox: Receiver<News>,
    /// One a voice.
    frames: Vec<NetPublisher>,
    /// What is usual in the dance of each voice.
    postures: [PostureReader; 1 + CHORUS],
    roles: NetPublisher,
    styles: Vec<String>,
    /// The stage's own style.
    style: String,
    /// Styles of the other voices, by their places in `styles`.
    chorus: [Option<usize>; CHORUS],
    dancer: DancerThread,
    timeline: Timeline,
    report: LeadReport,
    again: Instant,
    /// Another leader: its instance and term.
    rival: Option<(u64, u32)>,
}

impl Desk {
    fn run(&mut self, stop: &AtomicBool, progress: &Progress) -> anyhow::Result<()> {
        let mut next: Option<(i64, Box<Step>)> = None;
        let mut ended = false;
        loop {
            if stop.load(Ordering::Relaxed) {
                self.report.interrupted = true;
                return Ok(());
            }
            if self.is_beaten(progress)? {
                self.report.taken_over = true;
                return Ok(());
            }
            let now_ns = self.clock.now_ns();
            let lead_s = self.leader.lead_s(now_ns);
            self.report.lead_ms = lead_s * 1e3;
            self.report.lead_ms_max = self.report.lead_ms_max.max(lead_s * 1e3);
            while next.is_none() && !ended {
                match self.dancer.poll()? {
                    Next::Step(step) => {
                        let at_ns = self.timeline.place(&step, self.clock, lead_s);
                        next = Some((at_ns, step));
                    }
                    Next::Ended => ended = true,
                    Next::Late | Next::Away => break,
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
            let wait = until_ns.map_or(EVERY, |at_ns| self.clock.until(at_ns).min(EVERY));
            if let Ok(news) = self.inbox.recv_timeout(wait) {
                self.take(news)?;
                while let Ok(news) = self.inbox.try_recv() {
                    self.take(news)?;
                }
            }
            if self.again.elapsed() >= AGAIN {
                self.again = Instant::now();
                let roles = self.leader.roles();
                self.roles.put(roles)?;
                self.arrange();
            }
        }
    }

    /// Sends a frame in every style.
    fn send(&mut self, now_ns: i64, at_ns: i64, lead_s: f64, step: &Step) -> anyhow::Result<()> {
        let late_ns = now_ns - (at_ns - nanoseconds(lead_s));
        let is_late = late_ns > nanoseconds(1.0 / servodance_types::FRAME_RATE_HZ);
        self.report.late_frames += u64::from(is_late && step.captured.is_none());
        self.report.frames += 1;
        let own = (0, step.motion);
        for (voice, motion) in std::iter::once(own).chain(step.chorus.into_iter().flatten()) {
            let place = usize::from(voice);
            let style = match place.checked_sub(1) {
                None => &self.style,
                Some(other) => match self.chorus.get(other).copied().flatten() {
                    Some(style) => &self.styles[style],
                    None => continue, // not wanted any more
                },
            };
            let posture = self.postures[place].read(&motion);
            let frame = StageFrame::new(at_ns, &step.music, &motion, posture);
            let message = self.leader.frames(now_ns, voice, style, frame);
            self.frames[place].put(message)?;
        }
        Ok(())
    }

    fn take(&mut self, news: News) -> anyhow::Result<()> {
        match news {
            News::Leader(instance, term) if instance != self.leader.instance() => {
                self.rival = Some((instance, term));
            }
            News::Leader(..) => {}
            News::Heard(at_ns, bytes) => {
                let clock = self.clock;
                // What is wrong with a message was counted.
                match self.leader.receive(at_ns, &bytes, || clock.now_ns()) {
                    Ok(Outgoing::Reply(follower, messages)) => {
                        let key = self.keys.to_follower(follower);
                        for message in messages {
                            self.net.put(&key, message)?;
                        }
                    }
                    Ok(Outgoing::Roles(roles)) => self.roles.put(roles)?,
                    Ok(Outgoing::Nothing) | Err(_) => {}
                }
                let followers = self.leader.followers().count();
                self.report.followers = self.report.followers.max(followers);
            }
        }
        Ok(())
    }

    /// Whether another leader is to lead.
    fn is_beaten(&mut self, progress: &Progress) -> anyhow::Result<bool> {
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

    /// Begins and ends voices as followers want styles.
    fn arrange(&mut self) {
        let wanted = self.leader.followers().map(|f| f.style.as_str());
        let mut wanted: Vec<usize> = wanted
            .filter(|style| *style != self.style)
            .filter_map(|style| self.styles.iter().position(|known| known == style))
            .collect();
        wanted.sort_unstable();
        wanted.dedup();
        for (number, place) in (1..).zip(&mut self.chorus) {
            if place.is_some_and(|style| !wanted.contains(&style)) {
                *place = None;
                self.dancer.change(Change::Hush(number));
            }
        }
        for style in wanted {
            let known = self.chorus.contains(&Some(style));
            let free = self.chorus.iter().position(Option::is_none);
            if let (false, Some(place)) = (known, free) {
                self.chorus[place] = Some(style);
                self.postures[place + 1] = PostureReader::default();
                let number = place as u8 + 1;
                self.dancer.change(Change::Voice(number, style));
            }
        }
    }
}

fn nanoseconds(seconds: f64) -> i64 {
    (seconds * 1e9).round() as i64
}
