//! The ROS 2 message types of a recording, as viewers expect them in MCAP:
//! the fields of each type, then those of the types it contains.

const SEPARATOR: &str =
    "\n================================================================================\nMSG: ";

const HEADER: (&str, &str) =
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n");
const TIME: (&str, &str) = ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n");

const POSE: (&str, &str) =
    ("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n");
const POINT: (&str, &str) = ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n");
const QUATERNION: (&str, &str) =
    ("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n");

const ARRAY_LAYOUT: (&str, &str) =
    ("std_msgs/MultiArrayLayout", "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset\n");
const ARRAY_DIMENSION: (&str, &str) =
    ("std_msgs/MultiArrayDimension", "string label\nuint32 size\nuint32 stride\n");

/// A message type: its ROS 2 name, its fields in the `ros2msg` encoding, and the
/// types that the fields contain.
#[derive(Debug)]
pub struct MessageType {
    pub name: &'static str,
    fields: &'static str,
    parts: &'static [(&'static str, &'static str)],
}

const fn message(
    name: &'static str,
    fields: &'static str,
    parts: &'static [(&'static str, &'static str)],
) -> MessageType {
    MessageType { name, fields, parts }
}

pub const FLOAT64: MessageType = message("std_msgs/msg/Float64", "float64 data\n", &[]);
pub const STRING: MessageType = message("std_msgs/msg/String", "string data\n", &[]);
pub const JOINT_STATE: MessageType = message(
    "sensor_msgs/msg/JointState",
    "std_msgs/Header header\nstring[] name\nfloat64[] position\n\
     float64[] velocity\nfloat64[] effort\n",
    &[HEADER, TIME],
);
pub const POSE_ARRAY: MessageType = message(
    "geometry_msgs/msg/PoseArray",
    "std_msgs/Header header\ngeometry_msgs/Pose[] poses\n",
    &[HEADER, TIME, POSE, POINT, QUATERNION],
);
pub const POSE_STAMPED: MessageType = message(
    "geometry_msgs/msg/PoseStamped",
    "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
    &[HEADER, TIME, POSE, POINT, QUATERNION],
);
pub const FLOAT_ARRAY: MessageType = message(
    "std_msgs/msg/Float32MultiArray",
    "std_msgs/MultiArrayLayout layout\nfloat32[] data\n",
    &[ARRAY_LAYOUT, ARRAY_DIMENSION],
);
pub const TEMPERATURE: MessageType = message(
    "sensor_msgs/msg/Temperature",
    "std_msgs/Header header\nfloat64 temperature\nfloat64 variance\n",
    &[HEADER, TIME],
);
pub const LOG: MessageType = message(
    "rcl_interfaces/msg/Log",
    "byte DEBUG=10\nbyte INFO=20\nbyte WARN=30\nbyte ERROR=40\nbyte FATAL=50\n\
     builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\n\
     string file\nstring function\nuint32 line\n",
    &[TIME],
);

pub const AUDIO: MessageType = message(
    "foxglove_msgs/msg/RawAudio",
    "builtin_interfaces/Time timestamp\nuint8[] data\nstring format\n\
     uint32 sample_rate\nuint32 number_of_channels\n",
    &[TIME],
);

const VECTOR: (&str, &str) = ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n");
const TRANSFORM: (&str, &str) = (
    "geometry_msgs/Transform",
    "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
);
const TRANSFORM_STAMPED: (&str, &str) = (
    "geometry_msgs/TransformStamped",
    "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
);
pub const TRANSFORMS: MessageType = message(
    "tf2_msgs/msg/TFMessage",
    "geometry_msgs/TransformStamped[] transforms\n",
    &[TRANSFORM_STAMPED, HEADER, TIME, TRANSFORM, VECTOR, QUATERNION],
);

const COLOR: (&str, &str) = ("std_msgs/ColorRGBA", "float32 r\nfloat32 g\nfloat32 b\nfloat32 a\n");
const DURATION: (&str, &str) = ("builtin_interfaces/Duration", "int32 sec\nuint32 nanosec\n");
const IMAGE: (&str, &str) =
    ("sensor_msgs/CompressedImage", "std_msgs/Header header\nstring format\nuint8[] data\n");
const TEXTURE_PLACE: (&str, &str) = ("visualization_msgs/UVCoordinate", "float32 u\nfloat32 v\n");
const MESH_FILE: (&str, &str) = ("visualization_msgs/MeshFile", "string filename\nuint8[] data\n");
pub const MARKER: MessageType = message(
    "visualization_msgs/msg/Marker",
    "std_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\n\
     geometry_msgs/Pose pose\ngeometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\n\
     builtin_interfaces/Duration lifetime\nbool frame_locked\ngeometry_msgs/Point[] points\n\
     std_msgs/ColorRGBA[] colors\nstring texture_resource\n\
     sensor_msgs/CompressedImage texture\nvisualization_msgs/UVCoordinate[] uv_coordinates\n\
     string text\nstring mesh_resource\nvisualization_msgs/MeshFile mesh_file\n\
     bool mesh_use_embedded_materials\n",
    &[
        HEADER,
        TIME,
        POSE,
        POINT,
        QUATERNION,
        VECTOR,
        COLOR,
        DURATION,
        IMAGE,
        TEXTURE_PLACE,
        MESH_FILE,
    ],
);

impl MessageType {
    /// The whole definition in the `ros2msg` encoding.
    pub fn definition(&self) -> String {
        let mut text = self.fields.to_owned();
        for (name, definition) in self.parts {
            text.push_str(SEPARATOR);
            text.push_str(name);
            text.push('\n');
            text.push_str(definition);
        }
        text
    }
}
