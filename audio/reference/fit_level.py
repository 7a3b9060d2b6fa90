"""Fits the weights by which the level of the beat is chosen (`audio/src/beats/metrical_level.rs`).

    cargo build --release -p servodance-audio --examples
    python audio/reference/fit_level.py EXAMPLES_FOLDER [--songs FOLDER] [--real 60] [--slow-weight 0.1]

Softmax regression over the five readings, a sample a second, on rendered songs
at the tempi of their styles, on slow ones of 60 to 100 BPM (each weighs
`--slow-weight` times one of those) and on the real tracks that may be tuned on
(score_beats.py; `--real` times). Prints the share of samples right, and the
weights. Needs mir_eval, numpy, scipy, soundfile.
"""

import argparse
import glob
import os
import subprocess
import tempfile

import numpy as np
import soundfile
from scipy.optimize import minimize

from score_beats import SONGS, TUNED, score, true_beats

VALUES = 18
READINGS = 5


def songs_of(command):
    """Songs of (right reading, values [5, 14], possible [5]) samples."""
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    songs = []
    for text in lines.split("\n\n"):
        samples = []
        for line in text.split("\n"):
            fields = line.split()
            if not fields:
                continue
            values = np.zeros((READINGS, VALUES))
            possible = np.zeros(READINGS, bool)
            for i, field in enumerate(fields[1:]):
                if field != "-":
                    values[i], possible[i] = [float(v) for v in field.split(",")], True
            if possible[int(fields[0])]:
                samples.append((int(fields[0]), values, possible))
        if samples:
            songs.append(samples)
    return songs


def real_songs(binaries, folder):
    for path in sorted(glob.glob(f"{folder}/*/*/song.ogg")):
        if os.path.basename(os.path.dirname(path)) not in TUNED:
            continue
        truth = true_beats(path.replace("song.ogg", "notes.mid"), soundfile.info(path).duration)
        found = subprocess.run([f"{binaries}/track", path], capture_output=True, text=True, check=True).stdout
        offset_s = score(truth, np.array(found.split(), float))[3]
        with tempfile.NamedTemporaryFile("w") as beats:
            beats.writelines(f"{beat + offset_s:.4f}\n" for beat in truth)
            beats.flush()
            yield from songs_of([f"{binaries}/levels", "recording", path, beats.name])


def fit(groups, ridge):
    """`groups`: (weight of a song, songs)."""
    right, values, possible, weights = [], [], [], []
    for weight, songs in groups:
        for song in songs:
            for r, v, p in song:
                right.append(r), values.append(v), possible.append(p), weights.append(weight / len(song))
    right, values, possible = np.array(right), np.array(values), np.array(possible)
    weights = np.array(weights) / np.sum(weights)

    def loss(w):
        scores = np.where(possible, values @ w, -1e9)
        scores -= scores.max(1, keepdims=True)
        chances = np.exp(scores) / np.exp(scores).sum(1, keepdims=True)
        at = np.arange(len(right))
        likelihood = weights @ np.log(chances[at, right] + 1e-12)
        gradient = np.einsum("n,nr,nrv->v", weights, chances, values) - weights @ values[at, right]
        return ridge * w @ w - likelihood, gradient + 2 * ridge * w

    return minimize(loss, np.zeros(VALUES), jac=True).x


def share_right(songs, w):
    shares = []
    for song in songs:
        hits = [np.argmax(np.where(p, v @ w, -1e9)) == r for r, v, p in song]
        shares.append(np.mean(hits))
    return float(np.mean(shares))


def main():
    options = argparse.ArgumentParser()
    options.add_argument("binaries")
    options.add_argument("--songs", default=SONGS)
    options.add_argument("--rendered", type=int, default=212)
    options.add_argument("--slow", type=int, default=96)
    options.add_argument("--slow-weight", type=float, default=0.1)
    options.add_argument("--real", type=float, default=60.0)
    options.add_argument("--ridge", type=float, default=1e-3)
    options = options.parse_args()
    levels = f"{options.binaries}/levels"
    groups = {
        "rendered": (1.0, songs_of([levels, "rendered", str(options.rendered)])),
        "slow": (options.slow_weight, songs_of([levels, "rendered", str(options.slow), "60", "100"])),
        "real": (options.real, list(real_songs(options.binaries, options.songs))),
    }
    w = fit(groups.values(), options.ridge)
    for name, (_, songs) in groups.items():
        print(f"{name}: {len(songs)} songs, {sum(map(len, songs))} samples, right {share_right(songs, w):.3f}")
    print(", ".join(f"{v:.3f}" for v in w))


if __name__ == "__main__":
    main()
