"""The page in a real browser: `python3 tests/browser/show.py PROGRAM [PICTURES]`.

Judged by what the browser shows and by the simulated servos, which live in a
program of their own: the page loads without a console error, the robot moves,
the controls do what they say, stop turns every torque off, and a wrong token
gets nothing. With a folder for PICTURES the page's looks are kept there.
"""

import os
import re
import signal
import struct
import subprocess
import sys
import tempfile
import urllib.error
import urllib.request

from chromium import Chromium

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


def check(fact, name):
    if not fact:
        raise SystemExit(f"FAILED: {name}")
    print(f"ok: {name}", flush=True)


CANVAS = "(() => { const r = document.getElementById('scene').getBoundingClientRect();" \
         " return {x: r.x, y: r.y, width: r.width, height: r.height}; })()"
ACTIVITY = "document.getElementById('activity').textContent"
SAFETY = "document.getElementById('safety').textContent"
DEGREES = "[...document.querySelectorAll('.joint span:nth-of-type(1)')].map(e => e.textContent)"


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
    on, servos = torques(port)
    check((on, servos) == (0, 20), f"torque is off: {on} of {servos} have it")
    browser.wait_for("!document.getElementById('link').hidden")
    check(True, "the page says that the program is gone")
    browser.complaints.clear()  # it tried to connect again


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
    browser.wait_for(f"{ACTIVITY} === 'playing'")
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
    browser.click("#play")
    browser.wait_for(f"{clock} > 21")
    check(True, "it plays on")
    check(not browser.complaints, f"no console error {browser.complaints}")
    program.send_signal(signal.SIGINT)
    program.wait(30)


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
        servos, port = start(folder, "sim-bus", "--robot", "op3")
        try:
            for judge in (watch_and_stop, keyboard, strangers):
                with Chromium() as browser:
                    judge(browser, folder, port)
            with Chromium() as browser:
                replay(browser, folder)
            with Chromium() as browser:
                meshes(browser, folder)
        finally:
            servos.kill()
            servos.wait()
    print("the page works in a browser")


if __name__ == "__main__":
    main()
