"""Plays raw PCM (S16_LE, 48 kHz, stereo) into a FIFO in real time, again and
again: `play.py FIFO FILE.raw SECONDS [FROM:TO...]`; silent from FROM to TO, as
a microphone that stalls. A chunk is a third of 10 ms, a block of the device."""

import os
import sys
import time

FRAMES = 160
BYTES = FRAMES * 4
CHUNK_S = FRAMES / 48_000

fifo, path, seconds = sys.argv[1], sys.argv[2], float(sys.argv[3])
gaps = [tuple(map(float, gap.split(":"))) for gap in sys.argv[4:]]
sound = open(path, "rb").read()
whole = len(sound) // BYTES
try:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(35))
except PermissionError:
    pass
end = os.open(fifo, os.O_RDWR | os.O_NONBLOCK)
start = time.monotonic()
for i in range(int(seconds / CHUNK_S)):
    wait = start + i * CHUNK_S - time.monotonic()
    if wait > 0:
        time.sleep(wait)
    if any(a <= i * CHUNK_S < b for a, b in gaps):
        continue
    chunk = i % whole * BYTES
    try:
        os.write(end, sound[chunk : chunk + BYTES])
    except BlockingIOError:
        pass  # nobody listens yet, or not any more
