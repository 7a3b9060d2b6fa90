//! Sets the robots of a trial side by side.
//!
//! Robots are on one beat from the first window from which all windows of the
//! next two seconds are within [`ONE_BEAT_S`]. What comes after it counts in the
//! spread, however bad it is.

use super::figures::StageBenchReport;
use super::spread::{HOP_S, Together, Track, settled, windows};
use super::{StageTrial, TrialTimes};
use anyhow::Context;
use servodance_runtime::offline::motion_tracking::TrackedMotion;
use servodance_runtime::stage::FollowReport;
use std::path::Path;

/// Robots nearer together than this are on one beat, seconds.
const ONE_BEAT_S: f64 = 0.010;

/// What is told of a stretch of the trial, and all windows of it from when the
/// robots were on one beat.
struct Stretch {
    settled_s: Option<f64>,
    after: Vec<Together>,
}

impl Stretch {
    fn of(tracks: &[&Track], from_s: f64, to_s: f64) -> Self {
        let mut seen = windows(tracks, from_s, to_s);
        let place = settled(&seen, ONE_BEAT_S).filter(|_| tracks.len() > 1);
        Self {
            settled_s: place.map(|place| place as f64 * HOP_S),
            after: seen.split_off(place.unwrap_or(seen.len())),
        }
    }
}

pub fn judge(stage: &StageTrial, told: &TrialTimes) -> anyhow::Result<StageBenchReport> {
    let (mut reports, mut tracks) = (Vec::new(), Vec::new());
    for (place, member) in (1..).zip(&stage.members) {
        if !member.fell {
            reports.push(report(Path::new(&stage.file(&format!("{place}.json"))))?);
            tracks.push(Track::read(Path::new(&stage.file(&format!("{place}.txt"))))?);
        }
    }
    let all: Vec<&Track> = tracks.iter().collect();
    let joins = stage.members.last().is_some_and(|member| !member.fell);
    let ends = match (all.as_slice(), joins) {
        ([first, .., last], true) => vec![*first, *last],
        _ => Vec::new(),
    };
    let join = Stretch::of(&ends, told.joined_s, told.steady_s[0]);
    let recovery = Stretch::of(&all, told.whole_s, told.killed_s);
    let next = Stretch::of(&all, told.next_s, told.end_s);
    let steady = windows(&all, told.steady_s[0], told.steady_s[1]);
    let (mut spreads_ms, mut alike, mut apart) = (Vec::new(), Vec::new(), 0);
    for window in { steady.iter() }.chain(&recovery.after).chain(&next.after) {
        match window {
            Together::Within(spread_s, quality) => {
                spreads_ms.push(spread_s * 1e3);
                alike.push(*quality);
            }
            Together::Apart => apart += 1,
            Together::Unknown => {}
        }
    }
    spreads_ms.sort_by(f64::total_cmp);
    alike.sort_by(f64::total_cmp);
    let spread = |share: f64| TrackedMotion::quantile(&spreads_ms, share);
    let idle_s = { tracks.iter() }.map(|track| track.idles_s(told.killed_s, true));
    let idle_s = idle_s.collect::<Option<Vec<f64>>>();
    let greatest = |value: fn(&FollowReport) -> f64| reports.iter().map(value).fold(0.0, f64::max);
    let sum = |value: fn(&FollowReport) -> u64| -> u64 { reports.iter().map(value).sum() };
    let trial = stage.trial;
    Ok(StageBenchReport {
        version: env!("CARGO_PKG_VERSION"),
        robot: trial.robot.clone(),
        followers: trial.followers,
        namespaces: trial.namespaces,
        delay_ms: trial.delay_ms,
        loss: trial.loss,
        loss_modelled: trial.loss > 0.0 && stage.site.models_loss(),
        followers_fallen: stage.members.len() - reports.len(),
        windows: spreads_ms.len(),
        spread_ms_p50: spread(0.5),
        spread_ms_p99: spread(0.99),
        spread_ms_max: spread(1.0),
        windows_apart: apart,
        alike_p50: TrackedMotion::quantile(&alike, 0.5),
        alike_p1: TrackedMotion::quantile(&alike, 0.01),
        join_s: join.settled_s,
        recovery_s: recovery.settled_s,
        idle_s: idle_s.map(|all| all.into_iter().fold(0.0, f64::max) - told.killed_s),
        leader_recovery_s: next.settled_s,
        violations: sum(|r| {
            let broken = r.followed.violations.unwrap_or_default();
            broken.position + broken.velocity + broken.acceleration
        }),
        lead_ms: greatest(|r| r.lead_ms),
        way_ms: greatest(|r| r.way_ms),
        lost_frames: sum(|r| r.lost_frames),
        late_frames: sum(|r| r.followed.late_frames),
        cycle_late_ms_p99: greatest(|r| r.followed.late_ms_p99),
        cycle_late_ms_max: greatest(|r| r.followed.late_ms_max),
        cpu_cores: reports.iter().map(|r| r.cpu_cores).sum::<f64>() / reports.len() as f64,
        cpu_cores_max: greatest(|r| r.cpu_cores),
    })
}

fn report(path: &Path) -> anyhow::Result<FollowReport> {
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("a follower wrote no figures to {}", path.display()))?;
    Ok(serde_json::from_str(&text)?)
}
