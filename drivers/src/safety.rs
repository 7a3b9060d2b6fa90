//! The safety layer around every bus: nothing reaches the wire around it.
//!
//! ```text
//!             arm                    ok
//! Disarmed --------> Arming ------------------> Running <-----+
//!    ^                  |                          |          | fresh targets
//!    |                  | error                    | stale    | (ramp in again)
//!    |                  v           bus error,     v          |
//!    |                Fault <-------------------- Holding ----+
//!    |                          following error    |
//!    |   torque is off                             | still stale after hold_s
//!    +------------------------ Stopping <----------+   (or disarm or e-stop, from any state)
//! ```
//!
//! Every way out ends in torque off: an error, stale targets, `disarm`, and drop.
//!
//! - Targets that are not finite are refused whole and do not count as fresh.
//! - Each command holds position, velocity and acceleration limits relative to
//!   the **last command** ([`Limiter`]).
//! - After arming, and after a hold, targets are blended in over `ramp_s` from
//!   where the joints stand.
//! - An emergency stop ([`EStop`]) from any thread turns torque off at the next
//!   tick and stays latched until [`SafeBus::clear_estop`].
//! - A joint that stays away from its command faults the bus (a blocked arm).
//!
//! Time is passed in, in seconds on any clock that only goes forward.
//! [`SafeBus::tick`] is to be called once a control period. The limits are per
//! period, so a late tick slows the motion; a tick that comes less than half a
//! period after the one before (a loop that catches up) does nothing. Neither
//! speeds the motion up.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use servodance_types::JointState;

use crate::bus::{ArmReport, Bus, BusStats};
use crate::error::{BusError, ServoId};
use crate::limiter::Limiter;

/// Where the safety layer is: see the diagram above.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Torque is off.
    Disarmed,
    /// Servos are being checked and set up.
    Arming,
    /// Targets are followed.
    Running,
    /// No fresh targets: braked, holding position.
    Holding,
    /// Torque is being turned off.
    Stopping,
    /// Something failed; torque was turned off, or its servos named.
    Fault,
}

/// One change of state.
#[derive(Clone, Debug, PartialEq)]
pub struct Transition {
    /// When, on the caller's clock.
    pub time_s: f64,
    /// State before.
    pub from: State,
    /// State after.
    pub to: State,
    /// Why.
    pub cause: String,
}

/// How the safety layer behaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SafetyConfig {
    /// Control periods a second.
    pub control_hz: f64,
    /// Targets older than this are stale, seconds.
    pub stale_after_s: f64,
    /// Stale targets are held this long before torque goes off, seconds.
    pub hold_s: f64,
    /// Targets are blended in over this time, seconds.
    pub ramp_s: f64,
    /// A joint further than this from its command ..., radians
    pub following_error_rad: f64,
    /// ... for longer than this faults, seconds.
    pub following_error_s: f64,
}

impl SafetyConfig {
    /// The usual values at a control rate.
    pub fn at_hz(control_hz: f64) -> Self {
        Self {
            control_hz,
            stale_after_s: 0.25,
            hold_s: 0.5,
            ramp_s: 2.0,
            following_error_rad: 0.5,
            following_error_s: 0.25,
        }
    }

    fn checked(self) -> Result<Self, SafetyError> {
        let positive = |value: f64| value.is_finite() && value > 0.0;
        let bad = |key| Err(SafetyError::Config { key });
        if !positive(self.control_hz) {
            return bad("control_hz");
        }
        if !positive(self.stale_after_s) {
            return bad("stale_after_s");
        }
        if !(self.hold_s.is_finite() && self.hold_s >= 0.0) {
            return bad("hold_s");
        }
        if !(self.ramp_s.is_finite() && self.ramp_s >= 0.0) {
            return bad("ramp_s");
        }
        if !positive(self.following_error_rad) {
            return bad("following_error_rad");
        }
        if !positive(self.following_error_s) {
            return bad("following_error_s");
        }
        Ok(self)
    }
}

/// An emergency stop button: clones press the same button, from any thread.
#[derive(Clone, Debug, Default)]
pub struct EStop(Arc<AtomicBool>);

impl EStop {
    /// Presses it. Torque goes off at the next tick, and the button stays down.
    pub fn press(&self) {
        self.0.store(true, Ordering::Release);
    }

