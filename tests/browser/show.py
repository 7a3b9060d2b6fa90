"""The page in a real browser: `python3 tests/browser/show.py PROGRAM [PICTURES]`.

Judged by what the browser shows and by the simulated servos, which live in a
program of their own: the page loads without a console error, the robot moves,
the controls do what they say, stop turns every torque off, and a wrong token
gets nothing. With a folder for PICTURES the page's looks are kept there.
"""

import json
import os
import re
import signal
import struct
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
import wave

from chromium import Chromium
from silent_proxy import SilentProxy

PROGRAM = os.path.abspath(sys.argv[1])
PICTURES = os.path.abspath(sys.argv[2]) if len(sys.argv) > 2 else None


def start(folder, *arguments):
    """A running program and the first line that it says."""
    process = subprocess.Popen(
        [PROGRAM, *arguments], cwd=folder, stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )
    line = process.stdout.readline().strip()
    if not line:
        raise SystemExit(f"{arguments}: {process.stderr.read()}")
    return process, line


def torques(port):
    """How many servos have torque, and how many there are, as they say."""
    scan = subprocess.run([PROGRAM, "scan", port, "--baud", "2000000"],
                          capture_output=True, text=True, check=True)
    return len(re.findall("torque ON", scan.stdout)), len(re.findall("torque", scan.stdout))


def picture(browser, name, whole=False):
    if PICTURES:
        os.makedirs(PICTURES, exist_ok=True)
        browser.screenshot(os.path.join(PICTURES, name), whole)


def check_quietly(fact, name):
    if not fact:
        raise SystemExit(f"FAILED: {name}")


def check(fact, name):
    check_quietly(fact, name)
    print(f"ok: {name}", flush=True)


CANVAS = "(() => { const r = document.getElementById('scene').getBoundingClientRect();" \
         " return {x: r.x, y: r.y, width: r.width, height: r.height}; })()"
ACTIVITY = "document.getElementById('activity').textContent"
SAFETY = "document.getElementById('safety').textContent"
DEGREES = "[...document.querySelectorAll('.joint span:nth-of-type(1)')].map(e => e.textContent)"


# A browser that hears a file, and asks nobody for leave.
HEARS = ["--use-fake-device-for-media-stream", "--use-fake-ui-for-media-stream"]
REASONS = {"end of range", "top speed", "balance", "collision", "torque", "heat", "low voltage"}


def dance(folder, port):
    return start(folder, "dance", "--bus", f"serial:{port}", "--robot", "patient.toml",
                 "--no-picture", "--quiet", "--view")


def patient(folder):
    """The built-in robot, patient with replies and with silence on a busy machine."""
    configs = os.path.join(os.path.dirname(__file__), "..", "..", "configs")
    for name in ("op3.toml", "op3.urdf"):
        with open(os.path.join(configs, name), encoding="utf-8") as file:
            text = file.read()
        text = text.replace("[bus]\n", "[bus]\nreply_timeout_ms = 500.0\nwatchdog_ms = 2000\n", 1)
        name = name.replace("op3.toml", "patient.toml")
        with open(os.path.join(folder, name), "w", encoding="utf-8") as file:
            file.write(text)


def watch_and_stop(browser, folder, port):
    program, address = dance(folder, port)
    browser.open(address, 1440, 900)
    browser.wait_for(f"{ACTIVITY} === 'dancing'")
    before, seen = browser.ask(DEGREES), browser.screenshot(clip=browser.ask(CANVAS))
    check(len(before) == 20, "every joint has its track")
    browser.wait_for(f"{DEGREES}.filter((d, i) => d !== {before}[i]).length > 10")
    check(browser.screenshot(clip=browser.ask(CANVAS)) != seen, "the robot moves")
    browser.wait_for("document.querySelectorAll('.joint i:not(:empty)').length > 0")
    reasons = browser.ask("[...document.querySelectorAll('.joint i:not(:empty)')].map(e => e.textContent)")
    check(set(reasons) <= REASONS, f"joints that are held back say why {reasons}")
    picture(browser, "desk.png")

    browser.click("[data-do=hold]")
    browser.wait_for(f"{SAFETY} === 'holding'")
    browser.click("[data-do=resume]")
    browser.wait_for(f"{SAFETY} === 'running'")
    check(True, "hold holds and resume resumes")
    browser.ask("(() => { const a = document.getElementById('amplitude'); a.value = 40;"
                " a.dispatchEvent(new Event('input')); })()")
    browser.wait_for("document.getElementById('amplitude-now').textContent === '40 %'")
    check(True, "amplitude goes where the slider is")

    browser.open(address, 390, 844, mobile=True)
    browser.wait_for(f"{ACTIVITY} === 'dancing'")
    check(browser.ask("document.documentElement.scrollWidth <= 390"), "it fits a phone")
    picture(browser, "phone.png")
    picture(browser, "phone-whole.png", whole=True)

    check(not browser.complaints, f"no console error {browser.complaints}")
    browser.click("#estop")
    error = program.stderr.read()
    check(program.wait(30) == 1 and "emergency stop (the page)" in error, "stop stops")
    browser.wait_for(f"{STOP} === 'STOPPED'")
    on, servos = torques(port)
    check((on, servos) == (0, 20), f"torque is off as the page says: {on} of {servos} have it")
    browser.wait_for("!document.getElementById('link').hidden")
    check(True, "the page says that the program is gone")
    browser.complaints.clear()  # it tried to connect again


