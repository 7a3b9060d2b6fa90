"""A client drives simulated servos for long while faults come and go, in real time.

    python sim/reference/long_with_faults.py target/release/examples/serve dynamixel-sdk 60
    python sim/reference/long_with_faults.py target/release/examples/serve lerobot 60

The last argument is minutes. The client moves six servos 20 times a second; for 3 of every 10 s
something is wrong, from a list in turn. Facts, one a line: the client ends by itself; without a
fault every answer comes and every servo follows; a damaged answer never passes for a sound one;
each fault that hits answers is noticed; after each fault all is as before.
"""

import math
import sys
import time
from collections import Counter

from served import Served, check, done

COUNT, HZ, PERIOD_S, FAULT_S, GRACE_S = 6, 20, 10.0, 3.0, 1.5
MIDDLE, SWING = 2048, 300
# What begins, what ends it, and whether a client must notice it. A servo that reboots has no
# torque afterwards: the client turns it on again, as after every fault.
FAULTS = [
    ("wire corrupt 0.1", "wire clear", True),
    ("wire drop 0.1", "wire clear", True),
    ("wire truncate 0.1", "wire clear", True),
    ("wire noise 0.1", "wire clear", False),
    ("wire lose 0.1", "wire clear", True),
    ("wire late 0.1", "wire clear", False),
    ("wire corrupt-instruction 0.1", "wire clear", True),
    ("wire duplicate 0.1", "wire clear", False),
    ("unplug joint_3", "plug joint_3", True),
    ("joint_2 dead", "joint_2 revive", True),
    ("joint_4 reboot", None, False),
    ("wire bytes 0.003", "wire clear", True),
]


class DynamixelSdk:
    """dynamixel-sdk: group sync write, group sync read."""

    model, baud = "XM430-W350", 1_000_000

    def __init__(self, port):
        import dynamixel_sdk as dxl
        import dynamixel_sdk.port_handler

        dynamixel_sdk.port_handler.LATENCY_TIMER = 40
        self.sound, self.packet = dxl.COMM_SUCCESS, dxl.PacketHandler(2.0)
        self.port = dxl.PortHandler(port)
        self.port.openPort()
        self.port.setBaudRate(self.baud)
        self.goals = dxl.GroupSyncWrite(self.port, self.packet, 116, 4)
        self.reader = dxl.GroupSyncRead(self.port, self.packet, 132, 4)
        for servo in range(1, COUNT + 1):
            self.reader.addParam(servo)

    def torque(self, on):
        return all([self.packet.write1ByteTxRx(self.port, servo, 64, int(on))[0] == self.sound
                    for servo in range(1, COUNT + 1)])

    def write(self, goals):
        self.goals.clearParam()
        for servo, goal in enumerate(goals, 1):
            self.goals.addParam(servo, list(goal.to_bytes(4, "little")))
        self.goals.txPacket()

    def read(self):
        if self.reader.txRxPacket() != self.sound:
            raise OSError("no sound answer")
        return [self.reader.getData(servo, 132, 4) for servo in range(1, COUNT + 1)]


class Lerobot:
    """lerobot's bus of Feetech servos: sync write, sync read."""

    model, baud = "STS3215", 1_000_000

    def __init__(self, port):
        import lerobot_motors as lerobot

        norm = lerobot.MotorNormMode.RANGE_M100_100
        motors = {f"joint_{place}": lerobot.Motor(place, "sts3215", norm)
                  for place in range(1, COUNT + 1)}
        self.bus, self.joints = lerobot.FeetechMotorsBus(port, motors), list(motors)
        self.bus.connect()

    def torque(self, on):
        try:
            (self.bus.enable_torque if on else self.bus.disable_torque)()
            return True
        except (ConnectionError, RuntimeError):
            return False

    def write(self, goals):
        self.bus.sync_write("Goal_Position", dict(zip(self.joints, goals)), normalize=False)

    def read(self):
        try:
            seen = self.bus.sync_read("Present_Position", normalize=False)
        except (ConnectionError, RuntimeError) as error:
            raise OSError(str(error)) from None
        return [seen[joint] for joint in self.joints]


def main():
    program, name, minutes = sys.argv[1], sys.argv[2], float(sys.argv[3])
    kind = {"dynamixel-sdk": DynamixelSdk, "lerobot": Lerobot}[name]
    with Served(program, kind.model, COUNT, kind.baud) as served:
        client = kind(served.port)
        client.torque(True)
        client.write([MIDDLE] * COUNT)
        time.sleep(1.0)
        drive(name, client, served, minutes)
        check(f"{name}: torque goes off", client.torque(False), "confirmed by each servo")
    done()


def drive(name, client, served, minutes):
    began = time.monotonic()
    cycles = lost_clean = strange = 0
    worst_off = worst_cycle_s = 0.0
    noticed, tried, unrepaired = Counter(), Counter(), []
    fault, turn, ends_s, quiet_s = None, 0, 0.0, 2.0  # the first goals are far
    while (now_s := time.monotonic() - began) < 60 * minutes:
        into_s = now_s % PERIOD_S
        if fault is None and int(now_s / PERIOD_S) == turn and into_s > PERIOD_S - FAULT_S - GRACE_S:
            fault = FAULTS[turn % len(FAULTS)]
            tried[fault[0]] += 1
            served.say(fault[0])
            turn, ends_s = turn + 1, now_s + FAULT_S
        elif fault and now_s > ends_s:
            if fault[1]:
                served.say(fault[1])
            time.sleep(0.8)  # a servo that is plugged in begins
            if not any(client.torque(True) for _ in range(3)):
                unrepaired.append(fault[0])
            fault, quiet_s = None, time.monotonic() - began + GRACE_S
        clean = fault is None and now_s > quiet_s
        cycle_began = time.monotonic()
        goals = [MIDDLE + round(SWING * math.sin(now_s + servo)) for servo in range(COUNT)]
        client.write(goals)
        try:
            seen = client.read()
            off = max(abs(at - goal) for at, goal in zip(seen, goals))
            # Nothing that a servo says may be where no servo can be.
            strange += any(abs(at - MIDDLE) > SWING + 200 for at in seen)
            if clean:
                worst_off = max(worst_off, off)
        except OSError:
            lost_clean += clean
            if fault:
                noticed[fault[0]] += 1
        cycles += 1
        took_s = time.monotonic() - cycle_began
        worst_cycle_s = max(worst_cycle_s, took_s)
        time.sleep(max(0.0, 1 / HZ - took_s))
    unnoticed = [what for what, _, must in FAULTS if must and tried[what] and not noticed[what]]
    check(f"{name}: it drove to the end", cycles > 0, f"{cycles} cycles, {turn} faults")
    check(f"{name}: without a fault every answer comes", lost_clean <= cycles / 2000, lost_clean)
    check(f"{name}: without a fault servos follow", worst_off < 150, f"{worst_off} ticks off at most")
    check(f"{name}: no damaged answer passes", strange == 0, strange)
    check(f"{name}: faults are noticed", not unnoticed, unnoticed or dict(noticed))
    check(f"{name}: after a fault all is as before", not unrepaired, unrepaired or "each time")
    check(f"{name}: no call hangs", worst_cycle_s < 2.0, f"{worst_cycle_s:.2f} s at most")


main()
