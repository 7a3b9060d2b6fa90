#!/usr/bin/env python3
"""A base on two wheels plays a dance in MuJoCo: does it turn as planned, and stay in its place?

    servodance retarget CLIP.npz --robot cart.toml --out cart.csv
    python sim/reference/turning_base.py cart.urdf cart.csv --left wheel_left_joint \\
        --right wheel_right_joint --radius 0.033 --apart 0.16

Needs `mujoco` from PyPI. The description is an expanded URDF; casters slide.
"""
import argparse
import csv
import xml.etree.ElementTree as ElementTree

import mujoco
import numpy as np

RATE_HZ = 100
STEP_S = 0.002
KP, KV = 20.0, 1.0  # a servo of the XL430 class at a wheel
SETTLES_S = 1.0
MOST_LATE = 30  # cycles


def model_of(urdf, wheels):
    root = ElementTree.parse(urdf).getroot()
    for link in root.iter("link"):
        for visual in list(link.findall("visual")):
            link.remove(visual)
    compiler = ElementTree.SubElement(ElementTree.SubElement(root, "mujoco"), "compiler")
    compiler.attrib = {"discardvisual": "true", "fusestatic": "false", "strippath": "true"}
    spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
    spec.worldbody.first_body().add_freejoint()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    spec.option.timestep = STEP_S
    for geom in spec.geoms:
        if "caster" in geom.parent.name:
            geom.friction = [0.02, 1e-4, 1e-4]
    for joint in spec.joints:
        if joint.name in wheels:
            joint.armature, joint.damping = 0.01, [0.1, 0, 0]
            servo = spec.add_actuator(name=joint.name, target=joint.name)
            servo.trntype = mujoco.mjtTrn.mjTRN_JOINT
            servo.biastype = mujoco.mjtBias.mjBIAS_AFFINE
            servo.gainprm[0], servo.biasprm[1], servo.biasprm[2] = KP, -KP, -KV
    return spec.compile()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("urdf")
    parser.add_argument("commands", help="CSV of `servodance retarget`")
    parser.add_argument("--left", required=True, help="joint of the left wheel")
    parser.add_argument("--right", required=True, help="joint of the right wheel")
    parser.add_argument("--radius", type=float, required=True, help="of the wheels, metres")
    parser.add_argument("--apart", type=float, required=True, help="wheel to wheel, metres")
    args = parser.parse_args()
    with open(args.commands) as file:
        head, *rows = csv.reader(file)
    rows = np.array(rows, float)
    left, right = (rows[:, head.index(joint)] for joint in (args.left, args.right))
    planned = (right - left) * args.radius / args.apart

    model = model_of(args.urdf, (args.left, args.right))
    data = mujoco.MjData(model)
    servos = [model.actuator(joint).id for joint in (args.left, args.right)]
    mujoco.mj_step(model, data, int(SETTLES_S / STEP_S))
    start = data.qpos[:2].copy()
    turned, away = [], []
    for command in zip(left, right):
        data.ctrl[servos] = command
        mujoco.mj_step(model, data, round(1 / RATE_HZ / STEP_S))
        w, x, y, z = data.qpos[3:7]
        turned.append(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
        away.append(np.linalg.norm(data.qpos[:2] - start))
    turned = np.unwrap(turned)
    off = [np.std(turned[late:] - planned[: len(planned) - late]) for late in range(MOST_LATE)]
    late = int(np.argmin(off))
    print(f"turns: planned {np.degrees(np.ptp(planned)):.1f} degrees, MuJoCo "
          f"{np.degrees(np.ptp(turned)):.1f}; {np.degrees(off[late]):.2f} degrees RMS apart, "
          f"{1000 * late // RATE_HZ} ms later; farthest from its place {1000 * max(away):.1f} mm "
          f"in {len(rows) / RATE_HZ:.0f} s")


if __name__ == "__main__":
    main()
