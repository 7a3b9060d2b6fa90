//! What is said to rosbridge and heard from it, as JSON (protocol 2.0).

use std::time::{SystemTime, UNIX_EPOCH};

use serde::Deserialize;
use serde_json::json;
use servodance_types::JointState;

use super::address::Ros2Address;

const JOINT_STATE: &str = "sensor_msgs/msg/JointState";
const BOOL: &str = "std_msgs/msg/Bool";

/// Names of the topics.
pub(super) struct Topics {
    pub commands: String,
    pub states: String,
    pub enabled: String,
}

impl Topics {
    pub fn of(address: &Ros2Address) -> Self {
        Self {
            commands: address.topic("joint_commands"),
            states: address.topic("joint_states"),
            enabled: address.topic("enabled"),
        }
    }

    /// What is said first: what will be published, and what is listened to.
    pub fn introduction(&self) -> [String; 3] {
        let advertise =
            |topic: &str, kind: &str| json!({"op": "advertise", "topic": topic, "type": kind});
        let subscribe = json!({
            "op": "subscribe", "topic": self.states, "type": JOINT_STATE, "queue_length": 1,
        });
        let advertised =
            [advertise(&self.commands, JOINT_STATE), advertise(&self.enabled, BOOL), subscribe];
        advertised.map(|message| message.to_string())
    }

    /// Targets, radians.
    pub fn command<'a>(
        &self,
        names: impl Iterator<Item = &'a str>,
        targets_rad: impl Iterator<Item = f64>,
    ) -> String {
        // Time since 1970, as ROS 2 expects stamps to be.
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        json!({
            "op": "publish",
            "topic": self.commands,
            "msg": {
                "header": {
                    "stamp": {"sec": now.as_secs(), "nanosec": now.subsec_nanos()},
                    "frame_id": "",
                },
                "name": names.collect::<Vec<_>>(),
                "position": targets_rad.collect::<Vec<_>>(),
                "velocity": [],
                "effort": [],
            },
        })
        .to_string()
    }

    pub fn enabled(&self, enabled: bool) -> String {
        json!({"op": "publish", "topic": self.enabled, "msg": {"data": enabled}}).to_string()
    }
}

#[derive(Deserialize)]
struct Published {
    op: String,
    topic: Option<String>,
    msg: Option<serde_json::Value>,
}

/// A JointState that came.
#[derive(Deserialize)]
pub(super) struct JointMessage {
    name: Vec<String>,
    position: Vec<f64>,
    #[serde(default)]
    velocity: Vec<f64>,
}

impl JointMessage {
    /// `None` for whatever else rosbridge says.
    pub fn read(text: &str, topic: &str) -> Option<Self> {
        let published: Published = serde_json::from_str(text).ok()?;
        if published.op != "publish" || published.topic.as_deref() != Some(topic) {
            return None;
        }
        serde_json::from_value(published.msg?).ok()
    }

    /// One joint's state; `None` where it is not named, or is no number.
    pub fn state(&self, joint: &str) -> Option<JointState> {
        let index = self.name.iter().position(|name| name == joint)?;
        let position_rad = self.position.get(index).copied().filter(|p| p.is_finite())?;
        let velocity_rad_s = self.velocity.get(index).copied().filter(|v| v.is_finite());
        Some(JointState {
            position_rad,
            velocity_rad_s: velocity_rad_s.unwrap_or(0.0),
            current_a: 0.0,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_are_found_by_name_whatever_else_is_said() {
        let topic = "/joint_states";
        let text = r#"{"op":"publish","topic":"/joint_states","msg":{"header":{"stamp":
            {"sec":1,"nanosec":2},"frame_id":""},"name":["b","a"],"position":[0.5,-0.25],
            "velocity":[1.0],"effort":[]}}"#;
        let message = JointMessage::read(text, topic).unwrap();
        assert_eq!(message.state("a").unwrap().position_rad, -0.25);
        assert_eq!(message.state("b").unwrap().velocity_rad_s, 1.0);
        assert!(message.state("c").is_none());
        for other in ["", "{}", "[1]", r#"{"op":"status","level":"error","msg":"no"}"#] {
            assert!(JointMessage::read(other, topic).is_none(), "{other}");
        }
        let null = text.replace("-0.25", "null");
        assert!(JointMessage::read(&null, topic).is_none());
    }

    #[test]
    fn commands_are_joint_states() {
        let topics = Topics::of(&Ros2Address::parse("host:1/g1").unwrap());
        let text = topics.command(["hip", "knee"].into_iter(), [0.1, -0.2].into_iter());
        let said: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(said["topic"], "/g1/joint_commands");
        assert_eq!(said["msg"]["name"], json!(["hip", "knee"]));
        assert_eq!(said["msg"]["position"], json!([0.1, -0.2]));
        assert!(said["msg"]["header"]["stamp"]["sec"].as_u64().unwrap() > 1_600_000_000);
    }
}
