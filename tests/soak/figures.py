"""Prints the figures of a live run: `figures.py REPORT.json RSS_KIB.txt`."""

import json
import sys

report = json.load(open(sys.argv[1]))
rss = [int(line) for line in open(sys.argv[2]) if line.strip()]
cycles = report["bus_stats"]["cycles"]
latency, capture = report["latency_ms"], report["capture"]
print(f"length              {report['audio_s']:.0f} s, {cycles} control cycles")
print(f"late frames         {report['late_frames']} ({100 * report['late_frames'] / cycles:.3f} % of cycles)")
print(f"overruns            {capture['overruns']} ({capture['lost_s']:.2f} s lost)")
print(f"stalls              {capture['stalls']} ({capture['silence_s']:.2f} s of silence), opened {capture['opened']} times")
for name in ("ready", "command"):
    times = latency[name]
    print(f"sample to {name:9} p50 {times['p50_ms']:.1f} ms, p99 {times['p99_ms']:.1f} ms, longest {times['max_ms']:.1f} ms")
for name in ("features", "model", "retarget", "bus"):
    times = report["stages"][name]
    print(f"stage {name:13} p50 {times['p50_ms']:.2f} ms, p99 {times['p99_ms']:.2f} ms, longest {times['max_ms']:.2f} ms")
print(f"violations          {report['violations']}")
# Traces fill up in the first ten minutes; after them nothing may grow.
settled = rss[60:] or rss
print(f"memory              {rss[0] / 1024:.1f} MiB after 10 s, {settled[0] / 1024:.1f} MiB after {10 * (len(rss) - len(settled) + 1)} s, {rss[-1] / 1024:.1f} MiB at the end")
