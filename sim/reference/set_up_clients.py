"""What strangers' programs do to set servos up, against `servodance sim-bus`, in real time.

    pip install dynamixel-sdk==4.1.0 rustypot==1.13.1
    cargo build --release
    python sim/reference/set_up_clients.py target/release/servodance > sim/reference/set_up_clients.txt

Ids and rates are changed, rates that do not match are noise, a watchdog trips. Every line of
the output is one fact; the exit status is 1 if one of them is not as it should be.
"""

import subprocess
import sys
import time

import dynamixel_sdk as dxl
import dynamixel_sdk.port_handler
import rustypot

OK = dxl.COMM_SUCCESS
# An answer that this machine is too busy to give at once is not lost, milliseconds.
dynamixel_sdk.port_handler.LATENCY_TIMER = 200
failed = False


def check(name, passed, seen):
    global failed
    print(f"{'ok  ' if passed else 'FAIL'} {name}: {seen}")
    failed = failed or not passed


class Served:
    """A robot's simulated servos behind a port."""

    def __init__(self, program, robot):
        self.process = subprocess.Popen(
            [program, "sim-bus", "--robot", robot],
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        )
        self.port = self.process.stdout.readline().strip()

    def __enter__(self):
        return self.port

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait()


def vendor_sdk(path):
    port, packet = dxl.PortHandler(path), dxl.PacketHandler(2.0)
    check("sdk: open at 1 Mbps", port.openPort() and port.setBaudRate(1_000_000), port.getBaudRate())
    check("sdk: ping", packet.ping(port, 1)[1:] == (OK, 0), packet.ping(port, 1))
    port.setBaudRate(57_600)
    check("sdk: another rate is not understood", packet.ping(port, 1)[1] != OK, packet.ping(port, 1)[1])
    port.setBaudRate(1_000_000)
    seen = packet.write1ByteTxRx(port, 1, 7, 9)
    check("sdk: a new id is confirmed by the old one", seen == (OK, 0), seen)
    check("sdk: and answers from then on", packet.ping(port, 9)[1] == OK, packet.ping(port, 9))
    packet.write1ByteTxRx(port, 9, 7, 1)
    seen = packet.write1ByteTxRx(port, 1, 8, 1)
    port.setBaudRate(57_600)
    check("sdk: a new rate is in force", packet.ping(port, 1)[1] == OK, packet.ping(port, 1))
    packet.write1ByteTxRx(port, 1, 8, 3)
    port.setBaudRate(1_000_000)
    packet.write1ByteTxRx(port, 1, 64, 1)
    packet.write1ByteTxRx(port, 1, 98, 5)
    time.sleep(0.3)
    seen = packet.read1ByteTxRx(port, 1, 98)
    check("sdk: the watchdog trips after 100 ms", seen[0] == 255, seen)
    seen = packet.write4ByteTxRx(port, 1, 116, 2100)
    check("sdk: and refuses goals", seen[1] & 0x7F == 4, seen)
    packet.write1ByteTxRx(port, 1, 98, 0)
    seen = packet.write4ByteTxRx(port, 1, 116, 2100)
    check("sdk: until it is cleared", seen == (OK, 0), seen)
    packet.write1ByteTxRx(port, 1, 64, 0)
    port.closePort()


def rusty_pot(path):
    servos = rustypot.Xl430PyController(serial_port=path, baudrate=1_000_000, timeout=1.0)
    seen = servos.read_present_position(1)
    check("rustypot: reads a position", len(seen) == 1, seen)
    try:
        servos.write_id(1, 9)
        seen = "confirmed"
    except Exception as error:  # whatever the client raises is the fact
        seen = f"{error}"
    check("rustypot: write_id", seen == "confirmed", seen)
    seen = servos.ping(9)
    check("rustypot: the new id answers", seen is True, seen)


def main():
    program = sys.argv[1]
    with Served(program, "neck") as path:
        vendor_sdk(path)
    with Served(program, "neck") as path:
        rusty_pot(path)
    sys.exit(failed)


main()
