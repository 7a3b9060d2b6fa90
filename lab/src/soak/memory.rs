//! How much memory the program has, and whether it grows.
//!
//! Only what the system counts as resident is looked at. During a warm-up
//! everything is met once; the most that was held then is what is compared with.

use serde::Serialize;

/// Growth up to this share is flat.
pub const FLAT: f64 = 0.05;

/// Resident memory over a soak, mebibytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Memory {
    /// The most during the warm-up.
    pub warm_up_mib: f64,
    /// The most after the warm-up.
    pub highest_mib: f64,
    /// Resident memory at the end of the soak.
    pub last_mib: f64,
    /// How often it was looked at since the warm-up.
    pub samples: u64,
}

impl Memory {
    /// Looks at it now, if this system tells.
    pub fn sample(&mut self, warming_up: bool) {
        if let Some(mib) = resident_mib() {
            self.take(mib, warming_up);
        }
    }

    fn take(&mut self, mib: f64, warming_up: bool) {
        self.last_mib = mib;
        if warming_up {
            self.warm_up_mib = self.warm_up_mib.max(mib);
        } else {
            self.samples += 1;
            self.highest_mib = self.highest_mib.max(mib);
        }
    }

    /// Share by which the highest is above the warm-up's; `None` before the
    /// second sample after it.
    pub fn growth(&self) -> Option<f64> {
        let known = self.samples > 0 && self.warm_up_mib > 0.0;
        known.then(|| self.highest_mib / self.warm_up_mib - 1.0)
    }
}

/// Resident memory of this program; `None` where the system does not tell.
fn resident_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kib: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib / 1024.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growth_is_what_comes_after_the_warm_up() {
        let mut memory = Memory::default();
        assert_eq!(memory.growth(), None);
        for (mib, warming_up) in [(50.0, true), (100.0, true), (90.0, true)] {
            memory.take(mib, warming_up);
        }
        assert_eq!(memory.growth(), None);
        memory.take(80.0, false);
        assert!(memory.growth() < Some(0.0));
        memory.take(110.0, false);
        memory.take(100.0, false);
        assert!((memory.growth().unwrap() - 0.1).abs() < 1e-12);
        assert_eq!(memory.last_mib, 100.0);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn this_program_holds_some_memory() {
        assert!(resident_mib() > Some(1.0));
    }
}
