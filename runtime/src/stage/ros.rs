//! A follower as a node of ROS 2: what its joints do and were told, and the
//! skeleton that it follows.
//!
//! | topic | type | what |
//! |---|---|---|
//! | `/STAGE/NAME/joint_states` | sensor_msgs/JointState | what the servos reported (effort: amperes) |
//! | `/STAGE/NAME/joint_commands` | sensor_msgs/JointState | what they were told |
//! | `/STAGE/NAME/skeleton` | geometry_msgs/PoseArray | 22 points, x forward, z up |
//!
//! Stamps are seconds since 1970: the time of day is read once, at the start,
//! and goes on by the monotonic clock.

use crate::viewer::snapshot::Snapshot;
use rand::Rng;
use servodance_stage::net::{LivelinessGuard, NetError, NetPublisher, NetSession};
use servodance_stage::ros2::{
    Attachment, Node, Topic, TopicType, joint_state, pose_array, ros_word,
};
use std::time::{Duration, Instant, SystemTime};

/// Frames of what is published.
const JOINT_FRAME: &str = "base_link";
const SKELETON_FRAME: &str = "stage";
/// Samples a second, as many as viewers get.
const EVERY: Duration = Duration::from_millis(33);

/// The node and its publishers.
pub struct Ros {
    joints: Vec<String>,
    states: Publisher,
    commands: Publisher,
    skeleton: Publisher,
    _node: LivelinessGuard,
    start: Instant,
    start_since_1970: Duration,
    next: Instant,
}

struct Publisher {
    voice: NetPublisher,
    _token: LivelinessGuard,
    id: [u8; 16],
    number: i64,
}

impl Ros {
    /// A node in this domain.
    pub fn start(
        net: &NetSession,
        domain: u32,
        stage: &str,
        name: &str,
        joints: Vec<String>,
    ) -> Result<Self, NetError> {
        let node = Node {
            domain,
            session: net.id(),
            namespace: format!("{}/{}", ros_word(stage), ros_word(name)),
            name: "servodance".to_owned(),
        };
        let token = net.declare_liveliness(&node.token())?;
        let publisher = |entity, name, message| -> Result<Publisher, NetError> {
            let topic = Topic { name, message };
            Ok(Publisher {
                voice: net.publisher(&node.key(&topic))?,
                _token: net.declare_liveliness(&node.publisher_token(entity, &topic))?,
                id: rand::rng().random(),
                number: 0,
            })
        };
        let since_1970 = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        Ok(Self {
            states: publisher(1, "joint_states", TopicType::JointState)?,
            commands: publisher(2, "joint_commands", TopicType::JointState)?,
            skeleton: publisher(3, "skeleton", TopicType::PoseArray)?,
            joints,
            _node: token,
            start: Instant::now(),
            start_since_1970: since_1970.unwrap_or_default(),
            next: Instant::now(),
        })
    }

    /// Whether it is time for a sample.
    pub fn is_due(&self) -> bool {
        Instant::now() >= self.next
    }

    /// Publishes what is seen of the robot now.
    pub fn publish(&mut self, seen: &Snapshot) -> Result<(), NetError> {
        self.next = Instant::now() + EVERY;
        let now = self.start_since_1970 + self.start.elapsed();
        let time_s = now.as_secs_f64();
        let names = || self.joints.iter().map(String::as_str);
        let joints = &seen.joints;
        let states = joint_state(time_s, JOINT_FRAME, names())
            .f64s(joints.iter().map(|j| j.position_rad))
            .f64s(joints.iter().map(|j| j.velocity_rad_s))
            .f64s(joints.iter().map(|j| j.current_a))
            .finish();
        let commands = joint_state(time_s, JOINT_FRAME, names())
            .f64s(joints.iter().map(|j| j.target_rad))
            .u32(0)
            .u32(0)
            .finish();
        self.states.say(now, states)?;
        self.commands.say(now, commands)?;
        if let Some(human) = seen.now.human {
            let points = human.iter().map(|point| point.map(f64::from));
            let skeleton = pose_array(time_s, SKELETON_FRAME, points);
            self.skeleton.say(now, skeleton)?;
        }
        Ok(())
    }
}

impl Publisher {
    fn say(&mut self, now: Duration, bytes: Vec<u8>) -> Result<(), NetError> {
        self.number += 1;
        let attachment =
            Attachment { number: self.number, time_ns: now.as_nanos() as i64, publisher: self.id };
        self.voice.put_with(bytes, &attachment.bytes())
    }
}
