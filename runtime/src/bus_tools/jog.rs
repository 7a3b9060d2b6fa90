//! Moving one joint by hand, from the keyboard or by one amount.
//!
//! The bus is opened with that one servo alone: no other gets torque. Targets
//! move at the chosen speed and pass through [`SafeBus`] like those of a dance;
//! every way out (the end, Ctrl-C, an error) ends in torque off.

use super::consent::Consent;
use super::plug;
use crate::control::emergency_stop::EmergencyStopWatch;
use crate::process::console::{stderr_line, stdout_line};
use crate::process::output_thread::OutputThread;
use crate::process::wrong_usage::misused;
use crate::robot::Robot;
use anyhow::bail;
use servodance_drivers::{Bus, EStop, SafeBus, Servo, State, open_bus};
use servodance_types::JointState;
use std::io::BufRead;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::{Duration, Instant};

/// How long the joint gets to arrive after its target has.
const SETTLE_S: f64 = 0.5;

/// Less than an encoder tick.
const ARRIVED_RAD: f64 = 1e-3;

/// A change of the target, degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum JogStep {
    /// By an amount from the present target.
    By(f64),
    /// To an angle, wherever the target is.
    To(f64),
}

impl JogStep {
    /// Reads `5`, `+5`, `-5` (by) and `=30` (to).
    pub fn parse(text: &str) -> anyhow::Result<Self> {
        let (step, number): (fn(f64) -> Self, &str) = match text.strip_prefix('=') {
            Some(rest) => (Self::To, rest),
            None => (Self::By, text),
        };
        match number.trim().parse::<f64>() {
            Ok(degrees) if degrees.is_finite() => Ok(step(degrees)),
            _ => misused!("\"{text}\" is no step: degrees, as 5, -5, or =30 for an angle"),
        }
    }

    /// Where it leads, radians.
    fn target_rad(self, from_rad: f64, servo: &Servo) -> anyhow::Result<f64> {
        let target_rad = match self {
            Self::By(degrees) => from_rad + degrees.to_radians(),
            Self::To(degrees) => degrees.to_radians(),
        };
        let limits = servo.limits;
        if (limits.lower_rad..=limits.upper_rad).contains(&target_rad) {
            return Ok(target_rad);
        }
        bail!(
            "{} goes from {:.1} to {:.1} degrees, not to {:.1}",
            servo.name,
            limits.lower_rad.to_degrees(),
            limits.upper_rad.to_degrees(),
            target_rad.to_degrees()
        )
    }
}

/// Options of `servodance jog`.
#[derive(Debug)]
pub struct Jog<'a> {
    /// The robot of the joint.
    pub robot: &'a Robot,
    /// The joint to move, by name.
    pub joint: &'a str,
    /// The port of its bus, or of every bus of the robot.
    pub ports: &'a [String],
    /// One step, then the end; without it, steps from standard input.
    pub step: Option<JogStep>,
    /// Speed of the target, degrees a second.
    pub speed_deg_s: f64,
}

impl Jog<'_> {
    /// Asks, moves, and turns torque off. Returns where the joint went.
    pub fn run(&self, consent: Consent, stop: &AtomicBool) -> anyhow::Result<String> {
        let servo = self.robot.servo(self.joint)?.clone();
        let (port, layout) = plug::joint(self.robot, self.joint, self.ports)?;
        let fastest_deg_s = servo.limits.velocity_rad_s.to_degrees();
        if !(self.speed_deg_s > 0.0 && self.speed_deg_s <= fastest_deg_s) {
            bail!(
                "--speed {} must be above 0 and at most {fastest_deg_s:.0} degrees a second, the limit of {}",
                self.speed_deg_s,
                servo.name
            );
        }
        if let Some(step @ JogStep::To(_)) = self.step {
            step.target_rad(0.0, &servo)?;
        }
        consent.obtain(&format!(
            "{} (id {}) of {} gets torque and moves at up to {} degrees a second; \
             at the end its torque goes off: hold what it carries.",
            servo.name, servo.id, self.robot.name, self.speed_deg_s
        ))?;
        let bus = open_bus(&port, &layout.config, layout.servos)?;
        let estop = EStop::default();
        let _watch = EmergencyStopWatch::start(&estop, None, false)?;
        let bus = SafeBus::new(bus, self.robot.safety)?.with_estop(estop);
        let mut joint = ArmedJoint::arm(bus, servo, self.robot.period_s())?;
        let from_deg = joint.position_deg();
        joint.step_rad = self.speed_deg_s.to_radians() * self.robot.period_s();
        let moved = match self.step {
            Some(step) => joint.aim(step).and_then(|()| joint.follow(stop, StepInput::none())),
            None => joint.follow(stop, StepInput::from_stdin()),
        };
        let to_deg = joint.position_deg();
        let stopped = joint.disarm();
        moved?;
        stopped?;
        Ok(format!("{}: from {from_deg:.1} to {to_deg:.1} degrees; its torque is off", self.joint))
    }
}

/// Steps that come in while the joint moves.
struct StepInput(Option<Receiver<String>>);

impl StepInput {
    fn none() -> Self {
        Self(None)
    }

    /// Lines of standard input, until it ends.
    fn from_stdin() -> Self {
        let (sender, receiver) = channel();
        std::thread::spawn(move || {
            for line in std::io::stdin().lock().lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    return;
                }
            }
        });
        Self(Some(receiver))
    }

    /// The next line, if there is one by now; `Err` when there will be none.
    fn next(&mut self) -> Result<Option<String>, ()> {
        let Some(receiver) = &self.0 else {
            return Err(());
        };
        match receiver.try_recv() {
            Ok(line) if line.trim() == "q" => self.end(),
            Ok(line) => Ok(Some(line)),
            Err(TryRecvError::Empty) => Ok(None),
            Err(TryRecvError::Disconnected) => self.end(),
        }
    }

    fn end(&mut self) -> Result<Option<String>, ()> {
        self.0 = None;
        Err(())
    }
}

