//! Smaller motion for a servo that is close to a limit of its own.
//!
//! Severity is 0 where nothing is wrong and 1 where the safety layer stops; in
//! between the motion around its recent mean shrinks to `1 - severity` of the
//! way to `derate_to`. Speed and acceleration shrink with it. Heat and current
//! concern one joint, the supply concerns all.

use crate::bus::Health;
use servodance_types::HeldBack;

use super::config::SafetyConfig;

/// The mean around which motion shrinks forgets over this time, seconds.
const MEAN_S: f64 = 2.0;
/// Current is averaged over this time, seconds.
const CURRENT_S: f64 = 1.0;
/// Motion shrinks and grows back at these shares a second.
const SHRINK_PER_S: f64 = 0.5;
const GROW_PER_S: f64 = 0.05;
/// A measured limit must be reached this often in a row: one reading may be wrong.
const STRIKES: u32 = 3;

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Severity {
    /// 0 where nothing is wrong, 1 where the layer stops.
    pub level: f64,
    pub what: &'static str,
    pub actual: f64,
    pub limit: f64,
    pub unit: &'static str,
}

impl Severity {
    fn of(what: &'static str, unit: &'static str, actual: f64, begin: f64, end: f64) -> Self {
        let level = (actual - begin) / (end - begin);
        Self {
            // A reading that is not a number is no reading.
            level: if level > 0.0 { level.min(1.0) } else { 0.0 },
            what,
            actual,
            limit: end,
            unit,
        }
    }

    fn max(self, other: Self) -> Self {
        if other.level > self.level { other } else { self }
    }
}

#[derive(Clone, Debug)]
pub(super) struct Derate {
    config: SafetyConfig,
    health: Health,
    strikes: u32,
    current_a: f64,
    share: f64,
    mean_rad: Option<f64>,
}

impl Derate {
    pub fn new(config: SafetyConfig) -> Self {
        Self {
            config,
            health: Health::default(),
            strikes: 0,
            current_a: 0.0,
            share: 1.0,
            mean_rad: None,
        }
    }

    pub fn set_health(&mut self, health: Health) {
        self.health = health;
        let worst = self.heat().max(self.supply());
        self.strikes = if worst.level >= 1.0 { self.strikes + 1 } else { 0 };
    }

    pub fn health(&self) -> Health {
        self.health
    }

    pub fn add_current(&mut self, current_a: f64, period_s: f64) {
        if current_a.is_finite() {
            self.current_a += (current_a.abs() - self.current_a) * (period_s / CURRENT_S).min(1.0);
        }
    }

    pub fn own(&self) -> Severity {
        self.heat().max(self.load())
    }

    pub fn worst(&self) -> Severity {
        self.supply().max(self.own())
    }

    /// Severity of the supply, which all joints share.
    pub fn supply(&self) -> Severity {
        let health = self.health;
        let (Some(volts), Some(lowest)) = (health.voltage_v, health.lowest_voltage_v) else {
            return Severity::default();
        };
        if let Some(highest) = health.highest_voltage_v.filter(|highest| volts > *highest) {
            return Severity::of("supply", "V", volts, highest, highest + 1e-3);
        }
        let begin = lowest + self.config.voltage_margin_v;
        Severity::of("supply", "V", volts, begin, lowest)
    }

    fn heat(&self) -> Severity {
        let health = self.health;
        let limit = health.temperature_c.zip(health.highest_temperature_c);
        limit.map_or(Severity::default(), |(celsius, highest)| {
            let begin = highest - self.config.temperature_margin_c;
            let end = highest - self.config.temperature_fault_c;
            Severity::of("temperature", "C", celsius, begin, end)
        })
    }

    fn load(&self) -> Severity {
        let most = self.health.highest_current_a.filter(|most| *most > 0.0);
        most.map_or(Severity::default(), |most| {
            let begin = self.config.current_share * most;
            Severity::of("current", "A", self.current_a, begin, most)
        })
    }

    /// The condition that the layer must stop for, if any.
    pub fn fault(&self) -> Option<Severity> {
        let measured = self.heat().max(self.supply());
        if measured.level >= 1.0 && self.strikes >= STRIKES {
            return Some(measured);
        }
        Some(self.load()).filter(|load| load.level >= 1.0)
    }

    /// The target with its motion shrunk step by step to what `level` (0 to 1) leaves.
    pub fn shrink(&mut self, target_rad: f64, level: f64, period_s: f64) -> f64 {
        let mean_rad = self.mean_rad.get_or_insert(target_rad);
        *mean_rad += (target_rad - *mean_rad) * (period_s / MEAN_S).min(1.0);
        let wanted = 1.0 - level * (1.0 - self.config.derate_to);
        self.share =
            wanted.clamp(self.share - SHRINK_PER_S * period_s, self.share + GROW_PER_S * period_s);
        if self.share >= 1.0 {
            return target_rad;
        }
        *mean_rad + self.share * (target_rad - *mean_rad)
    }

