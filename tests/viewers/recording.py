"""A recording as other programs read it: `python3 tests/viewers/recording.py PROGRAM`.

Needs the packages `mcap`, `mcap-ros2-support` and `rerun-sdk`. The reader of `mcap` decodes
every message by the schema in the file; the angle of each joint is computed from `/tf` and the
URDF alone and compared with `/joint_states`; every frame must hang on `world`. Then rerun
converts the file and must hold transforms that change.
"""

import math
import os
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

PROGRAM = os.path.abspath(sys.argv[1])


def check(fact, name):
    if not fact:
        raise SystemExit(f"FAILED: {name}")
    print(f"ok: {name}", flush=True)


def product(a, b):
    """Of quaternions x, y, z, w."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz)


def of_rpy(roll, pitch, yaw):
    turn = lambda axis, angle: tuple(math.sin(angle / 2) * part for part in axis) + (math.cos(angle / 2),)
    return product(turn((0, 0, 1), yaw), product(turn((0, 1, 0), pitch), turn((1, 0, 0), roll)))


def joints_of(urdf):
    """Parent, child, rotation at zero and axis of each joint that turns."""
    numbers = lambda text: [float(part) for part in text.split()]
    for joint in ElementTree.fromstring(urdf).findall("joint"):
        if joint.get("type") not in ("revolute", "continuous"):
            continue
        origin, axis = joint.find("origin"), joint.find("axis")
        rpy = numbers(origin.get("rpy", "0 0 0")) if origin is not None else [0, 0, 0]
        axis = numbers(axis.get("xyz")) if axis is not None else [1, 0, 0]
        long = math.hypot(*axis)
        ends = joint.find("parent").get("link"), joint.find("child").get("link")
        yield joint.get("name"), ends, of_rpy(*rpy), [part / long for part in axis]


def angle(rotation, at_zero, axis):
    """By how much a joint is turned, from its whole rotation."""
    x, y, z, w = product((-at_zero[0], -at_zero[1], -at_zero[2], at_zero[3]), rotation)
    along = x * axis[0] + y * axis[1] + z * axis[2]
    return math.remainder(2 * math.atan2(along, w), 2 * math.pi)


def read(path):
    topics = {}
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            topics.setdefault(channel.topic, []).append((message.log_time, decoded))
    return topics


def judge(path):
    topics = read(path)
    for topic in ("/tf", "/tf_static", "/robot_description", "/joint_states", "/human", "/beat_marker"):
        check(topics.get(topic), f"{topic}: {len(topics.get(topic, []))} messages")
    urdf = topics["/robot_description"][0][1].data
    states = {at: dict(zip(state.name, state.position)) for at, state in topics["/joint_states"]}
    turning = {ends: (name, at_zero, axis) for name, ends, at_zero, axis in joints_of(urdf)}
    worst, compared, moved = 0.0, 0, {}
    for at, message in topics["/tf"]:
        for transform in message.transforms:
            ends = (transform.header.frame_id, transform.child_frame_id)
            name, at_zero, axis = turning.get(ends, (None, None, None))
            if name not in states[at]:
                continue
            turn = transform.transform.rotation
            found = angle((turn.x, turn.y, turn.z, turn.w), at_zero, axis)
            worst = max(worst, abs(math.remainder(found - states[at][name], 2 * math.pi)))
            low, high = moved.get(name, (found, found))
            moved[name] = (min(low, found), max(high, found))
            compared += 1
    joints = len(next(iter(states.values())))
    check(compared >= joints * len(topics["/tf"]), f"{compared} joint angles of {joints} joints in /tf")
    check(worst < 1e-3, f"/tf is /joint_states: {worst:.2e} rad apart at most")
    moving = sum(high - low > 0.02 for low, high in moved.values())
    check(moving > joints / 2, f"{moving} of {joints} joints move")

    parents = {}
    for topic in ("/tf", "/tf_static"):
        for _, message in topics[topic]:
            for transform in message.transforms:
                parents[transform.child_frame_id] = transform.header.frame_id
    for frame in list(parents) + [m.header.frame_id for t in ("/human", "/motion", "/root") for _, m in topics[t][:1]]:
        steps = 0
        while frame in parents and steps < 100:
            frame, steps = parents[frame], steps + 1
        check(frame == "world", "a frame hangs on world") if frame != "world" else None
    links = {link.get("name") for link in ElementTree.fromstring(urdf).findall("link")}
    check(links <= set(parents), f"all {len(links)} links hang on world")
    limbs = topics["/human"][0][1].points
    check(len(limbs) == 42, "the human has 21 limbs")


def judge_in_rerun(path, folder):
    converted = os.path.join(folder, "out.rrd")
    run = lambda *words: subprocess.run([sys.executable, "-m", "rerun", *words], check=True,
                                        capture_output=True, text=True).stdout
    run("mcap", "convert", path, "-o", converted)
    told = run("rrd", "print", "-vv", converted)
    transforms = sum("Transform3D" in line for line in told.splitlines())
    check(transforms > 0, f"rerun holds transforms: {transforms} mentions")


def main():
    with tempfile.TemporaryDirectory(prefix="viewers-") as folder:
        path = os.path.join(folder, "out.mcap")
        subprocess.run([PROGRAM, "dance", "--record", path, "--no-picture", "--quiet"],
                       cwd=folder, check=True)
        print(f"{os.path.getsize(path) / 1e6:.1f} MB")
        judge(path)
        judge_in_rerun(path, folder)
    print("other programs read the recording")


if __name__ == "__main__":
    main()
