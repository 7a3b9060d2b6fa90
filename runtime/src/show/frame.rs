//! A snapshot as JSON for viewers, link poses and all: what docs/show.md calls
//! a frame. Made by the viewer thread.

use super::scene::Scene;
use super::snapshot::{Snapshot, state_name};
use serde::Serialize;
use servodance_retarget::nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use servodance_types::BeatLock;

/// A number with four decimals; `null` if it is none.
#[derive(Clone, Copy)]
struct Short(f64);

impl Serialize for Short {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0.is_finite() {
            true => serializer.serialize_f64((self.0 * 1e4).round() / 1e4),
            false => serializer.serialize_none(),
        }
    }
}

#[derive(Serialize)]
struct Frame<'a> {
    activity: &'static str,
    safety: &'static str,
    estop: bool,
    hold: bool,
    robot_s: Short,
    music_s: Short,
    links: Vec<[Short; 7]>,
    human: Option<Vec<[Short; 3]>>,
    targets_rad: Vec<Short>,
    positions_rad: Vec<Short>,
    velocities_rad_s: Vec<Short>,
    currents_a: Vec<Short>,
    temperatures_c: Vec<Short>,
    beat: Beat,
    bands: Vec<Short>,
    idle_share: Short,
    amplitude: Short,
    settings: Settings<'a>,
    bus: Bus,
    late_ms: Short,
    late_frames: u64,
    interventions: u64,
    violations: Option<u64>,
    events: Vec<Event<'a>>,
}

#[derive(Serialize)]
struct Beat {
    phase: Short,
    tempo_bpm: Short,
    confidence: Short,
    lock: &'static str,
    presence: Short,
}

#[derive(Serialize)]
struct Settings<'a> {
    amplitude: Short,
    mirror: bool,
    idle: crate::dance::IdleStyle,
    style: &'a str,
    seed: u64,
}

#[derive(Serialize)]
struct Bus {
    rate_hz: Short,
    cycles: u64,
    timeouts: u64,
    crc_errors: u64,
    retries: u64,
}

#[derive(Serialize)]
struct Event<'a> {
    time_s: Short,
    state: &'a str,
    cause: &'a str,
}

/// The frame of a snapshot.
pub fn frame(scene: &Scene, snapshot: &Snapshot, estop: bool) -> String {
    let now = &snapshot.now;
    let joint = |value: fn(&super::snapshot::JointNow) -> f64| {
        snapshot.joints.iter().map(|j| Short(value(j))).collect()
    };
    let settings = &now.settings;
    let frame = Frame {
        activity: now.activity.name(),
        safety: state_name(now.safety),
        estop,
        hold: now.hold,
        robot_s: Short(now.robot_s),
        music_s: Short(now.music_s),
        links: links(scene, snapshot),
        human: now.human.as_ref().map(|points| {
            let short = |p: &[f32; 3]| p.map(|v| Short(f64::from(v)));
            points.iter().map(short).collect()
        }),
        targets_rad: joint(|j| j.target_rad),
        positions_rad: joint(|j| j.position_rad),
        velocities_rad_s: joint(|j| j.velocity_rad_s),
        currents_a: joint(|j| j.current_a),
        temperatures_c: joint(|j| j.temperature_c),
        beat: Beat {
            phase: Short(now.music.phase),
            tempo_bpm: Short(now.music.tempo_bpm),
            confidence: Short(now.music.confidence),
            lock: match now.music.lock {
                BeatLock::Lost => "lost",
                BeatLock::Locked => "locked",
                BeatLock::Holding => "holding",
            },
            presence: Short(now.music.presence),
        },
        bands: now.music.bands.map(|b| Short(f64::from(b))).to_vec(),
        idle_share: Short(now.idle_share),
        amplitude: Short(now.amplitude),
        settings: Settings {
            amplitude: Short(settings.amplitude),
            mirror: settings.mirror,
            idle: settings.idle,
            style: scene.styles.get(settings.style).map_or("", String::as_str),
            seed: settings.seed,
        },
        bus: Bus {
            rate_hz: Short(now.rate_hz),
            cycles: now.bus.cycles,
            timeouts: now.bus.timeouts,
            crc_errors: now.bus.crc_errors,
            retries: now.bus.retries,
        },
        late_ms: Short(now.late_ms),
        late_frames: now.late_frames,
        interventions: now.interventions,
        violations: now.violations,
        events: snapshot
            .events()
            .iter()
            .map(|event| Event {
                time_s: Short(event.time_s),
                state: event.state,
                cause: &event.cause,
            })
            .collect(),
    };
    // Numbers and text only: nothing here can fail.
    serde_json::to_string(&frame).unwrap_or_default()
}

/// Pose of every link in the world: x, y, z, then the quaternion x, y, z, w.
fn links(scene: &Scene, snapshot: &Snapshot) -> Vec<[Short; 7]> {
    let positions: Vec<f64> = snapshot.joints.iter().map(|j| j.position_rad).collect();
    let [x, y, z, i, j, k, w] = snapshot.now.root;
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
    let world_from_root = Isometry3::from_parts(Translation3::new(x, y, z), turn);
    let poses = scene.model.link_poses(&positions);
    let pose = |root_from_link: &Isometry3<f64>| {
        let at = world_from_root * root_from_link;
        let ([x, y, z], turn) = (at.translation.vector.into(), at.rotation.coords);
        [x, y, z, turn.x, turn.y, turn.z, turn.w].map(Short)
    };
    poses.iter().map(pose).collect()
}
