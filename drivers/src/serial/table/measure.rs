//! What the number in a register means: raw numbers to units and words, and back.

use std::f64::consts::TAU;

use crate::serial::memory::BaudDecoder;
use crate::serial::register::names_of;
use crate::servo::model::ServoModel;

/// What the number in a register means.
#[derive(Clone, Copy, Debug)]
pub enum Measure {
    /// The number itself.
    Plain,
    /// So much of a unit each.
    Scaled(f64, &'static str),
    /// An angle of the servo, degrees from the middle of its turn.
    Angle,
    /// A difference of angles, degrees.
    Turn,
    /// Degrees a second.
    Speed,
    /// Amperes; a load in 0.1 % where the model has no sensor.
    Current,
    /// A rate, bits a second.
    Rate(BaudDecoder),
    /// What each number means.
    Choice(&'static [(i64, &'static str)]),
    /// What each bit means.
    Flags(&'static [(u8, &'static str)]),
}

/// What the numbers of one model are worth.
#[allow(missing_docs)] // units stand in the names
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoUnits {
    pub rad_per_tick: f64,
    /// The middle of its turn.
    pub middle_ticks: f64,
    pub velocity_rad_s_per_unit: f64,
    /// `None` without a sensor.
    pub current_a_per_unit: Option<f64>,
}

impl From<&ServoModel> for ServoUnits {
    fn from(model: &ServoModel) -> Self {
        Self {
            rad_per_tick: model.rad_per_tick,
            middle_ticks: (f64::from(model.last_tick) + 1.0) / 2.0,
            velocity_rad_s_per_unit: model.velocity_rad_s_per_unit,
            current_a_per_unit: model.current_a_per_unit,
        }
    }
}

impl ServoUnits {
    /// An angle from the middle of the turn, degrees.
    pub fn degrees(&self, ticks: f64) -> f64 {
        (ticks - self.middle_ticks) * self.rad_per_tick.to_degrees()
    }
}

/// `(raw - zero) * factor` is the number in a unit.
struct Scale {
    zero: f64,
    factor: f64,
    unit: &'static str,
}

impl Scale {
    fn of(&self, raw: i64) -> f64 {
        (raw as f64 - self.zero) * self.factor
    }

    /// As many places as tell two raw numbers apart, three at most.
    fn places(&self) -> usize {
        match self.factor {
            1.0.. => 0,
            0.02.. => 1,
            _ => 3,
        }
    }
}

impl Measure {
    fn scale(&self, units: &ServoUnits) -> Option<Scale> {
        let scale = |zero, factor, unit| Some(Scale { zero, factor, unit });
        let tick_deg = units.rad_per_tick.to_degrees();
        match *self {
            Self::Scaled(factor, unit) => scale(0.0, factor, unit),
            Self::Angle => scale(units.middle_ticks, tick_deg, "deg"),
            Self::Turn => scale(0.0, tick_deg, "deg"),
            Self::Speed => scale(0.0, units.velocity_rad_s_per_unit.to_degrees(), "deg/s"),
            Self::Current => match units.current_a_per_unit {
                Some(amperes) => scale(0.0, amperes, "A"),
                None => scale(0.0, 0.1, "%"),
            },
            Self::Plain | Self::Rate(_) | Self::Choice(_) | Self::Flags(_) => None,
        }
    }

    fn in_unit(&self, raw: i64, units: &ServoUnits) -> Option<String> {
        let scale = self.scale(units)?;
        let unit = scale.unit;
        // A speed of one unit is more than a degree a second, and less than two.
        let places = scale.places().max(usize::from(matches!(self, Self::Speed)));
        Some(format!("{:.places$} {unit}", scale.of(raw)))
    }

    /// A raw number in words: `12.3 deg (2188)`.
    pub(super) fn show(&self, raw: i64, units: &ServoUnits) -> String {
        let words = match *self {
            Self::Rate(decoder) => match decoder(raw as u8) {
                0 => "unknown".into(),
                baud => format!("{baud} baud"),
            },
            Self::Choice(choices) => {
                let known = choices.iter().find(|(number, _)| *number == raw);
                known.map_or("unknown", |(_, word)| word).to_owned()
            }
            Self::Flags(_) if raw == 0 => "none".into(),
            Self::Flags(names) => names_of(raw as u8, names),
            _ => match self.in_unit(raw, units) {
                Some(words) => words,
                None => return raw.to_string(),
            },
        };
        format!("{words} ({raw})")
    }

    /// The ends of a range of raw numbers in its unit, as `, 0.0 to 1.0 V`; nothing without one.
    pub(super) fn span(&self, (lowest, highest): (i64, i64), units: &ServoUnits) -> String {
        match (self.scale(units), self.in_unit(highest, units)) {
            (Some(scale), Some(highest)) => {
                let places = scale.places().max(usize::from(matches!(self, Self::Speed)));
                format!(", {:.places$} to {highest}", scale.of(lowest))
            }
            _ => String::new(),
        }
    }

    /// The raw number that `text` means; `None` where it means none: not a number, another
    /// unit, a word that is not known.
    pub(super) fn parse(&self, text: &str, units: &ServoUnits) -> Option<i64> {
        let text = text.trim();
        if let Some(raw) = whole_number(text) {
            return Some(raw);
        }
        if let Self::Choice(choices) = self {
            let named = choices.iter().find(|(_, word)| word.eq_ignore_ascii_case(text));
            return named.map(|(number, _)| *number);
        }
        let scale = self.scale(units)?;
        let number = text.strip_suffix(scale.unit)?.trim().parse().ok();
        let number = number.filter(|number: &f64| number.is_finite())?;
        // Beyond 64 bits a cast ends at the last number, which no register takes.
        Some((number / scale.factor + scale.zero).round() as i64)
    }
}

/// A whole number, decimal or `0x` and hexadecimal.
fn whole_number(text: &str) -> Option<i64> {
    match text.strip_prefix("0x") {
        Some(digits) => i64::from_str_radix(digits, 16).ok(),
        None => text.parse().ok(),
    }
}

/// Radians a second in so many revolutions a minute.
pub(crate) const fn of_rpm(rpm: f64) -> f64 {
    rpm * TAU / 60.0
}
