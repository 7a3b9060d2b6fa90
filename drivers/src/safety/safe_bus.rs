//! The state machine around a bus: arm, follow, hold, stop. See the parent module for
//! its diagram and promises.

use std::sync::mpsc::Sender;

use servodance_types::{HeldBack, ImuState, JointState};

use super::config::{SafetyConfig, ServoLost};
use super::error::SafetyError;
use super::estop::EStop;
use super::followed::Followed;
use super::joint::{LostAdapter, SafeJoint};
use super::state::{Interventions, State, Transition};
use super::wire_watch::{LinkDelay, RoughWire, Unheard};
use crate::bus::{ArmReport, Bus, BusStats, Health};
use crate::error::{BusError, ServoId};
use crate::imu::SerialImu;

const KEPT: usize = 1000;

/// A bus whose targets stay inside the joints' limits; every error turns torque off.
pub struct SafeBus<B: Bus> {
    pub(super) bus: B,
    pub(super) config: SafetyConfig,
    pub(super) state: State,
    estop: EStop,
    transitions: Vec<Transition>,
    interventions: Interventions,
    pub(super) joints: Vec<SafeJoint>,
    pub(super) sent_rad: Vec<f64>,
    fresh_s: f64,
    held_since_s: f64,
    hold_asked: bool,
    stepped_s: f64,
    pub(super) examine: (usize, f64),
    pub(super) adapter: Option<LostAdapter>,
    /// When servos were last found stopped by their own watchdog, seconds.
    pub(super) stops_s: Vec<f64>,
    followed: Followed,
    pub(super) rough_wire: RoughWire,
    pub(super) link_delay: LinkDelay,
    pub(super) unheard: Unheard,
    /// Hears every change of state and every remark at once.
    listener: Option<Sender<Transition>>,
    /// A motion sensor that is on no bus.
    sensor: Option<SerialImu>,
    /// Whether the motion sensor has told anything, and does so still.
    imu_heard: Option<bool>,
}

impl<B: Bus> SafeBus<B> {
    /// Wraps a bus. Sends nothing.
    pub fn new(bus: B, config: SafetyConfig) -> Result<Self, SafetyError> {
        Ok(Self {
            config: config.checked()?,
            state: State::Disarmed,
            estop: EStop::default(),
            transitions: Vec::new(),
            interventions: Interventions::default(),
            joints: Vec::new(),
            sent_rad: vec![0.0; bus.servos().len()],
            fresh_s: 0.0,
            held_since_s: 0.0,
            hold_asked: false,
            stepped_s: f64::NEG_INFINITY,
            examine: (0, 0.0),
            adapter: None,
            stops_s: Vec::new(),
            followed: Followed::default(),
            rough_wire: RoughWire::default(),
            link_delay: LinkDelay::default(),
            unheard: Unheard::default(),
            listener: None,
            sensor: None,
            imu_heard: None,
            bus,
        })
    }

    /// Uses an emergency stop that others press too.
    pub fn with_estop(mut self, estop: EStop) -> Self {
        self.estop = estop;
        self
    }

    /// Reads a motion sensor of its own beside the bus.
    pub fn with_sensor(mut self, sensor: Option<SerialImu>) -> Self {
        self.sensor = sensor;
        self
    }

    /// Tells every change of state and every remark as it happens. A listener that is gone
    /// delays nothing.
    pub fn with_listener(mut self, listener: Sender<Transition>) -> Self {
        self.listener = Some(listener);
        self
    }

    /// A remark of whoever runs the cycles, told and kept like those of this layer.
    pub fn note(&mut self, now_s: f64, text: &str) {
        self.remark(now_s, text);
    }

    /// Checks the servos and turns torque on where they stand. After a fault of
    /// the port, opens it again first.
    pub fn arm(&mut self, now_s: f64) -> Result<ArmReport, SafetyError> {
        if !matches!(self.state, State::Disarmed | State::Fault) {
            return Err(self.misplaced("arm"));
        }
        self.check_estop()?;
        self.enter(now_s, State::Arming, "asked to arm");
        let reopened = match self.adapter {
            Some(_) => self.bus.reopen(),
            None => Ok(()),
        };
        let armed = reopened.and_then(|()| self.bus.arm());
        let report = armed.map_err(|error| self.fault(now_s, error))?;
        self.armed(now_s, &report.states);
        Ok(report)
    }

