"""Drives every simulated servo that rustypot has a class for, in real time.

    pip install rustypot==1.13.1
    cargo build --release -p servodance-sim --example serve
    python sim/reference/rustypot_servos.py target/release/examples/serve
"""

import sys
import time

import rustypot

from served import Served, attempt, check, done

RATE = 1_000_000
# Protocol 1.0 has no Sync Read.
SYNC_READ = ("XL430", "XL330", "STS3215")


def named(servos, pattern):
    """The call for plain register values, where the class has others in units as well."""
    return getattr(servos, pattern.format("raw_"), None) or getattr(servos, pattern.format(""))


def drive(name, kind, served):
    servos = kind(serial_port=served.port, baudrate=RATE, timeout=1.0)
    attempt(f"{name}: ping", True, lambda: servos.ping(1))
    attempt(f"{name}: ping of nobody", False, lambda: servos.ping(77))
    read = named(servos, "read_{}present_position")
    seen = attempt(f"{name}: reads a position", lambda seen: len(seen) == 1, lambda: read(1))
    confirmed = lambda seen: "Error" not in str(seen)
    torque = named(servos, "write_{}torque_enable")
    attempt(f"{name}: torque on", confirmed, lambda: torque(1, 1))
    goal = seen[0] + 60
    attempt(f"{name}: goal position", confirmed,
            lambda: named(servos, "write_{}goal_position")(1, goal))
    time.sleep(1.0)
    off = abs(read(1)[0] - goal)
    check(f"{name}: the servo is there", off <= 4, f"{off} ticks off")
    if name in SYNC_READ:
        both = named(servos, "sync_read_{}present_position")
        attempt(f"{name}: sync_read", lambda seen: len(seen) == 2, lambda: both([1, 2]))
    write = named(servos, "sync_write_{}goal_position")
    attempt(f"{name}: sync_write", confirmed,
            lambda: write([1, 2], [goal, goal]))
    time.sleep(1.0)
    off = abs(read(1)[0] - goal)
    check(f"{name}: and there", off <= 4, f"{off} ticks off")
    torque(1, 0)
    if hasattr(servos, "write_lock"):
        named(servos, "write_{}lock")(1, 0)
    attempt(f"{name}: write_id", confirmed,
            lambda: servos.write_id(1, 9))
    attempt(f"{name}: the new id answers", True, lambda: servos.ping(9))
    attempt(f"{name}: the old one does not", False, lambda: servos.ping(1))
    attempt(f"{name}: scan", lambda seen: 9 in seen and 2 in seen, lambda: list(servos.scan()))
    servos.close()


def main():
    program = sys.argv[1]
    for name, kind, model in (
        ("XL430", rustypot.Xl430PyController, "XL430-W250"),
        ("XL330", rustypot.Xl330PyController, "XL330-M288"),
        ("MX", rustypot.MxPyController, "MX-28(1.0)"),
        ("AX", rustypot.AxPyController, "AX-12A"),
        ("STS3215", rustypot.Sts3215PyController, "STS3215"),
    ):
        with Served(program, model) as served:
            attempt(f"{name}: all of it", None, lambda: drive(name, kind, served))
    done()


main()
