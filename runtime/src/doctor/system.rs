//! The operating system: priorities, punctuality, clock rates.

use super::Finding;
use crate::process::realtime::{ThreadRole, raise};
use std::path::Path;
use std::time::{Duration, Instant};

const NAPS: usize = 300;
const NAP: Duration = Duration::from_millis(1);

/// Whether the control loop may go before all other work. Tried in a thread of
/// its own, which ends with it.
pub fn priority() -> Finding {
    let tried = std::thread::spawn(|| raise(ThreadRole::Control)).join();
    match tried {
        Ok(Ok(())) => Finding::good("priority", "real-time priority is granted"),
        _ => Finding::warning(
            "priority",
            "real-time priority is refused: cycles may come late on a busy machine",
            "add `USER - rtprio 40` to /etc/security/limits.conf and log in again",
        ),
    }
}

/// How late the system wakes a thread that sleeps, against the control period.
pub fn timer(period_s: f64) -> Finding {
    let late_ms = std::thread::spawn(|| {
        let _ = raise(ThreadRole::Control); // as the control loop does
        let mut late_ms: Vec<f64> = (0..NAPS).map(|_| nap_lateness_ms()).collect();
        late_ms.sort_by(f64::total_cmp);
        late_ms[NAPS * 99 / 100]
    })
    .join()
    .unwrap_or(f64::INFINITY);
    let period_ms = period_s * 1e3;
    let what = format!(
        "a sleeping thread wakes {late_ms:.2} ms late (99th percentile of {NAPS}); a control cycle is {period_ms:.0} ms"
    );
    match late_ms < period_ms / 4.0 {
        true => Finding::good("timer", what),
        false => {
            Finding::warning("timer", what, "stop other programs, or grant real-time priority")
        }
    }
}

fn nap_lateness_ms() -> f64 {
    let start = Instant::now();
    std::thread::sleep(NAP);
    start.elapsed().saturating_sub(NAP).as_secs_f64() * 1e3
}

/// Whether the processor's clock stays up, where Linux tells.
pub fn governor() -> Option<Finding> {
    governor_in(Path::new("/sys/devices/system/cpu/cpu0/cpufreq"))
}

fn governor_in(folder: &Path) -> Option<Finding> {
    let text = std::fs::read_to_string(folder.join("scaling_governor")).ok()?;
    let governor = text.trim();
    let what = format!("the processor's frequency governor is {governor}");
    Some(match governor {
        "powersave" | "conservative" => Finding::warning(
            "processor",
            what,
            "echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor",
        ),
        _ => Finding::good("processor", what),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Verdict;

    #[test]
    fn a_governor_that_slows_the_processor_is_told_with_what_to_do() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(governor_in(folder.path()), None);
        let file = folder.path().join("scaling_governor");
        for (name, verdict) in [("powersave\n", Verdict::Warning), ("performance\n", Verdict::Good)]
        {
            std::fs::write(&file, name).unwrap();
            let finding = governor_in(folder.path()).unwrap();
            assert_eq!(finding.verdict, verdict, "{finding:?}");
            assert_eq!(finding.remedy.is_some(), verdict == Verdict::Warning);
        }
    }

    #[test]
    fn a_thread_that_must_wake_at_once_is_never_punctual() {
        assert_eq!(timer(0.0).verdict, Verdict::Warning);
        assert_eq!(timer(1e6).verdict, Verdict::Good);
    }
}
