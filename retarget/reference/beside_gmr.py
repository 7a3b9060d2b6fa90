"""servodance, mink and GMR on the same clips and the same humanoid, in one run.

    pip install mink mujoco "qpsolvers[daqp]" numpy scipy rich
    python retarget/reference/beside_gmr.py target/release/servodance GMR clip.npz... [--seconds 20]

GMR is a checkout of https://github.com/YanjieZe/GMR, outside this repository. The robot is
`g1`; its joints are called as those of GMR's `unitree_g1`, so that all three are judged by
one model, that of configs/g1.urdf. mink solves frame by frame as in mink_bench.py. GMR
wants the bodies' orientations too: they are made from the 22 points, each bone along its
limb and about it as its hinge says. servodance dances twice: held, as the other two (whose robot floats or is fixed), and on its
feet, which stay where they are while the balance is kept.

Prints a table: median angle of arms (in the heading of the shoulders) and of legs (in that
of the hips) to the dancer's, degrees; root mean square jerk of the joints from frame to
frame (20 a second, no interpolation), rad/s^3; time a frame, milliseconds.
"""

import argparse
import csv
import json
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import mujoco
import numpy as np
from mink_bench import FRAME_HZ, LIMBS, PARENT, Robot, directions, run
from scipy.spatial.transform import Rotation

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
ARMS = [part for part in LIMBS if "elbow" in part or "hand" in part]
LEGS = [part for part in LIMBS if part not in ARMS]
# Joints of the common skeleton.
L_HIP, R_HIP, SPINE1, L_KNEE, R_KNEE, SPINE3, L_ANKLE, R_ANKLE = 1, 2, 3, 4, 5, 9, 7, 8
L_FOOT, R_FOOT, NECK, L_SHO, R_SHO, L_ELB, R_ELB, L_WRI, R_WRI = 10, 11, 12, 16, 17, 18, 19, 20, 21


def unit(v):
    return v / max(np.linalg.norm(v), 1e-9)


def frame_of(first, second, axes):
    """The rotation with `first` on its first axis exactly, `second` nearly on its second."""
    a = unit(first)
    b = unit(second - a * second.dot(a))
    columns = {axes[0]: a, axes[1]: b}
    (third,) = set("xyz") - set(axes)
    order = "xyz"
    one, two = order[(order.index(third) + 1) % 3], order[(order.index(third) + 2) % 3]
    columns[third] = np.cross(columns[one], columns[two])
    return Rotation.from_matrix(np.stack([columns[axis] for axis in order], axis=1))


def human_bodies(points):
    """GMR's bodies of one frame: position and orientation, x left, y up, z ahead at rest."""
    p = points[:, [2, 0, 1]]
    left = p[L_HIP] - p[R_HIP]
    across = p[L_SHO] - p[R_SHO]
    turns = {
        "pelvis": (0, frame_of(left, p[SPINE1] - p[0], "xy")),
        "spine3": (SPINE3, frame_of(across, p[NECK] - p[SPINE3], "xy")),
    }
    chest_ahead = turns["spine3"][1].apply([0, 0, 1])
    for side, hip, knee, ankle, foot in (("left", L_HIP, L_KNEE, L_ANKLE, L_FOOT),
                                         ("right", R_HIP, R_KNEE, R_ANKLE, R_FOOT)):
        turns[f"{side}_hip"] = (hip, frame_of(p[hip] - p[knee], left, "yx"))
        turns[f"{side}_knee"] = (knee, frame_of(p[knee] - p[ankle], left, "yx"))
        toe = p[foot] - p[ankle]
        turns[f"{side}_foot"] = (foot, frame_of(np.array([toe[0], toe[1], 0.0]), np.array([0, 0, 1.0]), "zy"))
    for side, sign, shoulder, elbow, wrist in (("left", 1, L_SHO, L_ELB, L_WRI),
                                               ("right", -1, R_SHO, R_ELB, R_WRI)):
        upper, lower = p[elbow] - p[shoulder], p[wrist] - p[elbow]
        bend = lower - unit(upper) * lower.dot(unit(upper))
        ahead = bend if np.linalg.norm(bend) > 0.15 * np.linalg.norm(lower) else chest_ahead
        turns[f"{side}_shoulder"] = (shoulder, frame_of(sign * upper, ahead, "xz"))
        hinge = turns[f"{side}_shoulder"][1].apply([0, 1, 0])
        turns[f"{side}_elbow"] = (elbow, frame_of(sign * lower, hinge, "xy"))
        turns[f"{side}_wrist"] = (wrist, turns[f"{side}_elbow"][1])
    return {name: [p[at], turn.as_quat(scalar_first=True)] for name, (at, turn) in turns.items()}


