"""The dance in a real browser, without a server of ours:
`python3 tests/browser/web.py FOLDER PROGRAM ROWS [PICTURES]`.

FOLDER is what packaging/web.sh has built; it is served as files, no more. PROGRAM is
servodance and ROWS the example `rows` of the crate `servodance-web`: what they compute
with this machine's own instructions is what the browser must show. With a folder for
PICTURES the page's looks and the figures (web.json) are kept there.
"""

import array
import base64
import functools
import http.server
import io
import json
import math
import os
import struct
import subprocess
import sys
import tempfile
import threading
import time
import zipfile

from chromium import Chromium

FOLDER, PROGRAM, ROWS = (os.path.abspath(path) for path in sys.argv[1:4])
PICTURES = os.path.abspath(sys.argv[4]) if len(sys.argv) > 4 else None
SEED = 1
# Metres and radians: what frames may differ by.
MOST = 1e-4
# Numbers of a music row (web/src/studio.rs): what is heard, then 22 points.
HEARD, POINTS = 8 + 35, 3 * 22
ROW = HEARD + POINTS
# Features are of the size of 1.
FEATURES_MOST = 1e-3
MOST_BYTES = 15_000_000
STATE = "document.getElementById('state').textContent"
ERROR = "document.getElementById('error').textContent"
DANCE = "servodance.dance()"
CANVAS = "(() => { const r = document.getElementById('scene').getBoundingClientRect();" \
         " return {x: r.x, y: r.y, width: r.width, height: r.height}; })()"


def check(fact, name):
    if not fact:
        raise SystemExit(f"FAILED: {name}")
    print(f"ok: {name}", flush=True)


class Files(http.server.SimpleHTTPRequestHandler):
    extensions_map = {**http.server.SimpleHTTPRequestHandler.extensions_map,
                      ".wasm": "application/wasm", ".js": "text/javascript"}
    asked = []

    def log_message(self, *_):
        self.asked.append(self.path)


def serve(folder):
    handler = functools.partial(Files, directory=folder)
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return f"http://127.0.0.1:{server.server_address[1]}/"


def picture(browser, name, whole=False):
    if PICTURES:
        os.makedirs(PICTURES, exist_ok=True)
        browser.screenshot(os.path.join(PICTURES, name), whole)


def numbers_of_page(browser, rows):
    """All numbers of the dance's rows, as the page holds them."""
    text = browser.ask(
        f"(() => {{ const rows = {DANCE}.{rows}.all(); const width = rows[0].length;"
        " const all = new Float32Array(rows.length * width);"
        " rows.forEach((row, n) => all.set(row, n * width));"
        " return new Promise((done) => { const reader = new FileReader();"
        " reader.onload = () => done(reader.result.split(',')[1]);"
        " reader.readAsDataURL(new Blob([all])); }); })()")
    return array.array("f", base64.b64decode(text))


def numbers_of_file(path):
    with open(path, "rb") as file:
        return array.array("f", file.read())


def positions_of_npz(path):
    """The array `positions` as numbers, one after another."""
    with zipfile.ZipFile(path) as archive:
        file = io.BytesIO(archive.read("positions.npy"))
    file.seek(8)
    (header,) = struct.unpack("<H", file.read(2))
    described = file.read(header).decode()
    check("'<f4'" in described and "'fortran_order': False" in described, "positions are f32")
    return array.array("f", file.read())


def columns(music, first, end):
    """Those columns of the music rows, one after another."""
    rows = (music[at + first:at + end] for at in range(0, len(music), ROW))
    return array.array("f", (number for row in rows for number in row))


def points(music):
    return columns(music, HEARD, ROW)


def features(music):
    return columns(music, HEARD - 35, HEARD)


def gap(ours, theirs):
    """The largest difference, and how many numbers have other bits."""
    pairs = list(zip(ours, theirs))
    return max(abs(a - b) for a, b in pairs), sum(a != b for a, b in pairs)


