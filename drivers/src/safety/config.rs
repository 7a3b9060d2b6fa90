//! The settings of the safety layer: the `[safety]` table of a robot file.
//!
//! Every key may be left out. Refused, with the key named: numbers that are not
//! finite or outside their range, unknown keys and policies.

use serde::Deserialize;

use super::error::SafetyError;

/// What the layer does when one servo is lost: silent, or shut down by itself.
#[allow(missing_docs)] // each field says its name
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum ServoLost {
    #[default]
    Stop,
    Hold,
    DanceOn,
}

/// The settings of the safety layer, checked by [`SafetyConfig::at`].
///
/// Derating: between where it begins and where it ends the motion of a servo close to
/// a limit of its own shrinks linearly down to `derate_to`; at the end the layer
/// stops, before the servo does so by itself.
#[allow(missing_docs)] // units stand in the names; docs/serial.md explains the table
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct SafetyConfig {
    #[serde(skip)]
    pub control_hz: f64,
    pub on_servo_lost: ServoLost,
    pub rejoin_s: f64,
    pub rearm: bool,
    /// Servos that their own watchdog has stopped are taken on again after a silence of the
    /// host of at most this, seconds; after a longer one torque goes off. 0: never.
    pub resume_s: f64,
    /// How long the layer waits for an adapter, seconds; only with `rearm`.
    pub reconnect_s: f64,
    pub stale_after_s: f64,
    pub hold_s: f64,
    pub ramp_s: f64,
    pub following_error_deg: f64,
    pub following_error_s: f64,
    /// Derating begins this far below the servo's own temperature limit, Celsius, ends at the next.
    pub temperature_margin_c: f64,
    pub temperature_fault_c: f64,
    /// Derating begins this far above the lowest supply that the servo takes, volts;
    /// ends there. A supply above the highest stops at once.
    pub voltage_margin_v: f64,
    /// Derating begins at this share of the servo's own current limit, averaged over a
    /// second; ends at the limit.
    pub current_share: f64,
    /// The share of the motion that is left where derating ends.
    pub derate_to: f64,
}

impl Default for SafetyConfig {
    fn default() -> Self {
        Self {
            // Not usable before `at` has set it.
            control_hz: 0.0,
            on_servo_lost: ServoLost::Stop,
            rejoin_s: 10.0,
            rearm: false,
            resume_s: 1.0,
            reconnect_s: 10.0,
            stale_after_s: 0.25,
            hold_s: 0.5,
            ramp_s: 2.0,
            following_error_deg: 0.5f64.to_degrees(),
            following_error_s: 0.25,
            temperature_margin_c: 15.0,
            temperature_fault_c: 3.0,
            voltage_margin_v: 0.5,
            current_share: 0.8,
            derate_to: 0.3,
        }
    }
}

impl SafetyConfig {
    /// The default settings at a control rate.
    pub fn at_hz(control_hz: f64) -> Self {
        Self { control_hz, ..Self::default() }
    }

    /// These settings at a control rate; a number out of range is refused by its key.
    pub fn at(self, control_hz: f64) -> Result<Self, SafetyError> {
        Self { control_hz, ..self }.checked()
    }

    pub(super) fn period_s(&self) -> f64 {
        1.0 / self.control_hz
    }

    pub(super) fn checked(self) -> Result<Self, SafetyError> {
        let tiny = f64::MIN_POSITIVE;
        let coolest_c = self.temperature_fault_c + 0.1;
        for (key, actual, lowest, highest) in [
            ("control_hz", self.control_hz, tiny, 1e4),
            ("stale_after_s", self.stale_after_s, tiny, 10.0),
            ("hold_s", self.hold_s, 0.0, 60.0),
            ("ramp_s", self.ramp_s, 0.0, 60.0),
            ("following_error_deg", self.following_error_deg, tiny, 180.0),
            ("following_error_s", self.following_error_s, tiny, 10.0),
            ("rejoin_s", self.rejoin_s, 0.0, 3600.0),
            ("resume_s", self.resume_s, 0.0, 60.0),
            ("reconnect_s", self.reconnect_s, 0.0, 3600.0),
            ("temperature_fault_c", self.temperature_fault_c, 0.0, 50.0),
            ("temperature_margin_c", self.temperature_margin_c, coolest_c, 60.0),
            ("voltage_margin_v", self.voltage_margin_v, 0.01, 10.0),
            ("current_share", self.current_share, 0.05, 0.99),
            ("derate_to", self.derate_to, 0.0, 1.0),
        ] {
            // Not a number is outside every range.
            if !(lowest..=highest).contains(&actual) {
                return Err(SafetyError::Config { key, actual, highest });
            }
        }
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_read_and_its_numbers_are_checked() {
        let read = |text: &str| toml::from_str::<SafetyConfig>(text);
        assert_eq!(read("").unwrap(), SafetyConfig::default());
        let config =
            read("on_servo_lost = \"dance_on\"\nrearm = true\n").unwrap().at(100.0).unwrap();
        assert_eq!((config.on_servo_lost, config.rearm), (ServoLost::DanceOn, true));
        assert!(SafetyConfig::at_hz(50.0).checked().is_ok());
        assert!(read("on_servo_lost = \"pray\"").is_err());
        assert!(read("rearming = true").is_err());
        for (text, key) in [
            ("hold_s = nan", "hold_s"),
            ("derate_to = 2.0", "derate_to"),
            ("temperature_margin_c = 2.0", "temperature_margin_c"),
            ("following_error_deg = 0.0", "following_error_deg"),
        ] {
            let error = read(text).unwrap().at(100.0).unwrap_err().to_string();
            assert!(error.contains(key), "{text}: {error}");
        }
    }
}
