"""Our causal tracker beside librosa and BeatNet on the same songs, in one run.

    python audio/reference/compare_trackers.py SERVODANCE SONGS_DIR [--librosa] [--beatnet]

SONGS_DIR is what `servodance bench beats` takes: NAME.wav (ogg, mp3, flac) beside
NAME.beats (a line a beat: seconds, place in the bar). For each tracker mir_eval's F
measure, CMLt and AMLt without the first 5 s, at the one offset (-30 to 50 ms) that
suits it best over all songs, the shares of songs on the off-beat and below F 0.5,
and processor milliseconds for a second of sound. Ours is scored twice: by mir_eval
here and by `bench beats`, which must agree.

Needs mir_eval, numpy, soundfile; librosa and BeatNet (PyPI; its models are CC BY 4.0:
measured against, not shipped) if asked for. Those two live together in Python 3.9 with
numpy 1.23.5, scipy 1.10.1, cython < 3, setuptools < 70, librosa 0.10.1, numba < 0.59, torch 2.2.2, matplotlib < 3.8, then
`pip install --no-build-isolation madmom==0.16.1` and `pip install --no-deps BeatNet`.
"""

import glob
import json
import os
import subprocess
import sys
import time
import types

import mir_eval
import numpy as np
import soundfile

SKIPPED_S = 5.0
OFFSETS_S = np.arange(-0.03, 0.051, 0.01)


def truth_of(path):
    rows = np.loadtxt(os.path.splitext(path)[0] + ".beats", ndmin=2)
    return rows[:, 0], rows[:, 1].astype(int)


def ours(binary):
    def track(path):
        command = [binary, "beats", path, "--causal", "--downbeats"]
        lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
        rows = [line.split() for line in lines]
        return np.array([float(r[0]) for r in rows]), np.array([float(r[0]) for r in rows if r[1] == "1"])

    return track


def librosa_tracker(path):
    import librosa

    sound, rate = librosa.load(path, sr=22050)
    _, beats = librosa.beat.beat_track(y=sound, sr=rate, units="time")
    return beats, np.array([])


def beatnet_tracker(mode, inference):
    # BeatNet imports it for microphones alone, and it has to be built.
    sys.modules.setdefault("pyaudio", types.ModuleType("pyaudio"))
    from BeatNet.BeatNet import BeatNet

    def track(path):
        # A new one each time: its particle filter goes on from the song before.
        tracker = BeatNet(1, mode=mode, inference_model=inference, plot=[], thread=False)
        rows = tracker.process(path)
        return rows[:, 0], rows[rows[:, 1] == 1, 0]

    return track


def scores(truth, places, beats, downbeats, offset):
    late = lambda times: times[times >= SKIPPED_S]
    reference, found = late(truth), late(beats + offset)
    f = mir_eval.beat.f_measure(reference, found)
    between = mir_eval.beat.f_measure((reference[:-1] + reference[1:]) / 2, found)
    _, cmlt, _, amlt = mir_eval.beat.continuity(reference, found) if len(found) > 2 else (0, 0, 0, 0)
    down = np.nan
    if places.max() in (3, 4):
        down = mir_eval.beat.f_measure(late(truth[places == 1]), late(downbeats + offset))
    return f, cmlt, amlt, float(between > max(f, 0.5)), float(f < 0.5), down


def main():
    binary, folder = sys.argv[1:3]
    songs = sorted(p for e in ("wav", "ogg", "mp3", "flac") for p in glob.glob(f"{folder}/*.{e}")
                   if os.path.exists(os.path.splitext(p)[0] + ".beats"))
    trackers = {"ours, causal": ours(binary)}
    if "--librosa" in sys.argv:
        trackers["librosa, offline"] = librosa_tracker
    if "--beatnet" in sys.argv:
        trackers["BeatNet online (particle filter)"] = beatnet_tracker("online", "PF")
        trackers["BeatNet offline (DBN)"] = beatnet_tracker("offline", "DBN")
    seconds = sum(soundfile.info(p).duration for p in songs)
    print(f"{len(songs)} songs, {seconds / 60:.0f} minutes")
    print("| tracker | F | CMLt | AMLt | off-beat | F < 0.5 | downbeat F | ms a second |")
    print("|---|---|---|---|---|---|---|---|")
    for name, track in trackers.items():
        # Ours runs in a process of its own.
        clock = lambda: time.process_time() + sum(os.times()[2:4])
        begun = clock()
        found = {path: track(path) for path in songs}
        cost = 1e3 * (clock() - begun) / seconds
        table = {o: np.array([scores(*truth_of(p), *found[p], o) for p in songs]) for o in OFFSETS_S}
        best = max(table, key=lambda o: table[o][:, 0].mean())
        f, cmlt, amlt, off, low, down = np.nanmean(table[best], axis=0)
        print(f"| {name} | {f:.3f} | {cmlt:.3f} | {amlt:.3f} | {100 * off:.1f} % | {100 * low:.1f} % "
              f"| {down:.2f} | {cost:.1f} |", flush=True)
    report = json.loads(subprocess.run([binary, "bench", "beats", folder, "--json"], capture_output=True,
                                       text=True, check=True).stdout)
    print(f"bench beats: F {report['f']:.3f}, CMLt {report['cmlt']:.3f}, AMLt {report['amlt']:.3f}, "
          f"{report['cost_ms_per_s']:.1f} ms a second")


if __name__ == "__main__":
    main()
