//! The mechanics of a geared servo motor: voltage in, angle out.
//!
//! ```text
//! torque = stall_torque * (pwm * supply / nominal) - damping * speed
//! inertia * acceleration = torque - friction - gravity + external
//! ```
//!
//! `damping = stall_torque / no_load_speed` is the back-EMF, which limits the
//! speed by the supply. The reflected inertia of the rotor is taken so that the
//! vendor's stock position gain ends slightly above critical damping: such a
//! servo follows a smooth command with a lag of `damping / stiffness` (45 ms for
//! an XM430-W350) and does not overshoot. Friction is Coulomb's: it stops, and
//! never drives.
//!
//! The gear may have play: the shaft moves when the gear has crossed it, at once
//! with the gear's speed (what hangs on the shaft stays where it is meanwhile, and
//! there is no rebound). The encoder is on the shaft, behind the play.
//!
//! Angles are the servo's own, radians.

use servodance_drivers::DataSheet;
use servodance_drivers::can::MotorSettings;

pub const FULL_PWM: f64 = 885.0;
/// Radians of position error at which the stock gain of 800 asks for full PWM:
/// 885 / (800 / 128) ticks.
pub const FULL_PWM_ERROR_RAD: f64 = FULL_PWM / 6.25 * std::f64::consts::TAU / 4096.0;
/// Rotor inertia against the one at which the stock loop is critically damped.
const INERTIA_SHARE: f64 = 0.78;
const FRICTION_SHARE: f64 = 0.01;
/// Kelvin a watt and seconds of the winding: a stall overheats in about a minute.
const THERMAL_K_PER_W: f64 = 4.0;
const THERMAL_TIME_S: f64 = 60.0;
/// CAN motors: share of the peak torque that is held for ever (RobStride's data sheets: a
/// third), and how much warmer than the room the winding is then.
const CAN_RATED_SHARE: f64 = 1.0 / 3.0;
const CAN_RATED_K: f64 = 50.0;
pub const AMBIENT_C: f64 = 25.0;

#[derive(Clone, Debug)]
pub struct Motor {
    stall_torque_nm: f64,
    pub damping_nm_s: f64,
    pub inertia_kg_m2: f64,
    pub friction_nm: f64,
    amperes_per_nm: f64,
    nominal_v: f64,
    thermal_k_per_w: f64,
    /// How far the gear can turn without the shaft, radians.
    pub backlash_rad: f64,
    /// How far the gear is ahead of the shaft, up to half of that either way.
    ahead_rad: f64,
    /// Angle of the shaft, radians.
    pub angle_rad: f64,
    /// Speed of the gear, radians a second.
    pub speed_rad_s: f64,
    /// Current, amperes, positive towards higher angles.
    pub current_a: f64,
    pub temperature_c: f64,
    pub jammed: bool,
}

impl Motor {
    /// A motor at rest at zero, without play.
    pub fn new(sheet: &DataSheet, load_inertia_kg_m2: f64) -> Self {
        let damping_nm_s =
            sheet.stall_torque_nm / (sheet.no_load_rpm * std::f64::consts::TAU / 60.0);
        let stiffness = sheet.stall_torque_nm / FULL_PWM_ERROR_RAD;
        let critical_inertia = damping_nm_s * damping_nm_s / (4.0 * stiffness);
        Self {
            stall_torque_nm: sheet.stall_torque_nm,
            damping_nm_s,
            inertia_kg_m2: INERTIA_SHARE * critical_inertia + load_inertia_kg_m2,
            friction_nm: FRICTION_SHARE * sheet.stall_torque_nm,
            amperes_per_nm: sheet.stall_current_a / sheet.stall_torque_nm,
            nominal_v: sheet.voltage_v,
            thermal_k_per_w: THERMAL_K_PER_W,
            backlash_rad: 0.0,
            ahead_rad: 0.0,
            angle_rad: 0.0,
            speed_rad_s: 0.0,
            current_a: 0.0,
            temperature_c: AMBIENT_C,
            jammed: false,
        }
    }

    /// The same motor, so many times as strong, at the same current.
    pub fn times(self, strength: f64) -> Self {
        Self {
            stall_torque_nm: self.stall_torque_nm * strength,
            damping_nm_s: self.damping_nm_s * strength,
            inertia_kg_m2: self.inertia_kg_m2 * strength,
            friction_nm: self.friction_nm * strength,
            amperes_per_nm: self.amperes_per_nm / strength,
            ..self
        }
    }

    /// A CAN motor made for `nominal_v`: driven by torque, so that its inertia does not
    /// follow from a stock gain.
    pub fn of_can(settings: &MotorSettings, nominal_v: f64, load_inertia_kg_m2: f64) -> Self {
        let torque_nm = settings.model.torque_nm;
        let rpm = settings.model.velocity_rad_s * 60.0 / std::f64::consts::TAU;
        let sheet = DataSheet::new(torque_nm, rpm, torque_nm, nominal_v);
        let inertia_kg_m2 = settings.model.rotor_inertia_kg_m2() + load_inertia_kg_m2;
        let rated_w = CAN_RATED_SHARE * CAN_RATED_SHARE * torque_nm * nominal_v;
        let thermal_k_per_w = CAN_RATED_K / rated_w;
        Self { inertia_kg_m2, thermal_k_per_w, ..Self::new(&sheet, 0.0) }
    }