    /// Whether it is down.
    pub fn is_pressed(&self) -> bool {
        self.0.load(Ordering::Acquire)
    }
}

/// How often the safety layer changed what was asked for.
/// Joints count one by one; the ramp after arming does not count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Interventions {
    /// Target sets refused whole: not finite, or of the wrong length.
    pub nan: u64,
    /// Targets beyond a position limit.
    pub position: u64,
    /// Targets that were too fast.
    pub velocity: u64,
    /// Targets whose speed changed too fast.
    pub acceleration: u64,
    /// Ticks without fresh targets.
    pub stale: u64,
    /// Ticks that came too early and did nothing.
    pub early: u64,
}

/// Why the safety layer stopped, or never began.
#[derive(Debug, thiserror::Error)]
pub enum SafetyError {
    /// A value of [`SafetyConfig`] that makes no sense.
    #[error("safety: {key} must be a positive, finite number")]
    Config {
        /// Which value.
        key: &'static str,
    },
    /// The bus failed, and every torque is verified off.
    #[error("{0}; torque is off")]
    Bus(#[source] BusError),
    /// The bus failed, and so did turning torque off.
    #[error("{cause}; {torque}")]
    Unsafe {
        /// What failed first.
        cause: String,
        /// Why torque may still be on, with the joints.
        torque: BusError,
    },
    /// A joint does not go where it is told.
    #[error(
        "{servo} is {error_deg:.1} degrees from its command for more than {after_s} s \
         (blocked, overloaded or rebooted?); torque is off"
    )]
    Following {
        /// Which servo.
        servo: ServoId,
        /// How far off, degrees.
        error_deg: f64,
        /// The allowed time.
        after_s: f64,
    },
    /// The emergency stop was pressed; it must be cleared on purpose.
    #[error("the emergency stop is pressed: torque is off until it is cleared")]
    EStop,
    /// A call that the state does not allow.
    #[error("cannot {call} in state {state:?}")]
    State {
        /// What was called.
        call: &'static str,
        /// The state.
        state: State,
    },
}

/// A bus inside its limits. See the module's text for what it promises.
pub struct SafeBus<B: Bus> {
    bus: B,
    config: SafetyConfig,
    state: State,
    estop: EStop,
    transitions: Vec<Transition>,
    interventions: Interventions,
    limiters: Vec<Limiter>,
    targets_rad: Vec<f64>,
    sent_rad: Vec<f64>,
    ramp_from_rad: Vec<f64>,
    /// When the current ramp began; `None` before the first targets.
    ramp_began_s: Option<f64>,
    fresh_s: f64,
    held_since_s: f64,
    /// When the commands last moved on.
    stepped_s: f64,
    /// Since when each joint has been away from its command.
    away_since_s: Vec<Option<f64>>,
}

impl<B: Bus> SafeBus<B> {
    /// Wraps a bus. Sends nothing.
    pub fn new(bus: B, config: SafetyConfig) -> Result<Self, SafetyError> {
        let joints = bus.servos().len();
        Ok(Self {
            config: config.checked()?,
            state: State::Disarmed,
            estop: EStop::default(),
            transitions: Vec::new(),
            interventions: Interventions::default(),
            limiters: Vec::new(),
            targets_rad: vec![0.0; joints],
            sent_rad: vec![0.0; joints],
            ramp_from_rad: vec![0.0; joints],
            ramp_began_s: None,
            fresh_s: 0.0,
            held_since_s: 0.0,
            stepped_s: f64::NEG_INFINITY,
            away_since_s: vec![None; joints],
            bus,
        })
    }

