"""The page of a whole stage: `python3 tests/browser/whole_stage.py PROGRAM [PICTURES]`.

A leader and three robots, each a program of its own on simulated servos. All of them are on
one page, which draws often enough by software; cues that are pressed reach their robot, are
saved as a show, and come again at their moments when the show is played. STOP turns torque off
on all of them, and does not say so while one has not confirmed it.
"""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
import tomllib
import urllib.error
import urllib.request
import wave

from chromium import Chromium

PROGRAM = os.path.abspath(sys.argv[1])
PICTURES = os.path.abspath(sys.argv[2]) if len(sys.argv) > 2 else None
ROBOTS = ("op3", "torso13", "neck")
AIM_PICTURES = 12
MUSIC = "parseFloat(document.getElementById('clock').textContent)"
PICTURES_A_SECOND = "Number(document.getElementById('scene').dataset.pictures)"


def check(fact, name):
    if not fact:
        raise SystemExit(f"FAILED: {name}")
    print(f"ok: {name}", flush=True)


def picture(browser, address, name, width, height, mobile=False):
    if PICTURES:
        os.makedirs(PICTURES, exist_ok=True)
        browser.open(address, width, height, mobile)
        browser.wait_for(f"document.getElementById('scene').dataset.robots === '{len(ROBOTS)}'")
        time.sleep(1)
        browser.screenshot(os.path.join(PICTURES, name), whole=mobile)


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return listener.getsockname()[1]


class Stage:
    """Programs on one address; all of them end with it."""

    def __init__(self, folder):
        self.folder, self.programs, self.robots = folder, [], {}
        self.at = f"tcp/127.0.0.1:{free_port()}"

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for program in self.programs:
            if program.poll() is None:
                program.send_signal(signal.SIGINT)
        for program in self.programs:
            try:
                program.wait(30)
            except subprocess.TimeoutExpired:
                program.kill()

    def start(self, *arguments):
        program = subprocess.Popen([PROGRAM, *arguments], cwd=self.folder, text=True,
                                   stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                   stderr=subprocess.DEVNULL)
        self.programs.append(program)
        return program

    def lead(self, *arguments):
        """A leader with its page: the program and the operator's and the audience's links."""
        program = self.start("lead", "--quiet", "--view", "--listen", self.at, *arguments)
        lines = [program.stdout.readline() for _ in range(2)]
        links = [re.search(r"http://\S+", line) for line in lines]
        check(all(links), "the leader says where its page is")
        return program, *[link.group() for link in links]


def state(address):
    with urllib.request.urlopen(address + "api/state") as answer:
        return json.load(answer)


def post(address, request):
    """The status of a command."""
    asked = urllib.request.Request(address + "api/command", json.dumps(request).encode(),
                                   {"Content-Type": "application/json"})
    try:
        return urllib.request.urlopen(asked).status
    except urllib.error.HTTPError as error:
        return error.code


def long_song(folder):
    """The built-in song six times: time for a busy machine."""
    subprocess.run([PROGRAM, "song", "--out", "song.wav"], cwd=folder, check=True,
                   stdout=subprocess.DEVNULL)
    with wave.open(os.path.join(folder, "song.wav")) as song, \
            wave.open(os.path.join(folder, "long.wav"), "wb") as long:
        long.setparams(song.getparams())
        long.writeframes(6 * song.readframes(song.getnframes()))


