//! `servodance bench stage`: a leader and its followers, each a program of its
//! own, behind a bad network that then breaks.
//!
//! ```text
//! all but one follow | the last joins | steady, measured | links cut 3 s |
//! leader killed, 3 s later another begins | end
//! ```
//!
//! The first follower's network is good: the others are held to it, so that
//! what is called spread has the absolute lateness in it. Each follower's clock is
//! set wrong by up to a quarter of an hour and runs wrong by up to 50 ppm. What
//! is measured are the positions of the simulated servos, stamped with the clock
//! that all programs of the machine share.

mod relay;
mod site;
mod spread;

use super::follow::FollowReport;
use super::shared::shared_s;
use crate::progress::Progress;
use crate::song::write_demo_for;
use anyhow::{Context, bail};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use relay::{Fault, Relay};
use serde::Serialize;
use site::Site;
use spread::{HOP_S, Together, Track, settled_s, together};
use std::fmt;
use std::net::TcpStream;
use std::path::Path;
use std::process::Child;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Robots nearer together than this are on one beat, seconds.
const ONE_BEAT_S: f64 = 0.010;
/// From the first programs to the late one, and from it to what is measured.
const SETTLE_S: [f64; 2] = [11.0, 7.0];
/// How long links are cut and the leader is away.
const AWAY_S: f64 = 3.0;
/// How long it is watched what becomes of it.
const WATCHED_S: [f64; 2] = [10.0, 18.0];
/// A leader listens within this.
const PATIENCE: Duration = Duration::from_secs(60);
/// Followers are gone within this after they were told.
const FAREWELL: Duration = Duration::from_secs(20);
/// Clocks are wrong by up to this, seconds, and millionths.
const CLOCK_WRONG_S: f64 = 900.0;
const CLOCK_DRIFT_PPM: f64 = 50.0;

/// What is tried.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Simulated robots.
    pub followers: usize,
    /// Which robot they all are.
    pub robot: String,
    /// Delay of the network each way, milliseconds.
    pub delay_ms: f64,
    /// Share of what is sent that is lost.
    pub loss: f64,
    /// Seconds that are measured before things go wrong.
    pub seconds: f64,
    /// Each program in a namespace.
    pub namespaces: bool,
    /// Of the clocks and of the network.
    pub seed: u64,
}

/// What came of it.
#[derive(Clone, Debug, Serialize)]
pub struct Figures {
    /// Version of servodance.
    pub version: &'static str,
    /// Which robot.
    pub robot: String,
    /// How many.
    pub followers: usize,
    /// Whether each program was in a namespace.
    pub namespaces: bool,
    /// Delay each way, milliseconds.
    pub delay_ms: f64,
    /// Share that is lost.
    pub loss: f64,
    /// Whether what a loss does to TCP was modelled, not done by the kernel.
    pub loss_modelled: bool,
    /// Windows of a second in which all moved.
    pub windows: usize,
    /// Between the first and the last at the servos, milliseconds.
    pub spread_ms_p50: f64,
    /// See `spread_ms_p50`.
    pub spread_ms_p99: f64,
    /// See `spread_ms_p50`.
    pub spread_ms_max: f64,
    /// Windows in which they did not all dance the same.
    pub windows_apart: usize,
    /// From the start of a late program until it is on the beat, seconds.
    pub join_s: Option<f64>,
    /// From the end of a cut of 3 s until all are on one beat again, seconds.
    pub recovery_s: Option<f64>,
    /// From the death of the leader until the last follower idles, seconds.
    pub idle_s: Option<f64>,
    /// From the start of the next leader's program until all are on one beat;
    /// its music begins 4 s after it is ready.
    pub leader_recovery_s: Option<f64>,
    /// Limits broken at the simulated servos.
    pub violations: u64,
    /// How long before their time frames were sent at last, milliseconds.
    pub lead_ms: f64,
    /// Longest way of a frame in the last half minute, milliseconds.
    pub way_ms: f64,
    /// Frames that never came, all followers.
    pub lost_frames: u64,
    /// Control cycles without their frame, all followers.
    pub late_frames: u64,
    /// How late control cycles began, of the worst follower, milliseconds.
    pub cycle_late_ms_p99: f64,
    /// See `cycle_late_ms_p99`.
    pub cycle_late_ms_max: f64,
    /// Processor time of a follower's program with its simulated servos, cores: mean.
    pub cpu_cores: f64,
    /// The same of the hungriest.
    pub cpu_cores_max: f64,
}