STOP = "document.getElementById('estop').firstChild.textContent"
NEWS = "document.getElementById('link').textContent"
SILENT_S = 10


def silent_network(browser, folder, port):
    """STOP is pressed while the network is silent: it is not lost, and nothing is made up."""
    program, address = dance(folder, port)
    parts = address.split("/")
    proxy = SilentProxy(int(parts[2].split(":")[1]))
    parts[2] = f"127.0.0.1:{proxy.port}"
    browser.open("/".join(parts), 1440, 900)
    browser.wait_for(f"{ACTIVITY} === 'dancing'")
    proxy.fall_silent()
    began = time.monotonic()
    browser.wait_for("document.body.classList.contains('silent')")
    check(time.monotonic() - began < 1.5, "the page turns grey when nothing comes")
    browser.click("#estop")
    browser.wait_for(f"{STOP} === 'NOT CONFIRMED'")
    picture(browser, "not-confirmed.png")
    while time.monotonic() - began < SILENT_S:
        words = browser.ask(f"{STOP} + ', ' + {NEWS}")
        check_quietly(re.fullmatch(r"NOT CONFIRMED, no news for [0-9.]+ s", words), words)
        check_quietly(program.poll() is None, "the program goes on: nobody told it to stop")
        time.sleep(0.2)
    check(float(words.split()[-2]) > SILENT_S - 2, "it says for how long, and that nothing is confirmed")
    proxy.speak()
    browser.wait_for(f"{STOP} === 'STOPPED'")
    check(torques(port) == (0, 20) if program.wait(30) == 1 else False,
          "the network is back: the robot stops, the page reads STOPPED, and torque is off")
    check("emergency stop (the page)" in program.stderr.read(), "it was this stop")
    picture(browser, "stopped.png")
    browser.complaints.clear()  # the browser tells of lines that were given up


def space_on_a_button(browser, folder, port):
    program, address = dance(folder, port)
    browser.open(address, 1440, 900)
    browser.wait_for(f"{ACTIVITY} === 'dancing'")
    browser.ask("document.querySelector('[data-do=hold]').focus()")
    browser.key(" ", 32)
    browser.wait_for(f"{SAFETY} === 'holding'")
    check(browser.ask(STOP) == "STOP" and program.poll() is None,
          "the space bar presses the button that has the focus, not STOP")
    browser.ask("document.activeElement.blur()")
    browser.key(" ", 32)
    check(program.wait(30) == 1, "elsewhere the space bar stops")


OFF_MS = "document.querySelector('#sound output').dataset.offMs"
SOUND_S = 12


