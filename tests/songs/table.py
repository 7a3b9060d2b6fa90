"""The tables of docs/measurements/timing.md: how far off the beat dancer and servos are.

    python tests/songs/table.py SERVODANCE SONG.ogg ... [--as-live] [--robot NAME]

Dances the first minute of each song in simulated time and prints a row of
Markdown for each: dancer, servos without compensation, targets, servos. A
folder stands for the songs in it, `builtin` for the built-in one. Needs numpy
and soundfile.
"""

import argparse
import glob
import json
import os
import statistics
import subprocess
import tempfile

import soundfile

SECONDS = 60
STAGES = ("dancer", "servos, off", "targets", "**servos, on**")


def songs(names):
    for name in names:
        yield from sorted(glob.glob(f"{name}/**/song.ogg", recursive=True)) or [name]


def title(path):
    name = os.path.splitext(os.path.basename(path))[0]
    return os.path.basename(os.path.dirname(path)) if name == "song" else name


def excerpt(servodance, song, folder):
    """The first minute as a file of its own."""
    path = f"{folder}/song.wav"
    if song == "builtin":
        subprocess.run([servodance, "song", "--out", path], check=True, stdout=subprocess.DEVNULL)
        song = path
    with soundfile.SoundFile(song) as source:
        rate = source.samplerate
        samples = source.read(SECONDS * rate)
    soundfile.write(path, samples, rate)
    return path


def danced(servodance, song, options):
    """`error_ms, f1, fact` of each stage; numbers that are missing are None."""
    with tempfile.TemporaryDirectory() as folder:
        report = f"{folder}/report.json"
        path = excerpt(servodance, song, folder)
        command = [servodance, "dance", path, "--no-picture", "--report", report, *options]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        with open(report) as file:
            found = json.load(file)
    off = (found["compensation"]["off_servos"] or {}) if found.get("compensation") else {}
    stages = found["alignment"]
    order = (stages["generator"], off, stages["targets"], stages["servos"])
    return [tuple(stage.get(key) for key in ("error_ms", "f1", "fact")) for stage in order]


def cell(figures, bold):
    error, f1, fact = figures
    text = "-" if error is None else f"{error:.0f} ms, {f1:.2f}, {fact:.2f}"
    return f"**{text}**" if bold else text


def row(name, stages):
    return f"| {name} | " + " | ".join(cell(s, i == 3) for i, s in enumerate(stages)) + " |"


def mean(rows, stage):
    columns = zip(*(stages[stage] for stages in rows if None not in stages[stage]))
    return tuple(statistics.mean(column) for column in columns) or (None,) * 3


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("servodance")
    parser.add_argument("songs", nargs="+")
    parser.add_argument("--as-live", action="store_true")
    parser.add_argument("--robot", default="op3")
    args = parser.parse_args()
    options = ["--robot", args.robot] + ["--as-live"] * args.as_live
    print("| song | " + " | ".join(STAGES) + " |\n|" + "---|" * 5)
    rows = []
    for song in songs(args.songs):
        rows.append(danced(args.servodance, song, options))
        print(row(title(song), rows[-1]), flush=True)
    print(row(f"mean of {len(rows)}", [mean(rows, stage) for stage in range(4)]))
    errors = [stages[3][0] for stages in rows if stages[3][0] is not None]
    within = sum(error <= 60 for error in errors)
    print(f"\nservos within 60 ms on {within} of {len(errors)} songs, median {statistics.median(errors):.0f} ms")


if __name__ == "__main__":
    main()
