"""Drives the simulated servos with lerobot's motor classes, in real time.

    pip install --no-deps lerobot==0.4.4
    pip install dynamixel-sdk feetech-servo-sdk python-can deepdiff tqdm numpy
    cargo build --release -p servodance-sim --example serve
    python sim/reference/lerobot_motors.py target/release/examples/serve

lerobot imports torch and its like in a module of helpers; its motors use none of them, so
empty modules stand in where they are not installed. It waits one millisecond for an answer
on CAN, and some twenty on a serial line; here it waits longer, since the simulated motors
share a processor with it.
"""

import importlib.machinery
import importlib.util
import logging
import os
import sys
import time
import types


class Empty(types.ModuleType):
    """A module that has every name."""

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return type(name, (), {})


class StandIn:
    """Finds empty modules in place of heavy ones that are not installed."""

    NAMES = {"torch", "accelerate", "datasets", "draccus", "huggingface_hub"}

    def find_spec(self, name, path, target=None):
        if name.split(".")[0] in self.NAMES:
            return importlib.machinery.ModuleSpec(name, self, is_package=True)

    def create_module(self, spec):
        return Empty(spec.name)

    def exec_module(self, module):
        pass


sys.meta_path.append(StandIn())
os.environ["TQDM_DISABLE"] = "1"

import dynamixel_sdk.port_handler  # noqa: E402
from lerobot.motors import Motor, MotorNormMode  # noqa: E402
from lerobot.motors.damiao import DamiaoMotorsBus, damiao  # noqa: E402
from lerobot.motors.dynamixel import DynamixelMotorsBus  # noqa: E402
from lerobot.motors.feetech import FeetechMotorsBus  # noqa: E402
from lerobot.motors.robstride import RobstrideMotorsBus, robstride  # noqa: E402

from served import Served, attempt, check, done  # noqa: E402

WAIT_S = 0.2
dynamixel_sdk.port_handler.LATENCY_TIMER = 200
DEGREES = MotorNormMode.DEGREES


def serial(name, kind, model, served, rate):
    """Handshake, reads and writes of everyone, calibration, then its set-up of new servos."""
    motors = {joint: Motor(place, model, MotorNormMode.RANGE_M100_100)
              for place, joint in enumerate(("pan", "tilt"), 1)}
    attempt(f"{name}: scan_port", lambda seen: seen == {rate: [1, 2]},
            lambda: kind.scan_port(served.port))
    bus = kind(served.port, motors)
    attempt(f"{name}: connect, with its handshake", None, bus.connect)
    attempt(f"{name}: configure_motors", None, bus.configure_motors)
    attempt(f"{name}: torque off", None, bus.disable_torque)
    raw = lambda: bus.sync_read("Present_Position", normalize=False)
    seen = attempt(f"{name}: sync_read", lambda seen: set(seen) == {"pan", "tilt"}, raw)
    calibration = bus.read_calibration()
    for joint in motors:
        calibration[joint].range_min, calibration[joint].range_max = 1024, 3072
    bus.write_calibration(calibration)
    kept = bus.read_calibration()
    check(f"{name}: a calibration is kept", kept == calibration, kept["pan"])
    attempt(f"{name}: torque on", None, bus.enable_torque)
    goals = {joint: position + 200 for joint, position in seen.items()}
    attempt(f"{name}: sync_write of goals", None,
            lambda: bus.sync_write("Goal_Position", goals, normalize=False))
    time.sleep(1.5)
    off = max(abs(now - goals[joint]) for joint, now in raw().items())
    check(f"{name}: they are there", off <= 4, f"{off} ticks off")
    bus.disconnect()


def set_up(name, kind, model, served):
    """One servo alone on the bus gets an id and lerobot's rate."""
    served.say("unplug joint_2")
    time.sleep(0.3)
    bus = kind(served.port, {"pan": Motor(7, model, MotorNormMode.RANGE_M100_100)})
    attempt(f"{name}: setup_motor", None, lambda: bus.setup_motor("pan"))
    attempt(f"{name}: it answers with its new id", lambda seen: isinstance(seen, int),
            lambda: bus.ping("pan"))
    bus.port_handler.closePort()


def damiao_arm(served):
    damiao.SHORT_TIMEOUT_SEC = damiao.MEDIUM_TIMEOUT_SEC = WAIT_S
    wait = DamiaoMotorsBus._recv_motor_response
    DamiaoMotorsBus._recv_motor_response = (
        lambda self, expected_recv_id=None, timeout=WAIT_S: wait(self, expected_recv_id, WAIT_S))
    motors = {joint: Motor(place, "dm4310", DEGREES, "dm4310", 0x10 + place)
              for place, joint in enumerate(("pan", "tilt"), 1)}
    on_can("Damiao", DamiaoMotorsBus(served.port, motors, use_can_fd=False))


def robstride_arm(served):
    robstride.RUNNING_TIMEOUT = WAIT_S
    wait = RobstrideMotorsBus._recv_motor_response
    RobstrideMotorsBus._recv_motor_response = (
        lambda self, expected_recv_id=None, timeout=WAIT_S: wait(self, expected_recv_id, WAIT_S))
    motors = {joint: Motor(place, "o2", DEGREES, "o2", place)
              for place, joint in enumerate(("pan", "tilt"), 1)}
    on_can("RobStride", RobstrideMotorsBus(served.port, motors, use_can_fd=False))


def on_can(name, bus):
    attempt(f"{name}: connect, with its handshake", None, bus.connect)
    if not bus.is_connected:
        return
    attempt(f"{name}: torque on", None, bus.enable_torque)
    read = lambda: bus.sync_read("Present_Position")
    seen = attempt(f"{name}: sync_read", lambda seen: set(seen) == {"pan", "tilt"}, read)
    goal = 12.0
    for step in range(100):
        bus.sync_write("Goal_Position",
                       {joint: at + goal * (step + 1) / 100 for joint, at in seen.items()})
        time.sleep(0.01)
    time.sleep(0.5)
    off = max(abs(now - seen[joint] - goal) for joint, now in read().items())
    # lerobot's 10 Nm a radian against the friction of the gear.
    check(f"{name}: goals are followed", off < 2.0, f"{off:.2f} degrees off")
    attempt(f"{name}: set_zero_position", None,
            lambda: (bus.disable_torque(), bus.set_zero_position())[-1])
    time.sleep(0.1)
    off = max(abs(now) for now in read().values())
    check(f"{name}: which then is zero", off < 0.1, f"{off:.3f} degrees")
    attempt(f"{name}: disconnect, torque off", None, bus.disconnect)


def main():
    program = sys.argv[1]
    logging.disable(logging.WARNING)
    with Served(program, "XM430-W350") as served:
        serial("Dynamixel", DynamixelMotorsBus, "xm430-w350", served, 1_000_000)
        set_up("Dynamixel", DynamixelMotorsBus, "xm430-w350", served)
    with Served(program, "STS3215") as served:
        serial("Feetech", FeetechMotorsBus, "sts3215", served, 1_000_000)
        set_up("Feetech", FeetechMotorsBus, "sts3215", served)
    with Served(program, "DM-J4310") as served:
        damiao_arm(served)
    with Served(program, "RS02(MIT)") as served:
        robstride_arm(served)
    done()


if __name__ == "__main__":
    main()