def sound(browser, folder, port):
    """The page plays the song; by its audio clock it is where the robot is."""
    program, address = start(folder, "dance", "--no-picture", "--quiet", "--view")
    browser.open(address, 1440, 900)
    browser.wait_for("!document.getElementById('sound').hidden")
    browser.click("#legend")
    browser.wait_for(f"{OFF_MS} !== undefined")
    off_ms, late_ms, began = [], 0, time.monotonic()
    while time.monotonic() - began < SOUND_S:
        value = browser.ask(OFF_MS)
        late_ms = max(late_ms, browser.ask("fetch('api/state').then(a => a.json()).then(f => f.late_ms)"))
        if value is not None:
            off_ms.append(abs(float(value)))
        time.sleep(0.1)
    off_ms.sort()
    median, p99 = off_ms[len(off_ms) // 2], off_ms[int(0.99 * len(off_ms))]
    print(f"sound and robot apart: median {median:.1f} ms, p99 {p99:.1f} ms of {len(off_ms)} looks;"
          f" the robot itself was late by up to {late_ms:.0f} ms")
    # A robot that stalls on a busy machine falls behind by that much, and makes up for it slowly.
    check(len(off_ms) > 30 and median <= 15 + late_ms / 4 and p99 <= 40 + late_ms,
          "the sound is where the robot is")
    check(not browser.complaints, f"no console error {browser.complaints}")
    browser.click("#estop")
    browser.wait_for(f"{OFF_MS} === undefined")
    check(program.wait(30) == 1, "after STOP it is silent")


DROP = """(async (samples) => {
  const view = new DataView(new ArrayBuffer(44 + 2 * samples));
  const text = (at, word) => [...word].forEach((c, i) => view.setUint8(at + i, c.charCodeAt(0)));
  text(0, "RIFF"); view.setUint32(4, 36 + 2 * samples, true); text(8, "WAVEfmt ");
  view.setUint32(16, 16, true); view.setUint16(20, 1, true); view.setUint16(22, 1, true);
  view.setUint32(24, 16000, true); view.setUint32(28, 32000, true);
  view.setUint16(32, 2, true); view.setUint16(34, 16, true);
  text(36, "data"); view.setUint32(40, 2 * samples, true);
  for (let i = 0; i < samples; i++) view.setInt16(44 + 2 * i, i % 8000 < 800 ? 9000 * Math.sin(i / 9) : 0, true);
  const files = new DataTransfer();
  files.items.add(new File([view.buffer], "dropped.wav"));
  const drop = new DragEvent("drop", { dataTransfer: files, bubbles: true, cancelable: true });
  document.body.dispatchEvent(drop);
})(96000)"""


# The song that is dropped has 6 s.
FIRST_S = 8


def drop_a_song(browser, folder, port):
    """A file that is dropped on the page is danced next, with its own sound."""
    subprocess.run([PROGRAM, "song", "--out", "song.wav"], cwd=folder, check=True,
                   stdout=subprocess.DEVNULL)
    with wave.open(os.path.join(folder, "song.wav")) as song, \
            wave.open(os.path.join(folder, "first.wav"), "wb") as first:
        first.setparams(song.getparams())
        first.writeframes(song.readframes(FIRST_S * song.getframerate()))
    program, address = start(folder, "dance", "first.wav", "--no-picture", "--quiet", "--view",
                             "--report", "dropped.json")
    browser.open(address, 1440, 900)
    browser.wait_for(f"{ACTIVITY} === 'dancing'")
    browser.click("#legend")
    browser.ask(DROP)
    browser.wait_for("document.querySelector('#songs output').textContent === 'next: dropped.wav'")
    picture(browser, "next-song.png")
    browser.wait_for("fetch('api/state').then(a => a.json()).then(f => f.song === 1)")
    browser.wait_for(f"{OFF_MS} !== undefined")
    check(program.wait(60) == 0, "a song that is dropped is danced next, and is heard")
    with open(os.path.join(folder, "dropped.json"), encoding="utf-8") as file:
        check(json.load(file)["audio_s"] == 6, "the report is about the song that was dropped")
    check(not browser.complaints, f"no console error {browser.complaints}")


def audience(browser, folder, port):
    """The audience's link shows the dance and has no buttons; its requests are refused."""
    program, _ = dance(folder, port)
    address = program.stdout.readline().split(": ", 1)[1].strip()
    browser.open(address, 390, 844, mobile=True)
    browser.wait_for(f"{ACTIVITY} === 'dancing'")
    shown = browser.ask("['controls', 'stopping', 'links'].filter(i => !document.getElementById(i).hidden)")
    check(shown == [], f"no button that commands {shown}")
    browser.key("Escape", 27)
    refused = browser.ask("fetch('api/command', {method: 'POST', body: '{\"do\":\"estop\"}',"
                          " headers: {'Content-Type': 'application/json'}}).then(a => a.status)")
    check(refused == 403 and program.poll() is None, "the audience cannot stop")
    picture(browser, "audience.png")
    program.send_signal(signal.SIGINT)
    check(program.wait(30) == 130, "it danced on until Ctrl-C")


def large(browser, folder, port):
    program, address = dance(folder, port)
    browser.open(address, 2560, 1440)
    browser.wait_for(f"{ACTIVITY} === 'dancing'")
    browser.wait_for(f"!document.getElementById('links').hidden")
    wide = browser.ask("document.getElementById('scene').getBoundingClientRect().width")
    check(wide > 1200, f"a large screen is used: {wide} pixels of stage")
    small = browser.ask("[...document.querySelectorAll('button, select, input')].filter(e => e.offsetParent"
                        " && e.getBoundingClientRect().height < 44).map(e => e.id || e.textContent)")
    check(small == [], f"what is pressed is 44 pixels high {small}")
    picture(browser, "large.png")
    browser.open(address, 1280, 800)
    browser.wait_for(f"{ACTIVITY} === 'dancing'")
    picture(browser, "laptop.png", whole=True)
    program.send_signal(signal.SIGINT)
    program.wait(30)
    browser.complaints.clear()


def first_minute(browser, folder):
    """One command without arguments: a page that dances once it is open."""
    environment = {key: value for key, value in os.environ.items() if "DISPLAY" not in key}
    program = subprocess.Popen([PROGRAM], cwd=folder, stdin=subprocess.DEVNULL, env=environment,
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    address = program.stdout.readline().strip()
    browser.open(address, 1440, 900)
    browser.wait_for(f"{ACTIVITY} === 'dancing'")
    check(not browser.complaints, f"no console error {browser.complaints}")
    picture(browser, "first-minute.png")
    program.send_signal(signal.SIGINT)
    program.wait(60)
    lines = 1 + len((program.stdout.read() + program.stderr.read()).splitlines())
    check(program.returncode == 130 and lines <= 12, f"it dances, and says {lines} lines")
    browser.complaints.clear()


def keyboard(browser, folder, port):
    program, address = dance(folder, port)
    browser.open(address, 1440, 900)
    browser.wait_for(f"{ACTIVITY} === 'dancing'")
    browser.key("Escape", 27)
    check(program.wait(30) == 1, "the escape key stops")
    check(torques(port) == (0, 20), "torque is off again")


def strangers(browser, folder, port):
    program, address = dance(folder, port)
    token = address.split("/")[3]
    wrong = address.replace(token, token[::-1])
    for path in ("", "main.js", "api/scene", "api/state"):
        try:
            urllib.request.urlopen(wrong + path)
            check(False, f"a wrong token gets {path}")
        except urllib.error.HTTPError as error:
            check(error.code == 404 and error.read() == b"", f"a wrong token gets nothing /{path}")
    browser.open(wrong, 800, 600)
    browser.wait_for("document.readyState === 'complete'")
    check(browser.ask("document.getElementById('scene') === null"), "a wrong token shows nothing")
    # Another page knows the address and tries to stop the robot from outside.
    browser.do("Page.navigate", url="data:text/html,<title>foreign</title>")
    browser.wait_for("document.title === 'foreign'")
    refused = browser.ask(
        f"new Promise(done => {{ const s = new WebSocket('{address}api/live'.replace('http', 'ws'));"
        " s.onopen = () => done(false); s.onerror = () => done(true); })")
    check(refused, "a foreign page cannot connect")
    program.send_signal(signal.SIGINT)
    check(program.wait(30) == 130, "it went on until Ctrl-C")
    browser.complaints.clear()


def replay(browser, folder):
    subprocess.run([PROGRAM, "dance", "--record", "out.mcap", "--no-picture", "--quiet"],
                   cwd=folder, check=True)
    program, address = start(folder, "play", "out.mcap", "--view")
    browser.open(address, 1440, 900)
    browser.wait_for(f"{ACTIVITY} === 'recording'")
    clock = "parseFloat(document.getElementById('clock').textContent)"
    browser.click("#play")
    browser.ask("(() => { const t = document.getElementById('time'); t.value = 20;"
                " t.dispatchEvent(new Event('input')); })()")
    browser.wait_for(f"Math.abs({clock} - 20) < 0.2")
    check(True, "the slider goes to its moment")
    heat = "document.querySelector('.joint span:nth-of-type(2)').textContent"
    browser.wait_for(f"/[0-9]/.test({heat})")
    check(True, "a recording shows how warm servos were")
    loud = "(() => { const c = document.getElementById('spectrum');" \
           " return c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some(v => v > 0); })()"
    browser.wait_for(loud)
    check(True, "a recording shows its spectrum")
    browser.wait_for("document.getElementById('log').textContent.includes('torque is on')")
    check(True, "a recording shows what the safety layer did")
    picture(browser, "replay.png")
    check(not browser.ask("document.getElementById('sound').hidden"), "a recording has its song")
    browser.click("#play")
    browser.wait_for(f"{clock} > 21")
    check(True, "it plays on")
    check(not browser.complaints, f"no console error {browser.complaints}")
    program.send_signal(signal.SIGINT)
    program.wait(30)


def browser_microphone(browser, folder):
    """What the browser hears is danced next; closing the microphone ends it."""
    program, address = start(folder, "dance", "--robot", "neck", "--view", "--wait-for-start",
                             "--no-picture", "--quiet")
    browser.open(address, 1440, 900)
    browser.wait_for(f"{ACTIVITY} === 'ready to start'")
    browser.click("#microphone")
    browser.wait_for("document.querySelector('#songs output').textContent === 'next: microphone'")
    browser.click("[data-do=start]")
    browser.wait_for(f"{ACTIVITY} === 'dancing'")
    browser.wait_for("document.getElementById('presence').textContent === 'music'")
    check(True, "it dances to what the browser hears")
    check(browser.ask("document.getElementById('sound').hidden"), "what is heard is not played back")
    browser.click("#microphone")
    browser.wait_for(f"{ACTIVITY} === 'ready to start'")
    check(not browser.complaints, f"no console error {browser.complaints}")
    program.send_signal(signal.SIGINT)
    check(program.wait(30) == 130, "closing the microphone ends the dance")
    browser.complaints.clear()


def cube_stl(edge):
    """A cube as binary STL, around its centre."""
    corners = [[(i >> axis & 1) - 0.5 for axis in range(3)] for i in range(8)]
    sides = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    triangles = [t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))]
    text = b" " * 80 + struct.pack("<I", len(triangles))
    for triangle in triangles:
        text += bytes(12) + b"".join(
            struct.pack("<3f", *(edge * part for part in corners[i])) for i in triangle) + bytes(2)
    return text