/// The answer to a line from the user.
struct Told {
    mistake: Option<String>,
    place: String,
}

impl Told {
    fn print(self) {
        if let Some(mistake) = self.mistake {
            stderr_line!("{mistake}");
        }
        stdout_line!("{}", self.place);
    }
}

struct ArmedJoint {
    output: OutputThread<Told>,
    bus: SafeBus<Box<dyn Bus>>,
    servo: Servo,
    clock: Instant,
    period_s: f64,
    /// How far the target moves in a period.
    step_rad: f64,
    aim_rad: f64,
    target_rad: f64,
    states: [JointState; 1],
}

impl ArmedJoint {
    fn arm(mut bus: SafeBus<Box<dyn Bus>>, servo: Servo, period_s: f64) -> anyhow::Result<Self> {
        let clock = Instant::now();
        let report = bus.arm(clock.elapsed().as_secs_f64())?;
        for note in &report.notes {
            stderr_line!("{note}");
        }
        let Some(state) = report.states.first() else {
            bail!("{} told no state", servo.name);
        };
        let held_rad = servo.limits.clamp_rad(state.position_rad);
        Ok(Self {
            output: OutputThread::start(Told::print),
            states: [*state],
            bus,
            servo,
            clock,
            period_s,
            step_rad: 0.0,
            aim_rad: held_rad,
            target_rad: held_rad,
        })
    }

    fn position_deg(&self) -> f64 {
        self.states[0].position_rad.to_degrees()
    }

    fn aim(&mut self, step: JogStep) -> anyhow::Result<()> {
        self.aim_rad = step.target_rad(self.aim_rad, &self.servo)?;
        Ok(())
    }

    /// Moves until the joint has arrived and no step can come, or `stop`.
    fn follow(&mut self, stop: &AtomicBool, mut input: StepInput) -> anyhow::Result<()> {
        let mut arrived_s = None;
        let mut due_s = self.clock.elapsed().as_secs_f64();
        while !stop.load(Ordering::Acquire) {
            let over = match input.next() {
                Err(()) => true,
                Ok(None) => false,
                Ok(Some(line)) => {
                    self.apply_line(&line);
                    false
                }
            };
            self.tick()?;
            let now_s = self.clock.elapsed().as_secs_f64();
            // What is told lags what is wanted while the safety layer ramps in.
            if (self.bus.sent_rad()[0] - self.aim_rad).abs() > ARRIVED_RAD {
                arrived_s = None;
            } else if now_s - *arrived_s.get_or_insert(now_s) > SETTLE_S && over {
                return Ok(());
            }
            // After a stall the rhythm starts anew: no ticks are made up for.
            due_s = (due_s + self.period_s).max(now_s - self.period_s);
            std::thread::sleep(Duration::from_secs_f64((due_s - now_s).max(0.0)));
        }
        Ok(())
    }

    /// One line from the user. After a mistake nothing moves.
    fn apply_line(&mut self, line: &str) {
        let line = line.trim();
        let result = match line {
            "" => Ok(()),
            _ => JogStep::parse(line).and_then(|step| self.aim(step)),
        };
        let state = self.states[0];
        self.output.send(Told {
            mistake: result.err().map(|error| error.to_string()),
            place: format!(
                "{} at {:.1} degrees, {:.2} A, going to {:.1}",
                self.servo.name,
                state.position_rad.to_degrees(),
                state.current_a,
                self.aim_rad.to_degrees()
            ),
        });
    }

    fn tick(&mut self) -> anyhow::Result<()> {
        let left_rad = self.aim_rad - self.target_rad;
        self.target_rad = if left_rad.abs() <= self.step_rad {
            self.aim_rad
        } else {
            self.target_rad + self.step_rad.copysign(left_rad)
        };
        let now_s = self.clock.elapsed().as_secs_f64();
        self.bus.command(now_s, &[self.target_rad]);
        match self.bus.tick(now_s, &mut self.states)? {
            State::Running => Ok(()),
            state => bail!("{} stopped: {state:?}", self.servo.name),
        }
    }

    fn disarm(&mut self) -> anyhow::Result<()> {
        Ok(self.bus.disarm(self.clock.elapsed().as_secs_f64(), "end of jog")?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_read_and_held_against_the_limits() {
        let robot = Robot::load("neck").unwrap();
        let servo = robot.servo("neck_tilt").unwrap();
        let to_deg = |text: &str| {
            let target = JogStep::parse(text)?.target_rad(0.1f64.to_radians(), servo)?;
            anyhow::Ok(target.to_degrees())
        };
        assert!((to_deg("5").unwrap() - 5.1).abs() < 1e-9);
        assert!((to_deg("+5").unwrap() - 5.1).abs() < 1e-9);
        assert!((to_deg("=-20.5").unwrap() + 20.5).abs() < 1e-9);
        for (text, says) in [
            ("=60", "from -50.0 to 40.0 degrees, not to 60.0"),
            ("-90", "not to -89.9"),
            ("nan", "is no step"),
            ("=", "is no step"),
        ] {
            let error = to_deg(text).unwrap_err().to_string();
            assert!(error.contains(says), "{text}: {error}");
        }
    }
}