    /// One step of `dt_s` at a duty of -1 to 1 from a supply; `None`: the
    /// bridge is open and only friction acts. `external_nm` is gravity and the like.
    pub fn step(&mut self, dt_s: f64, duty: Option<f64>, supply_v: f64, external_nm: f64) {
        let drive_nm = duty.map_or(0.0, |duty| {
            let asked_nm = self.stall_torque_nm * duty * supply_v / self.nominal_v;
            // Back-EMF at the speed after this step keeps the step stable.
            let ahead = 1.0 + dt_s * self.damping_nm_s / self.inertia_kg_m2;
            (asked_nm - self.damping_nm_s * self.speed_rad_s) / ahead
        });
        self.current_a = drive_nm * self.amperes_per_nm;
        let pushed = self.speed_rad_s + dt_s * (drive_nm + external_nm) / self.inertia_kg_m2;
        let stopped_by = dt_s * self.friction_nm / self.inertia_kg_m2;
        self.speed_rad_s = pushed.signum() * (pushed.abs() - stopped_by).max(0.0);
        if self.jammed {
            self.speed_rad_s = 0.0;
        }
        self.turn(self.speed_rad_s * dt_s);
        self.heat(dt_s);
    }

    /// One step of `dt_s` whose motion a world computes: the torque that the motor gives
    /// at standstill if it is damped by `damping_nm_s`, which is the back-EMF's or, where
    /// a firmware damps, its own. Keeps current and heat.
    pub fn push(
        &mut self,
        dt_s: f64,
        duty: Option<f64>,
        supply_v: f64,
        damping_nm_s: f64,
    ) -> Option<f64> {
        let drive_nm = duty.map(|duty| {
            let asked_nm = self.stall_torque_nm * duty * supply_v / self.nominal_v;
            asked_nm - self.damping_nm_s * self.speed_rad_s
        });
        self.current_a = drive_nm.unwrap_or(0.0) * self.amperes_per_nm;
        self.heat(dt_s);
        drive_nm.map(|drive_nm| drive_nm + damping_nm_s * self.speed_rad_s)
    }

    /// The gear turns; the shaft goes with it where the play ends.
    fn turn(&mut self, gear_rad: f64) {
        let ahead_rad = self.ahead_rad + gear_rad;
        let half = 0.5 * self.backlash_rad;
        self.ahead_rad = ahead_rad.clamp(-half, half);
        self.angle_rad += ahead_rad - self.ahead_rad;
    }

    /// The duty at which this current flows at the present speed.
    pub fn duty_for_current(&self, current_a: f64, supply_v: f64) -> f64 {
        self.duty_for_torque(current_a / self.amperes_per_nm, supply_v)
    }

    /// The duty at which the motor gives this torque at the present speed.
    pub fn duty_for_torque(&self, torque_nm: f64, supply_v: f64) -> f64 {
        let against_emf_nm = torque_nm + self.damping_nm_s * self.speed_rad_s;
        against_emf_nm / (self.stall_torque_nm * supply_v / self.nominal_v)
    }

    fn heat(&mut self, dt_s: f64) {
        // All power at stall becomes heat: resistance is volts over stall amperes.
        let stall_a = self.amperes_per_nm * self.stall_torque_nm;
        let power_w = self.current_a * self.current_a * self.nominal_v / stall_a;
        let settled_c = AMBIENT_C + self.thermal_k_per_w * power_w;
        self.temperature_c += (settled_c - self.temperature_c) * dt_s / THERMAL_TIME_S;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT_S: f64 = 0.5e-3;

    fn motor() -> Motor {
        Motor::new(&servodance_drivers::ServoModel::from_number(1020).unwrap().sheet, 0.0)
    }

    #[test]
    fn full_duty_reaches_the_no_load_speed_less_friction() {
        let mut motor = motor();
        for _ in 0..2000 {
            motor.step(DT_S, Some(1.0), 12.0, 0.0);
        }
        let no_load = 46.0 * std::f64::consts::TAU / 60.0;
        assert!((motor.speed_rad_s / no_load - 0.99).abs() < 0.001, "{}", motor.speed_rad_s);
    }

    #[test]
    fn half_the_supply_gives_half_the_speed() {
        let mut motor = motor();
        for _ in 0..2000 {
            motor.step(DT_S, Some(1.0), 6.0, 0.0);
        }
        assert!((motor.speed_rad_s - 0.49 * 4.817).abs() < 0.01, "{}", motor.speed_rad_s);
    }

    #[test]
    fn the_shaft_waits_until_the_gear_has_crossed_its_play() {
        let play_rad = 15.0 / 60.0 * std::f64::consts::PI / 180.0;
        let mut motor = motor();
        motor.backlash_rad = play_rad;
        motor.turn(0.5 * play_rad);
        assert_eq!(motor.angle_rad, 0.0);
        motor.turn(0.1);
        assert!((motor.angle_rad - 0.1).abs() < 1e-12);
        motor.turn(-play_rad);
        assert!((motor.angle_rad - 0.1).abs() < 1e-12);
        motor.turn(-0.1);
        assert!(motor.angle_rad.abs() < 1e-12);
    }

    #[test]
    fn friction_stops_a_coasting_motor_and_never_drives_it() {
        let mut motor = motor();
        motor.speed_rad_s = 1.0;
        for _ in 0..4000 {
            motor.step(DT_S, None, 12.0, 0.0);
            assert!(motor.speed_rad_s >= 0.0);
        }
        assert_eq!(motor.speed_rad_s, 0.0);
    }

    #[test]
    fn a_stalled_motor_draws_its_stall_current_and_heats() {
        let mut motor = motor();
        motor.jammed = true;
        for _ in 0..60_000 {
            motor.step(DT_S, Some(1.0), 12.0, 0.0);
        }
        assert!((motor.current_a - 2.3).abs() < 0.2, "{}", motor.current_a);
        assert!(motor.temperature_c > 60.0, "{}", motor.temperature_c);
    }
}