def built_in_song(browser, address, figures):
    browser.open(address, 1280, 800)
    browser.wait_for(f"{STATE} === 'ready'")
    picture(browser, "ready.png")
    browser.click("#built-in")
    browser.wait_for(f"{STATE} === 'dancing'")
    browser.wait_for("parseFloat(document.getElementById('clock').textContent) > 8")
    seen = browser.screenshot(clip=browser.ask(CANVAS))
    time.sleep(0.5)
    check(browser.screenshot(clip=browser.ask(CANVAS)) != seen, "the robot moves")
    picture(browser, "desk.png")
    browser.wait_for(f"{DANCE}.whole")
    heard_s, spent_s = browser.ask(f"[{DANCE}.heard_s, {DANCE}.spent_s]")
    figures["song_s"], figures["computed_s"] = round(heard_s, 2), round(spent_s, 2)
    figures["real_time_factor"] = round(heard_s / spent_s, 2)
    figures["frames_a_second"] = round(20 * heard_s / spent_s, 1)
    print(f"{heard_s:.1f} s of music in {spent_s:.2f} s: {heard_s / spent_s:.1f} times real time")
    check("real time" in browser.ask("document.getElementById('speed').textContent"),
          "the page says how fast it is")
    before = browser.ask("parseFloat(document.getElementById('clock').textContent)")
    browser.click("#play")
    browser.wait_for(f"{STATE} === 'pause'")
    browser.ask("(() => { const t = document.getElementById('time'); t.value = 20;"
                " t.dispatchEvent(new Event('input')); })()")
    browser.wait_for("document.getElementById('clock').textContent.startsWith('20.0 ')")
    check(before > 8, "it pauses, and goes where the slider is")


def native_rows(folder, weights, robot, style, *heard):
    """Music rows and robot rows as this machine's own instructions compute them."""
    out = os.path.join(folder, "native")
    subprocess.run([ROWS, weights, robot, style, str(SEED), out, *heard], check=True)
    return numbers_of_file(f"{out}.music"), numbers_of_file(f"{out}.robot")


