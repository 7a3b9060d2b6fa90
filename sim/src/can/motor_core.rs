//! What all simulated CAN motors share: the motor, its torque loop, protection,
//! time-out and judge.
//!
//! Torque is `kp (goal - angle) + kd (speed wanted - speed) + feed-forward`,
//! within the torque limit. Angles are the motor's own after the gear.

use servodance_drivers::can::MotorSettings;
use servodance_drivers::serial::FACTORY_ID;

use crate::error::SimError;
use crate::fault::ServoFault;
use crate::servo::body::{ServoBody, SimServoState};
use crate::servo::motor::Motor;
use crate::servo::spec::SimServoSpec;

const REBOOT_S: f64 = 0.5;
const OVERLOAD_S: f64 = 1.0;
const OVERLOAD_SHARE: f64 = 0.8;
const HOTTEST_C: f64 = 90.0;
const LOWEST_SHARE: f64 = 0.6;
const HIGHEST_SHARE: f64 = 1.4;

/// Why a motor has turned itself off. Stays until it is cleared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MotorFault {
    UnderVoltage,
    OverVoltage,
    Overheat,
    Overload,
    CommunicationLost,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct TorqueCommand {
    pub goal_rad: f64,
    pub speed_rad_s: f64,
    pub kp: f64,
    pub kd: f64,
    pub torque_nm: f64,
    /// The goal is moved to at most so fast; `None`: it is there at once.
    pub ramp_rad_s: Option<f64>,
}

/// One motor without its protocol.
#[derive(Clone, Debug)]
pub(crate) struct MotorCore {
    pub settings: MotorSettings,
    pub body: ServoBody,
    nominal_v: f64,
    pub id: u8,
    pub enabled: bool,
    /// `None` until the first command after torque on.
    command: Option<TorqueCommand>,
    pub torque_limit_nm: f64,
    /// Torque goes off after this much silence, seconds; `None` is never.
    pub timeout_s: Option<f64>,
    pub silent_s: f64,
    pub fault: Option<MotorFault>,
    tripped: bool,
    tripped_s: Option<f64>,
    pub torque_nm: f64,
    /// Where the motor was told that its zero is, its own angle, radians.
    zero_rad: f64,
    period_s: f64,
    /// The last goal that was judged, of the joint, and when it came.
    told_s: f64,
    told_rad: f64,
    repeated_s: Option<f64>,
    /// Where a ramp is, the motor's own angle.
    ramp_rad: f64,
}

impl MotorCore {
    /// A motor fresh from the factory; `nominal_v` is what it is made for.
    pub fn new(
        spec: &SimServoSpec,
        nominal_v: f64,
        supply_v: Option<f64>,
        period_s: f64,
    ) -> Result<Self, SimError> {
        let settings =
            spec.motor.clone().ok_or_else(|| spec.refused("is not a CAN motor".into()))?;
        let torque_nm = settings.model.torque_nm;
        let motor = Motor::of_can(&settings, nominal_v, spec.load_inertia_kg_m2);
        Ok(Self {
            body: ServoBody::new(spec, motor, period_s, supply_v.unwrap_or(nominal_v)),
            nominal_v,
            id: spec.id,
            enabled: false,
            command: None,
            torque_limit_nm: torque_nm,
            timeout_s: None,
            silent_s: 0.0,
            fault: None,
            tripped: false,
            tripped_s: None,
            torque_nm: 0.0,
            zero_rad: 0.0,
            period_s,
            told_s: f64::NEG_INFINITY,
            told_rad: 0.0,
            repeated_s: None,
            ramp_rad: 0.0,
            settings,
        })
    }

    pub fn angle_rad(&self) -> f64 {
        self.body.motor.angle_rad - self.zero_rad
    }

    /// Where the motor stands is zero from now on. It stays there.
    pub fn set_zero(&mut self) {
        self.zero_rad = self.body.motor.angle_rad;
    }

    pub fn speed_rad_s(&self) -> f64 {
        self.body.motor.speed_rad_s
    }

    /// What a family shows for the present fault: the first code for none, then in the
    /// order of [`MotorFault`].
    pub fn fault_code<T: Copy>(&self, codes: [T; 6]) -> T {
        codes[self.fault.map_or(0, |fault| 1 + fault as usize)]
    }

    /// Torque on, without any until the first command. Refused while a fault lasts.
    pub fn enable(&mut self) {
        if self.fault.is_none() && !self.enabled {
            self.enabled = true;
            self.tripped = false;
            self.command = None;
            self.silent_s = 0.0;
            self.body.stalled_s = 0.0;
        }
    }

    pub fn disable(&mut self) {
        self.enabled = false;
        self.command = None;
        self.repeated_s = None;
        self.body.judge.end();
    }

    /// A command of the torque loop; without torque it means nothing.
    pub fn command(&mut self, command: TorqueCommand) {
        if !self.enabled {
            return;
        }
        let command = TorqueCommand { goal_rad: command.goal_rad + self.zero_rad, ..command };
        let goal_rad = self.body.joint_rad(command.goal_rad);
        if self.command.is_none() {
            self.ramp_rad = self.body.motor.angle_rad;
            let position_rad = self.body.position_rad();
            self.body.judge.begin(goal_rad, position_rad);
        }
        let is_same = |last: TorqueCommand| last.goal_rad == command.goal_rad;
        self.judge_goal(goal_rad, self.command.is_some_and(is_same));
        self.command = Some(command);
    }

