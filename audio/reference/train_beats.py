"""Trains the small network that tells beats, downbeats and music from sound.

    cargo build --release -p servodance-audio --examples
    beat_corpus FOLDER 360            # rendered pieces with known beats
    python audio/reference/train_beats.py OUT.f32 MINUTES FOLDER... [--from START.f32]

The network (audio/src/beats/network.rs) runs 80 times a second: a dense layer
over band rises and levels, a gated recurrent unit, then five logits: beat and
downbeat for the older and the newer hop of the step, and music. OUT.f32 holds
its weights in that order, little endian. A beat is marked DELAY_S after it is
audible, when all of its onset was heard. Nothing but rendered sound is used.
Needs torch and numpy.
"""

import json
import sys
import time

import numpy as np
import torch
from torch import nn

STEP_HZ, HOP_HZ, RATE = 80, 160, 20480
RESAMPLER_S = 16 / RATE
DELAY_S = 0.040
INPUTS, DENSE, UNITS = 80, 32, 40
CHUNK, BATCH = 400, 48
VALIDATION = 20


def targets(piece, steps):
    """Beat x 2, downbeat x 2, music for each step."""
    hops = 2 * steps
    out = np.zeros((3, hops), np.float32)
    for row, times in ((0, piece["beats_s"]), (1, piece["downbeats_s"])):
        for beat in times:
            at = (beat + DELAY_S + RESAMPLER_S) * HOP_HZ - 1
            for hop in range(int(at) - 3, int(at) + 5):
                if 0 <= hop < hops:
                    out[row, hop] = max(out[row, hop], np.exp(-0.5 * ((hop - at) / 1.4) ** 2))
    for start, end in piece["music_s"]:
        out[2, int(start * HOP_HZ): int(end * HOP_HZ)] = 1.0
    two = out.reshape(3, steps, 2)
    return np.concatenate([two[0], two[1], two[2, :, :1]], axis=1)


def load(folders):
    pieces = []
    for folder in folders:
        inputs = np.memmap(f"{folder}/inputs.f32", np.float32, "r").reshape(-1, INPUTS)
        at = 0
        for line in open(f"{folder}/pieces.jsonl"):
            piece = json.loads(line)
            steps = piece["steps"]
            pieces.append((inputs[at: at + steps].astype(np.float16), targets(piece, steps)))
            at += steps
    steps = min(len(x) for x, _ in pieces) // CHUNK * CHUNK
    x = torch.from_numpy(np.stack([x[:steps] for x, _ in pieces]))
    y = torch.from_numpy(np.stack([y[:steps] for _, y in pieces]))
    return x, y


class Network(nn.Module):
    def __init__(self):
        super().__init__()
        self.dense = nn.Linear(INPUTS, DENSE)
        self.gru = nn.GRU(DENSE, UNITS, batch_first=True)
        self.heads = nn.Linear(UNITS, 5)

    def forward(self, x, state=None):
        hidden, state = self.gru(torch.relu(self.dense(x)), state)
        return self.heads(hidden), state

    def parts(self):
        gru = self.gru
        return [self.dense.weight, self.dense.bias, gru.weight_ih_l0, gru.weight_hh_l0,
                gru.bias_ih_l0, gru.bias_hh_l0, self.heads.weight, self.heads.bias]

    def weights(self):
        return np.concatenate([p.detach().numpy().ravel() for p in self.parts()]).astype("<f4")

    def take(self, weights):
        at = 0
        for part in self.parts():
            part.data = torch.from_numpy(weights[at: at + part.numel()].reshape(part.shape).copy())
            at += part.numel()


POSITIVE = torch.tensor([3.0, 3.0, 3.0, 3.0, 1.0])
WEIGHT = torch.tensor([1.0, 1.0, 0.6, 0.6, 0.25])


def loss_of(logits, y):
    # A beat is unknowable in the silence after the music; downbeats are hard.
    raw = nn.functional.binary_cross_entropy_with_logits(logits, y, pos_weight=POSITIVE, reduction="none")
    return (raw * WEIGHT).mean(dim=(0, 1))


def augmented(x, generator):
    """Other equalisers: bands louder or softer, some missing."""
    batch = x.shape[0]
    gain = torch.exp(0.25 * torch.randn(batch, 1, 32, generator=generator))
    lost = (torch.rand(batch, 1, 32, generator=generator) < 0.05).float()
    gain = gain * (1 - lost)
    level = 0.3 * torch.randn(batch, 1, 16, generator=generator)
    rises = torch.cat([x[:, :, :32] * gain, x[:, :, 32:64] * gain], dim=2)
    return torch.cat([rises, (x[:, :, 64:] + level).clamp(min=0)], dim=2)


def main():
    out, budget_s, folders = sys.argv[1], 60 * float(sys.argv[2]), sys.argv[3:]
    begun = None
    if "--from" in folders:
        at = folders.index("--from")
        begun, folders = folders[at + 1], folders[:at]
    torch.manual_seed(1)
    torch.set_num_threads(1)
    generator = torch.Generator().manual_seed(2)
    x, y = load(folders)
    print(x.shape, "beats", float(y[:, :, 0].mean()), "music", float(y[:, :, 4].mean()), flush=True)
    network = Network()
    with torch.no_grad():
        flat = x[::7].float().reshape(-1, INPUTS)
        mean, std = flat.mean(0), flat.std(0) + 0.05
        # Inputs are brought to zero mean and unit variance by the first layer.
        network.dense.weight /= std
        network.dense.bias -= network.dense.weight @ mean
    if begun:
        network.take(np.fromfile(begun, "<f4"))
    rate = 1.5e-3 if begun else 4e-3
    optimizer = torch.optim.Adam(network.parameters(), lr=4e-3)
    train = torch.arange(VALIDATION, len(x))
    batches = len(train) // BATCH
    start, epoch = time.time(), 0
    while time.time() - start < budget_s:
        begin, sums = time.time(), np.zeros(5)
        order = train[torch.randperm(len(train), generator=generator)]
        for batch in range(batches):
            rows = order[batch * BATCH: (batch + 1) * BATCH]
            # The rate falls to nothing over the time given.
            part = min(1.0, (time.time() - start) / budget_s)
            warm = min(1.0, (epoch * batches + batch + 1) / 5)
            for group in optimizer.param_groups:
                group["lr"] = rate * warm * (0.02 + 0.49 * (1 + np.cos(np.pi * part)))
            bx, by = augmented(x[rows].float(), generator), y[rows]
            state = None
            for at in range(0, bx.shape[1], CHUNK):
                logits, state = network(bx[:, at: at + CHUNK], state)
                state = state.detach()
                each = loss_of(logits, by[:, at: at + CHUNK])
                optimizer.zero_grad()
                each.sum().backward()
                nn.utils.clip_grad_norm_(network.parameters(), 1.0)
                optimizer.step()
                sums += each.detach().numpy()
        with torch.no_grad():
            logits, _ = network(x[:VALIDATION].float())
            held = loss_of(logits, y[:VALIDATION]).numpy()
        chunks = batches * (x.shape[1] // CHUNK)
        print(epoch, "train", np.round(sums / chunks, 4), "held out", np.round(held, 4), f"{time.time() - begin:.0f} s", flush=True)
        network.weights().tofile(out)
        epoch += 1


if __name__ == "__main__":
    main()