    /// Begins to run: torque is on and the joints stand at `states`.
    pub(super) fn armed(&mut self, now_s: f64, states: &[JointState]) {
        let targets: Vec<f64> = self.joints.iter().map(|joint| joint.target_rad).collect();
        let had_targets = self.joints.iter().any(|joint| joint.ramp_began_s.is_some());
        let servos = self.bus.servos().iter().zip(states);
        self.joints = servos
            .map(|(servo, state)| SafeJoint::new(servo.limits, state.position_rad, &self.config))
            .collect();
        for (sent, joint) in self.sent_rad.iter_mut().zip(&self.joints) {
            *sent = joint.target_rad;
        }
        self.followed.begin(now_s, &self.sent_rad);
        let reconnected = self.adapter.take().is_some();
        self.stepped_s = f64::NEG_INFINITY;
        self.examine = (0, now_s);
        self.enter(now_s, State::Running, "torque is on");
        if reconnected && had_targets {
            // The motion went on without the robot: blend in to where it is now.
            for (joint, target) in self.joints.iter_mut().zip(targets) {
                joint.target_rad = target;
                joint.ramp_began_s = Some(now_s);
            }
        } else {
            self.fresh_s = now_s;
        }
    }

    /// Fresh targets, radians; the next [`SafeBus::tick`] follows them.
    pub fn command(&mut self, now_s: f64, targets_rad: &[f64]) {
        let usable = targets_rad.len() == self.sent_rad.len()
            && targets_rad.iter().all(|target| target.is_finite());
        if !usable {
            self.interventions.nan += 1;
            return;
        }
        for (joint, &target) in self.joints.iter_mut().zip(targets_rad) {
            joint.target_rad = target;
        }
        self.fresh_s = now_s;
        if self.state == State::Running && self.joints.iter().any(|j| j.ramp_began_s.is_none()) {
            self.begin_ramp(now_s);
        }
    }

    /// Brakes and holds position from the next tick on, whatever the targets are,
    /// or follows them again, blended in from where the joints are held.
    pub fn hold(&mut self, hold: bool) {
        self.hold_asked = hold;
    }

    fn begin_hold(&mut self, now_s: f64, cause: &str) {
        self.enter(now_s, State::Holding, cause);
        self.held_since_s = now_s;
    }

    pub(super) fn begin_ramp(&mut self, now_s: f64) {
        for (joint, &sent) in self.joints.iter_mut().zip(&self.sent_rad) {
            joint.ramp_from_rad = sent;
            joint.ramp_began_s = Some(now_s);
        }
    }

    /// One control period: limits, one bus cycle, checks. Does nothing to the
    /// wire while disarmed, nor when called again too early: `states` then stay.
    /// In state `Fault` it waits for an adapter, if that is allowed.
    pub fn tick(&mut self, now_s: f64, states: &mut [JointState]) -> Result<State, SafetyError> {
        if self.estop.is_pressed() {
            self.disarm(now_s, &format!("emergency stop: {}", self.estop.cause()))?;
            self.check_estop()?;
        }
        match self.state {
            State::Running | State::Holding => self.choose_to_hold(now_s)?,
            State::Fault => return self.reconnect(now_s, states),
            _ => {}
        }
        let early = now_s - self.stepped_s < 0.5 / self.config.control_hz;
        match self.state {
            State::Running | State::Holding if early => {
                self.interventions.early += 1;
                return Ok(self.state);
            }
            State::Running => self.follow(now_s),
            State::Holding => self.brake(),
            state => return Ok(state),
        }
        self.stepped_s = now_s;
        if let Some(sensor) = &mut self.sensor {
            sensor.cycle();
        }
        let cycled = self.bus.cycle(&self.sent_rad, states);
        self.take_back_unsent();
        if let Err(error) = cycled {
            self.cycle_failed(now_s, error, states)?;
            // Goals may be out already: sending them again would be a step too many.
            return Ok(self.state);
        }
        self.watch_imu(now_s);
        self.watch_wire(now_s);
        self.watch_unheard(now_s);
        self.watch_following(now_s, states)?;
        self.watch_stillness(now_s, states)?;
        self.watch_health(now_s, states)?;
        self.rejoin_lost(now_s, states);
        Ok(self.state)
    }

