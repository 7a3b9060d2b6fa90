"""Trains the network that hears beats, downbeats and music.

    cargo build --release -p servodance-audio --example beat_corpus
    beat_corpus FOLDER 250 0 FONTS TALKERS      # as often as wanted, other seeds
    python audio/reference/train_beats.py OUT.f32 MINUTES FOLDER... [--from START.f32]

The network (audio/src/beats/network.rs) runs 80 times a second: a dense layer
over the values of audio/src/beats/network_input.rs, ten residual blocks of
causal convolutions, dilated by 1 to 512 steps (25 s), then three logits: beat,
downbeat, music. OUT.f32 holds its weights in the order of `parts`, little endian.
A beat is marked DELAY_S after it is audible, when most of its onset was heard.
Nothing but rendered sound is used. New folders may appear while it trains: a `*`
in FOLDER is looked up again before every round. Needs torch and numpy.
"""

import copy
import glob
import json
import os
import sys
import time

import numpy as np
import torch
from torch import nn

STEP_HZ, RATE = 80, 20480
RESAMPLER_S = 16 / RATE
DELAY_S = 0.050
INPUTS, UNITS, BLOCKS, TAPS, OUTPUTS = 128, 48, 10, 3, 3
RISES, LEVELS = 64, 16
BATCH, BATCH_STEPS, VALIDATION = 6, 2000, 40
SPEED = 0.18  # most by which music is faster or slower, as a logarithm
AVERAGED = 0.998  # share of the older weights in the running mean that is kept
SCORED_EVERY = 200  # batches, at least


def targets(piece, start, speed, steps):
    """Beat, downbeat, music for each step of a crop that begins at step `start` and is played at `speed`."""
    out = np.zeros((3, steps), np.float32)
    for row, times in ((0, piece["beats_s"]), (1, piece["downbeats_s"])):
        for at in (((np.asarray(times) + DELAY_S + RESAMPLER_S) * STEP_HZ - 1) - start) / speed:
            for step in range(max(0, int(at) - 2), min(steps, int(at) + 4)):
                out[row, step] = max(out[row, step], np.exp(-0.5 * ((step - at) / 0.8) ** 2))
    for begin, end in piece["music_s"]:
        first, last = ((s * STEP_HZ - start) / speed for s in (begin, end))
        out[2, max(0, int(first)): max(0, int(last))] = 1.0
    return out


def at_speed(values, start, speed, steps):
    """So many steps from `start` on, at another speed: the same music at another tempo."""
    if speed == 1.0:
        return values[start: start + steps].astype(np.float32)
    at = start + speed * np.arange(steps)
    at = at[at < len(values) - 1]
    whole = at.astype(int)
    part = (at - whole)[:, None].astype(np.float32)
    return (1 - part) * values[whole].astype(np.float32) + part * values[whole + 1].astype(np.float32)