/// Does it.
///
/// # Errors
/// Programs that cannot be started or that failed.
pub fn bench(trial: &Trial, stop: &AtomicBool) -> anyhow::Result<Figures> {
    let mut stage = Stage::new(trial)?;
    let told = stage.play(stop)?;
    stage.judge(&told)
}

/// Programs that are ended when this is dropped.
struct Program(Child);

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// When what happened, seconds of the shared clock.
#[derive(Clone, Copy, Debug, Default)]
struct Told {
    joined_s: f64,
    steady_s: [f64; 2],
    whole_s: f64,
    killed_s: f64,
    next_s: f64,
    end_s: f64,
}

struct Stage<'a> {
    trial: &'a Trial,
    site: Site,
    folder: TempDir,
    rng: ChaCha8Rng,
    relays: Vec<Relay>,
    followers: Vec<Program>,
    progress: Progress,
    began: Instant,
}

impl<'a> Stage<'a> {
    fn new(trial: &'a Trial) -> anyhow::Result<Self> {
        let stage = Self {
            site: Site::new(trial.namespaces)?,
            folder: tempfile::tempdir()?,
            rng: ChaCha8Rng::seed_from_u64(trial.seed),
            relays: Vec::new(),
            followers: Vec::new(),
            progress: Progress::share("measuring", false),
            began: Instant::now(),
            trial,
        };
        write_demo_for(
            &stage.folder.path().join("song.wav"),
            stage.total_s() + 30.0,
        )?;
        Ok(stage)
    }

    fn total_s(&self) -> f64 {
        let settle_s = SETTLE_S[0] + SETTLE_S[1];
        settle_s + self.trial.seconds + 2.0 * AWAY_S + WATCHED_S[0] + WATCHED_S[1]
    }

    /// All that happens, in its order.
    fn play(&mut self, stop: &AtomicBool) -> anyhow::Result<Told> {
        let mut told = Told::default();
        let leader = self.lead()?;
        let late = self.trial.followers > 1;
        for place in 1..=self.trial.followers - usize::from(late) {
            self.follow(place)?;
        }
        self.wait(SETTLE_S[0], stop)?;
        told.joined_s = shared_s();
        if late {
            self.follow(self.trial.followers)?;
        }
        self.wait(SETTLE_S[1], stop)?;
        told.steady_s[0] = shared_s();
        self.wait(self.trial.seconds, stop)?;
        told.steady_s[1] = shared_s();
        self.cut(true)?;
        self.wait(AWAY_S, stop)?;
        self.cut(false)?;
        told.whole_s = shared_s();
        self.wait(WATCHED_S[0], stop)?;
        told.killed_s = shared_s();
        drop(leader);
        self.wait(AWAY_S, stop)?;
        told.next_s = shared_s();
        let _leader = self.lead()?;
        self.wait(WATCHED_S[1], stop)?;
        told.end_s = shared_s();
        self.farewell()?;
        self.progress.done();
        Ok(told)
    }

    fn file(&self, name: &str) -> String {
        self.folder.path().join(name).display().to_string()
    }

