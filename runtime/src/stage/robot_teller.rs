//! Tells the leader's page what this robot looks like and where its links are. Nothing is
//! sent while nobody leads with a page: no one subscribes then.

use crate::viewer::Scene;
use crate::viewer::snapshot::{Snapshot, state_name};
use crate::viewer::stage_link::{RobotLook, RobotNews, RobotPose};
use servodance_stage::net::{NetError, NetPublisher, NetSession, StageKeys};
use std::time::{Duration, Instant};

/// Poses a second.
const EVERY: Duration = Duration::from_millis(40);
/// How often the look is sent again, for leaders that come later.
const LOOK_EVERY: Duration = Duration::from_secs(2);

/// A follower's robot as others see it.
pub struct RobotTeller {
    scene: Scene,
    /// The robot's look, as it is sent.
    look: Vec<u8>,
    id: u64,
    voice: NetPublisher,
    next: Instant,
    next_look: Instant,
}

impl RobotTeller {
    /// Of a robot without its meshes.
    pub fn new(
        net: &NetSession,
        keys: &StageKeys,
        id: u64,
        scene: Scene,
    ) -> Result<Self, NetError> {
        let look = RobotNews::Look(RobotLook {
            robot: scene.robot.clone(),
            links: scene.model.link_names().len(),
            shapes: scene.shapes(),
        });
        Ok(Self {
            look: message(id, &look),
            scene,
            id,
            voice: net.publisher_for_people(&keys.robot(Some(id)))?,
            next: Instant::now(),
            next_look: Instant::now(),
        })
    }

    /// Whether it is time to tell.
    pub fn is_due(&self) -> bool {
        Instant::now() >= self.next
    }

    /// Tells what is seen of the robot now.
    pub fn tell(&mut self, seen: &Snapshot) -> Result<(), NetError> {
        let now = Instant::now();
        self.next = now + EVERY;
        if now >= self.next_look {
            self.next_look = now + LOOK_EVERY;
            self.voice.put(self.look.clone())?;
        }
        let status = &seen.now;
        let pose = RobotNews::Pose(RobotPose {
            links: self.scene.link_poses(seen).map(|pose| pose.map(|v| v as f32)).collect(),
            activity: status.activity.name().to_owned(),
            safety: state_name(status.safety).to_owned(),
            stopped: status.stopped.is_some(),
            late_ms: status.late_ms,
            late_frames: status.late_frames,
            violations: status.violations,
        });
        self.voice.put(message(self.id, &pose))
    }
}

/// The id, then JSON.
fn message(id: u64, news: &RobotNews) -> Vec<u8> {
    let mut bytes = id.to_le_bytes().to_vec();
    // Numbers and text only: nothing here can fail.
    bytes.extend(serde_json::to_vec(news).unwrap_or_default());
    bytes
}