def watch_and_cue(browser, stage):
    """All robots on one page, and cues; the show that was saved."""
    program, address, audience = stage.lead("long.wav")
    for robot in ROBOTS:
        record = ["--record", "followed.mcap"] if robot == "neck" else []
        stage.robots[robot] = stage.start(
            "follow", "--robot", robot, "--connect", stage.at, "--quiet", *record)
    browser.open(address, 1280, 800)
    browser.wait_for(f"document.getElementById('scene').dataset.robots === '{len(ROBOTS)}'")
    check(True, f"{len(ROBOTS)} robots of a stage are on one page")
    browser.wait_for(f"{MUSIC} > 2")
    drawn = []
    for _ in range(10):
        drawn.append(browser.ask(PICTURES_A_SECOND))
        time.sleep(0.5)
    drawn.sort()
    print(f"pictures a second, drawn by software: median {drawn[5]}, least {drawn[0]} (aim {AIM_PICTURES})")
    browser.wait_for("[...document.querySelectorAll('.card .state')].filter("
                     "e => / ms late/.test(e.textContent)).length === 3")
    check(True, "each robot's card says how late it is")
    browser.click("[data-follower=torso13] button")
    browser.wait_for("document.querySelector('[data-follower=torso13] button')"
                     ".getAttribute('aria-pressed') === 'true'")
    browser.wait_for("document.querySelectorAll('#cue-list li').length === 1")
    roles = {robot["name"]: robot["mirror"] for robot in state(address)["robots"]}
    check(roles == {"op3": None, "torso13": True, "neck": None}, f"a cue reaches its robot {roles}")
    check(post(audience, {"cue": {"follower": "all", "mirror": True}}) == 403,
          "the audience gives no cues")
    later_s = state(address)["music_s"] + 4
    check(post(address, {"cue": {"follower": "all", "amplitude": 0.5, "at_s": later_s}}) == 202,
          "a cue can be given for later")
    check(post(address, {"cue": {"follower": "all", "style": "polka"}}) == 400,
          "a style that there is not is refused")
    browser.wait_for("document.querySelectorAll('#cue-list li').length === 2")
    check(all(robot["amplitude"] is None for robot in state(address)["robots"]),
          "a later cue waits")
    while state(address)["music_s"] < later_s + 0.3:
        time.sleep(0.05)
    amplitudes = [robot["amplitude"] for robot in state(address)["robots"]]
    check(amplitudes == [0.5] * len(ROBOTS), f"a later cue comes {amplitudes}")
    check(not browser.complaints, f"no console error {browser.complaints}")
    until = time.monotonic() + 60
    while not state(address)["outline"] and time.monotonic() < until:
        time.sleep(0.2)  # the song is heard once, behind all else
    show = urllib.request.urlopen(address + "api/show").read().decode()
    for shot in (("stage-desk.png", 1280, 800), ("stage-large.png", 2560, 1440),
                 ("stage-phone.png", 390, 844, True)):
        picture(browser, address, *shot)
    browser.open(address, 1280, 800)
    browser.wait_for(f"{MUSIC} > 2")
    browser.click("#end")
    check(program.wait(30) == 0, "the page ends the dance")
    browser.complaints.clear()  # it tried to connect again
    return show


def play_again(stage, show):
    """The cues of the saved show come again at their moments."""
    written = tomllib.loads(show)
    cues = written["cue"]
    check([cue["follower"] for cue in cues] == ["torso13", "all"], "the show has its cues")
    check(len(written["bars_s"]) > 5 and written["section"], "the show has bars and sections")
    with open(os.path.join(stage.folder, "show.toml"), "w", encoding="utf-8") as file:
        file.write(show)
    _, address, _ = stage.lead("--show", "show.toml")
    came = {}
    while len(came) < 2:
        now = state(address)
        for robot in now["robots"]:
            if robot["name"] == "torso13" and robot["mirror"]:
                came.setdefault("torso13", now["music_s"])
            if robot["amplitude"] == 0.5:
                came.setdefault("all", now["music_s"])
        check_late = (now["music_s"] or 0) < cues[1]["at_s"] + 5
        if not check_late:
            raise SystemExit(f"FAILED: the cues of the show do not come: {came}")
        time.sleep(0.02)
    late_s = [came[cue["follower"]] - cue["at_s"] for cue in cues]
    check(all(0 <= late <= 0.5 for late in late_s), f"the cues come at their moments {late_s}")
    return address


def stop_all(browser, stage, address):
    """STOP for every robot, one of which hears nothing for a while."""
    browser.open(address, 1280, 800)
    browser.wait_for(f"document.getElementById('scene').dataset.robots === '{len(ROBOTS)}'")
    text = "document.getElementById('estop').textContent"
    browser.wait_for(f"{text}.startsWith('STOPtorque')")
    stage.robots["op3"].send_signal(signal.SIGSTOP)
    browser.click("#estop")
    browser.wait_for(f"{text}.includes('use the power switch: op3')")
    stopped = {robot["name"]: robot.get("stopped") for robot in state(address)["robots"]}
    stage.robots["op3"].send_signal(signal.SIGCONT)
    check(True, "a robot that does not answer is named: STOP is not confirmed")
    check(stopped["torso13"] and stopped["neck"], f"the others have turned torque off {stopped}")
    browser.wait_for(f"{text}.startsWith('STOPPED')")
    stopped = {robot["name"]: robot.get("stopped") for robot in state(address)["robots"]}
    check(all(stopped.values()) and len(stopped) == len(ROBOTS), f"STOPPED is true {stopped}")
    if PICTURES:
        browser.screenshot(os.path.join(PICTURES, "stage-stop.png"))


def main():
    with tempfile.TemporaryDirectory(prefix="stage-") as folder:
        long_song(folder)
        with Stage(folder) as stage:
            with Chromium() as browser:
                show = watch_and_cue(browser, stage)
                address = play_again(stage, show)
                stop_all(browser, stage, address)
        path = os.path.join(folder, "followed.mcap")
        subprocess.run([PROGRAM, "export", path, "--csv", "followed.csv"], cwd=folder, check=True,
                       stdout=subprocess.DEVNULL)
        with open(os.path.join(folder, "followed.csv"), encoding="utf-8") as file:
            check(len(file.readlines()) > 500, "what a follower danced was recorded")
    print("the page of a stage works in a browser")


if __name__ == "__main__":
    main()
