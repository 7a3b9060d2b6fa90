#!/usr/bin/env bash
# One long live run in simulation: a song played into a virtual microphone in
# real time, `dance --mic` on the simulated bus, figures at the end. Linux with
# ALSA's library, Python 3, a build with --features mic.
#
#   tests/soak/run.sh SONG.raw [SECONDS] [SERVODANCE]
#
# SONG.raw is played again and again: 16-bit, little endian, stereo, 48 kHz
# (ffmpeg -i song.ogg -f s16le -ac 2 -ar 48000 song.raw).
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
song=$(realpath "$1")
seconds=${2:-3600}
program=$(realpath "${3:-target/release/servodance}")
work=$(mktemp -d)
trap 'kill "${writer:-}" 2>/dev/null || true; rm -rf "$work"' EXIT
cd "$work"
mkfifo fifo
sed "s#FIFO#$work/fifo#" "$here/asound.conf" > asound.conf
cp "$here"/../../configs/op3.urdf .
# A busy machine is no lost reply.
sed 's/^\[bus\]$/[bus]\nreply_timeout_ms = 200.0\nwatchdog_ms = 1000/' \
    "$here"/../../configs/op3.toml > patient.toml

python3 "$here/play.py" fifo "$song" "$((seconds + 60))" &
writer=$!
ALSA_CONFIG_PATH=$work/asound.conf "$program" dance --robot patient.toml --mic mic \
    --report report.json --no-picture 2> errors.txt &
dance=$!
for ((t = 0; t < seconds; t += 10)); do
    sleep 10
    [ -d /proc/$dance ] || break
    awk '/VmRSS/ {print $2}' /proc/$dance/status >> rss_kib.txt
done
kill -INT "$dance" 2>/dev/null || true
wait "$dance" || true
grep -v '^ALSA lib\|^$' errors.txt || true
python3 "$here/figures.py" report.json rss_kib.txt
