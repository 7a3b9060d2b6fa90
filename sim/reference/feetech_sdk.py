"""Drives the simulated STS servos with the public Feetech client, in real time.

    pip install feetech-servo-sdk==1.0.0
    cargo build --release -p servodance-sim --example serve
    python sim/reference/feetech_sdk.py target/release/examples/serve > sim/reference/feetech_sdk.txt
"""

import subprocess
import sys
import time

import scservo_sdk as scs
import scservo_sdk.port_handler

OK = scs.COMM_SUCCESS
# An answer that this machine is too busy to give at once is not lost, milliseconds.
scservo_sdk.port_handler.LATENCY_TIMER = 200
LITTLE_ENDIAN = 0


def check(name, passed, seen):
    print(f"{'ok  ' if passed else 'FAIL'} {name}: {seen}")
    global failed
    failed = failed or not passed


def main():
    count, baud = 6, 1_000_000
    server = subprocess.Popen(
        [sys.argv[1], str(count), str(baud), "STS3215"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )
    port = scs.PortHandler(server.stdout.readline().strip())
    packet = scs.PacketHandler(LITTLE_ENDIAN)
    check("open at 1 Mbps", port.openPort() and port.setBaudRate(baud), port.getBaudRate())
    for servo in range(1, count + 1):
        model, result, error = packet.ping(port, servo)
        check(f"ping {servo}", (model, result, error) == (777, OK, 0), (model, result, error))
    _, result, _ = packet.ping(port, 99)
    check("a servo that is not there times out", result == scs.COMM_RX_TIMEOUT, result)

    delay, _, _ = packet.read1ByteTxRx(port, 1, 7)
    check("return delay of the factory", delay == 250, delay)
    result, error = packet.write1ByteTxRx(port, 1, 7, 0)
    check("write is confirmed", (result, error) == (OK, 0), (result, error))

    torque = scs.GroupSyncWrite(port, packet, 40, 1)
    goals = scs.GroupSyncWrite(port, packet, 42, 2)
    for servo in range(1, count + 1):
        torque.addParam(servo, [1])
        goal = 2048 + 50 * servo
        goals.addParam(servo, [goal & 0xFF, goal >> 8])
    check("sync write torque", torque.txPacket() == OK, "sent")
    check("sync write goals", goals.txPacket() == OK, "sent")
    time.sleep(1.0)
    reader = scs.GroupSyncRead(port, packet, 56, 15)
    for servo in range(1, count + 1):
        reader.addParam(servo)
    check("sync read", reader.txRxPacket() == OK, "read")
    off = max(abs(reader.getData(s, 56, 2) - (2048 + 50 * s)) for s in range(1, count + 1))
    check("servos reached their goals", off <= 3, f"{off} ticks off")
    volts, celsius = reader.getData(1, 62, 1), reader.getData(1, 63, 1)
    check("voltage and temperature", (volts, celsius) == (120, 25), (volts, celsius))

    packet.write2ByteTxRx(port, 2, 42, 1000)
    time.sleep(0.15)
    speed, _, _ = packet.read2ByteTxRx(port, 2, 58)
    check("speed downwards has its sign in bit 15", speed & 0x8000 != 0, hex(speed))
    result, error = packet.regWriteTxRx(port, 3, 42, 2, [0, 8])
    before, _, _ = packet.read2ByteTxRx(port, 3, 42)
    packet.action(port, scs.BROADCAST_ID)
    after, _, _ = packet.read2ByteTxRx(port, 3, 42)
    check("registered write waits for the action", (before, after) == (2198, 2048), (before, after))

    wheel = 6
    packet.write1ByteTxRx(port, wheel, 40, 0)
    packet.write1ByteTxRx(port, wheel, 55, 0)
    packet.write1ByteTxRx(port, wheel, 33, 1)
    packet.write1ByteTxRx(port, wheel, 40, 1)
    for goal, sign in ((1200, 0), (1200, 0x8000)):
        packet.write2ByteTxRx(port, wheel, 46, goal | sign)
        time.sleep(3.0)
        speed, _, _ = packet.read2ByteTxRx(port, wheel, 58)
        place, _, _ = packet.read2ByteTxRx(port, wheel, 56)
        right = speed & 0x8000 == sign and abs((speed & 0x7FFF) - goal) < 60 and place < 4096
        check(f"wheel mode at {'-' if sign else ''}{goal}", right, (hex(speed), place))
    packet.write1ByteTxRx(port, wheel, 40, 0)

    port.closePort()
    server.stdin.close()
    print(server.stdout.read().strip())
    sys.exit(1 if failed else 0)


failed = False
main()