def meshes(browser, folder):
    """A neck whose head is a mesh, and whose base would be one that is not there."""
    configs = os.path.join(os.path.dirname(__file__), "..", "..", "configs")
    for name in ("neck.toml", "neck.urdf"):
        with open(os.path.join(configs, name), encoding="utf-8") as file:
            text = file.read()
        text = text.replace("[bus]\n", "[bus]\nreply_timeout_ms = 500.0\nwatchdog_ms = 2000\n", 1)
        for shape, mesh in (('<box size="0.09 0.1 0.08"/>', "head.stl"),
                            ('<cylinder radius="0.05" length="0.04"/>', "gone.stl")):
            text = text.replace(shape, f'<mesh filename="{mesh}" scale="0.001 0.001 0.0015"/>')
        with open(os.path.join(folder, name), "w", encoding="utf-8") as file:
            file.write(text)
    with open(os.path.join(folder, "head.stl"), "wb") as file:
        file.write(cube_stl(80.0))
    program, address = start(folder, "dance", "--robot", "neck.toml", "--view", "--no-picture",
                             "--quiet")
    browser.open(address, 1440, 900)
    browser.wait_for(f"{ACTIVITY} === 'dancing'")
    browser.wait_for("performance.getEntriesByType('resource').some("
                     "e => e.name.endsWith('api/mesh/0') && e.responseStatus === 200)")
    check(True, "the page fetches the mesh")
    picture(browser, "mesh.png")
    check(not browser.complaints, f"no console error {browser.complaints}")
    program.send_signal(signal.SIGINT)
    error = program.communicate(timeout=30)[1]
    check(error.count("gone.stl: there is no such file") == 1, "a missing mesh is said once")


def main():
    with tempfile.TemporaryDirectory(prefix="show-") as folder:
        patient(folder)
        for judge in (watch_and_stop, silent_network, space_on_a_button, sound, drop_a_song, audience,
                      large, keyboard, strangers):
            # Servos of its own: after a stop a joint may have swung beyond its limit.
            servos, port = start(folder, "sim-bus", "--robot", "op3")
            try:
                with Chromium() as browser:
                    judge(browser, folder, port)
            finally:
                servos.kill()
                servos.wait()
        song = os.path.join(folder, "song.wav")
        with Chromium(more=[*HEARS, f"--use-file-for-fake-audio-capture={song}"]) as browser:
            browser_microphone(browser, folder)
        for judge in (first_minute, replay, meshes):
            with Chromium() as browser:
                judge(browser, folder)
    print("the page works in a browser")


if __name__ == "__main__":
    main()