def by_gmr(folder, positions):
    sys.path.insert(0, str(folder))
    # Its package brings viewers and loaders along that need a screen, or smplx.
    import types
    package = types.ModuleType("general_motion_retargeting")
    package.__path__ = [str(Path(folder) / "general_motion_retargeting")]
    sys.modules.setdefault("general_motion_retargeting", package)
    from general_motion_retargeting.motion_retarget import GeneralMotionRetargeting

    height = float(np.median(positions[:, 15, 1] - positions[:, [10, 11], 1].min(axis=1))) + 0.2
    gmr = GeneralMotionRetargeting("smplx", "unitree_g1", actual_human_height=height)
    names = [gmr.model.joint(i).name for i in range(gmr.model.njnt)][1:]
    rows, turns, times = [], [], []
    for frame, points in enumerate(positions):
        begin = time.perf_counter()
        for _ in range(20 if frame == 0 else 1):  # the way from its zero pose
            qpos = gmr.retarget(human_bodies(points))
        if frame:
            times.append(time.perf_counter() - begin)
        rows.append(dict(zip(names, qpos[7:])))
        turns.append(Rotation.from_quat(qpos[3:7], scalar_first=True))
    return rows, turns, 1e3 * np.mean(times)


def by_servodance(program, clip, frames, stance):
    with tempfile.TemporaryDirectory() as place:
        robot, out = Path(place) / "g1.toml", Path(place) / "dance.csv"
        text = (CONFIGS / "g1.toml").read_text()
        if stance == "hung":  # its gains are for its balance
            text = re.sub(r"\n\[retarget\.gain\](\n[a-z_]+ = [\d.]+)*", "", text)
        robot.write_text(text.replace('stance = "planted"', f'stance = "{stance}"'))
        robot.with_suffix(".urdf").write_text((CONFIGS / "g1.urdf").read_text())
        subprocess.run([program, "retarget", clip, "--robot", robot, "--out", out, "--quiet"], check=True)
        with open(out) as file:
            rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
        rate = round((len(rows) - 1) / (rows[-1]["time_s"] * FRAME_HZ))
        bench = subprocess.run([program, "bench", "retarget", "--robot", robot, "--motion", clip, "--seconds",
                                str(frames / FRAME_HZ), "--json"], check=True, capture_output=True, text=True)
    return rows[::rate][:frames], json.loads(bench.stdout)["us_mean"] * rate * 1e-3


class Judge:
    """Directions of the robot's limbs by configs/g1.urdf."""

    def __init__(self, robot):
        self.robot, self.data = robot, mujoco.MjData(robot.model)

    def at(self, joints):
        for name, value in joints.items():
            if name in self.robot.joints:
                self.data.qpos[self.robot.model.joint(name).qposadr[0]] = value
        mujoco.mj_kinematics(self.robot.model, self.data)

    def place(self, part):
        return self.data.body(self.robot.links[part]).xpos.copy()

    def sole_turn(self):
        """The root's turn where the left sole is level."""
        return Rotation.from_matrix(self.data.body(self.robot.links["left_sole"]).xmat.reshape(3, 3)).inv()

    def limbs(self, root):
        across = {ARMS[0]: "shoulder", LEGS[0]: "hip"}
        found = {}
        for parts in (ARMS, LEGS):
            pair = across[parts[0]]
            left = root.apply(self.place(f"left_{pair}") - self.place(f"right_{pair}"))
            level = Rotation.from_euler("z", -np.arctan2(-left[0], left[1])) * root
            for part in parts:
                found[part] = unit(level.apply(self.place(part) - self.place(PARENT[part])))
        return found


