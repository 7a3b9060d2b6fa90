"""Scores dances on real music against their exact tempo maps.

Music as in score_beats.py, no offset fitted. The dances bring their kinematic beats
in their reports:

    servodance dance SONG.ogg --report REPORT.json [--as-live]
    python audio/reference/score_dance.py SONG.ogg REPORT.json

Prints, for the dancer, the servos without compensation and the servos: the
median distance of kinematic beats from the nearest true beat (ms) and F1 at
100 ms. Needs what score_beats.py needs.
"""

import json
import sys

import numpy as np
from score_beats import true_beats


def f1(found, truth, window=0.1):
    i = j = hits = 0
    while i < len(found) and j < len(truth):
        if abs(found[i] - truth[j]) <= window:
            hits, i, j = hits + 1, i + 1, j + 1
        elif found[i] < truth[j]:
            i += 1
        else:
            j += 1
    return 2 * hits / max(1, len(found) + len(truth))


def error_ms(found, truth):
    return 1e3 * np.median([np.min(np.abs(truth - beat)) for beat in found])


def main():
    song, report = sys.argv[1:3]
    report = json.load(open(report))
    truth = true_beats(song.replace("song.ogg", "notes.mid"), report["audio_s"])
    kinematic = {key: np.array(beats) for key, beats in report["kinematic_beats_s"].items()}
    for stage in ("generator", "off_servos", "servos"):
        beats = kinematic[stage]
        if len(beats):
            print(f"{stage:10} {error_ms(beats, truth):4.0f} ms  F1 {f1(beats, truth):.2f}")


if __name__ == "__main__":
    main()
