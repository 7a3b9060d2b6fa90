"""How near plain k-means over joint positions comes to held-out dance, frame by frame,
without any network: `python position_codes.py DATA HELD [LEVELS]`.

DATA gives the codes: training motion that is no choreography, and its motion turned over.
HELD gives the clips: captured originals of the splits validation and test, of at least 5 s.
LEVELS are those of trunk, left leg, right leg, left arm, right arm: `3,3,3,3,3`.
"""

import sys

import torch
import torch.nn.functional as F

from config import position_channels, presets
from data import Dataset
from geometry import local_joints
from vqvae import Codebook

ROWS, TURNED_ROWS, CODES = 60_000, 20_000, 256


def rows(data, clips, count):
    frames = torch.cat([data.motion[data.frames(c)] for c in clips] or [data.motion[:0]])
    return frames[torch.randperm(len(frames))[:count]]


def learned(data):
    """Frames to cluster: as they were danced, and turned over."""
    clips = [c for c in data.of_split(0).tolist() if not data.synthetic[c]]
    is_turned = lambda c: "tilted/" in str(data.clips[c])
    plain = rows(data, [c for c in clips if not is_turned(c)], ROWS)
    return torch.cat([plain, rows(data, [c for c in clips if is_turned(c)], TURNED_ROWS)])


def codebooks(x, levels):
    books = []
    for _ in range(levels):
        book = Codebook(CODES, x.shape[1])
        book.k_means(x)
        books.append(book)
        x = x - F.embedding(book.nearest(x), book.embed)
    return books


def captured(held, split):
    """Clips of captured dance as it was danced, of at least 5 s."""
    whole = lambda c: held.dance[c] and not held.synthetic[c] and held.variant[c] == 0
    return [c for c in held.of_split(split).tolist() if whole(c) and held.clip_length[c] >= 100]


def quantised(x, books):
    left = x
    for book in books:
        left = left - F.embedding(book.nearest(left), book.embed)
    return x - left


@torch.no_grad()
def main():
    torch.manual_seed(0)
    data, held = Dataset(sys.argv[1]), Dataset(sys.argv[2])
    parts = presets("live")["parts"]
    levels = [int(n) for n in sys.argv[3].split(",")] if len(sys.argv) > 3 else [3] * len(parts)
    motion = learned(data)
    # Positions and height alone: the root's turn and way have no part in this error.
    channels = {p: [c for c in position_channels(p) if c >= 3] for p in parts}
    books = {p: codebooks(motion[:, channels[p]], n) for p, n in zip(parts, levels)}
    for split, name in [(1, "validation"), (2, "test")]:
        errors = []
        for c in captured(held, split):
            real = held.motion[held.frames(c)]
            near = real.clone()
            for part, its in channels.items():
                near[:, its] = quantised(real[:, its], books[part])
            errors.append((local_joints(near) - local_joints(real)).norm(dim=-1).mean(-1))
        print(f"{name}: MPJPE {1e3 * float(torch.cat(errors).mean()):.1f} mm, {sum(levels)} codes a frame")


if __name__ == "__main__":
    main()
