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

mod figures;
mod judge;
mod relay;
mod site;
mod spread;

pub use figures::StageBenchReport;

use anyhow::{Context, bail};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use relay::{LinkFault, Relay};
use servodance_drivers::BusLayout;
use servodance_runtime::offline::song_file::write_demo_for;
use servodance_runtime::process::progress::Progress;
use servodance_runtime::robot::Robot;
use servodance_runtime::stage::shared_s;
use site::Site;
use std::net::TcpStream;
use std::process::Child;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// From the first programs to the late one, and from it to what is measured.
const SETTLE_S: [f64; 2] = [11.0, 7.0];
/// How long links are cut and the leader is away.
const AWAY_S: f64 = 3.0;
/// How long it is watched what becomes of it.
const WATCHED_S: [f64; 2] = [10.0, 18.0];
const PATIENCE: Duration = Duration::from_secs(60);
/// Followers are gone within this after they were told.
const FAREWELL: Duration = Duration::from_secs(20);
/// How long a bus waits for simulated servos on a starved machine, and they for a
/// command, milliseconds: the network is judged here, not the processor.
const REPLY_MS: u32 = 500;
const WATCHDOG_MS: u32 = 2000;
/// Clocks are wrong by up to this, seconds, and millionths.
const CLOCK_WRONG_S: f64 = 900.0;
const CLOCK_DRIFT_PPM: f64 = 50.0;

/// How many robots dance together, behind which network.
#[derive(Clone, Debug)]
#[allow(missing_docs)] // the other names say it
pub struct StageBench {
    pub followers: usize,
    pub robot: String,
    /// Delay of the network each way, milliseconds.
    pub delay_ms: f64,
    /// Share of what is sent that is lost.
    pub loss: f64,
    /// Seconds that are measured before things go wrong.
    pub seconds: f64,
    pub namespaces: bool,
    pub seed: u64,
}

/// Runs leader and followers through the whole trial and compares them.
/// Fails for: programs that cannot be started or that failed.
pub fn bench(trial: &StageBench, stop: &AtomicBool) -> anyhow::Result<StageBenchReport> {
    let mut stage = StageTrial::new(trial)?;
    let told = stage.play(stop)?;
    judge::judge(&stage, &told)
}

/// Programs that are ended when this is dropped.
struct Program(Child);

struct Member {
    program: Program,
    relay: Relay,
    /// It ended by itself, before it was told to.
    fell: bool,
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// When what happened, seconds of the shared clock.
#[derive(Clone, Copy, Debug, Default)]
struct TrialTimes {
    joined_s: f64,
    steady_s: [f64; 2],
    whole_s: f64,
    killed_s: f64,
    next_s: f64,
    end_s: f64,
}

struct StageTrial<'a> {
    trial: &'a StageBench,
    site: Site,
    folder: TempDir,
    rng: ChaCha8Rng,
    members: Vec<Member>,
    patience: Vec<String>,
    progress: Progress,
    began: Instant,
}

impl<'a> StageTrial<'a> {
    fn new(trial: &'a StageBench) -> anyhow::Result<Self> {
        let stage = Self {
            site: Site::new(trial.namespaces)?,
            folder: tempfile::tempdir()?,
            rng: ChaCha8Rng::seed_from_u64(trial.seed),
            members: Vec::new(),
            patience: patience(&Robot::load(&trial.robot)?),
            progress: Progress::share("measuring", false),
            began: Instant::now(),
            trial,
        };
        write_demo_for(&stage.folder.path().join("song.wav"), stage.total_s() + 30.0)?;
        Ok(stage)
    }

    fn total_s(&self) -> f64 {
        let settle_s = SETTLE_S[0] + SETTLE_S[1];
        settle_s + self.trial.seconds + 2.0 * AWAY_S + WATCHED_S[0] + WATCHED_S[1]
    }