    fn choose_to_hold(&mut self, now_s: f64) -> Result<(), SafetyError> {
        let age_s = now_s - self.fresh_s;
        // A clock that is not a number counts as stale too.
        let stale = age_s > self.config.stale_after_s || age_s.is_nan();
        let missing = self.missing().filter(|_| self.config.on_servo_lost == ServoLost::Hold);
        let held_s = now_s - self.held_since_s;
        match (self.state, missing) {
            (State::Running, None) if stale => {
                self.begin_hold(now_s, &format!("targets are {age_s:.3} s old"));
            }
            (State::Running, None) if self.hold_asked => self.begin_hold(now_s, "asked to hold"),
            (State::Running, Some(index)) => {
                let who = self.id_of(index);
                self.begin_hold(now_s, &format!("waiting for {who}"));
            }
            (State::Holding, _) if stale && held_s >= self.config.hold_s => {
                self.disarm(now_s, &format!("no fresh targets for {age_s:.3} s"))?;
            }
            (State::Holding, Some(index)) if held_s >= self.config.rejoin_s => {
                let who = self.id_of(index);
                self.disarm(now_s, &format!("{who} did not come back for {held_s:.1} s"))?;
            }
            (State::Holding, None) if !stale && self.hold_asked => self.held_since_s = now_s,
            (State::Holding, None) if !stale => {
                self.begin_ramp(now_s);
                let cause = "targets are fresh and every servo is there";
                self.enter(now_s, State::Running, cause);
            }
            _ => {}
        }
        Ok(())
    }

    fn follow(&mut self, now_s: f64) {
        let period_s = self.config.period_s();
        let supply = self.worst_supply();
        for (joint, sent) in self.joints.iter_mut().zip(&mut self.sent_rad) {
            let weight = joint.ramp_weight(now_s, self.config.ramp_s);
            let level = joint.derate.own().level.max(supply);
            let asked = joint.derate.shrink(joint.target_rad, level, period_s);
            let from = joint.ramp_from_rad;
            let target = match weight {
                Some(weight) => from + weight * (asked - from),
                None => *sent,
            };
            let limited = joint.limiter.step(target);
            *sent = limited.position_rad;
            joint.held = joint.derate.held_back(supply).max(limited.held_back());
            if weight == Some(1.0) {
                self.interventions.position += u64::from(limited.position);
                self.interventions.velocity += u64::from(limited.velocity);
                self.interventions.acceleration += u64::from(limited.acceleration);
                self.interventions.derated += u64::from(joint.derate.is_derated());
            }
        }
    }

    /// Goals that were not sent: the next ones are planned from those that were.
    fn take_back_unsent(&mut self) {
        let joints = self.joints.iter_mut().zip(&mut self.sent_rad).enumerate();
        for (_, (joint, sent)) in joints.filter(|(index, _)| !self.bus.sent_goal(*index)) {
            joint.limiter.take_back();
            *sent = joint.limiter.position_rad();
        }
    }

    fn brake(&mut self) {
        self.interventions.stale += u64::from(!self.hold_asked);
        for (sent, joint) in self.sent_rad.iter_mut().zip(&mut self.joints) {
            *sent = joint.limiter.brake();
        }
    }

    /// Says once that the motion sensor has fallen silent, and that it is back.
    fn watch_imu(&mut self, now_s: f64) {
        let hears = self.imu().is_some();
        match (self.imu_heard, hears) {
            (Some(true), false) => {
                self.remark(now_s, "the motion sensor has not answered for 100 ms");
            }
            (Some(false), true) => self.remark(now_s, "the motion sensor answers again"),
            _ => {}
        }
        self.imu_heard = (hears || self.imu_heard.is_some()).then_some(hears);
    }

    /// What the motion sensor told in the last 100 ms, in the axes of the root link.
    pub fn imu(&self) -> Option<ImuState> {
        self.sensor.as_ref().map_or_else(|| self.bus.imu(), SerialImu::state)
    }

