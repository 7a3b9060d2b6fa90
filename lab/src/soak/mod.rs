//! The soak: hours of music at maximum speed through the whole path in
//! simulation, while things go wrong at random.
//!
//! One dance after another in one program. It passes if the simulated servos
//! counted no broken limit, no servo drove after the end of any dance, every
//! dance in which nothing went wrong reached its end, and resident memory stayed
//! flat. Faults may end a dance: safely, then the next begins.

mod fault_plan;
mod memory;
mod music;

pub use memory::Memory;
pub use music::SoakMusic;

use fault_plan::{PlannedFault, faults, script};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use servodance_drivers::ServoLost;
use servodance_model::Generator;
use servodance_runtime::control::idle::IdleStyle;
use servodance_runtime::robot::Robot;
use servodance_runtime::session::fault_run::FaultRun;
use servodance_runtime::session::fault_run::FaultRunResult;
use servodance_runtime::telemetry::ViolationReport;
use servodance_runtime::world::WorldChoice;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// One dance in so many has no fault.
const CALM_EVERY: usize = 4;
/// Memory is looked at this often, seconds of music.
const LOOK_EVERY_S: f64 = 5.0;
/// Causes of stops that are kept in words.
const CAUSES: usize = 20;

/// What is soaked, and for how long.
#[derive(Clone, Debug)]
#[allow(missing_docs)] // the other names say it
pub struct Soak {
    pub robot: Robot,
    pub music: SoakMusic,
    pub piece_s: f64,
    pub total_s: f64,
    /// A fault every so many seconds, on average.
    pub fault_every_s: f64,
    pub seed: u64,
}

/// What became of the faults of one kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct FaultTally {
    /// How often it happened.
    pub happened: u64,
    /// The dance went on.
    pub recovered: u64,
    /// The dance ended with it, safely unless said otherwise.
    pub stopped: u64,
}

/// A dance that a simulated fault ended.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FaultStop {
    /// Name of the fault.
    pub fault: &'static str,
    /// When it began, seconds since torque on.
    pub at_s: f64,
    /// What the program said, as it would of real servos. Whether the simulated
    /// ones still drove was looked at: see `objections`.
    pub said: String,
}

/// The verdict on a soak, and its figures.
#[derive(Clone, Debug, Default, Serialize)]
#[allow(missing_docs)] // the other names say it
pub struct SoakReport {
    pub passed: bool,
    /// Why not, a line each.
    pub objections: Vec<String>,
    pub interrupted: bool,
    pub version: &'static str,
    pub robot: String,
    pub seed: u64,
    pub music_s: f64,
    /// Seconds on the clock.
    pub wall_s: f64,
    pub dances: u64,
    pub finished: u64,
    pub faults: BTreeMap<&'static str, FaultTally>,
    /// What ended dances, the first of them.
    pub stopped_by: Vec<FaultStop>,
    /// Limits broken at the simulated servos.
    pub violations: ViolationReport,
    pub late_frames: u64,
    /// Resident memory of the program over the soak.
    pub memory: Memory,
}

impl Soak {
    /// Dances until the time is over. `progress` is told the seconds of music so far; `stop` ends it.
    /// Fails for: music that cannot be read, a dance that cannot begin.
    pub fn run(
        &self,
        generator: &Generator,
        stop: &AtomicBool,
        mut progress: impl FnMut(f64),
    ) -> anyhow::Result<SoakReport> {
        memory::give_large_blocks_back();
        let began = Instant::now();
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let mut summary = SoakReport {
            version: env!("CARGO_PKG_VERSION"),
            robot: self.robot.name.clone(),
            seed: self.seed,
            ..SoakReport::default()
        };
        let mut round = 0_usize;
        while summary.music_s < self.total_s && !stop.load(Ordering::Relaxed) {
            let faults = match (round + 1).is_multiple_of(CALM_EVERY) {
                true => Vec::new(),
                false => faults(&self.robot, self.piece_s, self.fault_every_s, &mut rng),
            };
            let robot = self.robot_of(&mut rng);
            let styles = generator.styles();
            let fault_run = FaultRun {
                robot: &robot,
                generator,
                world: WorldChoice::None,
                song: self.music.piece(round)?,
                faults: script(&faults),
                seed: rng.random(),
                style: Some(styles[rng.random_range(0..styles.len())].clone()),
                idle: IDLES[rng.random_range(0..IDLES.len())],
                as_live: rng.random(),
            };
            let (memory, so_far_s) = (&mut summary.memory, summary.music_s);
            let mut looked_s = 0.0;
            let result = fault_run.run(stop, |time_s| {
                if time_s >= looked_s + LOOK_EVERY_S {
                    looked_s = time_s;
                    memory.sample();
                    progress(so_far_s + time_s);
                }
            })?;
            summary.take(round, &faults, result);
            round += 1;
        }
        summary.interrupted = stop.load(Ordering::Relaxed);
        summary.wall_s = began.elapsed().as_secs_f64();
        summary.judge();
        Ok(summary)
    }

    /// The robot with another policy for what is lost.
    fn robot_of(&self, rng: &mut ChaCha8Rng) -> Robot {
        let mut robot = self.robot.clone();
        let policies = [ServoLost::Stop, ServoLost::Hold, ServoLost::DanceOn];
        robot.safety.on_servo_lost = policies[rng.random_range(0..policies.len())];
        robot.safety.rearm = rng.random();
        robot
    }
}

const IDLES: [IdleStyle; 3] = [IdleStyle::Sway, IdleStyle::Hold, IdleStyle::Rest];