    fn play(&mut self, stop: &AtomicBool) -> anyhow::Result<TrialTimes> {
        let mut told = TrialTimes::default();
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

    fn follow(&mut self, place: usize) -> anyhow::Result<()> {
        let good = place == 1;
        let fault = LinkFault {
            delay_s: if good { 0.0 } else { self.trial.delay_ms * 1e-3 },
            loss: match self.site.models_loss() && !good {
                true => self.trial.loss,
                false => 0.0,
            },
        };
        let number = u8::try_from(place).context("too many followers")?;
        let relay = self.site.relay(number, fault, self.rng.random())?;
        let wrong_s = self.rng.random_range(-CLOCK_WRONG_S..CLOCK_WRONG_S);
        let drift_ppm = self.rng.random_range(-CLOCK_DRIFT_PPM..CLOCK_DRIFT_PPM);
        let mut words = [
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
        .map(str::to_owned)
        .to_vec();
        for set in &self.patience {
            words.extend(["--set".to_owned(), set.clone()]);
        }
        let loss = if good { 0.0 } else { self.trial.loss };
        self.members.push(Member {
            program: Program(self.site.start(number, loss, &words)?),
            relay,
            fell: false,
        });
        Ok(())
    }

    /// Cuts all links but that of the first, or joins them again.
    fn cut(&self, cut: bool) -> anyhow::Result<()> {
        for (place, member) in (1..).zip(&self.members).skip(1) {
            if !member.fell {
                self.site.cut(place, &member.relay, cut)?;
            }
        }
        Ok(())
    }

    fn wait(&mut self, seconds: f64, stop: &AtomicBool) -> anyhow::Result<()> {
        let until = Instant::now() + Duration::from_secs_f64(seconds);
        while Instant::now() < until {
            if stop.load(Ordering::Relaxed) {
                bail!("stopped");
            }
            self.look_after()?;
            let share = self.began.elapsed().as_secs_f64() / self.total_s();
            self.progress.at(100.0 * share.min(1.0));
            std::thread::sleep(Duration::from_millis(20));
        }
        Ok(())
    }

    /// Notes who ended by itself; the others dance on.
    fn look_after(&mut self) -> anyhow::Result<()> {
        for (place, member) in (1..).zip(&mut self.members) {
            if member.fell {
                continue;
            }
            if let Some(status) = member.program.0.try_wait()? {
                member.fell = true;
                self.progress.note(&format!(
                    "follower {place} ended by itself ({status}); the others dance on"
                ));
            }
        }
        if !self.members.is_empty() && self.members.iter().all(|member| member.fell) {
            bail!("all followers ended by themselves");
        }
        Ok(())
    }

    /// Ends the followers as a user would, so that they write their figures.
    fn farewell(&mut self) -> anyhow::Result<()> {
        for member in self.members.iter().filter(|member| !member.fell) {
            kill(Pid::from_raw(member.program.0.id() as i32), Signal::SIGTERM)?;
        }
        let began = Instant::now();
        for (place, member) in (1..).zip(&mut self.members) {
            while member.program.0.try_wait()?.is_none() {
                if began.elapsed() > FAREWELL {
                    bail!("follower {place} does not end");
                }
                std::thread::sleep(Duration::from_millis(20));
            }
        }
        Ok(())
    }
}

/// What makes the simulated servos of a robot patient.
fn patience(robot: &Robot) -> Vec<String> {
    let several = robot.buses.len() > 1;
    let set = |bus: &BusLayout| {
        let key = match several {
            true => format!("bus.{}", bus.config.name),
            false => "bus".to_owned(),
        };
        [("reply_timeout_ms", REPLY_MS), ("watchdog_ms", WATCHDOG_MS)]
            .map(|(what, value)| format!("{key}.{what}={value}"))
    };
    robot.buses.iter().flat_map(set).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_runtime::robot::Overrides;

    #[test]
    fn every_built_in_robot_can_be_patient() {
        for name in ["neck", "torso13", "op3", "lite22"] {
            let robot = Robot::load(name).unwrap();
            let set = Overrides::from_user(&patience(&robot)).unwrap();
            let robot = Robot::load_with(name, &set).unwrap();
            for bus in robot.buses {
                assert_eq!(bus.config.reply_timeout_ms, f64::from(REPLY_MS), "{name}");
            }
        }
    }
}
