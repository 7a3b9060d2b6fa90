//! What every simulated servo is, whatever it speaks: a motor in a joint, its
//! judge and supply, and what can happen to those. Angles of the motor are its
//! own, radians after the gear.

use crate::fault::ServoFault;
use crate::judge::Judge;
use crate::servo::motor::Motor;
use crate::servo::spec::SimServoSpec;
use crate::world::{JointDrive, ShaftDrive, ShaftState};

/// Damping of a shaft that something holds, newton metre seconds.
const JAMMED_NM_S: f64 = 1e4;

/// What a servo really does, whatever it says on the wire.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[allow(missing_docs)] // the other names say it
pub struct SimServoState {
    pub time_s: f64,
    pub position_rad: f64,
    pub velocity_rad_s: f64,
    /// The goal it holds, joint radians.
    pub goal_rad: f64,
    /// Motor current towards higher joint positions, amperes.
    pub current_a: f64,
    pub temperature_c: f64,
    pub torque_enabled: bool,
    pub watchdog_tripped: bool,
    /// When it tripped last, simulated seconds.
    pub tripped_s: Option<f64>,
    pub hardware_error: u8,
}

#[derive(Clone, Debug)]
pub struct ServoBody {
    spec: SimServoSpec,
    pub motor: Motor,
    pub judge: Judge,
    supply_v: f64,
    /// What the others on the line make the supply sag by, volts.
    pub sag_v: f64,
    pub time_s: f64,
    deaf_until_s: f64,
    excused_until_s: f64,
    dead: bool,
    pub stalled_s: f64,
    /// Where a world moves the shaft.
    shaft: Option<WorldShaft>,
}

/// A shaft that a world moves.
#[derive(Clone, Copy, Debug, Default)]
struct WorldShaft {
    drive: ShaftDrive,
    is_pushed: bool,
    /// What the servo counts its angle from, beside its zero: whole turns.
    turns_rad: f64,
}

impl ServoBody {
    /// A body at rest where the spec says, its gear with the spec's play; `period_s` is
    /// the control period of its judge.
    pub fn new(spec: &SimServoSpec, mut motor: Motor, period_s: f64, supply_v: f64) -> Self {
        motor.angle_rad = spec.zero_rad + spec.direction * spec.initial_rad;
        motor.backlash_rad = spec.backlash_rad;
        Self {
            motor,
            judge: Judge::new(&spec.name, spec.limits, period_s),
            spec: spec.clone(),
            supply_v,
            sag_v: 0.0,
            time_s: 0.0,
            deaf_until_s: 0.0,
            excused_until_s: 0.0,
            dead: false,
            stalled_s: 0.0,
            shaft: None,
        }
    }

    pub fn joint_rad(&self, angle_rad: f64) -> f64 {
        (angle_rad - self.spec.zero_rad) * self.spec.direction
    }

    pub fn position_rad(&self) -> f64 {
        self.joint_rad(self.motor.angle_rad)
    }

    /// The supply at its terminals, volts.
    pub fn volts(&self) -> f64 {
        self.supply_v - self.sag_v
    }

    pub fn listens(&self) -> bool {
        !self.dead && self.time_s >= self.deaf_until_s
    }

    pub fn be_deaf_for(&mut self, seconds: f64) {
        self.deaf_until_s = self.time_s + seconds;
        self.stalled_s = 0.0;
    }

    /// Until `until_s` the true motion is not the host's fault and is not judged.
    pub fn excuse_motion(&mut self, until_s: f64) {
        self.excused_until_s = until_s;
    }

    /// One step of the motor with its gravity; `None` is no torque.
    pub fn step(&mut self, dt_s: f64, duty: Option<f64>) {
        self.step_damped(dt_s, duty, None);
    }

