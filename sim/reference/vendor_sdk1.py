"""Drives the simulated AX and MX servos with the vendor's own client, Protocol 1.0, in real time.

    pip install dynamixel-sdk==4.1.0
    cargo build --release -p servodance-sim --example serve
    python sim/reference/vendor_sdk1.py target/release/examples/serve > sim/reference/vendor_sdk1.txt

Every line of the output is one fact about the wire as the vendor's SDK saw it.
"""

import subprocess
import sys
import time

import dynamixel_sdk as dxl
import dynamixel_sdk.port_handler

OK = dxl.COMM_SUCCESS
# An answer that this machine is too busy to give at once is not lost, milliseconds.
dynamixel_sdk.port_handler.LATENCY_TIMER = 200
COUNT, BAUD = 6, 1_000_000


def check(name, passed, seen):
    print(f"{'ok  ' if passed else 'FAIL'} {name}: {seen}")
    global failed
    failed = failed or not passed


def served(model):
    server = subprocess.Popen(
        [sys.argv[1], str(COUNT), str(BAUD), model],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )
    port = dxl.PortHandler(server.stdout.readline().strip())
    check(f"{model}: open", port.openPort() and port.setBaudRate(BAUD), port.getBaudRate())
    return server, port, dxl.PacketHandler(1.0)


def basics(model, number, port, packet):
    seen = packet.ping(port, 1)
    check(f"{model}: ping", seen == (number, OK, 0), seen)
    _, result, _ = packet.ping(port, 99)
    check(f"{model}: a servo that is not there times out", result == dxl.COMM_RX_TIMEOUT, result)
    for servo in range(1, COUNT + 1):
        packet.write1ByteTxRx(port, servo, 5, 0)
    value, _, _ = packet.read1ByteTxRx(port, COUNT, 5)
    check(f"{model}: return delay written", value == 0, value)
    highest, _, _ = packet.read2ByteTxRx(port, 1, 8)
    check(f"{model}: angle limit of the factory", highest in (1023, 4095), highest)
    _, error = packet.write2ByteTxRx(port, 1, 30, highest + 1)
    check(f"{model}: a goal beyond the limit is refused", error & 2 == 2, error)
    volts, _, _ = packet.read1ByteTxRx(port, 1, 42)
    check(f"{model}: voltage", volts == 120, volts)
    torque = dxl.GroupSyncWrite(port, packet, 24, 1)
    goals = dxl.GroupSyncWrite(port, packet, 30, 2)
    middle = (highest + 1) // 2
    for servo in range(1, COUNT + 1):
        torque.addParam(servo, [1])
        goals.addParam(servo, list((middle + 10 * servo).to_bytes(2, "little")))
    torque.txPacket()
    goals.txPacket()
    time.sleep(1.0)
    positions = [packet.read2ByteTxRx(port, servo, 36)[0] for servo in range(1, COUNT + 1)]
    off = max(abs(p - (middle + 10 * (i + 1))) for i, p in enumerate(positions))
    check(f"{model}: sync write moves everyone to the goal", off <= 3, f"{off} ticks off")
    packet.regWriteTxRx(port, 2, 30, 2, list(middle.to_bytes(2, "little")))
    waiting, _, _ = packet.read2ByteTxRx(port, 2, 30)
    packet.action(port, dxl.BROADCAST_ID)
    done, _, _ = packet.read2ByteTxRx(port, 2, 30)
    check(f"{model}: registered write waits for action", (waiting, done) == (middle + 20, middle), (waiting, done))


def main():
    for model, number in (("AX-12A", 12), ("MX-28(1.0)", 29)):
        server, port, packet = served(model)
        basics(model, number, port, packet)
        # GroupBulkRead of version 4.1 cannot speak Protocol 1.0: its packet handler can.
        param = [byte for servo in range(1, COUNT + 1) for byte in (8, servo, 36)]
        packet.bulkReadTx(port, param, len(param))
        answers = [packet.readRx(port, servo, 8)[1:] for servo in range(1, COUNT + 1)]
        result = max((answer for answer in answers), key=lambda answer: answer != (OK, 0))[0]
        known = model.startswith("MX")
        check(f"{model}: bulk read {'answers' if known else 'is not known'}", (result == OK) == known, result)
        port.closePort()
        server.stdin.close()
        print(server.stdout.read().strip())
    sys.exit(1 if failed else 0)


failed = False
main()
