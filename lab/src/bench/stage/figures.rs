//! What came of a trial: one line of JSON, or a table to be read.

use serde::Serialize;
use std::fmt;

/// How near together the robots of a stage dance, and what faults cost.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs)] // the other names say it
pub struct StageBenchReport {
    pub version: &'static str,
    pub robot: String,
    pub followers: usize,
    pub namespaces: bool,
    pub delay_ms: f64,
    pub loss: f64,
    /// Whether what a loss does to TCP was modelled, not done by the kernel.
    pub loss_modelled: bool,
    /// Followers that ended by themselves and are not in what follows.
    pub followers_fallen: usize,
    /// Windows of a second in which all danced the same.
    pub windows: usize,
    /// Between the first and the last at the servos, milliseconds.
    pub spread_ms_p50: f64,
    /// The same in the worst hundredth of the windows, milliseconds.
    pub spread_ms_p99: f64,
    /// The same in the worst window, milliseconds.
    pub spread_ms_max: f64,
    /// Windows in which they did not all dance the same: somebody idled.
    pub windows_apart: usize,
    /// Share of the movement of one that the least alike other explains: median
    /// of these windows, and the first percentile.
    pub alike_p50: f64,
    /// The same share in the least alike hundredth of the windows.
    pub alike_p1: f64,
    /// From the start of a late program until it is on the beat, seconds; as the
    /// two that follow, when it stays so for two seconds.
    pub join_s: Option<f64>,
    /// From the end of a cut of 3 s until all are on one beat again, seconds.
    pub recovery_s: Option<f64>,
    /// From the death of the leader until the last follower idles, seconds.
    pub idle_s: Option<f64>,
    /// From the start of the next leader's program until all are on one beat;
    /// its music begins 4 s after it is ready.
    pub leader_recovery_s: Option<f64>,
    pub violations: u64,
    /// How long before their time frames were sent at last, milliseconds.
    pub lead_ms: f64,
    /// Longest way of a frame in the last half minute, milliseconds.
    pub way_ms: f64,
    pub lost_frames: u64,
    /// Control cycles without their frame, all followers.
    pub late_frames: u64,
    /// How late control cycles began, of the worst follower, milliseconds.
    pub cycle_late_ms_p99: f64,
    /// How late the worst cycle of all followers began, milliseconds.
    pub cycle_late_ms_max: f64,
    /// Processor time of a follower's program with its simulated servos, cores: mean.
    pub cpu_cores: f64,
    pub cpu_cores_max: f64,
}

impl fmt::Display for StageBenchReport {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let Self { robot, followers, delay_ms, windows, windows_apart, followers_fallen, .. } =
            self;
        let Self {
            spread_ms_p50, spread_ms_p99, spread_ms_max, alike_p50, lead_ms, way_ms, ..
        } = self;
        let Self { lost_frames, late_frames, cycle_late_ms_p99, cycle_late_ms_max, .. } = self;
        let seconds = |value: Option<f64>| value.map_or("never".into(), |s| format!("{s:.1} s"));
        let [joined, recovered] = [self.join_s, self.recovery_s].map(seconds);
        let [idle, next] = [self.idle_s, self.leader_recovery_s].map(seconds);
        let [lost, cpu, cpu_max] =
            [self.loss, self.cpu_cores, self.cpu_cores_max].map(|s| 100.0 * s);
        let modelled = if self.loss_modelled { " (modelled)" } else { "" };
        writeln!(out, "{followers} x {robot}, {delay_ms} ms each way, {lost} % lost{modelled}")?;
        writeln!(
            out,
            "spread at the servos   p50 {spread_ms_p50:.1} ms, p99 {spread_ms_p99:.1} ms, worst \
             {spread_ms_max:.1} ms of {windows} windows; {windows_apart} apart, alike {alike_p50:.3}"
        )?;
        if *followers_fallen > 0 {
            let what = "ended by themselves and are not counted";
            writeln!(out, "fallen                 {followers_fallen} {what}")?;
        }
        write!(
            out,
            "late joiner            {joined} until on the beat\n\
             links cut for 3 s      {recovered} until on one beat\n\
             leader killed          {idle} until all idle; the next one: {next} from its start\n\
             frames                 sent {lead_ms:.0} ms ahead, {way_ms:.0} ms on their way at most; \
             {lost_frames} lost, {late_frames} late\n\
             control cycles         p99 {cycle_late_ms_p99:.1} ms, worst {cycle_late_ms_max:.1} ms late\n\
             processor              {cpu:.1} % of a core a follower, {cpu_max:.1} % the hungriest\n"
        )?;
        writeln!(out, "limits broken          {}", self.violations)
    }
}
