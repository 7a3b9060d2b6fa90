"""Whether those who watch delay the robot: `python3 tests/browser/hundred_viewers.py PROGRAM`.

One dance in real time. In turns nobody watches, and then 100 pages of the audience do, as
WebSockets that take every frame, while songs are put into the queue. How late the latest
control cycle of each second was, is asked for once a second all along: the worst of the turns
with viewers against the worst of those without. For a machine that does nothing else: the
viewers are programs of this machine, of the lowest priority.
"""

import base64
import json
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import urllib.error
import urllib.request

PROGRAM = os.path.abspath(sys.argv[1])
VIEWERS, TURNS, TURN_S, SETTLE_S = 100, 10, 6, 1.5


def upgrade(host, port, path):
    """A WebSocket of which only bytes are read."""
    line = socket.create_connection((host, port))
    key = base64.b64encode(os.urandom(16)).decode()
    line.sendall((f"GET {path} HTTP/1.1\r\nHost: {host}:{port}\r\nUpgrade: websocket\r\n"
                  f"Connection: Upgrade\r\nSec-WebSocket-Key: {key}\r\n"
                  "Sec-WebSocket-Version: 13\r\n\r\n").encode())
    if b"101" not in line.recv(64):
        raise SystemExit("a viewer was not let in")
    return line


def watch(host, port, path, seconds):
    """Takes every frame for so long; how many bytes came."""
    os.nice(19)
    lines = [upgrade(host, port, path) for _ in range(VIEWERS)]
    taken, until = 0, time.monotonic() + seconds
    while time.monotonic() < until:
        ready, _, _ = select.select(lines, [], [], 0.1)
        taken += sum(len(line.recv(1 << 16)) for line in ready)
    for line in lines:
        line.close()
    return taken


def watchers(address, seconds):
    """100 viewers in a program of their own; how many bytes they took."""
    host, port = address.split("/")[2].split(":")
    path = "/" + "/".join(address.split("/")[3:]) + "api/live"
    code = (f"import sys; sys.argv = [sys.argv[0], '']; sys.path.insert(0, {os.path.dirname(os.path.abspath(__file__))!r});"
            f"import hundred_viewers as h; print(h.watch({host!r}, {port}, {path!r}, {seconds}))")
    return subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)


def add_songs(address, song):
    """Puts a song into the queue every second, as long as it takes any."""
    time.sleep(SETTLE_S)
    for number in range(int(TURN_S - SETTLE_S)):
        asked = urllib.request.Request(f"{address}api/song/{number}.wav", song, method="POST")
        try:
            urllib.request.urlopen(asked).read()
        except urllib.error.HTTPError as error:
            if b"wait already" not in error.read():
                raise
        time.sleep(1)


def late_ms(address, seconds):
    """The worst lateness that is told in the next seconds, those of the first left out."""
    until, worst = time.monotonic() + seconds, 0.0
    time.sleep(SETTLE_S)
    while time.monotonic() < until:
        with urllib.request.urlopen(address + "api/state") as answer:
            worst = max(worst, json.load(answer)["late_ms"])
        time.sleep(0.5)
    return worst


def main():
    with tempfile.TemporaryDirectory(prefix="viewers-") as folder:
        subprocess.run([PROGRAM, "song", "--out", "song.wav"], cwd=folder, check=True,
                       stdout=subprocess.DEVNULL)
        with open(os.path.join(folder, "song.wav"), "rb") as file:
            song = file.read()
        program = subprocess.Popen([PROGRAM, "dance", "--view", "--no-picture", "--quiet"],
                                   cwd=folder, stdin=subprocess.DEVNULL, text=True,
                                   stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        operator = program.stdout.readline().strip()
        audience = program.stdout.readline().split()[-1]
        time.sleep(5)
        alone, watched, taken = [], [], 0
        for _ in range(TURNS):
            alone.append(late_ms(operator, TURN_S))
            viewers = watchers(audience, TURN_S)
            songs = threading.Thread(target=add_songs, args=(operator, song))
            songs.start()
            watched.append(late_ms(operator, TURN_S))
            taken += int(viewers.communicate()[0])
            songs.join()
        program.send_signal(signal.SIGINT)
        program.wait(30)
        ratio = max(watched) / max(alone)
        print(f"latest control cycle, ms: nobody watches {[round(ms, 2) for ms in alone]},"
              f" {VIEWERS} viewers and a queue of songs {[round(ms, 2) for ms in watched]},"
              f" worst against worst {ratio:.2f}; {taken / 1e6:.0f} MB were watched")
        sys.exit(0 if ratio <= 2 else 1)


if __name__ == "__main__":
    main()
