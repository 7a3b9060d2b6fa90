"""The same robot and motion through servodance and through mink, in one run.

    pip install mink mujoco "qpsolvers[daqp]" numpy
    python retarget/reference/mink_bench.py target/release/servodance op3 \
        configs/op3.toml dance.npz [--seconds 30]

mink (https://github.com/kevinzakka/mink, a public Python solver of weighted
tasks on a QP) gets the limbs' key points, scaled to the robot's segments, as
position tasks of elbows, hands, knees and ankles, with a posture task. Twice:

- `cycle`: one QP a control cycle with position and velocity limits, the
  nearest thing to what servodance does;
- `frame`: up to ten iterations a 20 Hz frame with position limits alone, joints
  interpolated by straight lines to the control rate: per-frame IK.

Prints one JSON object: microseconds a cycle (mean, p99), jerk RMS over all
joints, and limits broken by definition (differences of the output).
"""

import argparse
import json
import subprocess
import time
import tomllib
from pathlib import Path

import mink
import mujoco
import numpy as np

FRAME_HZ = 20.0
# Joint, from, of the common skeleton of 22.
LIMBS = {
    "left_elbow": (16, 18), "left_hand": (18, 20), "right_elbow": (17, 19), "right_hand": (19, 21),
    "left_knee": (1, 4), "left_ankle": (4, 7), "right_knee": (2, 5), "right_ankle": (5, 8),
}
PARENT = {
    "left_elbow": "left_shoulder", "left_hand": "left_elbow", "right_elbow": "right_shoulder",
    "right_hand": "right_elbow", "left_knee": "left_hip", "left_ankle": "left_knee",
    "right_knee": "right_hip", "right_ankle": "right_knee",
}


def directions(positions):
    """Unit vectors of the limbs in robot axes, the heading of the chest taken out."""
    robot = positions[..., [2, 0, 1]]
    left = robot[:, 16] - robot[:, 17]
    yaw = np.arctan2(-left[:, 0], left[:, 1])
    cos, sin = np.cos(-yaw), np.sin(-yaw)
    turn = np.zeros((len(yaw), 3, 3))
    turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1], turn[:, 2, 2] = cos, -sin, sin, cos, 1
    out = {}
    for name, (a, b) in LIMBS.items():
        v = np.einsum("tij,tj->ti", turn, robot[:, b] - robot[:, a])
        out[name] = v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-6)
    return out


class Robot:
    def __init__(self, toml_path):
        self.file = tomllib.loads(Path(toml_path).read_text())
        urdf = Path(toml_path).with_name(self.file["urdf"]).read_text()
        # mujoco merges links that do not move unless told otherwise.
        urdf = urdf.replace("<link ", '<mujoco><compiler fusestatic="false" discardvisual="true"/></mujoco><link ', 1)
        self.model = mujoco.MjModel.from_xml_string(urdf)
        self.hz = self.file["control_hz"]
        self.joints = {j["name"]: j for j in self.file["joint"]}
        self.links = self.file["retarget"].get("body", {})
        self.order = [self.model.joint(i).name for i in range(self.model.njnt)]

    def limit(self, key):
        return np.radians([self.joints[name][key] for name in self.order])


def problem(robot, configuration):
    tasks, lengths = {}, {}
    data = configuration.data
    for part, parent in PARENT.items():
        if part in robot.links and parent in robot.links:
            tasks[part] = mink.FrameTask(robot.links[part], "body", position_cost=1.0, orientation_cost=0.0,
                                         lm_damping=0.1)
            a, b = (data.body(robot.links[p]).xpos for p in (parent, part))
            lengths[part] = np.linalg.norm(b - a)
    posture = mink.PostureTask(robot.model, cost=1e-2)
    posture.set_target_from_configuration(configuration)
    return tasks, lengths, posture


def aim(robot, configuration, tasks, lengths, wanted, share, frame):
    at = {}
    nxt = min(frame + 1, len(next(iter(wanted.values()))) - 1)
    for part, task in tasks.items():
        parent = PARENT[part]
        start = at.get(parent, configuration.data.body(robot.links[parent]).xpos.copy())
        way = (1 - share) * wanted[part][frame] + share * wanted[part][nxt]
        at[part] = start + way * lengths[part]
        task.set_target(mink.SE3.from_translation(at[part]))


