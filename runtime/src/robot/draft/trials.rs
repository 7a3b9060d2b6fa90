//! Rates, crouch and stance of a new robot, settled by dancing with it.

use super::file_text::{FilePlan, robot_file};
use crate::offline::motion_tracking::{TrackedMotion, track_motion};
use crate::physics::find_amplitude;
use crate::robot::config_source::ConfigSource;
use crate::robot::loaded::Robot;
use crate::robot::overrides::Overrides;
use crate::robot::robot_file::RobotError;
use crate::telemetry::JointSpans;
use anyhow::bail;
use servodance_retarget::{BodyKind, DiagnosticCode, Stance, rest_deg};

/// Baud rates and control rates that are tried until the servos fit.
pub(super) const RATES: [(u32, f64); 5] = [
    (1_000_000, 100.0),
    (2_000_000, 100.0),
    (4_000_000, 100.0),
    (4_000_000, 50.0),
    (4_000_000, 20.0),
];
/// Crouches of a standing robot that are tried in turn, as shares of its leg length.
const CROUCHES: [f64; 3] = [0.05, 0.12, 0.2];
/// Share of cycles that may go wrong before a robot is put on a stand.
const TOLERATED: f64 = 1e-3;

impl FilePlan<'_> {
    /// Finds rates that the bus can carry and a stance that holds in a dance.
    pub(super) fn settle(&mut self) -> anyhow::Result<()> {
        if self.draft.config.stance == Stance::Planted {
            match self.stand()? {
                Ok(line) => self.tried.push(line),
                Err(why) => {
                    let line = format!("planted was tried and given up ({why}): hung on a stand");
                    self.tried.push(line);
                    self.draft.config.stance = Stance::Hung;
                }
            }
        }
        if self.draft.config.stance == Stance::Planted && !self.dances.is_empty() {
            self.keep_on_its_feet()?;
        }
        let robot = self.fitting_robot()??;
        self.rest =
            rest_deg(&robot.urdf_xml, &robot.retarget, &robot.joint_limits(), robot.control_hz)?;
        let robot = self.parse()?;
        let mut moved = JointSpans::new(robot.servos.len());
        let followed = track_motion(&robot, &self.trial.frames(), |_, positions_rad| {
            moved.see(positions_rad);
            Ok(())
        })?;
        moved.refuse_still()?;
        let duration_s = self.trial.frames().len() as f64 / servodance_types::FRAME_RATE_HZ;
        self.tried.push(danced(&followed, robot.retarget.kind, duration_s));
        Ok(())
    }

    /// Finds how much of a dance the robot can stand in the simulated world.
    fn keep_on_its_feet(&mut self) -> anyhow::Result<()> {
        let robot = self.parse()?;
        let links = robot.retargeter()?.rigid_links();
        if links.iter().all(|link| link.mass_kg == 0.0) {
            self.hang("no link has a mass, so that nothing tells whether it would fall");
            return Ok(());
        }
        let Some(found) = find_amplitude(&robot, self.dances, true)? else {
            self.hang("in the simulated world it falls whatever it leaves out");
            return Ok(());
        };
        let (shares, config) = (found.shares, &mut self.draft.config);
        shares.scale(config);
        let shown = match config.kind {
            BodyKind::Quadruped => {
                format!("{:.0} % of the trunk's movement", shares.pelvis * 100.0)
            }
            _ => shares.shown(&config.body),
        };
        self.tried.push(format!(
            "in the simulated world (motors as strong as its masses ask for) it stands and dances \
             with {shown}"
        ));
        Ok(())
    }

    fn hang(&mut self, why: &str) {
        self.draft.config.stance = Stance::Hung;
        self.tried.push(format!("{why}: hung on a stand"));
    }

    fn stand(&mut self) -> anyhow::Result<Result<String, String>> {
        let mut verdict = Err(String::new());
        for crouch in CROUCHES {
            self.draft.config.crouch = crouch;
            verdict = match self.fitting_robot()? {
                Ok(robot) => stands(&self.dance(&robot)?),
                Err(error) => Err(format!("{error:#}")),
            };
            if verdict.is_ok() {
                break;
            }
        }
        Ok(verdict)
    }

    /// The robot at the first rates that the bus carries; the inner error is
    /// of the robot, the outer of the rates.
    fn fitting_robot(&mut self) -> anyhow::Result<anyhow::Result<Robot>> {
        for rates in RATES {
            self.rates = rates;
            match self.parse() {
                Err(error) if code(&error) == Some(DiagnosticCode::BusRate) => {}
                other => return Ok(other),
            }
        }
        bail!("{} servos are too many for one bus", self.servos.len())
    }

    fn dance(&self, robot: &Robot) -> anyhow::Result<TrackedMotion> {
        track_motion(robot, &self.trial.frames(), |_, _| Ok(()))
    }

    fn parse(&self) -> anyhow::Result<Robot> {
        let source = ConfigSource {
            file: "the new robot file",
            text: &robot_file(self),
            overrides: &Overrides::default(),
        };
        Robot::from_source(&source, |_| Ok(self.source.to_owned()))
    }
}

fn code(error: &anyhow::Error) -> Option<DiagnosticCode> {
    error.downcast_ref::<RobotError>().map(|error| error.code)
}

fn stands(followed: &TrackedMotion) -> Result<String, String> {
    let share = |count: u64| count as f64 / followed.cycles.max(1) as f64;
    let (feet, balance) =
        (share(followed.counts.feet_moved_cycles), share(followed.counts.unbalanced_cycles));
    if feet > TOLERATED {
        return Err(format!("a foot slipped in {:.1} % of cycles", feet * 100.0));
    }
    if balance > TOLERATED {
        return Err(format!("out of balance in {:.1} % of cycles", balance * 100.0));
    }
    Ok("planted: both feet stay and the balance is kept".into())
}

fn danced(followed: &TrackedMotion, kind: BodyKind, duration_s: f64) -> String {
    let broken = followed.violations;
    let median = TrackedMotion::quantile(&followed.direction_errors_deg, 0.5);
    let arms = match followed.direction_errors_deg.is_empty() {
        true if kind.is_human_like() => "; no arms to compare".into(),
        true => String::new(),
        false => format!("; arms point within {median:.0} degrees of the dancer's (median)"),
    };
    let touching = match kind {
        BodyKind::Quadruped | BodyKind::Biped => "a leg touching another part",
        BodyKind::Arm => "the arm touching itself",
        _ => "an arm touching the body",
    };
    format!(
        "{duration_s:.0} s of dance: {} limits broken, {} cycles with {touching}{arms}",
        broken.position + broken.velocity + broken.acceleration,
        followed.counts.collision_cycles,
    )
}
