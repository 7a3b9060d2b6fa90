//! A snapshot as JSON for viewers, link poses and all: what docs/show.md calls
//! a frame. Made by the viewer thread.

use super::scene::Scene;
use super::snapshot::{JointStatus, MusicStatus, Snapshot, ViewerEvent, rounded, state_name};
use crate::control::idle::IdleStyle;
use serde::Serialize;
use servodance_types::HeldBack;

#[derive(Clone, Copy, Serialize)]
struct Rounded(#[serde(serialize_with = "rounded")] f64);

/// What a frame tells beside the snapshot.
#[derive(Debug)]
pub struct FrameSurroundings<'a> {
    /// Whether the emergency stop is pressed.
    pub estop: bool,
    /// How old the snapshot is, seconds.
    pub age_s: f64,
    /// The server's clock, seconds.
    pub clock_s: f64,
    /// Names of the presses of STOP that have stopped the robot.
    pub confirmed: Vec<&'a str>,
    /// Pages that are open.
    pub viewers: usize,
    /// The song that the page can play, another number for another song.
    pub song: Option<u32>,
    /// Names of the songs that wait.
    pub queue: Vec<String>,
}

#[derive(Serialize)]
struct FrameJson<'a> {
    activity: &'static str,
    safety: &'static str,
    age_s: Rounded,
    clock_s: Rounded,
    estop: bool,
    stopped: bool,
    confirmed: &'a [&'a str],
    viewers: usize,
    song: Option<u32>,
    queue: &'a [String],
    hold: bool,
    robot_s: Rounded,
    music_s: Rounded,
    links: Vec<[Rounded; 7]>,
    human: Option<Vec<[Rounded; 3]>>,
    targets_rad: Vec<Rounded>,
    positions_rad: Vec<Rounded>,
    velocities_rad_s: Vec<Rounded>,
    currents_a: Vec<Rounded>,
    temperatures_c: Vec<Rounded>,
    held_back: Vec<Option<&'static str>>,
    servo_errors: Vec<[u64; 3]>,
    beat: MusicStatus,
    bands: Vec<Rounded>,
    idle_share: Rounded,
    amplitude: Rounded,
    settings: SettingsJson<'a>,
    bus: BusJson,
    late_ms: Rounded,
    late_frames: u64,
    interventions: u64,
    violations: Option<u64>,
    events: &'a [ViewerEvent],
}

#[derive(Serialize)]
struct SettingsJson<'a> {
    amplitude: Rounded,
    mirror: bool,
    idle: IdleStyle,
    style: &'a str,
    seed: u64,
}

#[derive(Serialize)]
struct BusJson {
    rate_hz: Rounded,
    cycles: u64,
    timeouts: u64,
    crc_errors: u64,
    retries: u64,
    gap_p50_ms: Rounded,
    gap_p99_ms: Rounded,
    gap_max_ms: Rounded,
    delay_ms: Rounded,
}

pub fn frame(scene: &Scene, snapshot: &Snapshot, around: &FrameSurroundings) -> String {
    let now = &snapshot.now;
    let joint = |value: fn(&JointStatus) -> f64| {
        snapshot.joints.iter().map(|j| Rounded(value(j))).collect()
    };
    let settings = &now.settings;
    let frame = FrameJson {
        activity: now.activity.name(),
        safety: state_name(now.safety),
        age_s: Rounded(around.age_s),
        clock_s: Rounded(around.clock_s),
        estop: around.estop,
        stopped: now.stopped.is_some(),
        confirmed: &around.confirmed,
        viewers: around.viewers,
        song: around.song,
        queue: &around.queue,
        hold: now.hold,
        robot_s: Rounded(now.robot_s),
        music_s: Rounded(now.music_s),
        links: scene.link_poses(snapshot).map(|pose| pose.map(Rounded)).collect(),
        human: now.human.as_ref().map(|points| {
            let short = |p: &[f32; 3]| p.map(|v| Rounded(f64::from(v)));
            points.iter().map(short).collect()
        }),
        targets_rad: joint(|j| j.target_rad),
        positions_rad: joint(|j| j.position_rad),
        velocities_rad_s: joint(|j| j.velocity_rad_s),
        currents_a: joint(|j| j.current_a),
        temperatures_c: joint(|j| j.temperature_c),
        held_back: snapshot.joints.iter().map(|j| reason(j.held)).collect(),
        servo_errors: snapshot
            .joints
            .iter()
            .map(|j| [j.errors.timeouts, j.errors.crc_errors, j.errors.retries])
            .collect(),
        beat: now.music,
        bands: now.music.bands.map(|b| Rounded(f64::from(b))).to_vec(),
        idle_share: Rounded(now.idle_share),
        amplitude: Rounded(now.amplitude),
        settings: SettingsJson {
            amplitude: Rounded(settings.amplitude),
            mirror: settings.mirror,
            idle: settings.idle,
            style: scene.styles.get(settings.style).map_or("", String::as_str),
            seed: settings.seed,
        },
        bus: BusJson {
            rate_hz: Rounded(now.rate_hz),
            cycles: now.bus.cycles,
            timeouts: now.bus.timeouts,
            crc_errors: now.bus.crc_errors,
            retries: now.bus.retries,
            gap_p50_ms: Rounded(now.gaps.p50_ms),
            gap_p99_ms: Rounded(now.gaps.p99_ms),
            gap_max_ms: Rounded(now.gaps.max_ms),
            delay_ms: Rounded(now.bus.delay_us as f64 * 1e-3),
        },
        late_ms: Rounded(now.late_ms),
        late_frames: now.late_frames,
        interventions: now.interventions,
        violations: now.violations,
        events: snapshot.events(),
    };
    // Numbers and text only: nothing here can fail.
    serde_json::to_string(&frame).unwrap_or_default()
}

/// The word for what holds a joint back.
fn reason(held: HeldBack) -> Option<&'static str> {
    (held != HeldBack::Nothing).then_some(held.name())
}
