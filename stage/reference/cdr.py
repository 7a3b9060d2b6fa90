"""Golden files for stage/tests/golden_cdr.rs, from independent writers.

    python3 -m venv venv && venv/bin/pip install rosbags mcap-ros2-support
    venv/bin/python stage/reference/cdr.py

Writes the messages with rosbags (its own CDR writer, its own definitions of the
types), reads them back with mcap-ros2-support (another CDR reader), and writes
the hashes that rosbags computes from the definitions (REP 2016).
"""

from pathlib import Path

import numpy as np
from mcap_ros2._dynamic import generate_dynamic
from rosbags.typesys import Stores, get_typestore

HERE = Path(__file__).parent
store = get_typestore(Stores.ROS2_JAZZY)
T = store.types
Time, Header = T["builtin_interfaces/msg/Time"], T["std_msgs/msg/Header"]


def header(time_s, frame):
    nanoseconds = round(time_s * 1e9)
    sec, nanosec = divmod(nanoseconds, 1_000_000_000)
    return Header(stamp=Time(sec=sec, nanosec=nanosec), frame_id=frame)


def floats(*values):
    return np.array(values, dtype=np.float64)


JointState = T["sensor_msgs/msg/JointState"]
Pose, Point = T["geometry_msgs/msg/Pose"], T["geometry_msgs/msg/Point"]
Quaternion = T["geometry_msgs/msg/Quaternion"]
PoseArray = T["geometry_msgs/msg/PoseArray"]

messages = {
    "joint_state": JointState(
        header=header(12.25, "base_link"),
        name=["head_pan", "l_sho_pitch", "r"],
        position=floats(0.5, -1.25, 3.0),
        velocity=floats(0.0, 2.0, -0.125),
        effort=floats(0.75, 0.0, -0.5),
    ),
    "joint_command": JointState(
        header=header(-0.5, ""),
        name=["head_pan"],
        position=floats(1.0),
        velocity=floats(),
        effort=floats(),
    ),
    "pose_array": PoseArray(
        header=header(3.5, "stage"),
        poses=[
            Pose(
                position=Point(x=float(i), y=0.5 * i, z=-float(i)),
                orientation=Quaternion(x=0.0, y=0.0, z=0.0, w=1.0),
            )
            for i in range(22)
        ],
    ),
}

for name, message in messages.items():
    kind = message.__msgtype__
    data = bytes(store.serialize_cdr(message, kind))
    (HERE / f"{name}.cdr").write_bytes(data)
    text, _ = store.generate_msgdef(kind, ros_version=2)
    read = generate_dynamic(kind.replace("/msg/", "/"), text)[kind.replace("/msg/", "/")](data)
    assert read.header.frame_id == message.header.frame_id
    assert read.header.stamp.sec == message.header.stamp.sec
    assert read.header.stamp.nanosec == message.header.stamp.nanosec
    if kind.endswith("JointState"):
        for field in ("name", "position", "velocity", "effort"):
            assert list(getattr(read, field)) == list(getattr(message, field)), field
    else:
        for a, b in zip(read.poses, message.poses, strict=True):
            for part in ("position", "orientation"):
                for axis in "xyz":
                    assert getattr(getattr(a, part), axis) == getattr(getattr(b, part), axis)
    print(f"{name}: {len(data)} bytes, read back")

lines = []
for kind in ("sensor_msgs/msg/JointState", "geometry_msgs/msg/PoseArray"):
    package, _, name = kind.split("/")
    lines.append(f"{package}::msg::dds_::{name}_ {store.hash_rihs01(kind)}")
(HERE / "hashes.txt").write_text("\n".join(lines) + "\n")
