#!/usr/bin/env python3
"""The simulated world against MuJoCo: the same robot, servos and commands.

    servodance bench world --robot op3 --songs 2 --dump DIR
    python3 sim/reference/mujoco_world.py DIR

Each trial in DIR is a JSON file: links, servos, world, commands at every control cycle,
and what our engine made of them. Prints, for each, falls in both, the difference of the
pelvis's tilt and of the feet's force; then the sums. Needs PyPI mujoco and numpy.
"""
import json, math, pathlib, sys
import mujoco
import numpy as np

FALLEN = math.radians(50.0)


def quaternion(rows):
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.array(rows, dtype=float).flatten())
    return quat


def text(values):
    return " ".join(f"{float(value):.12g}" for value in values)


def is_own(links, index):
    """Whether a link's joint is the servo's: others follow it."""
    def plain(link):
        drive = link["drive"]
        return drive is not None and drive["scale"] == 1.0 and drive["offset"] == 0.0

    alike = [i for i, link in enumerate(links)
             if plain(link) and link["drive"]["joint"] == links[index]["drive"]["joint"]]
    return alike[:1] == [index]


def body_xml(links, children, servos, index, depth):
    link = links[index]
    pad = "  " * depth
    out = []
    origin = link["origin"]
    if link["parent"] is None:
        out.append(f'{pad}<body name="{link["name"]}_0"><freejoint/>')
    else:
        out.append(
            f'{pad}<body name="{link["name"]}_{index}" pos="{text(origin["at_m"])}" quat="{text(quaternion(origin["rotation"]))}">'
        )
    motion, drive = link["motion"], link["drive"]
    if isinstance(motion, dict) and drive is not None and link["parent"] is not None:
        (kind, axis), = motion.items()
        servo = servos[drive["joint"]]
        own = is_own(links, index)
        name = f'j{drive["joint"]}' if own else f'm{index}'
        kind = {"Revolute": "hinge", "Prismatic": "slide"}[kind]
        out.append(
            f'{pad}  <joint name="{name}" type="{kind}" axis="{text(axis)}" '
            f'armature="{servo["armature_kg_m2"] if own else 0}" damping="{servo["damping_nm_s"] if own else 0}" '
            f'frictionloss="{servo["friction_nm"] if own else 0}"/>'
        )
        if own and servo["play_rad"] > 0:
            # The shaft behind the gear: free inside the play, stopped at its ends.
            half = servo["play_rad"] / 2
            out.append(
                f'{pad}  <joint name="p{drive["joint"]}" type="{kind}" axis="{text(axis)}" limited="true" '
                f'range="{-half} {half}" solreflimit="0.004 1" armature="1e-5"/>'
            )
    if link["mass_kg"] > 0:
        inertia = np.array(link["inertia_kg_m2"])
        full = [inertia[0, 0], inertia[1, 1], inertia[2, 2], inertia[0, 1], inertia[0, 2], inertia[1, 2]]
        out.append(f'{pad}  <inertial pos="{text(link["com_m"])}" mass="{link["mass_kg"]}" fullinertia="{text(full)}"/>')
    for point in link["touch"]:
        radius = max(point["radius_m"], 1e-4)
        group = "" if point["foot"] is None else f' name="foot{point["foot"]}_{text(point["at_m"])}"'
        out.append(f'{pad}  <geom{group} type="sphere" size="{radius}" pos="{text(point["at_m"])}" mass="0"/>')
    for child in children[index]:
        out.extend(body_xml(links, children, servos, child, depth + 1))
    out.append(f"{pad}</body>")
    return out


def model_of(trial):
    links, servos, world = trial["links"], trial["servos"], trial["world"]
    children = {index: [] for index in range(len(links))}
    for index, link in enumerate(links):
        if link["parent"] is not None:
            children[link["parent"]].append(index)
    lean_x, lean_y = world["tilt_rad"]
    normal = np.array([math.sin(lean_y), -math.sin(lean_x), 1.0])
    normal /= np.linalg.norm(normal)
    axis = np.cross([0, 0, 1], normal)
    sine = np.linalg.norm(axis)
    quat = [1, 0, 0, 0]
    if sine > 1e-12:
        half = math.asin(sine) / 2
        quat = [math.cos(half), *(axis / sine * math.sin(half))]
    xml = [
        "<mujoco>",
        f'<compiler angle="radian" inertiafromgeom="false" balanceinertia="true" boundmass="1e-9" boundinertia="1e-12"/>',
        f'<option timestep="{world["dt_s"]}" gravity="0 0 -9.81" cone="elliptic"/>',
        f'<default><geom contype="1" conaffinity="0" condim="3" friction="{world["friction"]} 0.005 0.0001"/></default>',
        "<worldbody>",
        f'<geom name="floor" type="plane" size="0 0 1" contype="0" conaffinity="1" quat="{text(quat)}"/>',
        *body_xml(links, children, servos, 0, 1),
        "</worldbody>",
        "<equality>",
    ]
    for index, link in enumerate(links):
        drive = link["drive"]
        if drive is None or isinstance(link["motion"], str):
            continue
        if not is_own(links, index):
            xml.append(f'<joint joint1="m{index}" joint2="j{drive["joint"]}" polycoef="{drive["offset"]} {drive["scale"]} 0 0 0"/>')
    xml += ["</equality>", "</mujoco>"]
    return mujoco.MjModel.from_xml_string("\n".join(xml))