    /// Checks the servos and turns torque on where they stand.
    pub fn arm(&mut self, now_s: f64) -> Result<ArmReport, SafetyError> {
        if !matches!(self.state, State::Disarmed | State::Fault) {
            return Err(self.misplaced("arm"));
        }
        if self.estop.is_pressed() {
            return Err(SafetyError::EStop);
        }
        self.enter(now_s, State::Arming, "asked to arm");
        let report = match self.bus.arm() {
            Ok(report) => report,
            Err(error) => return Err(self.fault(now_s, error)),
        };
        let period_s = 1.0 / self.config.control_hz;
        self.limiters.clear();
        for (index, (servo, state)) in self.bus.servos().iter().zip(&report.states).enumerate() {
            let held = servo.limits.clamp_rad(state.position_rad);
            self.limiters
                .push(Limiter::new(servo.limits, period_s, held));
            self.targets_rad[index] = held;
            self.sent_rad[index] = held;
        }
        self.away_since_s.fill(None);
        self.ramp_began_s = None;
        self.stepped_s = f64::NEG_INFINITY;
        self.fresh_s = now_s;
        self.enter(now_s, State::Running, "torque is on");
        Ok(report)
    }

    /// Fresh targets, radians; the next [`SafeBus::tick`] follows them.
    pub fn command(&mut self, now_s: f64, targets_rad: &[f64]) {
        let usable = targets_rad.len() == self.targets_rad.len()
            && targets_rad.iter().all(|target| target.is_finite());
        if !usable {
            self.interventions.nan += 1;
            return;
        }
        self.targets_rad.copy_from_slice(targets_rad);
        self.fresh_s = now_s;
        match self.state {
            State::Holding => {
                self.begin_ramp(now_s);
                self.enter(now_s, State::Running, "targets are fresh again");
            }
            State::Running if self.ramp_began_s.is_none() => self.begin_ramp(now_s),
            _ => {}
        }
    }

    fn begin_ramp(&mut self, now_s: f64) {
        self.ramp_from_rad.copy_from_slice(&self.sent_rad);
        self.ramp_began_s = Some(now_s);
    }

    /// One control period: limits, one bus cycle, checks. Does nothing to the
    /// wire while disarmed, nor when called again too early: `states` then stay.
    pub fn tick(&mut self, now_s: f64, states: &mut [JointState]) -> Result<State, SafetyError> {
        if self.estop.is_pressed() {
            self.disarm(now_s, "emergency stop")?;
            return Err(SafetyError::EStop);
        }
        match self.state {
            State::Running => self.watch_staleness(now_s),
            State::Holding if now_s - self.held_since_s >= self.config.hold_s => {
                let cause = format!("no fresh targets for {:.3} s", now_s - self.fresh_s);
                self.disarm(now_s, &cause)?;
            }
            State::Fault => return Err(self.misplaced("tick")),
            _ => {}
        }
        let early = now_s - self.stepped_s < 0.5 / self.config.control_hz;
        match self.state {
            State::Running | State::Holding if early => {
                self.interventions.early += 1;
                return Ok(self.state);
            }
            State::Running => self.follow(now_s),
            State::Holding => self.hold(),
            state => return Ok(state),
        }
        self.stepped_s = now_s;
        if let Err(error) = self.bus.cycle(&self.sent_rad, states) {
            return Err(self.fault(now_s, error));
        }
        self.watch_following(now_s, states)?;
        Ok(self.state)
    }

    fn watch_staleness(&mut self, now_s: f64) {
        let age_s = now_s - self.fresh_s;
        // A clock that is not a number counts as stale too.
        if age_s > self.config.stale_after_s || age_s.is_nan() {
            self.held_since_s = now_s;
            self.enter(
                now_s,
                State::Holding,
                &format!("targets are {age_s:.3} s old"),
            );
        }
    }

    /// The commands towards the targets, blended in and limited.
    fn follow(&mut self, now_s: f64) {
        let weight = self.ramp_weight(now_s);
        for (index, limiter) in self.limiters.iter_mut().enumerate() {
            let from = self.ramp_from_rad[index];
            let target = match weight {
                Some(weight) => from + weight * (self.targets_rad[index] - from),
                None => self.sent_rad[index],
            };
            let limited = limiter.step(target);
            self.sent_rad[index] = limited.position_rad;
            if weight == Some(1.0) {
                self.interventions.position += u64::from(limited.position);
                self.interventions.velocity += u64::from(limited.velocity);
                self.interventions.acceleration += u64::from(limited.acceleration);
            }
        }
    }

