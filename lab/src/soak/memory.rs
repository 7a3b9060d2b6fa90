//! How much memory the program has, and whether it grows.
//!
//! Only what the system counts as resident is looked at. Means are compared: of
//! the first half of a soak and of the last, an hour each at most.

use serde::Serialize;

/// Growth up to this share is flat.
pub const FLAT: f64 = 0.05;
/// Looks at either end that are compared: an hour of music.
const PART: usize = 720;

/// Blocks of this many bytes go back to the system when they are freed.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const LARGE_BLOCK: i32 = 128 * 1024;

/// Tells glibc to give every large block back when it is freed, which it does
/// only until it has freed the first: later it keeps one or two MiB more after
/// one dance than after another, as much as the leak that a soak looks for.
pub fn give_large_blocks_back() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    #[allow(unsafe_code)]
    // SAFETY: sets a number of the allocator, under its own lock.
    unsafe {
        nix::libc::mallopt(nix::libc::M_MMAP_THRESHOLD, LARGE_BLOCK);
    }
}

/// Resident memory over a soak, mebibytes.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Memory {
    /// One look every five seconds of music.
    pub looks_mib: Vec<f64>,
}

impl Memory {
    /// Takes a look now, if this system tells.
    pub fn sample(&mut self) {
        self.looks_mib.extend(resident_mib());
    }

    /// The most that was seen.
    pub fn highest_mib(&self) -> f64 {
        self.looks_mib.iter().copied().fold(0.0, f64::max)
    }

    /// Share by which the last part's mean is above the first part's; `None`
    /// before the second look.
    pub fn growth(&self) -> Option<f64> {
        let looks = &self.looks_mib;
        let part = PART.min(looks.len() / 2);
        let mean = |looks: &[f64]| looks.iter().sum::<f64>() / part as f64;
        (part > 0).then(|| mean(&looks[looks.len() - part..]) / mean(&looks[..part]) - 1.0)
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

    fn of(looks: impl IntoIterator<Item = f64>) -> Memory {
        Memory { looks_mib: looks.into_iter().collect() }
    }

    #[test]
    fn a_leak_is_growth_and_one_high_look_is_not() {
        assert_eq!(of([]).growth(), None);
        assert_eq!(of([50.0]).growth(), None);
        let leak = of((0..200).map(|look| 50.0 + 0.1 * f64::from(look)));
        assert!((leak.growth().unwrap() - 10.0 / 54.95).abs() < 1e-9);
        let peak = of((0..200).map(|look| if look == 150 { 60.0 } else { 50.0 }));
        assert!(peak.growth().unwrap() < FLAT);
        assert_eq!(peak.highest_mib(), 60.0);
    }

    #[test]
    fn hours_between_the_first_and_the_last_count_whole() {
        let long = of((0..8 * PART).map(|look| 100.0 + look as f64 / PART as f64));
        assert!((long.growth().unwrap() - 7.0 / 100.5).abs() < 1e-3);
    }

    #[test]
    fn this_program_holds_some_memory() {
        if cfg!(target_os = "linux") {
            assert!(resident_mib().unwrap() > 1.0);
        }
    }
}
