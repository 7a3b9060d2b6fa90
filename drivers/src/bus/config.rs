//! The `[bus]` tables of a robot file, and their check.

use std::fmt;
use std::time::Duration;

use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};

use crate::bus::kind::BusKind;
use crate::bus::reply_clock::ReplyClock;
use crate::error::ConfigError;
use crate::imu::ImuConfig;

/// The `[bus]` table, or one of several `[[bus]]`.
#[allow(missing_docs)] // docs/serial.md and docs/can.md describe every key
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct BusConfig {
    /// The name that joints and `--bus` call it by; may be empty where there is one bus only.
    #[serde(default)]
    pub name: String,
    pub kind: BusKind,
    /// Bits a second; `bitrate` says the same.
    #[serde(alias = "bitrate")]
    pub baud: u32,
    #[serde(default = "default_reply_timeout_ms")]
    pub reply_timeout_ms: f64,
    #[serde(skip)]
    pub reply_clock: ReplyClock,
    #[serde(default = "default_retries")]
    pub retries: u32,
    /// The servos stop by themselves after this much silence, milliseconds
    /// (20 to 2540, in steps of 20).
    #[serde(default = "default_watchdog_ms")]
    pub watchdog_ms: u32,
    #[serde(default)]
    pub accept_no_watchdog: bool,
    /// ODrive: endpoint ids of `axis0.config.watchdog_timeout` and
    /// `axis0.config.enable_watchdog`, from the firmware's `flat_endpoints.json`.
    #[serde(default)]
    pub watchdog_endpoints: Option<[u16; 2]>,
    /// Control cycles a second, which the robot file has elsewhere; `None` where
    /// nobody asks for a rate.
    #[serde(skip)]
    pub control_hz: Option<f64>,
    /// The motion sensor on this bus, which the robot file has elsewhere.
    #[serde(skip)]
    pub imu: Option<ImuConfig>,
}

fn default_reply_timeout_ms() -> f64 {
    20.0
}

fn default_retries() -> u32 {
    2
}

/// A killed program's servos are to stand within 200 ms; its last commands are
/// still under way, and a Dynamixel counts in steps of 20 ms.
fn default_watchdog_ms() -> u32 {
    160
}

impl BusConfig {
    /// A Dynamixel Protocol 2.0 bus with the defaults of the robot file.
    pub fn dynamixel2(baud: u32) -> Self {
        Self::of_kind(BusKind::Dynamixel2, baud)
    }

    /// A bus with the defaults of the robot file.
    pub fn of_kind(kind: BusKind, baud: u32) -> Self {
        Self {
            name: String::new(),
            kind,
            baud,
            reply_timeout_ms: default_reply_timeout_ms(),
            reply_clock: ReplyClock::Wall,
            retries: default_retries(),
            watchdog_ms: default_watchdog_ms(),
            accept_no_watchdog: false,
            watchdog_endpoints: None,
            control_hz: None,
            imu: None,
        }
    }

    /// The longest that a cycle of `servos` servos may take, every retry, and
    /// the search for who is silent, included.
    pub fn longest_cycle(&self, servos: usize) -> Duration {
        const SEND_S: f64 = 0.1;
        const REPLY_BYTES: f64 = 40.0;
        let exchange_s = self.reply_timeout_ms * 1e-3 + SEND_S;
        let wire_s = servos as f64 * REPLY_BYTES * 10.0 / f64::from(self.baud);
        let exchanges = f64::from(self.retries + 1) + servos as f64;
        Duration::from_secs_f64(exchanges * (exchange_s + wire_s))
    }

    /// The same configuration, if it is usable.
    pub fn checked(self) -> Result<Self, ConfigError> {
        let bad = |key, actual: String, wanted| ConfigError::Bus { key, actual, wanted };
        if !(9_600..=10_000_000).contains(&self.baud) {
            return Err(bad("baud", self.baud.to_string(), "9600 to 10000000"));
        }
        if !(self.reply_timeout_ms > 0.0 && self.reply_timeout_ms <= 60_000.0) {
            let actual = self.reply_timeout_ms.to_string();
            return Err(bad("reply_timeout_ms", actual, "above 0, at most 60000"));
        }
        if self.retries > 10 {
            return Err(bad("retries", self.retries.to_string(), "0 to 10"));
        }
        if !(20..=2540).contains(&self.watchdog_ms) || !self.watchdog_ms.is_multiple_of(20) {
            let actual = self.watchdog_ms.to_string();
            return Err(bad("watchdog_ms", actual, "20 to 2540 in steps of 20"));
        }
        Ok(self)
    }
}

/// Reads `[bus]` or several `[[bus]]`.
pub fn one_or_several<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<BusConfig>, D::Error> {
    struct BusTables;
    impl<'de> Visitor<'de> for BusTables {
        type Value = Vec<BusConfig>;

        fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
            f.write_str("a [bus] table or several [[bus]] tables")
        }

        fn visit_map<A: MapAccess<'de>>(self, table: A) -> Result<Self::Value, A::Error> {
            Ok(vec![BusConfig::deserialize(MapAccessDeserializer::new(table))?])
        }

        fn visit_seq<A: SeqAccess<'de>>(self, tables: A) -> Result<Self::Value, A::Error> {
            Vec::deserialize(SeqAccessDeserializer::new(tables))
        }
    }
    from.deserialize_any(BusTables)
}