    /// How much of the targets is followed, 0 to 1; `None` before any came.
    /// Quintic: speed and acceleration are zero at both ends.
    fn ramp_weight(&self, now_s: f64) -> Option<f64> {
        let elapsed_s = now_s - self.ramp_began_s?;
        if elapsed_s >= self.config.ramp_s {
            return Some(1.0);
        }
        let u = (elapsed_s / self.config.ramp_s).clamp(0.0, 1.0);
        Some(u * u * u * (10.0 + u * (6.0 * u - 15.0)))
    }

    fn hold(&mut self) {
        self.interventions.stale += 1;
        for (sent, limiter) in self.sent_rad.iter_mut().zip(&mut self.limiters) {
            *sent = limiter.brake();
        }
    }

    /// A joint far from its command for too long is blocked, or limp.
    fn watch_following(&mut self, now_s: f64, states: &[JointState]) -> Result<(), SafetyError> {
        let mut lost = None;
        for (index, state) in states.iter().enumerate() {
            let error_rad = (state.position_rad - self.sent_rad[index]).abs();
            if error_rad <= self.config.following_error_rad {
                self.away_since_s[index] = None;
                continue;
            }
            let since_s = *self.away_since_s[index].get_or_insert(now_s);
            if now_s - since_s > self.config.following_error_s {
                lost = Some((index, error_rad));
            }
        }
        let Some((index, error_rad)) = lost else {
            return Ok(());
        };
        let error = SafetyError::Following {
            servo: ServoId::of(&self.bus.servos()[index]),
            error_deg: error_rad.to_degrees(),
            after_s: self.config.following_error_s,
        };
        self.enter(now_s, State::Fault, &error.to_string());
        match self.bus.disarm() {
            Ok(()) => Err(error),
            Err(torque) => Err(SafetyError::Unsafe {
                cause: error.to_string(),
                torque,
            }),
        }
    }

    /// Torque off, verified. From any state, at any time.
    pub fn disarm(&mut self, now_s: f64, cause: &str) -> Result<(), SafetyError> {
        if self.state == State::Disarmed && !self.bus.is_armed() {
            return Ok(());
        }
        self.enter(now_s, State::Stopping, cause);
        match self.bus.disarm() {
            Ok(()) => {
                self.enter(now_s, State::Disarmed, "torque is off");
                Ok(())
            }
            Err(torque) => {
                self.enter(now_s, State::Fault, &torque.to_string());
                Err(SafetyError::Unsafe {
                    cause: cause.into(),
                    torque,
                })
            }
        }
    }

    /// The emergency stop of this bus, to give to a key, a signal, a network handler.
    pub fn estop(&self) -> EStop {
        self.estop.clone()
    }

    /// Releases the emergency stop. Torque stays off until the next `arm`.
    pub fn clear_estop(&mut self) {
        self.estop.0.store(false, Ordering::Release);
    }

    fn fault(&mut self, now_s: f64, error: BusError) -> SafetyError {
        self.enter(now_s, State::Fault, &error.to_string());
        match self.bus.disarm() {
            Ok(()) => SafetyError::Bus(error),
            Err(torque) => SafetyError::Unsafe {
                cause: error.to_string(),
                torque,
            },
        }
    }

    fn misplaced(&self, call: &'static str) -> SafetyError {
        SafetyError::State {
            call,
            state: self.state,
        }
    }

    fn enter(&mut self, time_s: f64, to: State, cause: &str) {
        self.transitions.push(Transition {
            time_s,
            from: self.state,
            to,
            cause: cause.into(),
        });
        self.state = to;
    }

    /// The commands of the last tick, radians: what the servos were told,
    /// before rounding to encoder ticks.
    pub fn sent_rad(&self) -> &[f64] {
        &self.sent_rad
    }

    /// The state.
    pub fn state(&self) -> State {
        self.state
    }

    /// Whether targets are still being blended in (or none have come yet).
    pub fn is_ramping(&self, now_s: f64) -> bool {
        self.ramp_weight(now_s) != Some(1.0)
    }

    /// What was changed so far.
    pub fn interventions(&self) -> Interventions {
        self.interventions
    }

    /// Every change of state so far, oldest first.
    pub fn transitions(&self) -> &[Transition] {
        &self.transitions
    }

    /// The bus inside.
    pub fn bus(&self) -> &B {
        &self.bus
    }

    /// The counters of the bus inside.
    pub fn stats(&self) -> BusStats {
        self.bus.stats()
    }
}
