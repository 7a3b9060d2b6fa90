"""How near trained codes come to held-out dance with further codes for what their decoder
misses: `python refined_codes.py WEIGHTS DATA HELD [LEVELS [STEPS]]`.

WEIGHTS are trained, with encoders. Their codes and their decoder stay. Each part has LEVELS more
codebooks (k-means over joint positions, true minus decoded), and a small causal network makes
the motion of the decoded one and these codes. DATA is learned from: captured motion as it was
danced, and turned over. HELD gives the clips: captured originals of the splits validation and
test, of at least 5 s.
"""

import copy
import math
import sys

import torch

import checkpoint
from config import position_channels
from data import Dataset
from geometry import local_joints
from losses import motion_terms
from position_codes import captured, codebooks, quantised
from vqvae import Decoder, VqVae

ROWS, CROP, BATCH, WARM_UP, REPORT = 80_000, 96, 24, 40, 100
SIZES = {"dim": 128, "heads": 4, "ff": 256, "decoder_layers": 2, "decoder_window": 32,
         "decoder_slopes": [0.5, 0.1, 0.02, 0.004], "skip": True, "head_dim": 32}
POSITION, VELOCITY, JERK, SLIDE = 8.0, 0.5, 6.0, 6.0


class Base:
    """Stage 1 as it was trained."""

    def __init__(self, path):
        found = checkpoint.load(path, "vq")
        self.config, self.mean, self.std = found["config"], found["mean"], found["std"]
        self.net = VqVae(self.config)
        self.net.load_state_dict(found["model"])
        self.net.eval()
        self.channels = {p: position_channels(p) for p in self.net.parts}

    @torch.no_grad()
    def decoded(self, motion):
        """Normalised: what is coded, and what becomes of it, [T, 137]."""
        x = (motion - self.mean) / self.std
        return x, self.net.decode(self.net.encode(x[None]))[0]

    def inputs(self, motion, books):
        """Decoded motion and the vectors of the further codes, [T, 137 + positions]."""
        x, near = self.decoded(motion)
        vectors = [near]
        for part, its in self.channels.items():
            vectors.append(quantised((x - near)[:, its], books[part]))
        return torch.cat(vectors, -1)


def learned(data):
    """Captured motion: as it was danced, and every second clip that was turned over."""
    ids = [c for c in data.of_split(0).tolist() if not data.synthetic[c]]
    name = lambda c: str(data.clips[c])
    plain = [c for c in ids if not any(word in name(c) for word in ("tilted/", "figures", "song"))]
    return plain, [c for c in ids if "tilted/" in name(c)][::2]


def refiner(base):
    """Begins with each position plus what its codes say."""
    config = copy.deepcopy(base.config)
    places = [c for its in base.channels.values() for c in its]
    config["parts"], config["code_dim"] = ["all"], 137 + len(places)
    config["vq"].update(SIZES)
    net = Decoder(config, 0.0)
    for parameter in [net.skip.weight, net.skip.bias, net.output.weight, net.output.bias]:
        torch.nn.init.zeros_(parameter)
    with torch.no_grad():
        net.skip.weight[:, :137] = torch.eye(137)
        net.skip.weight[places, range(137, 137 + len(places))] = 1.0
    return net


@torch.no_grad()
def report(step, net, base, held, books):
    jerk = lambda x: local_joints(x).diff(n=3, dim=0).norm(dim=-1).mean()
    for split, name in [(1, "validation"), (2, "test")]:
        frames = apart = jerks = 0.0
        for c in captured(held, split):
            real = held.motion[held.frames(c)]
            out = net(base.inputs(real, books)[None])[0] * base.std + base.mean
            apart += 1e3 * float((local_joints(out) - local_joints(real)).norm(dim=-1).mean()) * len(real)
            jerks += float(jerk(out) / jerk(real)) * len(real)
            frames += len(real)
        print(f"{step} {name}: MPJPE {apart / frames:.1f} mm, jerk {jerks / frames:.2f} x real", flush=True)


def main():
    torch.manual_seed(0)
    weights, data, held = sys.argv[1], Dataset(sys.argv[2]), Dataset(sys.argv[3])
    levels, steps = [int(n) for n in (sys.argv[4:6] + ["2", "600"][len(sys.argv[4:6]):])]
    base = Base(weights)
    plain, turned = learned(data)
    clips = [data.motion[data.frames(c)] for c in plain + turned]
    missed = []
    for motion in clips:
        x, near = base.decoded(motion)
        missed.append((x - near)[::3])
    missed = torch.cat(missed)
    missed = missed[torch.randperm(len(missed))[:ROWS]]
    books = {p: codebooks(missed[:, its], levels) for p, its in base.channels.items()}
    clips = [(base.inputs(motion, books), motion) for motion in clips if len(motion) >= CROP]
    net = refiner(base)
    print(f"{sum(p.numel() for p in net.parameters())} numbers, {len(base.net.parts) * (1 + levels)} codes a frame")
    report(0, net, base, held, books)
    optimizer = torch.optim.AdamW(net.parameters(), lr=1e-3, betas=(0.9, 0.98))
    weight = torch.tensor([float(len(motion)) for _, motion in clips])
    valid = torch.ones(BATCH, CROP, dtype=torch.bool)
    for step in range(steps):
        for group in optimizer.param_groups:
            fall = 0.5 * (1 + math.cos(math.pi * step / steps)) + 0.02
            group["lr"] = 1e-3 * min(1.0, (step + 1) / WARM_UP) * fall
        seen, real = [], []
        for i in torch.multinomial(weight, BATCH, True).tolist():
            start = int(torch.randint(len(clips[i][1]) - CROP + 1, (1,)))
            for batch, rows in zip((seen, real), clips[i]):
                batch.append(rows[start:start + CROP])
        terms = motion_terms(net(torch.stack(seen)), torch.stack(real), base.mean, base.std, valid, SLIDE)
        loss = (terms["huber"] + POSITION * terms["position"] + VELOCITY * terms["velocity"]
                + JERK * terms["jerk"])
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimizer.step()
        if (step + 1) % REPORT == 0:
            report(step + 1, net, base, held, books)


if __name__ == "__main__":
    main()
