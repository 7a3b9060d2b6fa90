"""Compares the streaming features with librosa 0.11 on the same samples.

    cargo build --release -p servodance-audio --examples
    python audio/reference/compare_features.py FEATURES_BINARY SONG...

FEATURES_BINARY is the example `features`, which prints 20 frames a second of a
wav file. Each song is brought to 20,480 Hz once, here, so that both sides see
the same samples; librosa then works at that rate with windows and hops of the
same length in seconds as AIST++ has at 10,240 Hz, mel bands up to 5,120 Hz.
The streaming side is delayed by its resampler (16 samples); librosa's input is
delayed alike. Needs librosa, numpy, soundfile.
"""

import subprocess
import sys
import tempfile

import librosa
import numpy as np
import soundfile

RATE, HOP, WINDOW, DELAY = 20480, 1024, 4096, 16
ENVELOPE_UNIT_DB, LEVEL_UNIT_DB, MFCC_UNIT = 5.0, 20.0, 50.0


def correlation(a, b):
    a, b = a - a.mean(), b - b.mean()
    norm = np.sqrt((a * a).sum() * (b * b).sum())
    return float((a * b).sum() / norm) if norm > 0 else float("nan")


def main():
    binary, songs = sys.argv[1], sys.argv[2:]
    rows = []
    for song in songs:
        sound, _ = librosa.load(song, sr=RATE, duration=60.0)
        with tempfile.NamedTemporaryFile(suffix=".wav") as wav:
            soundfile.write(wav.name, sound, RATE, subtype="FLOAT")
            text = subprocess.run([binary, wav.name], capture_output=True, text=True, check=True).stdout
        ours = np.array([line.split() for line in text.splitlines()], float)[:, 1:]
        delayed = np.concatenate([np.zeros(DELAY, np.float32), sound])
        mel = librosa.feature.melspectrogram(
            y=delayed, sr=RATE, n_fft=WINDOW, hop_length=HOP, n_mels=128, fmax=5120.0)
        # Half the rate means half the samples under a window: a quarter of the power.
        # top_db clips at the loudest moment of the whole file, which nobody knows
        # live: without it for what must agree, with it for the correlations.
        mel_db = librosa.power_to_db(mel * 0.25, top_db=None)
        clipped_db = librosa.power_to_db(mel * 0.25)
        envelope = librosa.onset.onset_strength(S=mel_db, sr=RATE, n_fft=WINDOW, hop_length=HOP)
        mfcc = librosa.feature.mfcc(S=mel_db, n_mfcc=20)
        aist_envelope = librosa.onset.onset_strength(S=clipped_db, sr=RATE, n_fft=WINDOW, hop_length=HOP)
        aist_mfcc = librosa.feature.mfcc(S=clipped_db, n_mfcc=20)
        cens = librosa.feature.chroma_cens(y=delayed, sr=RATE, hop_length=HOP)
        peaks = np.zeros(len(envelope))
        peaks[librosa.onset.onset_detect(onset_envelope=aist_envelope, sr=RATE, hop_length=HOP)] = 1

        n = min(len(ours), len(envelope)) - 3
        use = np.arange(10, n)
        env = ours[use, 0] * ENVELOPE_UNIT_DB
        limit = env < 20.0 - 1e-4
        error = np.abs(env - envelope[use])[limit] / max(1e-9, np.std(envelope[use]))
        # Our window ends at the frame: librosa's frame two hops earlier.
        ours_mfcc = ours[use, 2:21] * MFCC_UNIT
        mfcc_error = np.abs(ours_mfcc - mfcc[1:20, use - 2].T) / mfcc[1:20].std()
        rows.append({
            "envelope error/sd median": np.median(error),
            "envelope error/sd p90": np.percentile(error, 90),
            "MFCC 1-19 error/sd median": np.median(mfcc_error),
            "MFCC 1-19 error/sd p90": np.percentile(mfcc_error, 90),
            "envelope r": correlation(env, aist_envelope[use]),
            "MFCC 1-19 r, same frame": np.mean([correlation(ours_mfcc[:, k], aist_mfcc[k + 1, use]) for k in range(19)]),
            "MFCC 1-19 r, 2 frames late": np.mean([correlation(ours_mfcc[:, k], aist_mfcc[k + 1, use - 2]) for k in range(19)]),
            "level r, 2 frames late": correlation(ours[use, 1], aist_mfcc[0, use - 2]),
            **{f"CENS r, {lag} frames late": correlation(ours[use, 21:33].ravel(), cens[:, np.maximum(use - lag, 0)].T.ravel())
               for lag in (0, 5, 10, 15)},
            "peaks r": correlation(ours[use, 33], peaks[use]),
        })
        print(song.split("/")[-2:], {k: round(float(v), 4) for k, v in rows[-1].items()})
    print("mean over", len(rows), "songs")
    for key in rows[0]:
        print(f"  {key:28} {np.mean([row[key] for row in rows]):.4f}")


if __name__ == "__main__":
    main()
