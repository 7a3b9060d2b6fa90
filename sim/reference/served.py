"""What the clients of this folder share: simulated servos behind a port, and facts, one a line."""

import subprocess
import sys

failed = False


def check(name, passed, seen):
    """One fact as the client saw it."""
    global failed
    print(f"{'ok  ' if passed else 'FAIL'} {name}: {seen}", flush=True)
    failed = failed or not passed


def attempt(name, wanted, act):
    """A fact that is a call: what it returns, or what it raises, beside what is wanted."""
    try:
        seen = act()
    except Exception as error:  # whatever the client raises is the fact
        seen = f"{type(error).__name__}: {' '.join(str(error).split())[:120]}"
    check(name, wanted(seen) if callable(wanted) else seen == wanted, seen)
    return seen


def done():
    sys.exit(1 if failed else 0)


class Served:
    """Simulated servos of the built-in neck, with these settings of its file."""

    def __init__(self, program, **settings):
        keys = [f"{key.replace('__', '.')}={value}" for key, value in settings.items()]
        options = [word for key in keys for word in ("--set", key)]
        self.process = subprocess.Popen(
            [program, "sim-bus", "--robot", "neck", *options],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        )
        self.port = self.process.stdout.readline().strip()

    def say(self, line):
        """A line for the simulated bench: plug, unplug, new."""
        self.process.stdin.write(f"{line}\n")
        self.process.stdin.flush()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait()


def neck(model, kind=None, baud=1_000_000, reply_ids=None):
    """The settings of a neck with two servos of a model."""
    settings = {"bus__baud": baud}
    if kind:
        settings["bus__kind"] = kind
    for place, joint in enumerate(("neck_pan", "neck_tilt")):
        settings[f"joint__{joint}__model"] = model
        if reply_ids:
            settings[f"joint__{joint}__reply_id"] = reply_ids[place]
    return settings
