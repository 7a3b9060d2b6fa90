"""Scores the beat trackers on real music with an exact tempo map.

Music: the Debian packages fretsonfire-songs-muldjord and
fretsonfire-songs-sectoid (CC BY-SA), or the FOLDER with the two folders of
songs in them; notes.mid beside each song.ogg holds the tempo map. The
recordings start up to 100 ms off it, so the offset that scores best, -20 to
100 ms, is fitted per track, for every tracker alike.

    cargo build --release -p servodance-audio --examples
    python audio/reference/score_beats.py TRACK_BINARY [--librosa] [--all] [--starts N] [--songs FOLDER]

With --starts the causal tracker also hears a minute of each track from N places
in it (the same each time), since what it makes of a song depends on where it
begins: F without the first 5 s, and the share of minutes with F below 0.5.

Tuning looked at the tracks in TUNED only; without --all only those are scored.
Needs mir_eval, numpy, soundfile (and librosa with --librosa).
"""

import glob
import os
import struct
import subprocess
import sys
import tempfile

import mir_eval
import numpy as np
import soundfile

SONGS = "/usr/share/games/fretsonfire/data/songs"
TUNED = {"armygeddon", "internal_degeneration", "Feelings", "Metal madness"}


def varint(data, at):
    value = 0
    while True:
        byte = data[at]
        at += 1
        value = (value << 7) | (byte & 127)
        if byte < 128:
            return value, at


def tempo_map(path):
    """Ticks per beat and (tick, seconds per beat) in order."""
    data = open(path, "rb").read()
    _, tracks, division = struct.unpack(">HHH", data[8:14])
    at, tempi = 14, []
    for _ in range(tracks):
        end = at + 8 + struct.unpack(">I", data[at + 4 : at + 8])[0]
        at += 8
        tick, running = 0, None
        while at < end:
            delta, at = varint(data, at)
            tick += delta
            status = data[at]
            if status & 0x80:
                at += 1
                running = status if status < 0xF0 else running
            else:
                status = running
            if status == 0xFF:
                kind = data[at]
                length, at = varint(data, at + 1)
                if kind == 0x51:
                    tempi.append((tick, int.from_bytes(data[at : at + 3], "big") / 1e6))
                at += length
            elif status in (0xF0, 0xF7):
                length, at = varint(data, at)
                at += length
            else:
                at += 1 if status & 0xF0 in (0xC0, 0xD0) else 2
    return division, sorted(tempi)


def true_beats(path, duration_s):
    division, tempi = tempo_map(path)
    beats, now_s, tick, beat_s = [], 0.0, 0, tempi[0][1]
    changes = tempi[1:]
    while now_s < duration_s:
        beats.append(now_s)
        target = len(beats) * division
        while changes and changes[0][0] <= target:
            now_s += (changes[0][0] - tick) / division * beat_s
            tick, beat_s = changes.pop(0)
        now_s += (target - tick) / division * beat_s
        tick = target
    return np.array(beats)


def score(truth, found):
    found = mir_eval.beat.trim_beats(found)
    best = None
    for offset in np.arange(-0.02, 0.101, 0.005):
        reference = mir_eval.beat.trim_beats(truth + offset)
        f = mir_eval.beat.f_measure(reference, found)
        _, cmlt, _, amlt = mir_eval.beat.continuity(reference, found)
        if best is None or f + amlt > best[0] + best[1]:
            best = (f, amlt, cmlt, offset)
    return best


def beats_of(binary, path, tracker):
    lines = subprocess.run([binary, path, tracker], capture_output=True, text=True, check=True).stdout
    return np.array(lines.split(), float)


def score_starts(binary, song, truth, count):
    """F of a minute from each of so many places; `truth` in the time of the recording."""
    sound, rate = soundfile.read(song)
    scores = []
    for start in np.random.default_rng(1).uniform(0.0, len(sound) / rate - 60.0, count):
        with tempfile.NamedTemporaryFile(suffix=".wav") as minute:
            soundfile.write(minute.name, sound[int(start * rate) : int((start + 60.0) * rate)], rate)
            found = beats_of(binary, minute.name, "causal")
        reference = truth - start
        reference = reference[(reference > 5.0) & (reference < 60.0)]
        scores.append(mir_eval.beat.f_measure(reference, found[found > 5.0]))
    return np.array(scores)


def main():
    binary = sys.argv[1]
    everything = "--all" in sys.argv
    trackers = ["causal", "offline"] + (["librosa"] if "--librosa" in sys.argv else [])
    table = {tracker: {} for tracker in trackers}
    starts = int(sys.argv[sys.argv.index("--starts") + 1]) if "--starts" in sys.argv else 0
    minutes = []
    folder = sys.argv[sys.argv.index("--songs") + 1] if "--songs" in sys.argv else SONGS
    for song in sorted(glob.glob(f"{folder}/*/*/song.ogg")):
        name = os.path.basename(os.path.dirname(song))
        if not everything and name not in TUNED:
            continue
        info = soundfile.info(song)
        truth = true_beats(song.replace("song.ogg", "notes.mid"), info.duration)
        for tracker in trackers:
            if tracker == "librosa":
                import librosa

                sound, rate = librosa.load(song, sr=22050)
                _, found = librosa.beat.beat_track(y=sound, sr=rate, units="time")
            else:
                found = beats_of(binary, song, tracker)
            f, amlt, cmlt, offset = score(truth, found)
            tempo = 60 / np.median(np.diff(found)) if len(found) > 2 else 0
            true_tempo = 60 / np.median(np.diff(truth))
            table[tracker][name] = (f, amlt)
            print(f"{tracker:8} {name:22} F {f:.3f} AMLt {amlt:.3f} CMLt {cmlt:.3f} "
                  f"tempo {tempo:5.1f} of {true_tempo:5.1f} offset {1e3 * offset:4.0f} ms", flush=True)
            if tracker == "causal" and starts:
                minutes.append(score_starts(binary, song, truth + offset, starts))
                print(f"  minutes F {minutes[-1].mean():.3f}, below 0.5 {(minutes[-1] < 0.5).mean():.2f}", flush=True)
    for tracker, rows in table.items():
        for label, names in (("tuned", TUNED & rows.keys()), ("held out", rows.keys() - TUNED)):
            if names:
                f, amlt = np.mean([rows[n] for n in names], axis=0)
                print(f"{tracker:8} {label:8} ({len(names)} tracks): F {f:.3f} AMLt {amlt:.3f}")
    if minutes:
        scores = np.concatenate(minutes)
        print(f"causal   {len(scores)} minutes: F {scores.mean():.3f}, below 0.5 {(scores < 0.5).mean():.3f}")


if __name__ == "__main__":
    main()
