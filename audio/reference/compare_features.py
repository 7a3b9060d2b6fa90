"""Compares the streaming features with librosa 0.11 on the same samples.

    cargo build --release -p servodance-audio --examples
    python audio/reference/compare_features.py FEATURES_BINARY SONG...

FEATURES_BINARY is the example `features`, which prints 20 frames a second of a
wav file. Each song is brought to 20,480 Hz once, here, so that both sides see
the same samples; librosa then works at that rate with windows and hops of the
same length in seconds as AIST++ has at 10,240 Hz, mel bands up to 5,120 Hz.
The streaming side is delayed by its resampler (17 samples, less a hundredth); librosa's input is
delayed alike.

Two tables in Markdown. First, where the definition is causal: librosa's mel
spectrum, cosine transform and flux with our running reference in place of the
maximum of the file; differences relative to the feature's root mean square.
Second, all 35 features against AIST++'s own, which know the whole file:
correlation in the same frame, and at the delay of up to a second that fits
best, mean over the songs. Needs librosa, numpy, scipy, soundfile.
"""

import subprocess
import sys
import tempfile

import librosa
import numpy as np
import scipy.fft
import soundfile

RATE, HOP, WINDOW, DELAY = 20480, 1024, 4096, 17
ENVELOPE_UNIT_DB, LEVEL_UNIT_DB, MFCC_UNIT = 5.0, 20.0, 50.0
# audio/src/spectral.rs
RANGE_DB, FADE_DB, FLOOR_DB, ENVELOPE_LIMIT_DB = 80.0, 1.0 / 20.0, -30.0, 20.0
# Frames by which a window that ends at the frame is later than a centred one.
LATE = 2
MOST_LATE = 20
PITCHES = "C C# D D# E F F# G G# A A# B".split()
NAMES = (["onset envelope"] + ["MFCC 0, level"] + [f"MFCC {k}" for k in range(1, 20)]
         + [f"chroma {p}" for p in PITCHES] + ["onset peak", "beat"])


def mel_power(sound):
    """librosa's, as at half the rate: half the samples, a quarter of the power."""
    return 0.25 * librosa.feature.melspectrogram(
        y=sound, sr=RATE, n_fft=WINDOW, hop_length=HOP, n_mels=128, fmax=5120.0)


def causal(mel):
    """Envelope and MFCC of windows that end at the frame, levels below a running reference."""
    db = 10.0 * np.log10(np.maximum(mel, 1e-10))
    db = np.concatenate([np.full((len(db), LATE), -100.0), db], axis=1)
    out = np.zeros((21, db.shape[1]))
    reference = FLOOR_DB
    for k in range(1, db.shape[1]):
        reference = max(reference - FADE_DB, db[:, k].max(), FLOOR_DB)
        now, before = (np.maximum(db[:, j], reference - RANGE_DB) for j in (k, k - 1))
        rise = np.maximum(now - before, 0.0).mean()
        out[0, k] = min(rise, ENVELOPE_LIMIT_DB) / ENVELOPE_UNIT_DB
        mfcc = scipy.fft.dct(now - reference, type=2, norm="ortho")[:20]
        out[1, k] = (mfcc[0] / np.sqrt(128) + RANGE_DB / 2) / LEVEL_UNIT_DB
        out[2:, k] = mfcc[1:] / MFCC_UNIT
    return out


def offline(sound, mel):
    """The 35 features as AIST++ has them; the whole file is known."""
    db = librosa.power_to_db(mel)
    envelope = librosa.onset.onset_strength(S=db, sr=RATE, n_fft=WINDOW, hop_length=HOP)
    events = np.zeros((2, len(envelope)))
    events[0, librosa.onset.onset_detect(onset_envelope=envelope, sr=RATE, hop_length=HOP)] = 1
    _, beats = librosa.beat.beat_track(onset_envelope=envelope, sr=RATE, hop_length=HOP)
    events[1, beats] = 1
    cens = librosa.feature.chroma_cens(y=sound, sr=RATE, hop_length=HOP)
    return np.concatenate([envelope[None], librosa.feature.mfcc(S=db, n_mfcc=20), cens, events])


def correlation(a, b):
    a, b = a - a.mean(), b - b.mean()
    norm = np.sqrt((a * a).sum() * (b * b).sum())
    return float((a * b).sum() / norm) if norm > 0 else float("nan")


def main():
    binary, songs = sys.argv[1], sys.argv[2:]
    errors, correlations = [], []
    for song in songs:
        sound, _ = librosa.load(song, sr=RATE, duration=60.0)
        with tempfile.NamedTemporaryFile(suffix=".wav") as wav:
            soundfile.write(wav.name, sound, RATE, subtype="FLOAT")
            text = subprocess.run([binary, wav.name], capture_output=True, text=True, check=True).stdout
        ours = np.array([line.split() for line in text.splitlines()], float)[:, 1:].T
        delayed = np.concatenate([np.zeros(DELAY, np.float32), sound])
        mel = mel_power(delayed)
        truth, original = causal(mel), offline(delayed, mel)
        n = min(ours.shape[1], original.shape[1]) - 1
        use = np.arange(MOST_LATE, n)
        scale = np.sqrt((truth[:, use] ** 2).mean(axis=1, keepdims=True))
        errors.append(np.abs(ours[:21, use] - truth[:, use]) / scale)
        correlations.append([[correlation(ours[k, use], original[k, use - late]) for late in range(MOST_LATE + 1)]
                             for k in range(35)])
        print(song, len(use), "frames", file=sys.stderr, flush=True)

    print("| feature | median | 99 % | largest | within 1e-3 |\n|---|---|---|---|---|")
    for name, rows in (("onset envelope", slice(0, 1)), ("MFCC 0, level", slice(1, 2)), ("MFCC 1-19", slice(2, 21))):
        e = np.concatenate([song[rows].ravel() for song in errors])
        print(f"| {name} | {np.median(e):.1e} | {np.percentile(e, 99):.1e} | {e.max():.1e} | {(e <= 1e-3).mean():.2%} |")
    mean = np.nanmean(correlations, axis=0)
    print(f"\n{len(songs)} songs\n\n| feature | same frame | best, frames late |\n|---|---|---|")
    for name, row in zip(NAMES, mean):
        late = int(np.argmax(row))
        print(f"| {name} | {row[0]:.2f} | {row[late]:.2f}, {late} |")


if __name__ == "__main__":
    main()