impl SoakReport {
    fn take(&mut self, round: usize, faults: &[PlannedFault], result: FaultRunResult) {
        self.dances += 1;
        self.music_s += result.music_s;
        self.late_frames += result.late_frames;
        self.violations.position += result.violations.position;
        self.violations.velocity += result.violations.velocity;
        self.violations.acceleration += result.violations.acceleration;
        let mut object = |what: String| self.objections.push(format!("dance {round}: {what}"));
        if let Some(note) = result.violation_notes.first() {
            object(format!("a limit was broken: {note}"));
        }
        if !result.unsafe_joints.is_empty() {
            object(format!("still driven at the end: {}", result.unsafe_joints.join(", ")));
        }
        let happened: Vec<&PlannedFault> =
            faults.iter().filter(|f| f.at_s <= result.robot_s).collect();
        match (&result.stopped_by, happened.last()) {
            (None, _) => self.finished += 1,
            (Some(cause), None) => {
                object(format!("ended although nothing went wrong: {cause}"));
            }
            (Some(cause), Some(fault)) if self.stopped_by.len() < CAUSES => {
                self.stopped_by.push(FaultStop {
                    fault: fault.kind,
                    at_s: fault.at_s,
                    said: cause.clone(),
                });
            }
            _ => {}
        }
        for (place, fault) in happened.iter().enumerate() {
            let tally = self.faults.entry(fault.kind).or_default();
            let stopped = result.stopped_by.is_some() && place + 1 == happened.len();
            tally.happened += 1;
            tally.stopped += u64::from(stopped);
            tally.recovered += u64::from(!stopped);
        }
    }

    /// Whether all was as it must be.
    fn judge(&mut self) {
        let growth = self.memory.growth();
        if let Some(growth) = growth.filter(|growth| *growth > memory::FLAT) {
            let percent = growth * 100.0;
            self.objections.push(format!("memory grew by {percent:.1} %"));
        }
        self.passed = self.objections.is_empty();
    }

    /// All of it in one line.
    pub fn line(&self) -> String {
        let sum = |of: fn(&FaultTally) -> u64| self.faults.values().map(of).sum::<u64>();
        let v = self.violations;
        let memory = match self.memory.growth() {
            Some(growth) => format!(
                "memory {:.0} MiB at most, {:+.1} % from the first part to the last",
                self.memory.highest_mib(),
                growth * 100.0
            ),
            None => "memory not judged".into(),
        };
        let verdict = match (self.passed, self.objections.first()) {
            (true, _) => "passed".to_owned(),
            (false, first) => format!("FAILED: {}", first.cloned().unwrap_or_default()),
        };
        format!(
            "{:.1} min of music on {} in {:.0} s ({:.1}x): {} dances, {} faults ({} recovered, \
             {} stopped safely), limits broken {}/{}/{}, {memory}: {verdict}",
            self.music_s / 60.0,
            self.robot,
            self.wall_s,
            self.music_s / self.wall_s.max(1e-9),
            self.dances,
            sum(|tally| tally.happened),
            sum(|tally| tally.recovered),
            sum(|tally| tally.stopped),
            v.position,
            v.velocity,
            v.acceleration,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn result(stopped_by: Option<&str>, robot_s: f64) -> FaultRunResult {
        FaultRunResult {
            stopped_by: stopped_by.map(String::from),
            music_s: 10.0,
            robot_s,
            violations: ViolationReport::default(),
            violation_notes: Vec::new(),
            unsafe_joints: Vec::new(),
            late_frames: 0,
            body: None,
            fall_s: None,
            events: Vec::new(),
        }
    }

    fn fault(kind: &'static str, at_s: f64) -> PlannedFault {
        let cues = Vec::new();
        PlannedFault { kind, at_s, cues }
    }

    #[test]
    fn faults_are_tallied_by_what_became_of_them() {
        let mut summary = SoakReport::default();
        let day = [fault("a", 1.0), fault("b", 2.0), fault("a", 9.0)];
        summary.take(0, &day, result(Some("b broke"), 2.5));
        summary.take(1, &day, result(None, 12.0));
        summary.judge();
        let tally = |happened, recovered, stopped| FaultTally { happened, recovered, stopped };
        assert_eq!(summary.faults["a"], tally(3, 3, 0));
        assert_eq!(summary.faults["b"], tally(2, 1, 1));
        assert!(summary.passed && summary.finished == 1, "{summary:?}");
        let stop = &summary.stopped_by[0];
        assert_eq!((stop.fault, stop.at_s), ("b", 2.0));
        assert!(summary.line().ends_with("passed"), "{}", summary.line());
    }

    #[test]
    fn whatever_must_not_be_is_objected_to() {
        let objections = |change: fn(&mut FaultRunResult)| {
            let mut summary = SoakReport::default();
            let mut result = result(None, 12.0);
            change(&mut result);
            summary.take(0, &[], result);
            summary.judge();
            assert!(!summary.passed);
            summary.line()
        };
        for (said, word) in [
            (objections(|e| e.violation_notes = vec!["knee".into()]), "knee"),
            (objections(|e| e.unsafe_joints = vec!["hip".into()]), "hip"),
            (objections(|e| e.stopped_by = Some("silent".into())), "nothing went wrong"),
        ] {
            assert!(said.contains("FAILED") && said.contains(word), "{said}");
        }
        let memory = Memory { looks_mib: vec![100.0, 106.0] };
        let mut summary = SoakReport { memory, ..SoakReport::default() };
        summary.judge();
        assert!(!summary.passed && summary.line().contains("grew by 6.0 %"));
    }
}