    /// Starts a leader and waits until it listens.
    fn lead(&mut self) -> anyhow::Result<Program> {
        let listen = self.site.listen();
        let song = self.file("song.wav");
        let words = ["lead", &song, "--listen", &listen, "--quiet"].map(str::to_owned);
        let mut leader = Program(self.site.start(0, 0.0, &words)?);
        let began = Instant::now();
        while TcpStream::connect(self.site.leader()).is_err() {
            if let Some(status) = leader.0.try_wait()? {
                bail!("the leader ended at once ({status})");
            }
            if began.elapsed() > PATIENCE {
                bail!("the leader does not listen");
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        Ok(leader)
    }

    /// Starts a follower behind its network.
    fn follow(&mut self, place: usize) -> anyhow::Result<()> {
        let good = place == 1;
        let fault = Fault {
            delay_s: if good {
                0.0
            } else {
                self.trial.delay_ms * 1e-3
            },
            loss: match self.site.models_loss() && !good {
                true => self.trial.loss,
                false => 0.0,
            },
        };
        let number = u8::try_from(place).context("too many followers")?;
        let relay = self.site.relay(number, fault, self.rng.random())?;
        let wrong_s = self.rng.random_range(-CLOCK_WRONG_S..CLOCK_WRONG_S);
        let drift_ppm = self.rng.random_range(-CLOCK_DRIFT_PPM..CLOCK_DRIFT_PPM);
        let words = [
            "follow",
            "--robot",
            &self.trial.robot,
            "--name",
            &format!("follower-{place}"),
            "--connect",
            &format!("tcp/{}", relay.address),
            "--clock-offset",
            &wrong_s.to_string(),
            "--clock-drift-ppm",
            &drift_ppm.to_string(),
            "--witness",
            &self.file(&format!("{place}.txt")),
            "--report",
            &self.file(&format!("{place}.json")),
            "--quiet",
        ]
        .map(str::to_owned);
        let loss = if good { 0.0 } else { self.trial.loss };
        self.followers
            .push(Program(self.site.start(number, loss, &words)?));
        self.relays.push(relay);
        Ok(())
    }

    /// Cuts all links but that of the first, or joins them again.
    fn cut(&self, cut: bool) -> anyhow::Result<()> {
        for (place, relay) in (1..).zip(&self.relays).skip(1) {
            self.site.cut(place, relay, cut)?;
        }
        Ok(())
    }

    fn wait(&mut self, seconds: f64, stop: &AtomicBool) -> anyhow::Result<()> {
        let until = Instant::now() + Duration::from_secs_f64(seconds);
        while Instant::now() < until {
            if stop.load(Ordering::Relaxed) {
                bail!("stopped");
            }
            for (place, follower) in (1..).zip(&mut self.followers) {
                if let Some(status) = follower.0.try_wait()? {
                    bail!("follower {place} ended by itself ({status})");
                }
            }
            let share = self.began.elapsed().as_secs_f64() / self.total_s();
            self.progress.at(100.0 * share.min(1.0));
            std::thread::sleep(Duration::from_millis(20));
        }
        Ok(())
    }

    /// Ends the followers as a user would, so that they write their figures.
    fn farewell(&mut self) -> anyhow::Result<()> {
        for follower in &self.followers {
            kill(Pid::from_raw(follower.0.id() as i32), Signal::SIGTERM)?;
        }
        let began = Instant::now();
        for (place, follower) in (1..).zip(&mut self.followers) {
            while follower.0.try_wait()?.is_none() {
                if began.elapsed() > FAREWELL {
                    bail!("follower {place} does not end");
                }
                std::thread::sleep(Duration::from_millis(20));
            }
        }
        Ok(())
    }

    /// Sets the robots side by side.
    fn judge(&self, told: &Told) -> anyhow::Result<Figures> {
        let (mut reports, mut tracks) = (Vec::new(), Vec::new());
        for place in 1..=self.trial.followers {
            reports.push(read_report(Path::new(
                &self.file(&format!("{place}.json")),
            ))?);
            tracks.push(Track::read(Path::new(&self.file(&format!("{place}.txt"))))?);
        }
        let all: Vec<&Track> = tracks.iter().collect();
        let ends: Vec<&Track> = all.first().into_iter().chain(all.last()).copied().collect();
        let [from_s, to_s] = told.steady_s;
        let count = ((to_s - from_s - spread::WINDOW_S) / HOP_S) as u32;
        let windows = (0..count).map(|i| together(&all, from_s + f64::from(i) * HOP_S));
        let (mut spreads_ms, mut apart) = (Vec::new(), 0);
        for window in windows {
            match window {
                Together::Within(spread_s) => spreads_ms.push(spread_s * 1e3),
                Together::Apart => apart += 1,
                Together::Unknown => {}
            }
        }
        spreads_ms.sort_by(f64::total_cmp);
        let quantile = |share: f64| crate::follow::Followed::quantile(&spreads_ms, share);
        let settled = |tracks: &[&Track], from_s, to_s| {
            let several = self.trial.followers > 1;
            several.then(|| settled_s(tracks, from_s, to_s, ONE_BEAT_S))?
        };
        let idle_s = tracks
            .iter()
            .map(|track| track.idles_s(told.killed_s, true));
        let idle_s = idle_s.collect::<Option<Vec<f64>>>();
        let greatest =
            |value: fn(&FollowReport) -> f64| reports.iter().map(value).fold(0.0, f64::max);
        let sum = |value: fn(&FollowReport) -> u64| -> u64 { reports.iter().map(value).sum() };
        Ok(Figures {
            version: env!("CARGO_PKG_VERSION"),
            robot: self.trial.robot.clone(),
            followers: self.trial.followers,
            namespaces: self.trial.namespaces,
            delay_ms: self.trial.delay_ms,
            loss: self.trial.loss,
            loss_modelled: self.trial.loss > 0.0 && self.site.models_loss(),
            windows: spreads_ms.len(),
            spread_ms_p50: quantile(0.5),
            spread_ms_p99: quantile(0.99),
            spread_ms_max: quantile(1.0),
            windows_apart: apart,
            join_s: settled(&ends, told.joined_s, told.steady_s[0]),
            recovery_s: settled(&all, told.whole_s, told.killed_s),
            idle_s: idle_s.map(|all| all.into_iter().fold(0.0, f64::max) - told.killed_s),
            leader_recovery_s: settled(&all, told.next_s, told.end_s),
            violations: sum(|r| {
                let broken = r.followed.violations.unwrap_or_default();
                broken.position + broken.velocity + broken.acceleration
            }),
            lead_ms: greatest(|r| r.lead_ms),
            way_ms: greatest(|r| r.way_ms),
            lost_frames: sum(|r| r.lost_frames),
            late_frames: sum(|r| r.followed.late_frames),
            cycle_late_ms_p99: greatest(|r| r.followed.late_ms_p99),
            cycle_late_ms_max: greatest(|r| r.followed.late_ms_max),
            cpu_cores: reports.iter().map(|r| r.cpu_cores).sum::<f64>() / reports.len() as f64,
            cpu_cores_max: greatest(|r| r.cpu_cores),
        })
    }
}

fn read_report(path: &Path) -> anyhow::Result<FollowReport> {
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("a follower wrote no figures to {}", path.display()))?;
    Ok(serde_json::from_str(&text)?)
}

impl fmt::Display for Figures {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let seconds = |value: Option<f64>| value.map_or("never".into(), |s| format!("{s:.1} s"));
        writeln!(
            out,
            "{} x {}, {} ms each way, {} % lost{}",
            self.followers,
            self.robot,
            self.delay_ms,
            self.loss * 100.0,
            if self.loss_modelled {
                " (modelled)"
            } else {
                ""
            }
        )?;
        writeln!(
            out,
            "spread at the servos   p50 {:.1} ms, p99 {:.1} ms, worst {:.1} ms of {} windows; {} apart",
            self.spread_ms_p50,
            self.spread_ms_p99,
            self.spread_ms_max,
            self.windows,
            self.windows_apart
        )?;
        writeln!(
            out,
            "late joiner            {} until on the beat",
            seconds(self.join_s)
        )?;
        writeln!(
            out,
            "links cut for 3 s      {} until on one beat",
            seconds(self.recovery_s)
        )?;
        writeln!(
            out,
            "leader killed          {} until all idle; the next one: {} from its start",
            seconds(self.idle_s),
            seconds(self.leader_recovery_s)
        )?;
        writeln!(
            out,
            "frames                 sent {:.0} ms ahead, {:.0} ms on their way at most; {} lost, {} late",
            self.lead_ms, self.way_ms, self.lost_frames, self.late_frames
        )?;
        writeln!(
            out,
            "control cycles         p99 {:.1} ms, worst {:.1} ms late",
            self.cycle_late_ms_p99, self.cycle_late_ms_max
        )?;
        writeln!(
            out,
            "processor              {:.1} % of a core a follower, {:.1} % the hungriest",
            self.cpu_cores * 100.0,
            self.cpu_cores_max * 100.0
        )?;
        writeln!(out, "limits broken          {}", self.violations)
    }
}