    fn watch_following(&mut self, now_s: f64, states: &[JointState]) -> Result<(), SafetyError> {
        let mut stuck = None;
        self.followed.begin_cycle(now_s);
        for (index, (joint, state)) in self.joints.iter_mut().zip(states).enumerate() {
            let error_rad = (state.position_rad - self.sent_rad[index]).abs();
            // A lost servo was told of, and goes its own way.
            if joint.lost.is_none() {
                self.followed.push(index, self.sent_rad[index], state.position_rad);
            }
            if error_rad <= self.config.following_error_deg.to_radians() || joint.lost.is_some() {
                joint.away_since_s = None;
                continue;
            }
            let since_s = *joint.away_since_s.get_or_insert(now_s);
            if now_s - since_s > self.config.following_error_s {
                stuck = Some((index, error_rad));
            }
        }
        let Some((index, error_rad)) = stuck else {
            return Ok(());
        };
        let error = SafetyError::Following {
            servo: self.id_of(index),
            error_deg: error_rad.to_degrees(),
            after_s: self.config.following_error_s,
        };
        Err(self.fault_of(now_s, error))
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
                Err(SafetyError::Unsafe { cause: cause.into(), torque })
            }
        }
    }

    /// The emergency stop of this bus, to give to a key, a signal, a network handler.
    pub fn estop(&self) -> EStop {
        self.estop.clone()
    }

    fn check_estop(&self) -> Result<(), SafetyError> {
        if !self.estop.is_pressed() {
            return Ok(());
        }
        Err(SafetyError::EStop { cause: self.estop.cause() })
    }

    pub(super) fn fault(&mut self, now_s: f64, error: BusError) -> SafetyError {
        self.fault_of(now_s, SafetyError::Bus(error))
    }

    pub(super) fn fault_of(&mut self, now_s: f64, error: SafetyError) -> SafetyError {
        let text = error.to_string();
        let cause = text.strip_suffix(TORQUE_IS_OFF).unwrap_or(&text).to_owned();
        self.enter(now_s, State::Fault, &cause);
        match self.bus.disarm() {
            Ok(()) => error,
            Err(torque) => SafetyError::Unsafe { cause, torque },
        }
    }

    pub(super) fn id_of(&self, index: usize) -> ServoId {
        ServoId::of(&self.bus.servos()[index])
    }

    pub(super) fn misplaced(&self, call: &'static str) -> SafetyError {
        SafetyError::State { call, state: self.state }
    }

    pub(super) fn remark(&mut self, time_s: f64, cause: &str) {
        self.enter(time_s, self.state, cause);
    }

    pub(super) fn enter(&mut self, time_s: f64, to: State, cause: &str) {
        let transition = Transition { time_s, from: self.state, to, cause: cause.into() };
        if let Some(listener) = &self.listener {
            let _ = listener.send(transition.clone());
        }
        if self.transitions.len() < KEPT {
            self.transitions.push(transition);
        }
        self.state = to;
    }

    /// The commands of the last tick, radians, before rounding to encoder ticks.
    pub fn sent_rad(&self) -> &[f64] {
        &self.sent_rad
    }

    /// The health of each servo as last read.
    pub fn health(&self) -> impl Iterator<Item = Health> + '_ {
        self.joints.iter().map(|joint| joint.derate.health())
    }

    /// What changed each servo's last command, if anything did.
    pub fn held_back(&self) -> impl Iterator<Item = HeldBack> + '_ {
        self.joints.iter().map(|joint| joint.held)
    }

    /// The present state; see the diagram of this module.
    pub fn state(&self) -> State {
        self.state
    }

    /// Whether targets are still being blended in (or none have come yet).
    pub fn is_ramping(&self, now_s: f64) -> bool {
        let weight = |joint: &SafeJoint| joint.ramp_weight(now_s, self.config.ramp_s);
        self.joints.is_empty() || self.joints.iter().any(|joint| weight(joint) != Some(1.0))
    }

    /// The share of cycles in which each joint was where its command had been a moment
    /// before (`followed.rs`), in the order of joints.
    pub fn followed(&self) -> Vec<f64> {
        self.followed.shares().collect()
    }

    /// How often targets were changed so far.
    pub fn interventions(&self) -> Interventions {
        self.interventions
    }

    /// Every change of state and every remark so far, oldest first; at most 1000.
    pub fn transitions(&self) -> &[Transition] {
        &self.transitions
    }

    /// The bus that is wrapped.
    pub fn bus(&self) -> &B {
        &self.bus
    }

    /// The counters of the bus that is wrapped.
    pub fn stats(&self) -> BusStats {
        self.bus.stats()
    }
}

const TORQUE_IS_OFF: &str = "; torque is off";
