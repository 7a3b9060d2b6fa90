"""HumanML3D's 263 numbers a frame by another way (quaternions, numpy): golden
values for `humanml.rs`, and a check against the data set's public sample.

    python humanml.py > humanml.in
    python humanml.py new_joints/012314.npy new_joint_vecs/012314.npy
"""
import sys

import numpy as np

CHAINS = [[0, 2, 5, 8, 11], [0, 1, 4, 7, 10], [0, 3, 6, 9, 12, 15], [9, 14, 17, 19, 21], [9, 13, 16, 18, 20]]
REST = {1: (1, 0, 0), 13: (1, 0, 0), 2: (-1, 0, 0), 14: (-1, 0, 0), 10: (0, 0, 1), 11: (0, 0, 1), 15: (0, 0, 1),
        3: (0, 1, 0), 6: (0, 1, 0), 9: (0, 1, 0), 12: (0, 1, 0)}


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def times(a, b):
    w, v = a[..., :1], a[..., 1:]
    x, u = b[..., :1], b[..., 1:]
    return np.concatenate([w * x - (v * u).sum(-1, keepdims=True), w * u + x * v + np.cross(v, u)], -1)


def inverse(q):
    return q * [1, -1, -1, -1]


def rotate(q, v):
    pure = np.concatenate([np.zeros_like(v[..., :1]), v], -1)
    return times(times(q, pure), inverse(q))[..., 1:]


def arc(a, b):
    """The quaternion that takes direction a to direction b the shortest way."""
    a, b = unit(np.broadcast_to(a, b.shape)), unit(b)
    return unit(np.concatenate([1 + (a * b).sum(-1, keepdims=True), np.cross(a, b)], -1))


def smoothed(x, sigma=20, reach=80):
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    padded = np.pad(x, ((reach, reach), (0, 0)), mode="edge")
    return np.stack([np.convolve(padded[:, k], kernel / kernel.sum(), "valid") for k in range(x.shape[1])], -1)


def vectors(p):
    up = np.array([0.0, 1.0, 0.0])
    facing = np.cross(up, (p[0, 2] - p[0, 1]) + (p[0, 17] - p[0, 16]))
    p = rotate(arc(facing[None], np.array([[0.0, 0.0, 1.0]]))[:, None], p)
    forward = np.cross(up, unit((p[:, 1] - p[:, 2]) + (p[:, 17] - p[:, 16])))
    root = arc(smoothed(forward), np.broadcast_to([0.0, 0.0, 1.0], forward.shape))
    root[0] = [1, 0, 0, 0]
    yaw = np.arcsin(times(root[1:], inverse(root[:-1]))[:, 2:3])
    step = rotate(root[1:], p[1:, 0] - p[:-1, 0])
    local = rotate(root[:, None], p - p[:, :1] * [1, 0, 1])
    turns = np.zeros((len(p), 22, 6))
    for chain in CHAINS:
        before = root
        for a, b in zip(chain, chain[1:]):
            now = arc(np.array(REST.get(b, (0, -1, 0)), float), p[:, b] - p[:, a])
            q = times(inverse(before), now)
            turns[:, b] = np.concatenate([rotate(q, np.broadcast_to(e, (len(p), 3))) for e in np.eye(3)[:2]], -1)
            before = now
    moved = p[1:] - p[:-1]
    contact = ((moved ** 2).sum(-1) < 0.002)[:, [7, 10, 8, 11]]
    flat = lambda x: x.reshape(len(x), -1)
    return np.concatenate([yaw, step[:, [0, 2]], p[:-1, 0, 1:2], flat(local[:-1, 1:]), flat(turns[:-1, 1:]),
                           flat(rotate(root[:-1, None], moved)), contact], -1)


def circling():
    left, right = {1, 4, 7, 10, 13, 16, 18, 20}, {2, 5, 8, 11, 14, 17, 19, 21}
    j = np.arange(22)[None]
    t = np.arange(50)[:, None] / 20
    side = np.array([0.02 * (k + 10) * ((k in left) - float(k in right)) for k in range(22)])[None]
    x = side + 0.05 * np.sin(2 * t + j)
    y = 1 + 0.5 * np.sin(1.7 * j) + 0.05 * np.cos(3 * t + 2 * j)
    z = 0.1 * np.cos(4 * t + 0.5 * j) + 0.1 * np.sin(2.3 * j)
    a = 0.7 + 0.8 * t
    return np.stack([np.cos(a) * x + np.sin(a) * z + 0.3 * t, y,
                     np.cos(a) * z - np.sin(a) * x + 0.2 * np.sin(2 * t)], -1)


if __name__ == "__main__":
    if len(sys.argv) == 3:
        mine, theirs = vectors(np.load(sys.argv[1]).astype(float)), np.load(sys.argv[2])
        for name, a, b in [("root", 0, 4), ("positions", 4, 67), ("rotations", 67, 193),
                           ("steps", 193, 259), ("contacts", 259, 263)]:
            # The last joints of the sample were recovered from one vector fewer.
            gap = np.abs(mine[:, a:b] - theirs[:len(mine), a:b])
            print(f"{name}: largest difference {gap.max():.2e}, mean {gap.mean():.2e}")
    else:
        v = vectors(circling())
        for name, row in [("FIRST", v[0]), ("THIRTIETH", v[30])]:
            numbers = ", ".join(f"{x:.9}" if "e" in f"{x:.9}" or "." in f"{x:.9}" else f"{x:.1f}"
                                for x in np.concatenate([row[:10], row[67:79]]))
            print(f"const GOLDEN_{name}: [f64; 22] = [{numbers}];")
        k = np.arange(v.size)
        print(f"const GOLDEN_SUM: f64 = {(v.ravel() * (1 + np.sin(k))).sum():.6f};")