def run(robot, wanted, frames, per_frame):
    configuration = mink.Configuration(robot.model)
    configuration.update(np.clip(np.zeros(robot.model.nq), robot.limit("lower_deg"), robot.limit("upper_deg")))
    tasks, lengths, posture = problem(robot, configuration)
    for name, joint in robot.joints.items():
        robot.model.joint(name).range[:] = np.radians([joint["lower_deg"], joint["upper_deg"]])
    limits = [mink.ConfigurationLimit(robot.model)]
    if not per_frame:
        limits.append(mink.VelocityLimit(robot.model, {
            name: np.radians(joint["velocity_deg_s"]) for name, joint in robot.joints.items()}))
    steps = int(frames / FRAME_HZ * robot.hz)
    per = 1 if not per_frame else int(round(robot.hz / FRAME_HZ))
    track, times = [], []
    for step in range(0, steps, per):
        place = step / robot.hz * FRAME_HZ
        begin = time.perf_counter()
        aim(robot, configuration, tasks, lengths, wanted, place % 1.0, int(place))
        for _ in range(10 if per_frame else 1):
            velocity = mink.solve_ik(configuration, [*tasks.values(), posture], 1.0 / robot.hz, "daqp",
                                     damping=1e-3, limits=limits)
            configuration.integrate_inplace(velocity, 1.0 / robot.hz)
            if per_frame and np.abs(velocity).max() / robot.hz < 1e-3:
                break
        times.append((time.perf_counter() - begin) * 1e6)
        track.append(configuration.q.copy())
    track = np.array(track)
    if per_frame:
        fine = np.arange(steps) / per
        track = np.stack([np.interp(fine, np.arange(len(track)), q) for q in track.T], axis=1)
    return np.array(times), track


def figures(robot, times, track):
    rates = [track]
    for _ in range(3):
        rates.append(np.diff(rates[-1], axis=0) * robot.hz)
    rise = robot.file["retarget"].get("jerk_rise_s", 0.05)
    most = [robot.limit("velocity_deg_s"), robot.limit("acceleration_deg_s2"), robot.limit("acceleration_deg_s2") / rise]
    # The first second is the way from the zero pose.
    begin = int(robot.hz)
    return {
        "us_mean": round(float(times.mean()), 1), "us_p99": round(float(np.percentile(times, 99)), 1),
        "jerk_rms_rad_s3": round(float(np.sqrt((rates[3][begin:] ** 2).mean())), 1),
        "cycles_too_fast": int((np.abs(rates[1][begin:]) > most[0] * 1.001).any(axis=1).sum()),
        "cycles_too_hard": int((np.abs(rates[2][begin:]) > most[1] * 1.001).any(axis=1).sum()),
        "cycles_too_jerky": int((np.abs(rates[3][begin:]) > most[2] * 1.001).any(axis=1).sum()),
        "cycles": len(track),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("servodance")
    parser.add_argument("name")
    parser.add_argument("toml")
    parser.add_argument("motion")
    parser.add_argument("--seconds", type=float, default=30.0)
    args = parser.parse_args()
    ours = subprocess.run([args.servodance, "bench", "retarget", "--robot", args.name, "--motion", args.motion,
                           "--seconds", str(args.seconds), "--json"], capture_output=True, text=True, check=True)
    clip = np.load(args.motion)
    assert abs(float(clip["fps"]) - FRAME_HZ) < 1e-6, "the motion must have 20 frames a second"
    frames = min(len(clip["positions"]), int(args.seconds * FRAME_HZ))
    wanted = directions(clip["positions"][:frames].astype(float))
    robot = Robot(args.toml)
    out = {"servodance": json.loads(ours.stdout)}
    for name, per_frame in (("mink_cycle", False), ("mink_frame", True)):
        out[name] = figures(robot, *run(robot, wanted, frames, per_frame))
    print(json.dumps(out, indent=1))


if __name__ == "__main__":
    main()
