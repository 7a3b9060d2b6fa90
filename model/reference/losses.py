"""The loss of stage 1; the same in Rust is `model/src/train/motion_loss.rs`."""

import torch
import torch.nn.functional as F

from geometry import FEET, displacement


def channel_weights():
    """Root channels are 4 of 137 but move the whole body."""
    w = torch.ones(137)
    w[0:3], w[3], w[67:133], w[133:137] = 6.0, 3.0, 0.5, 1.0
    return w / w.mean()


def motion_terms(out, real, mean, std, valid, slide):
    """Terms between normalised `out` and motion as it is, [B, T, 137]: Huber on
    every number, joint positions once more, displacement and its change, each a
    mean over `valid` frames in standard deviations."""
    motion, real_out = (real - mean) / std, out * std + mean
    both = valid[:, 1:] & valid[:, :-1]
    apart = F.smooth_l1_loss(out, motion, reduction="none")
    speed = std[67]  # metres a frame: the scale of every velocity
    moved, true = displacement(real_out) / speed, displacement(real) / speed
    # A foot that stands must not slide: its displacement counts most.
    stand = real[:, :-1, 133:137] * real[:, 1:, 133:137]
    w = torch.ones(*both.shape, 22)
    w[..., FEET] = 3.0 + slide * stand
    return {
        "huber": (apart * channel_weights())[valid].mean(),
        "position": apart[..., 3:67][valid].mean(),
        "velocity": (F.smooth_l1_loss(moved, true, reduction="none") * w[..., None])[both].mean(),
        "jerk": F.smooth_l1_loss(moved.diff(dim=1), true.diff(dim=1), reduction="none")[both[:, 1:]].mean(),
    }
