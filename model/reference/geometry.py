"""From the 137-d vector to metres: world displacement and recovery of positions.

Channel 0 is the yaw step as a half angle; channels 1-2 are the root velocity
in the next frame's heading; positions are relative to the root on the floor
plane and keep their height.
"""

import torch

FEET = [7, 10, 8, 11]  # joints of the four contact channels


def rotate_y(angle, p):
    """Rotates points [..., J, 3] about +y by `angle` [...]."""
    c, s = angle.cos()[..., None], angle.sin()[..., None]
    x, y, z = p.unbind(-1)
    return torch.stack([c * x + s * z, y, c * z - s * x], -1)


def local_joints(motion):
    """The 22 joints [..., 22, 3] seen from the heading; y is height."""
    root = torch.zeros_like(motion[..., :3])
    root[..., 1] = motion[..., 3]
    joints = motion[..., 4:67].unflatten(-1, (21, 3))
    return torch.cat([root[..., None, :], joints], -2)


def displacement(motion):
    """How far every joint moves over the floor to the next frame, metres,
    [..., T-1, 22, 3] in the next frame's heading."""
    joints = local_joints(motion)
    step = torch.zeros_like(motion[..., :-1, :3])
    step[..., 0], step[..., 2] = motion[..., :-1, 1], motion[..., :-1, 2]
    before = rotate_y(2 * motion[..., :-1, 0], joints[..., :-1, :, :])
    return joints[..., 1:, :, :] + step[..., None, :] - before


def recover(motion):
    """World positions [T, 22, 3] of unnormalised motion [T, 137]."""
    half = torch.zeros_like(motion[:, 0])
    half[1:] = motion[:-1, 0].cumsum(0)
    step = torch.zeros(len(motion), 1, 3)
    step[1:, 0, 0], step[1:, 0, 2] = motion[:-1, 1], motion[:-1, 2]
    root = rotate_y(-2 * half, step).cumsum(0)
    return rotate_y(-2 * half, local_joints(motion)) + root