def play(trial):
    model = model_of(trial)
    data = mujoco.MjData(model)
    servos, world = trial["servos"], trial["world"]
    joints = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, f"j{index}") for index in range(len(servos))]
    where = np.array([model.jnt_qposadr[joint] for joint in joints])
    dofs = np.array([model.jnt_dofadr[joint] for joint in joints])
    # Encoders sit on the shafts, behind the play.
    plays = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, f"p{index}") for index in range(len(servos))]
    behind = np.array([model.jnt_qposadr[play] if play >= 0 else 0 for play in plays])
    has_play = np.array([float(play >= 0) for play in plays])
    kp = np.array([servo["kp"] for servo in servos])
    limit = np.array([servo["limit_nm"] for servo in servos])
    feet = [[], []]
    for geom in range(model.ngeom):
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, geom) or ""
        if name.startswith("foot"):
            feet[int(name[4])].append(geom)
    side = {geom: foot for foot in (0, 1) for geom in feet[foot]}
    data.qpos[:3] = trial["start"]["at_m"]
    data.qpos[3:7] = quaternion(trial["start"]["rotation"])
    data.qpos[where] = trial["cycles"][0]["commands"]
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    height = data.subtree_com[1][2]
    force = np.zeros(6)
    tilt, loads, fell = [], [], None
    push_at, push = trial["push_at"], np.array(trial["push_ns"])
    for number, cycle in enumerate(trial["cycles"]):
        goal = np.array(cycle["commands"])
        sums = np.zeros(2)
        for _ in range(trial["steps"]):
            data.qfrc_applied[dofs] = np.clip(kp * (goal - data.qpos[where] - has_play * data.qpos[behind]), -limit, limit)
            since = (number - push_at) * trial["period_s"]
            data.xfrc_applied[1, :2] = push / 0.05 if 0 <= since < 0.05 - 1e-9 else 0.0
            # A push acts on the link's origin, MuJoCo's on its centre of mass.
            arm = data.xpos[1] - data.xipos[1]
            data.xfrc_applied[1, 3:] = np.cross(arm, data.xfrc_applied[1, :3])
            mujoco.mj_step(model, data)
            for contact in range(data.ncon):
                pair = data.contact[contact].geom
                foot = side.get(pair[0], side.get(pair[1]))
                if foot is not None:
                    mujoco.mj_contactForce(model, data, contact, force)
                    sums[foot] += force[0]
        up = data.xmat[1].reshape(3, 3)[2]
        tilt.append([math.atan2(up[0], up[2]), math.atan2(up[1], up[2])])
        loads.append(sums / trial["steps"])
        if math.acos(max(-1.0, min(1.0, up[2]))) > FALLEN or data.subtree_com[1][2] < 0.5 * height:
            fell = number * trial["period_s"]
            break
    return np.array(tilt), np.array(loads), fell


def main():
    agree, rows = 0, []
    for path in sorted(pathlib.Path(sys.argv[1]).glob("*.json")):
        trial = json.loads(path.read_text())
        tilt, loads, fell = play(trial)
        # Bodies that fall are compared until the first of them lies.
        falls = [time for time in (fell, trial["fell_s"]) if time is not None]
        count = min([len(tilt), len(trial["cycles"])] + [round(time / trial["period_s"]) for time in falls])
        window = max(1, min(count, int(20.0 / trial["period_s"])))
        ours = np.array([cycle["tilt"] for cycle in trial["cycles"]])[:window]
        our_loads = np.array([cycle["load_n"] for cycle in trial["cycles"]])[:window]
        rms = np.degrees(np.sqrt(np.mean((ours - tilt[:window]) ** 2, axis=0)))
        width = max(1, round(0.05 / trial["period_s"]))
        smooth = lambda load: np.array([np.convolve(load[:, foot], np.ones(width) / width, "valid") for foot in (0, 1)])
        weight = np.mean(np.sum(our_loads, axis=1))
        off = np.sqrt(np.mean((smooth(our_loads) - smooth(loads[:window])) ** 2)) / weight
        same = (fell is None) == (trial["fell_s"] is None)
        agree += same
        rows.append((same, *rms, off))
        print(f"{path.stem}: ours fell {trial['fell_s']}, MuJoCo {fell}; tilt off by {rms[0]:.2f}, {rms[1]:.2f} deg RMS; feet's force by {100 * off:.1f} % of the weight", flush=True)
    table = np.array([row[1:] for row in rows])
    both = [index for index, row in enumerate(rows) if row[0]]
    print(f"same verdict in {agree} of {len(rows)}; median (worst) tilt {np.median(table[both, :2]):.2f} ({table[both, :2].max():.2f}) deg, force {100 * np.median(table[both, 2]):.1f} ({100 * table[both, 2].max():.1f}) %")


main()