    pub fn is_derated(&self) -> bool {
        self.share < 1.0
    }

    /// Why its motion is smaller now; `supply` is the severity of the worst of all supplies.
    pub fn held_back(&self, supply: f64) -> HeldBack {
        let (heat, load) = (self.heat().level, self.load().level);
        match self.is_derated() {
            false => HeldBack::Nothing,
            true if supply > heat.max(load) => HeldBack::Supply,
            true if load > heat => HeldBack::Torque,
            true => HeldBack::Heat,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joint() -> Derate {
        Derate::new(SafetyConfig::at_hz(100.0))
    }

    fn at(celsius: f64, volts: f64) -> Health {
        Health {
            temperature_c: Some(celsius),
            highest_temperature_c: Some(80.0),
            voltage_v: Some(volts),
            lowest_voltage_v: Some(9.5),
            highest_voltage_v: Some(16.0),
            highest_current_a: Some(3.2),
        }
    }

    #[test]
    fn severity_grows_from_the_margin_to_the_stop() {
        let mut joint = joint();
        for (celsius, level) in [(60.0, 0.0), (65.0, 0.0), (71.0, 0.5), (77.0, 1.0), (90.0, 1.0)] {
            joint.set_health(at(celsius, 12.0));
            assert!((joint.own().level - level).abs() < 1e-9, "{celsius}");
        }
        for (volts, level) in [(12.0, 0.0), (9.75, 0.5), (9.0, 1.0), (17.0, 1.0)] {
            joint.set_health(at(30.0, volts));
            assert!((joint.supply().level - level).abs() < 1e-9, "{volts}");
        }
    }

    #[test]
    fn one_wrong_reading_is_no_fault_and_three_are() {
        let mut joint = joint();
        for (strike, faults) in [(1, false), (2, false), (3, true)] {
            joint.set_health(at(78.0, 12.0));
            assert_eq!(joint.fault().is_some(), faults, "{strike}");
        }
        joint.set_health(at(70.0, 12.0));
        assert!(joint.fault().is_none());
        let unknown = Health::default();
        joint.set_health(unknown);
        assert_eq!(joint.own().level, 0.0);
    }

    #[test]
    fn a_joint_that_moves_less_says_why() {
        let held = |celsius: f64, supply: f64, current_a: f64| {
            let mut joint = joint();
            joint.set_health(at(celsius, 12.0));
            (0..1000).for_each(|_| joint.add_current(current_a, 0.01));
            let level = joint.own().level.max(supply);
            for _ in 0..100 {
                joint.shrink(1.0, level, 0.01);
            }
            joint.held_back(supply)
        };
        assert_eq!(held(50.0, 0.0, 0.1), HeldBack::Nothing);
        assert_eq!(held(73.0, 0.0, 0.1), HeldBack::Heat);
        assert_eq!(held(50.0, 0.0, 3.1), HeldBack::Torque);
        assert_eq!(held(66.0, 0.9, 0.1), HeldBack::Supply);
    }

    #[test]
    fn current_counts_by_its_mean() {
        let mut joint = joint();
        joint.set_health(at(30.0, 12.0));
        joint.add_current(-50.0, 0.01);
        assert_eq!(joint.own().level, 0.0, "a peak");
        for _ in 0..500 {
            joint.add_current(-2.9, 0.01);
        }
        assert!((0.4..0.6).contains(&joint.own().level), "{:?}", joint.own());
        joint.add_current(f64::NAN, 0.01);
        assert!(joint.own().level > 0.4);
    }

    #[test]
    fn motion_shrinks_around_its_mean_and_grows_back() {
        let mut joint = joint();
        let swing = |k: usize| 1.0 + 0.5 * (0.05 * k as f64).sin();
        let mut amplitude = |level: f64, periods: usize| {
            let moved: Vec<f64> =
                (0..periods).map(|k| joint.shrink(swing(k), level, 0.01)).collect();
            let late = &moved[periods - 300..];
            let highest = late.iter().copied().fold(f64::MIN, f64::max);
            (highest - late.iter().copied().fold(f64::MAX, f64::min)) / 2.0
        };
        assert!((amplitude(0.0, 400) - 0.5).abs() < 0.01);
        let small = amplitude(1.0, 1000);
        assert!(small < 0.3, "{small}");
        assert!((amplitude(0.0, 2500) - 0.5).abs() < 0.01);
    }
}
