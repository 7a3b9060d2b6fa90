"""Drives the simulated servos with the vendor's own client, in real time.

    pip install dynamixel-sdk==4.1.0       # or 3.7.31
    cargo build --release -p servodance-sim --example serve
    python sim/reference/vendor_sdk.py target/release/examples/serve > sim/reference/vendor_sdk.txt

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


def check(name, passed, seen):
    print(f"{'ok  ' if passed else 'FAIL'} {name}: {seen}")
    global failed
    failed = failed or not passed


def main():
    count, baud = 20, 4_000_000
    server = subprocess.Popen(
        [sys.argv[1], str(count), str(baud)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )
    port = dxl.PortHandler(server.stdout.readline().strip())
    packet = dxl.PacketHandler(2.0)
    check("open at 4 Mbps", port.openPort() and port.setBaudRate(baud), port.getBaudRate())

    model, result, error = packet.ping(port, 1)
    check("ping", (model, result, error) == (1020, OK, 0), (model, result, error))
    found, result = packet.broadcastPing(port)
    check("broadcast ping", sorted(found) == list(range(1, count + 1)), sorted(found))
    check("broadcast ping data", found.get(20) == [1020, 48], found.get(20))

    _, result, _ = packet.ping(port, 99)
    check("a servo that is not there times out", result == dxl.COMM_RX_TIMEOUT, result)

    value, result, error = packet.read1ByteTxRx(port, 1, 9)
    check("return delay of the factory", (value, error) == (250, 0), value)
    for servo in range(1, count + 1):
        packet.write1ByteTxRx(port, servo, 9, 0)
    value, result, error = packet.read1ByteTxRx(port, 20, 9)
    check("return delay written", value == 0, value)

    result, error = packet.write4ByteTxRx(port, 1, 132, 0)
    check("a read-only register is refused", error == 7, error)
    result, error = packet.write2ByteTxRx(port, 1, 116, 0)
    check("half a register is refused", error == 5, error)
    result, error = packet.write4ByteTxRx(port, 1, 116, 5000)
    check("a goal beyond the servo's limit is refused", error == 6, error)
    result, error = packet.write1ByteTxRx(port, 1, 64, 1)
    check("torque on", (result, error) == (OK, 0), error)
    result, error = packet.write1ByteTxRx(port, 1, 11, 4)
    check("EEPROM is locked while torque is on", error == 7, error)
    packet.write1ByteTxRx(port, 1, 64, 0)

    writer = dxl.GroupSyncWrite(port, packet, 116, 4)
    torque = dxl.GroupSyncWrite(port, packet, 64, 1)
    for servo in range(1, count + 1):
        torque.addParam(servo, [1])
        writer.addParam(servo, list((2048 + 20 * servo).to_bytes(4, "little")))
    check("sync write torque", torque.txPacket() == OK, "sent")
    check("sync write goals", writer.txPacket() == OK, "sent")
    time.sleep(1.0)

    for kind, receive in (("sync read", "txRxPacket"), ("fast sync read", "fastSyncRead")):
        reader = dxl.GroupSyncRead(port, packet, 126, 10)
        if not hasattr(reader, receive):  # versions before 4
            continue
        for servo in range(1, count + 1):
            reader.addParam(servo)
        result = getattr(reader, receive)()
        check(kind, result == OK, result)
        off = max(abs(reader.getData(s, 132, 4) - (2048 + 20 * s)) for s in range(1, count + 1))
        check(f"{kind}: servos reached their goals", off <= 3, f"{off} ticks off")

    bulk = dxl.GroupBulkRead(port, packet)
    bulk.addParam(1, 0, 2)
    bulk.addParam(2, 132, 4)
    bulk.addParam(3, 146, 1)
    check("bulk read", bulk.txRxPacket() == OK, bulk.getData(1, 0, 2))
    check("bulk read data", bulk.getData(3, 146, 1) == 25, bulk.getData(3, 146, 1))
    bulk_writer = dxl.GroupBulkWrite(port, packet)
    bulk_writer.addParam(1, 65, 1, [1])
    bulk_writer.addParam(2, 104, 4, [5, 0, 0, 0])
    bulk_writer.txPacket()
    led, _, _ = packet.read1ByteTxRx(port, 1, 65)
    velocity, _, _ = packet.read4ByteTxRx(port, 2, 104)
    check("bulk write", (led, velocity) == (1, 5), (led, velocity))

    result, error = packet.regWriteTxRx(port, 4, 116, 4, [0, 8, 0, 0])
    waiting, _, _ = packet.read1ByteTxRx(port, 4, 69)
    goal, _, _ = packet.read4ByteTxRx(port, 4, 116)
    check("registered write waits", (waiting, goal) == (1, 2128), (waiting, goal))
    packet.action(port, dxl.BROADCAST_ID)
    goal, _, _ = packet.read4ByteTxRx(port, 4, 116)
    check("action carries it out", goal == 2048, goal)

    # A parameter that needs stuffing: FF FF FD in the data.
    packet.write2ByteTxRx(port, 5, 168, 224)
    result, error = packet.writeTxRx(port, 5, 224, 5, [0xFF, 0xFF, 0xFD, 0x00, 0xFD])
    data, result, error = packet.readTxRx(port, 5, 224, 5)
    check("stuffed data survives both ways", list(data) == [0xFF, 0xFF, 0xFD, 0x00, 0xFD], list(data))

    packet.write1ByteTxRx(port, 6, 98, 5)
    time.sleep(0.3)
    tripped, _, _ = packet.read1ByteTxRx(port, 6, 98)
    result, error = packet.write4ByteTxRx(port, 6, 116, 2000)
    check("bus watchdog trips and refuses goals", (tripped, error) == (255, 4), (tripped, error))
    packet.write1ByteTxRx(port, 6, 98, 0)
    result, error = packet.write4ByteTxRx(port, 6, 116, 2000)
    check("cleared, it takes goals again", error == 0, error)

    result, error = packet.reboot(port, 7)
    check("reboot answers", (result, error) == (OK, 0), (result, error))
    _, result, _ = packet.ping(port, 7)
    check("and is deaf for a while", result == dxl.COMM_RX_TIMEOUT, result)
    time.sleep(0.4)
    enabled, result, _ = packet.read1ByteTxRx(port, 7, 64)
    check("and comes back without torque", (enabled, result) == (0, OK), (enabled, result))

    port.closePort()
    server.stdin.close()
    print(server.stdout.read().strip())
    sys.exit(1 if failed else 0)


failed = False
main()