def moved(values, bands, notes):
    """Higher or lower by so many bands and semitones."""
    out = np.zeros_like(values)
    half = RISES // 2
    for first, last, by in ((0, half, bands), (half, RISES, bands), (RISES, RISES + LEVELS, bands // 2),
                            (RISES + LEVELS, INPUTS, notes)):
        low, high = max(first, first + by), min(last, last + by)
        out[:, low:high] = values[:, low - by: high - by]
    return out


class Corpus:
    def __init__(self, patterns):
        self.patterns, self.seen, self.pieces = patterns, {}, []

    def look(self):
        """Takes in what has been rendered since."""
        for folder in sorted({f for p in self.patterns for f in glob.glob(p)}):
            lines = open(f"{folder}/pieces.jsonl").read().split("\n")[:-1]
            begun, at = self.seen.get(folder, (0, 0))
            if not os.path.getsize(f"{folder}/inputs.f32"):
                continue
            new = [json.loads(line) for line in lines[begun:]]
            file = np.memmap(f"{folder}/inputs.f32", np.float32, "r")
            values = file[: len(file) // INPUTS * INPUTS].reshape(-1, INPUTS)
            for piece in new:
                steps = piece["steps"]
                if at + steps > len(values):
                    break
                self.pieces.append((values[at: at + steps].astype(np.float16), piece))
                begun, at = begun + 1, at + steps
            self.seen[folder] = (begun, at)

    def batch(self, rows, rng, steps, vary=True):
        """Crops of pieces; most of them at another speed and pitch if they may `vary`."""
        x, y = np.zeros((len(rows), steps, INPUTS), np.float32), np.zeros((len(rows), 3, steps), np.float32)
        for i, row in enumerate(rows):
            values, piece = self.pieces[row]
            speed = np.exp(rng.uniform(-SPEED, SPEED)) if vary and rng.random() < 0.6 else 1.0
            start = rng.integers(0, max(1, len(values) - int(steps * speed) + 1))
            part = at_speed(values, start, speed, steps)
            if vary and rng.random() < 0.5:
                part = moved(part, rng.integers(-2, 3), rng.integers(-4, 5))
            x[i, : len(part)], y[i] = part, targets(piece, start, speed, steps)
        return torch.from_numpy(x), torch.from_numpy(y)


class Block(nn.Module):
    """`x + mix(relu(taps(x two dilations ago, one ago, now)))`, (batch, steps, UNITS)."""

    def __init__(self, dilation):
        super().__init__()
        self.dilation = dilation
        # Matrix products train twice as fast as torch's convolutions on a processor.
        self.taps = nn.Linear(TAPS * UNITS, UNITS)
        self.mix = nn.Linear(UNITS, UNITS)
        with torch.no_grad():
            self.mix.weight *= 0.3

    def forward(self, x):
        steps, past = x.shape[1], nn.functional.pad(x, (0, 0, (TAPS - 1) * self.dilation, 0))
        seen = torch.cat([past[:, tap * self.dilation:][:, :steps] for tap in range(TAPS)], dim=2)
        return x + self.mix(torch.relu(self.taps(seen)))


class Network(nn.Module):
    def __init__(self):
        super().__init__()
        self.dense = nn.Linear(INPUTS, UNITS)
        self.blocks = nn.ModuleList(Block(2**i) for i in range(BLOCKS))
        self.heads = nn.Linear(UNITS, OUTPUTS)

    def forward(self, x, drop=0.0):
        x = torch.relu(self.dense(x))
        for block in self.blocks:
            x = block(x)
            if drop and self.training:
                # Some units are silent over a whole piece.
                x = x * nn.functional.dropout(torch.ones(len(x), 1, UNITS), drop)
        return self.heads(torch.relu(x)).transpose(1, 2)

    def parts(self):
        """Weights and biases in the order of the file: by output, then tap (oldest first), then input."""
        layers = [self.dense, *(layer for b in self.blocks for layer in (b.taps, b.mix)), self.heads]
        return [part for layer in layers for part in (layer.weight, layer.bias)]

    def weights(self):
        return np.concatenate([p.detach().numpy().ravel() for p in self.parts()]).astype("<f4")

    def take(self, weights):
        at = 0
        for part in self.parts():
            part.data = torch.from_numpy(weights[at: at + part.numel()].copy()).reshape(part.shape)
            at += part.numel()


WEIGHT = torch.tensor([1.0, 1.0, 0.1])


def loss_of(logits, y):
    raw = nn.functional.binary_cross_entropy_with_logits(logits, y, reduction="none")
    return raw.mean(dim=(0, 2))


def augmented(x, generator):
    """Other equalisers: bands louder or softer, some missing, now and then the notes."""
    batch = x.shape[0]
    draw = lambda *shape: torch.rand(*shape, generator=generator)
    gain = torch.exp(0.2 * torch.randn(batch, 1, RISES // 2, generator=generator))
    gain = gain * (draw(batch, 1, RISES // 2) >= 0.04)
    level = 0.3 * torch.randn(batch, 1, LEVELS, generator=generator)
    notes = torch.exp(0.2 * torch.randn(batch, 1, INPUTS - RISES - LEVELS, generator=generator))
    notes = notes * (draw(batch, 1, 1) >= 0.1)
    rises = x[:, :, :RISES] * torch.cat([gain, gain], dim=2)
    levels = (x[:, :, RISES: RISES + LEVELS] + level).clamp(min=0)
    return torch.cat([rises, levels, x[:, :, RISES + LEVELS:] * notes], dim=2)


def peak_scores(logits, y):
    """How sure the network is at beats, and between them: mean probabilities."""
    p = torch.sigmoid(logits)
    return [float((p[:, row] * (y[:, row] > 0.9)).sum() / (y[:, row] > 0.9).sum()) for row in (0, 1)]


def main():
    out, budget_s, folders = sys.argv[1], 60 * float(sys.argv[2]), sys.argv[3:]
    begun = None
    if "--from" in folders:
        at = folders.index("--from")
        begun, folders = folders[at + 1], folders[:at]
    torch.manual_seed(1)
    torch.set_num_threads(1)
    rng, generator = np.random.default_rng(1), torch.Generator().manual_seed(2)
    corpus, network = Corpus(folders), Network()
    corpus.look()
    flat = np.concatenate([x[::20] for x, _ in corpus.pieces]).astype(np.float32)
    mean, std = torch.from_numpy(flat.mean(0)), torch.from_numpy(flat.std(0)) + 0.05
    with torch.no_grad():
        # Inputs are brought to zero mean and unit variance by the first layer.
        network.dense.weight /= std
        network.dense.bias -= network.dense.weight @ mean
    if begun:
        network.take(np.fromfile(begun, "<f4"))
    print(sum(p.numel() for p in network.parameters()), "weights", flush=True)
    rate = 2.5e-3 if begun else 4e-3
    optimizer = torch.optim.Adam(network.parameters(), lr=rate)
    mean_network = copy.deepcopy(network).eval()
    held_x, held_y = corpus.batch(range(VALIDATION), rng, 3900, vary=False)
    start, epoch, done = time.time(), 0, 0
    begin, sums, batches = time.time(), np.zeros(3), 0
    while time.time() - start < budget_s:
        corpus.look()
        order = rng.permutation(np.arange(VALIDATION, len(corpus.pieces)))
        network.train()
        for first in range(0, len(order) - BATCH + 1, BATCH):
            # The rate falls to nothing over the time given.
            part = min(1.0, (time.time() - start) / budget_s)
            for group in optimizer.param_groups:
                group["lr"] = rate * min(1.0, (done + 1) / 100) * (0.01 + 0.495 * (1 + np.cos(np.pi * part)))
            x, y = corpus.batch(order[first: first + BATCH], rng, BATCH_STEPS)
            each = loss_of(network(augmented(x, generator), 0.05), y)
            optimizer.zero_grad()
            (each * WEIGHT).sum().backward()
            nn.utils.clip_grad_norm_(network.parameters(), 0.5)
            optimizer.step()
            with torch.no_grad():
                for kept, new in zip(mean_network.parameters(), network.parameters()):
                    kept.lerp_(new, 1.0 - AVERAGED)
            sums, batches, done = sums + each.detach().numpy(), batches + 1, done + 1
            if done % 50 == 0:
                print("  ", done, np.round(sums / batches, 4), f"{time.time() - start:.0f} s", flush=True)
            if part >= 1.0:
                break
        epoch += 1
        if batches < SCORED_EVERY and time.time() - start < budget_s:
            continue
        with torch.no_grad():
            logits = torch.cat([mean_network(held_x[i: i + 8]) for i in range(0, VALIDATION, 8)])
            held = loss_of(logits, held_y).numpy()
        print(epoch, len(order), "train", np.round(sums / max(1, batches), 4), "held out", np.round(held, 4),
              "at beats", np.round(peak_scores(logits, held_y), 3), f"{time.time() - begin:.0f} s", flush=True)
        mean_network.weights().tofile(out)
        begin, sums, batches = time.time(), np.zeros(3), 0


if __name__ == "__main__":
    main()