    /// One goal a control period is judged. A command whose answer got lost is
    /// said again, at once or just before the next goal: such a repetition is not
    /// a goal of its own, a goal that stays the same for a period is.
    fn judge_goal(&mut self, goal_rad: f64, is_same: bool) {
        let now_s = self.body.time_s;
        let is_later = |then_s: f64| now_s - then_s >= 0.5 * self.period_s;
        if let Some(repeated_s) = self.repeated_s.filter(|then_s| is_later(*then_s)) {
            self.body.judge.judge_goal(repeated_s, self.told_rad);
            self.told_s = repeated_s;
            self.repeated_s = None;
        }
        if !is_same {
            self.body.judge.judge_goal(now_s, goal_rad);
            (self.told_s, self.told_rad) = (now_s, goal_rad);
            self.repeated_s = None;
        } else if is_later(self.told_s) {
            self.repeated_s.get_or_insert(now_s);
        }
    }

    pub fn reboot(&mut self) {
        self.disable();
        self.fault = None;
        self.tripped = false;
        self.timeout_s = None;
        self.torque_limit_nm = self.settings.model.torque_nm;
        self.body.be_deaf_for(REBOOT_S);
    }

    fn fail(&mut self, fault: MotorFault) {
        self.fault = Some(fault);
        self.disable();
    }

    /// True if its protocol must restart too.
    pub fn suffer(&mut self, injected: ServoFault) -> bool {
        match self.body.suffer(injected) {
            Some(ServoFault::Unplug) => self.disable(),
            Some(ServoFault::Reboot | ServoFault::Plug) => {
                self.reboot();
                return true;
            }
            Some(ServoFault::Overload) => self.fail(MotorFault::Overload),
            Some(ServoFault::Id(id)) => self.id = id,
            Some(ServoFault::New) => {
                self.id = FACTORY_ID;
                self.reboot();
                return true;
            }
            // A controller at another bitrate never gets onto the bus.
            Some(ServoFault::Baud(_)) => {
                self.body.suffer(ServoFault::Dead);
            }
            _ => {}
        }
        false
    }

    /// One step of firmware and motor, ending at `time_s`.
    pub fn step(&mut self, time_s: f64, dt_s: f64) {
        self.body.time_s = time_s;
        self.watch_silence(dt_s);
        let command = self.command.map(|command| self.ramped(command, dt_s));
        let drive = command.map(|command| self.drive(command));
        if drive.is_none() {
            self.torque_nm = 0.0;
        }
        let duty = drive.map(|(duty, _)| duty);
        self.body.step_damped(dt_s, duty, drive.and_then(|(_, damping_nm_s)| damping_nm_s));
        self.protect(dt_s);
    }

    fn watch_silence(&mut self, dt_s: f64) {
        if !self.enabled {
            return;
        }
        self.silent_s += dt_s;
        let is_over = |limit_s| self.silent_s > limit_s;
        if self.timeout_s.is_some_and(is_over) {
            self.fail(MotorFault::CommunicationLost);
            self.tripped = true;
            self.tripped_s = Some(self.body.time_s);
        }
    }

    /// The command with its goal as far as its ramp is.
    fn ramped(&mut self, command: TorqueCommand, dt_s: f64) -> TorqueCommand {
        let step_rad = command.ramp_rad_s.map_or(f64::INFINITY, |speed| speed * dt_s);
        let left_rad = command.goal_rad - self.ramp_rad;
        self.ramp_rad += left_rad.clamp(-step_rad, step_rad);
        TorqueCommand { goal_rad: self.ramp_rad, ..command }
    }

    /// Duty, and how much of it is damping, newton metre seconds, where no limit cuts it.
    fn drive(&mut self, command: TorqueCommand) -> (f64, Option<f64>) {
        let asked_nm = command.kp * (command.goal_rad - self.body.motor.angle_rad)
            + command.kd * (command.speed_rad_s - self.body.motor.speed_rad_s)
            + command.torque_nm;
        self.torque_nm = asked_nm.clamp(-self.torque_limit_nm, self.torque_limit_nm);
        let volts = self.body.volts();
        let duty = self.body.motor.duty_for_torque(self.torque_nm, volts);
        let is_cut = self.torque_nm != asked_nm || duty.abs() > 1.0;
        (duty.clamp(-1.0, 1.0), (!is_cut).then_some(command.kd))
    }

    fn protect(&mut self, dt_s: f64) {
        let pushes_hard = self.torque_nm.abs() > OVERLOAD_SHARE * self.torque_limit_nm;
        let stalled_s = self.body.stalled_for(dt_s, pushes_hard);
        let share = self.body.volts() / self.nominal_v;
        if self.fault.is_some() {
            return;
        }
        if stalled_s > OVERLOAD_S {
            self.fail(MotorFault::Overload);
        } else if self.body.motor.temperature_c > HOTTEST_C {
            self.fail(MotorFault::Overheat);
        } else if share < LOWEST_SHARE {
            self.fail(MotorFault::UnderVoltage);
        } else if share > HIGHEST_SHARE {
            self.fail(MotorFault::OverVoltage);
        }
    }

    pub fn state(&self) -> SimServoState {
        let goal = self.command.map_or(self.body.motor.angle_rad, |c| c.goal_rad);
        SimServoState {
            goal_rad: self.body.joint_rad(goal),
            torque_enabled: self.enabled,
            watchdog_tripped: self.tripped,
            tripped_s: self.tripped_s,
            hardware_error: self.fault.map_or(0, |fault| 1 << fault as u8),
            ..self.body.state()
        }
    }
}
