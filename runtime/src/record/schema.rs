//! The ROS 2 message types of a recording, as viewers expect them in MCAP:
//! the fields of each type, then those of the types it contains.

const SEPARATOR: &str =
    "\n================================================================================\nMSG: ";

const HEADER: (&str, &str) = (
    "std_msgs/Header",
    "builtin_interfaces/Time stamp\nstring frame_id\n",
);
const TIME: (&str, &str) = ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n");

const POSE: (&str, &str) = (
    "geometry_msgs/Pose",
    "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
);
const POINT: (&str, &str) = ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n");
const QUATERNION: (&str, &str) = (
    "geometry_msgs/Quaternion",
    "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
);

const ARRAY_LAYOUT: (&str, &str) = (
    "std_msgs/MultiArrayLayout",
    "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset\n",
);
const ARRAY_DIMENSION: (&str, &str) = (
    "std_msgs/MultiArrayDimension",
    "string label\nuint32 size\nuint32 stride\n",
);

/// A message type: its name and its definition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MessageType {
    /// `std_msgs/msg/Float64`: one number.
    Float64,
    /// `std_msgs/msg/String`: one text.
    Text,
    /// `sensor_msgs/msg/JointState`: name, position, velocity, effort.
    JointState,
    /// `geometry_msgs/msg/PoseArray`: positions and orientations.
    PoseArray,
    /// `geometry_msgs/msg/PoseStamped`: one of them.
    PoseStamped,
    /// `std_msgs/msg/Float32MultiArray`: numbers, and what they stand for.
    FloatArray,
    /// `sensor_msgs/msg/Temperature`: Celsius, of what its frame names.
    Temperature,
    /// `rcl_interfaces/msg/Log`: level, who, what.
    Log,
}

impl MessageType {
    /// The full ROS 2 name.
    pub const fn name(self) -> &'static str {
        match self {
            MessageType::Float64 => "std_msgs/msg/Float64",
            MessageType::Text => "std_msgs/msg/String",
            MessageType::JointState => "sensor_msgs/msg/JointState",
            MessageType::PoseArray => "geometry_msgs/msg/PoseArray",
            MessageType::PoseStamped => "geometry_msgs/msg/PoseStamped",
            MessageType::FloatArray => "std_msgs/msg/Float32MultiArray",
            MessageType::Temperature => "sensor_msgs/msg/Temperature",
            MessageType::Log => "rcl_interfaces/msg/Log",
        }
    }

    /// The definition in the `ros2msg` encoding.
    pub fn definition(self) -> String {
        match self {
            MessageType::Float64 => "float64 data\n".into(),
            MessageType::Text => "string data\n".into(),
            MessageType::JointState => join(
                "std_msgs/Header header\nstring[] name\nfloat64[] position\n\
                 float64[] velocity\nfloat64[] effort\n",
                &[HEADER, TIME],
            ),
            MessageType::PoseArray => join(
                "std_msgs/Header header\ngeometry_msgs/Pose[] poses\n",
                &[HEADER, TIME, POSE, POINT, QUATERNION],
            ),
            MessageType::PoseStamped => join(
                "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
                &[HEADER, TIME, POSE, POINT, QUATERNION],
            ),
            MessageType::FloatArray => join(
                "std_msgs/MultiArrayLayout layout\nfloat32[] data\n",
                &[ARRAY_LAYOUT, ARRAY_DIMENSION],
            ),
            MessageType::Temperature => join(
                "std_msgs/Header header\nfloat64 temperature\nfloat64 variance\n",
                &[HEADER, TIME],
            ),
            MessageType::Log => join(
                "byte DEBUG=10\nbyte INFO=20\nbyte WARN=30\nbyte ERROR=40\nbyte FATAL=50\n\
                 builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\n\
                 string file\nstring function\nuint32 line\n",
                &[TIME],
            ),
        }
    }
}

fn join(fields: &str, parts: &[(&str, &str)]) -> String {
    let mut text = fields.to_owned();
    for (name, definition) in parts {
        text.push_str(SEPARATOR);
        text.push_str(name);
        text.push('\n');
        text.push_str(definition);
    }
    text
}
