"""The dataset file and random crops of it.

`motion` [N, 137] and `music` [N, 39] hold all clips one after another;
`clip_start`, `clip_length`, `style`, `split` (0 train, 1 validation, 2 test),
`dance`, `has_music`, `synthetic` say where each clip is and what.
"""

import json
import math

import torch
from safetensors import safe_open

# Channels that share one scale: yaw step, root velocity, root height,
# positions, velocities, contacts.
GROUPS = [(0, 1), (1, 3), (3, 4), (4, 67), (67, 133), (133, 137)]


class Dataset:
    def __init__(self, path):
        with safe_open(path, "pt") as f:
            for key in f.keys():
                setattr(self, key, f.get_tensor(key))
            meta = f.metadata() or {}
        self.styles = json.loads(meta.get("styles", "[]"))
        self.recipe = meta.get("recipe", "")
        self.clips = json.loads(meta.get("clips", "[]"))
        self.music = getattr(self, "music", torch.zeros(len(self.motion), 0))

    def of_split(self, split):
        return torch.nonzero(self.split == split)[:, 0]

    def frames(self, clip):
        start = int(self.clip_start[clip])
        return slice(start, start + int(self.clip_length[clip]))

    def normalisation(self, grouped=True):
        """Mean and standard deviation of the training motion, the deviation
        averaged within each group as HumanML3D does."""
        keep = torch.cat([torch.arange(len(self.motion))[self.frames(c)] for c in self.of_split(0)])
        motion = self.motion[keep]
        mean, std = motion.mean(0), motion.std(0).clamp(min=1e-4)
        if grouped:
            for a, b in GROUPS:
                std[a:b] = std[a:b].mean()
        return mean, std

    def music_normalisation(self):
        """Mean and deviation of the spectral features; the four beat numbers
        stay as they are."""
        keep = torch.cat([torch.arange(len(self.music))[self.frames(c)]
                          for c in self.of_split(0) if self.has_music[c]])
        mean, std = self.music[keep].mean(0), self.music[keep].std(0).clamp(min=1e-3)
        mean[35:], std[35:] = 0.0, 1.0
        return mean, std


def beat_agreement(data, clip):
    """Share of the beats that are heard in a clip at which the body slows down
    (a local minimum of the mean joint speed within 0.1 s), and of such minima
    that are on a beat: their F1."""
    frames = data.frames(clip)
    speed = data.motion[frames, 67:133].unflatten(-1, (22, 3)).norm(dim=-1).mean(-1)
    speed = torch.cat([speed[:1], (speed[1:] + speed[:-1]) / 2])
    lowest = -torch.nn.functional.max_pool1d(-speed[None, None], 7, 1, 3)[0, 0]
    minima = torch.nonzero((speed == lowest)[1:-1])[:, 0] + 1.0
    sin, cos, _, confidence = data.music[frames, 35:].T
    phase = torch.atan2(sin, cos) / (2 * math.pi) % 1
    sure = torch.minimum(confidence[1:], confidence[:-1]) > 0.5
    at = torch.nonzero(sure & (phase[:-1] > 0.5) & (phase[1:] < 0.5))[:, 0]
    beats = at + (1 - phase[at]) / (1 - phase[at] + phase[at + 1])
    if len(beats) == 0 or len(minima) == 0:
        return 0.0
    near = (beats[:, None] - minima[None]).abs() <= 2
    recall, precision = near.any(1).float().mean(), near.any(0).float().mean()
    return float(2 * recall * precision / (recall + precision).clamp(min=1e-6))


class Crops:
    """Endless random crops: a clip by weight times length, then a start."""

    def __init__(self, data, clips, weights, length, seed=0):
        self.data, self.clips, self.length = data, clips, length
        self.weights = weights * data.clip_length[clips].float().clamp(max=4000)
        self.rng = torch.Generator().manual_seed(seed)

    def batch(self, size):
        """Frame indices [size, length], their validity, and the clips."""
        pick = self.clips[torch.multinomial(self.weights, size, True, generator=self.rng)]
        total = self.data.clip_length[pick]
        room = (total - self.length).clamp(min=0) + 1
        start = (torch.rand(size, generator=self.rng) * room).long()
        offset = start[:, None] + torch.arange(self.length)[None]
        valid = offset < total[:, None]
        offset = torch.minimum(offset, total[:, None] - 1)
        return self.data.clip_start[pick][:, None] + offset, valid, pick
