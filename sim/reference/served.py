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
    """Simulated servos of one model, their ids from 1."""

    def __init__(self, program, model, count=2, baud=1_000_000):
        self.process = subprocess.Popen(
            [program, str(count), str(baud), model],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        )
        self.port = self.process.stdout.readline().strip()

    def say(self, line):
        """Something that happens, such as `unplug joint_2`."""
        self.process.stdin.write(f"{line}\n")
        self.process.stdin.flush()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait()