def wanted_limbs(positions):
    """Of the dancer: arms in the heading of the shoulders, legs in that of the hips."""
    arms = directions(positions)
    swapped = positions.copy()
    swapped[:, [L_SHO, R_SHO]] = positions[:, [L_HIP, R_HIP]]
    legs = directions(swapped)
    return {part: (arms if part in ARMS else legs)[part] for part in LIMBS}


def figures(judge, wanted, rows, turns):
    errors = {part: [] for part in LIMBS}
    for frame, joints in enumerate(rows):
        judge.at(joints)
        root = judge.sole_turn() if turns is None else turns[frame]
        for part, direction in judge.limbs(root).items():
            cosine = np.clip(direction.dot(wanted[part][frame]), -1, 1)
            errors[part].append(np.degrees(np.arccos(cosine)))
    names = [name for name in rows[0] if name in judge.robot.joints]
    track = np.array([[joints[name] for name in names] for joints in rows])
    jerk = np.diff(track[int(FRAME_HZ):], n=3, axis=0) * FRAME_HZ**3
    median = lambda parts: float(np.median(np.concatenate([errors[part] for part in parts])))
    return median(ARMS), median(LEGS), float(np.sqrt((jerk**2).mean()))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("servodance")
    parser.add_argument("gmr")
    parser.add_argument("clips", nargs="+")
    parser.add_argument("--seconds", type=float, default=20.0)
    args = parser.parse_args()
    robot = Robot(CONFIGS / "g1.toml")
    judge = Judge(robot)
    print("| clip | by | arms | legs | jerk, rad/s^3 | ms a frame |\n|---|---|---|---|---|---|")
    all_rows = {}
    for clip in args.clips:
        loaded = np.load(clip)
        assert abs(float(loaded["fps"]) - FRAME_HZ) < 1e-6, f"{clip}: not 20 frames a second"
        positions = loaded["positions"][:int(args.seconds * FRAME_HZ)].astype(float)
        wanted = wanted_limbs(positions)
        hung, hung_ms = by_servodance(args.servodance, clip, len(positions), "hung")
        stands, stands_ms = by_servodance(args.servodance, clip, len(positions), "planted")
        begin = time.perf_counter()
        _, track = run(robot, directions(positions), len(positions), True)
        mink_ms = 1e3 * (time.perf_counter() - begin) / len(positions)
        step = int(round(robot.hz / FRAME_HZ))
        mink_rows = [dict(zip(robot.order, row)) for row in track[::step]]
        gmr_rows, gmr_turns, gmr_ms = by_gmr(args.gmr, positions)
        still = [Rotation.identity()] * len(mink_rows)
        for name, rows, turns, spent in (("servodance, held", hung, still, hung_ms),
                                         ("servodance, on its feet", stands, None, stands_ms),
                                         ("mink", mink_rows, still, mink_ms), ("GMR", gmr_rows, gmr_turns, gmr_ms)):
            rows = rows[:len(positions)]
            row = (*figures(judge, wanted, rows, turns), spent)
            all_rows.setdefault(name, []).append(row)
            print(f"| {Path(clip).stem} | {name} | {row[0]:.1f} | {row[1]:.1f} | {row[2]:.0f} | {row[3]:.2f} |", flush=True)
    for name, rows in all_rows.items():
        row = np.median(np.array(rows), axis=0)
        print(f"| median | {name} | {row[0]:.1f} | {row[1]:.1f} | {row[2]:.0f} | {row[3]:.2f} |")


if __name__ == "__main__":
    main()