def same_frames(browser, folder, figures):
    """The page's numbers beside those of the same code built natively, and of the program."""
    weights = os.path.join(FOLDER, "weights.safetensors")
    style = browser.ask("document.getElementById('style').value")
    robot = browser.ask("document.getElementById('robot').value")
    music, rows = (numbers_of_page(browser, kind) for kind in ("music", "robot"))
    heard = os.path.join(folder, "heard")
    with open(heard, "wb") as file:
        file.write(music.tobytes())

    native, native_robot = native_rows(folder, weights, robot, style, heard)
    check(len(music) == len(native) > 0, f"from what is heard, as many frames: {len(music) // ROW}")
    far_m, other = gap(points(music), points(native))
    figures["frames"] = len(music) // ROW
    figures["dancer"] = {"far_m": far_m, "numbers": len(points(music)), "other_bits": other}
    check(far_m <= MOST, f"the same dancer: {far_m:.2g} m apart, {other} numbers with other bits")
    check(len(rows) == len(native_robot) > 0, "as many rows of the robot")
    far, other = gap(rows, native_robot)
    figures["robot"] = {"far_m_or_rad": far, "numbers": len(rows), "other_bits": other}
    check(far <= MOST, f"the same robot: {far:.2g} m or rad apart, {other} numbers with other bits")

    # From the sound on: resampler and FFT use other instructions here, so features differ
    # by rounding, until a draw between two codes falls to the other side.
    native, _ = native_rows(folder, weights, robot, style)
    figures["features_far"] = gap(features(music), features(native))[0]
    check(figures["features_far"] <= FEATURES_MOST, f"the same features within {figures['features_far']:.2g}")
    motion = os.path.join(folder, "native.npz")
    subprocess.run([PROGRAM, "generate", "--seed", str(SEED), "--style", style, "--model", weights,
                    "--quiet", "--out", motion], check=True)
    theirs, ours = positions_of_npz(motion), points(music)
    check(len(ours) == len(theirs), "as many frames as the program makes of the song")
    apart = (n // POINTS for n, (a, b) in enumerate(zip(ours, theirs)) if abs(a - b) > MOST)
    figures["first_frame_apart"] = next(apart, None)
    print(f"from the sound on, the program's dance is the same up to frame {figures['first_frame_apart']}")
    check(gap(theirs, points(native))[0] <= MOST, "the crate's dance is the program's")


def wav(seconds, rate_hz):
    """A beat of 120 BPM as a 16-bit wav file."""
    samples = (math.exp(-12 * (t / rate_hz % 0.5)) * math.sin(440 * t / rate_hz)
               for t in range(int(seconds * rate_hz)))
    data = b"".join(struct.pack("<h", int(20_000 * sample)) for sample in samples)
    kind = struct.pack("<HHIIHH", 1, 1, rate_hz, 2 * rate_hz, 2, 16)
    return (b"RIFF" + struct.pack("<I", 36 + len(data)) + b"WAVEfmt " + struct.pack("<I", 16)
            + kind + b"data" + struct.pack("<I", len(data)) + data)


def drop(browser, name, content):
    """As if somebody had dropped a file on the page."""
    text = base64.b64encode(content).decode()
    browser.ask(
        f"fetch('data:application/octet-stream;base64,{text}').then((a) => a.arrayBuffer()).then((bytes) => {{"
        f" const files = new DataTransfer(); files.items.add(new File([bytes], {json.dumps(name)}));"
        " dispatchEvent(new DragEvent('drop', {dataTransfer: files, bubbles: true, cancelable: true})); })")


def a_file_of_ones_own(browser, folder):
    drop(browser, "beat.wav", wav(9, 22_050))
    browser.wait_for("document.getElementById('song-name').textContent === 'beat.wav'")
    browser.wait_for(f"{DANCE}.whole")
    frames = browser.ask(f"{DANCE}.music.all().length")
    check(abs(frames - 180) <= 2, f"a dropped file is danced to: {frames} frames")
    drop(browser, "words.txt", b"no sound at all")
    browser.wait_for(f"{ERROR}.includes('words.txt')")
    check("no sound file" in browser.ask(ERROR), "what is no sound is refused in one line")
    picture(browser, "refused.png")


def other_robots(browser):
    """Every robot dances, and each differently placed."""
    for robot in browser.ask("[...document.getElementById('robot').options].map((o) => o.value)"):
        browser.ask(f"(() => {{ const r = document.getElementById('robot'); r.value = {json.dumps(robot)};"
                    " r.dispatchEvent(new Event('change')); })()")
        browser.wait_for(f"{DANCE}.scene.robot === {json.dumps(robot)} && {DANCE}.whole")
        moved = browser.ask(
            f"(() => {{ const rows = {DANCE}.robot.all(), joints = 7 * {DANCE}.scene.links.length;"
            " const span = (n) => { const v = rows.map((r) => r[n]); return Math.max(...v) - Math.min(...v); };"
            " return Math.max(...Array.from({length: rows[0].length - joints}, (_, n) => span(joints + n))); })()")
        check(moved > 0.1, f"{robot} dances: a joint moves {moved:.2f} rad")
        browser.wait_for("parseFloat(document.getElementById('clock').textContent) > 2")
        picture(browser, f"robot-{robot}.png")


def microphone(browser):
    browser.click("#microphone")
    browser.wait_for(f"{STATE} === 'listening' && {DANCE}.heard_s > 3")
    heard_s, spent_s = browser.ask(f"[{DANCE}.heard_s, {DANCE}.spent_s]")
    check(spent_s < heard_s, f"it dances to a microphone as the sound comes: {heard_s:.1f} s")
    browser.click("#microphone")
    browser.wait_for(f"{STATE} === 'ready'")


def phone(browser, address):
    browser.open(address, 390, 844, mobile=True)
    browser.wait_for(f"{STATE} === 'ready'")
    browser.click("#built-in")
    browser.wait_for("parseFloat(document.getElementById('clock').textContent) > 4")
    check(browser.ask("document.documentElement.scrollWidth <= 390"), "it fits a phone")
    small = browser.ask("[...document.querySelectorAll('button, select, input')].filter(e => e.offsetParent"
                        " && e.getBoundingClientRect().height < 44).map(e => e.id || e.textContent)")
    check(small == [], f"what is pressed is 44 pixels high {small}")
    browser.ask("scrollTo(0, 0)")
    picture(browser, "phone.png")
    picture(browser, "phone-whole.png", whole=True)


def main():
    sizes = {name: os.path.getsize(os.path.join(FOLDER, name)) for name in sorted(os.listdir(FOLDER))}
    figures = {"bytes": sum(sizes.values()), "files": sizes}
    check(figures["bytes"] <= MOST_BYTES, f"the folder has {figures['bytes'] / 1e6:.2f} MB")
    address = serve(FOLDER)
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="web-") as folder:
        with Chromium(more=["--use-fake-device-for-media-stream",
                            "--use-fake-ui-for-media-stream"]) as browser:
            built_in_song(browser, address, figures)
            same_frames(browser, folder, figures)
            a_file_of_ones_own(browser, folder)
            other_robots(browser)
            microphone(browser)
            phone(browser, address)
            check(not browser.complaints, f"no console error {browser.complaints}")
    strange = [path for path in Files.asked if path.count("/") != 1]
    check(not strange, f"nothing is asked for but the folder's files {strange}")
    if PICTURES:
        with open(os.path.join(PICTURES, "web.json"), "w", encoding="utf-8") as file:
            json.dump(figures, file, indent=2)
    print(f"the dance works in a browser ({time.monotonic() - began:.0f} s)")


if __name__ == "__main__":
    main()
