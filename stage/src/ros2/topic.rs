//! Names: the key of a topic, the liveliness tokens of a node and its publishers,
//! the attachment of a sample.
//!
//! ```text
//! <domain>/<topic with namespace>/<type>/<hash of the type>
//! @ros2_lv/<domain>/<session>/<node>/<node>/NN/%/<namespace>/<name>
//! @ros2_lv/<domain>/<session>/<node>/<entity>/MP/%/<namespace>/<name>/<topic>/<type>/<hash>/<qos>
//! ```
//!
//! In liveliness tokens `%` stands for `/`, and alone for an enclave that is not set.

/// Reliable, volatile, the last ten kept, all else as ROS 2 has it by default.
const QOS: &str = "::,10:,:,:,,";

/// Message types that are published.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TopicType {
    /// The message type `sensor_msgs/msg/JointState`.
    JointState,
    /// The message type `geometry_msgs/msg/PoseArray`.
    PoseArray,
}

impl TopicType {
    /// The name of the type on the wire.
    pub const fn wire_name(self) -> &'static str {
        match self {
            TopicType::JointState => "sensor_msgs::msg::dds_::JointState_",
            TopicType::PoseArray => "geometry_msgs::msg::dds_::PoseArray_",
        }
    }

    /// The hash of its definition (REP 2016), as in ROS 2 Jazzy and Kilted.
    pub const fn hash(self) -> &'static str {
        match self {
            TopicType::JointState => {
                "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e"
            }
            TopicType::PoseArray => {
                "RIHS01_af0cc36d190e104d546d168d6b39df04fa4b4ccecf59cb4c9ed328d3d5004aa0"
            }
        }
    }
}

/// A ROS 2 node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Node {
    /// ROS domain of the node (`ROS_DOMAIN_ID`).
    pub domain: u32,
    /// Hexadecimal id of the Zenoh session.
    pub session: String,
    /// Namespace without slashes at its ends, such as `stage/op3`.
    pub namespace: String,
    /// Name of the node, a [`ros_word`].
    pub name: String,
}

impl Node {
    /// The liveliness token of the node.
    pub fn token(&self) -> String {
        self.begin(0, "NN")
    }

    /// The liveliness token of a publisher, the `entity`th of this node.
    pub fn publisher_token(&self, entity: u32, topic: &Topic) -> String {
        let begin = self.begin(entity, "MP");
        let name = format!("%{}", mangled(&self.qualified(topic)));
        let (wire_name, hash) = (topic.message.wire_name(), topic.message.hash());
        format!("{begin}/{name}/{wire_name}/{hash}/{QOS}")
    }

    /// The Zenoh key of a topic of this node.
    pub fn key(&self, topic: &Topic) -> String {
        let (wire_name, hash) = (topic.message.wire_name(), topic.message.hash());
        let name = self.qualified(topic);
        format!("{}/{name}/{wire_name}/{hash}", self.domain)
    }

    fn begin(&self, entity: u32, kind: &str) -> String {
        let (domain, session) = (self.domain, &self.session);
        let namespace = match self.namespace.as_str() {
            "" => "%".to_owned(),
            namespace => format!("%{}", mangled(namespace)),
        };
        let name = &self.name;
        format!("@ros2_lv/{domain}/{session}/0/{entity}/{kind}/%/{namespace}/{name}")
    }

    fn qualified(&self, topic: &Topic) -> String {
        match self.namespace.as_str() {
            "" => topic.name.to_owned(),
            namespace => format!("{namespace}/{}", topic.name),
        }
    }
}

/// A topic of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Topic {
    /// Name inside the node's namespace.
    pub name: &'static str,
    /// Type of the messages.
    pub message: TopicType,
}

/// The attachment of each sample: number, time, publisher.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Attachment {
    /// One more for each sample of a publisher, from 1.
    pub number: i64,
    /// Time of the sample, nanoseconds since 1970.
    pub time_ns: i64,
    /// Random identifier of the publisher.
    pub publisher: [u8; 16],
}

impl Attachment {
    /// The bytes: two little-endian numbers, the length of the id, the id.
    pub fn bytes(&self) -> [u8; 33] {
        let mut bytes = [0; 33];
        bytes[..8].copy_from_slice(&self.number.to_le_bytes());
        bytes[8..16].copy_from_slice(&self.time_ns.to_le_bytes());
        bytes[16] = 16;
        bytes[17..].copy_from_slice(&self.publisher);
        bytes
    }
}

fn mangled(name: &str) -> String {
    name.replace('/', "%")
}

/// A word as ROS 2 names allow it: letters, digits, underscores, no digit first.
pub fn ros_word(word: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let word: String = word.chars().map(plain).collect();
    match word.starts_with(|c: char| c.is_ascii_digit()) || word.is_empty() {
        true => format!("_{word}"),
        false => word,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node() -> Node {
        Node {
            domain: 2,
            session: "aac3178e146ba6f1fc6e6a4085e77f21".into(),
            namespace: "stage/op3".into(),
            name: "servodance".into(),
        }
    }

    #[test]
    fn names_are_those_of_the_middleware() {
        let topic = Topic { name: "joint_states", message: TopicType::JointState };
        let hash = TopicType::JointState.hash();
        assert_eq!(
            node().key(&topic),
            format!("2/stage/op3/joint_states/sensor_msgs::msg::dds_::JointState_/{hash}")
        );
        let base = "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0";
        assert_eq!(node().token(), format!("{base}/0/NN/%/%stage%op3/servodance"));
        assert_eq!(
            node().publisher_token(10, &topic),
            format!(
                "{base}/10/MP/%/%stage%op3/servodance/%stage%op3%joint_states/\
                 sensor_msgs::msg::dds_::JointState_/{hash}/::,10:,:,:,,"
            )
        );
        let bare = Node { namespace: String::new(), ..node() };
        assert_eq!(bare.token(), format!("{base}/0/NN/%/%/servodance"));
        assert!(bare.key(&topic).starts_with("2/joint_states/"));
    }

    #[test]
    fn an_attachment_is_numbers_then_length_then_id() {
        let bytes = Attachment { number: 3, time_ns: -2, publisher: [7; 16] }.bytes();
        assert_eq!(bytes[..8], 3i64.to_le_bytes());
        assert_eq!(bytes[8..16], (-2i64).to_le_bytes());
        assert_eq!(bytes[16..], [&[16], &[7; 16][..]].concat());
    }

    #[test]
    fn words_of_others_become_words_of_ros() {
        for (word, wanted) in [("op3", "op3"), ("my robot-2", "my_robot_2"), ("3d", "_3d")] {
            assert_eq!(ros_word(word), wanted);
        }
    }
}