    /// The same of a motor whose firmware damps so much, newton metre seconds, faster
    /// than a world is stepped.
    pub fn step_damped(&mut self, dt_s: f64, duty: Option<f64>, damping_nm_s: Option<f64>) {
        if let Some(shaft) = &mut self.shaft {
            let (volts, direction) = (self.supply_v - self.sag_v, self.spec.direction);
            let damping_nm_s = damping_nm_s.unwrap_or(self.motor.damping_nm_s);
            let torque_nm = self.motor.push(dt_s, duty, volts, damping_nm_s);
            shaft.drive.drive = match self.motor.jammed {
                true => Some(JointDrive { torque_nm: 0.0, damping_nm_s: JAMMED_NM_S }),
                false => torque_nm
                    .map(|torque_nm| JointDrive { torque_nm: direction * torque_nm, damping_nm_s }),
            };
            return;
        }
        let joint_rad = self.position_rad();
        let gravity_nm = -self.spec.direction * self.spec.gravity_nm * joint_rad.sin();
        self.motor.step(dt_s, duty, self.volts(), gravity_nm);
    }

    /// The shaft is where a world has moved it.
    pub(crate) fn turn_shaft(&mut self, state: ShaftState) {
        let shaft = self.shaft.get_or_insert_default();
        shaft.is_pushed = state.is_pushed;
        let turned_rad = self.spec.direction * state.position_rad;
        self.motor.angle_rad = self.spec.zero_rad + turned_rad + shaft.turns_rad;
        self.motor.speed_rad_s = self.spec.direction * state.velocity_rad_s;
    }

    /// What it does to its joint in a world, and what was done to it by hand.
    pub(crate) fn shaft_drive(&mut self) -> ShaftDrive {
        let Some(shaft) = &mut self.shaft else {
            return ShaftDrive::default();
        };
        let drive = shaft.drive;
        shaft.drive.put_at_rad = None;
        drive
    }

    /// Whole turns are no longer counted.
    pub fn clear_turns(&mut self) {
        let angle_rad = self.motor.angle_rad.rem_euclid(std::f64::consts::TAU);
        if let Some(shaft) = &mut self.shaft {
            shaft.turns_rad += angle_rad - self.motor.angle_rad;
        }
        self.motor.angle_rad = angle_rad;
    }

    /// For how long it has been pushing hard without moving, seconds.
    pub fn stalled_for(&mut self, dt_s: f64, pushes_hard: bool) -> f64 {
        let stands = self.motor.speed_rad_s.abs() < 0.1;
        self.stalled_s = if pushes_hard && stands { self.stalled_s + dt_s } else { 0.0 };
        self.stalled_s
    }

    /// The end of a control period: the true position is judged.
    pub fn end_period(&mut self) {
        let position_rad = self.position_rad();
        match self.shaft {
            Some(WorldShaft { is_pushed: true, .. }) => self.judge.pass_motion(position_rad),
            _ if self.time_s < self.excused_until_s => self.judge.pass_motion(position_rad),
            _ => self.judge.judge_motion(self.time_s, position_rad),
        }
    }

    /// Something goes wrong; what is not the body's is handed back.
    pub fn suffer(&mut self, fault: ServoFault) -> Option<ServoFault> {
        match fault {
            ServoFault::Dead => self.dead = true,
            ServoFault::Revive => self.dead = false,
            ServoFault::Unplug | ServoFault::Plug => {
                self.dead = fault == ServoFault::Unplug;
                return Some(fault);
            }
            ServoFault::Free => self.motor.jammed = false,
            ServoFault::Overheat(celsius) => self.motor.temperature_c = celsius,
            ServoFault::Jam => {
                self.motor.jammed = true;
                self.judge.motion.last = None; // until torque comes on again
            }
            ServoFault::Supply(volts) => self.supply_v = volts,
            ServoFault::Moved(joint_rad) => {
                self.motor.angle_rad = self.spec.zero_rad + self.spec.direction * joint_rad;
                if let Some(shaft) = &mut self.shaft {
                    shaft.drive.put_at_rad = Some(joint_rad);
                }
            }
            other => return Some(other),
        }
        None
    }

    /// The truth, of a servo that has no torque and holds no goal.
    pub fn state(&self) -> SimServoState {
        SimServoState {
            time_s: self.time_s,
            position_rad: self.position_rad(),
            velocity_rad_s: self.spec.direction * self.motor.speed_rad_s,
            goal_rad: self.position_rad(),
            current_a: self.spec.direction * self.motor.current_a,
            temperature_c: self.motor.temperature_c,
            ..SimServoState::default()
        }
    }
}
