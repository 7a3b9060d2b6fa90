"""Drives the simulated CAN motors with independent clients, in real time.

    pip install python-can==4.6.1 msgpack canopen==2.4.1 odrive cantools odrive-can==2.1.0
    cargo build --release -p servodance-sim --example serve
    python sim/reference/python_can.py target/release/examples/serve > sim/reference/python_can.txt

python-can reaches them over slcan and over udp_multicast; canopen is a CANopen
master of its own; the names of ODrive's errors come from the package odrive, and
ODrive's messages are packed and read by cantools from the public DBC of firmware
0.6.10, which the package odrive-can brings.
Every line of the output is one fact about the bus as these clients saw it.
"""

import contextlib
import importlib.resources
import struct
import subprocess
import sys
import time

import can
import canopen
import cantools
import odrive.enums

DBC = importlib.resources.files("odrive_can") / "dbc" / "odrive-cansimple-0.6.10.dbc"
CANSIMPLE = cantools.database.load_string(DBC.read_text(), "dbc")

failed = False


def check(name, passed, seen):
    global failed
    failed = failed or not passed
    print(f"{'ok  ' if passed else 'FAIL'} {name}: {seen}")


@contextlib.contextmanager
def motors(model, group=None):
    command = [sys.argv[1], "2", "1000000", model] + ([group] if group else [])
    server = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    port = server.stdout.readline().strip()
    try:
        yield port
    finally:
        server.stdin.close()
        server.wait(10)


def slcan(port):
    return can.Bus(interface="slcan", channel=port, bitrate=1_000_000, sleep_after_open=0.2)


def exchange(bus, message, accept, seconds=1.0):
    bus.send(message)
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        answer = bus.recv(0.1)
        if answer is not None and accept(answer):
            return answer
    return None


def frame(arbitration_id, data=b"", extended=False, remote=False):
    length = 8 if remote else len(data)
    return can.Message(arbitration_id=arbitration_id, data=data, is_extended_id=extended,
                       is_remote_frame=remote, dlc=length)


def code(value, span, bits):
    return round((value + span) / (2 * span) * ((1 << bits) - 1))


def angle(high, low, span):
    return (high << 8 | low) / 65535 * 2 * span - span


def mit(position, kp, kd, velocity_range, torque_range):
    fields = ((code(position, 12.5, 16), 16), (code(0, velocity_range, 12), 12),
              (round(kp / 500 * 4095), 12), (round(kd / 5 * 4095), 12),
              (code(0, torque_range, 12), 12))
    word = 0
    for value, bits in fields:
        word = word << bits | value
    return word.to_bytes(8, "big")


def damiao(bus, where):
    def mine(answer):
        return answer.arbitration_id == 0x11 and answer.data[0] & 0xF == 1

    def register(number, command=0x33, value=bytes(4)):
        question = frame(0x7FF, bytes([1, 0, command, number]) + value)
        answer = exchange(bus, question, lambda a: a.arbitration_id == 0x11 and a.data[3] == number)
        return bytes(answer.data[4:])

    for number, name, wanted in ((21, "PMAX", 12.5), (22, "VMAX", 30.0), (23, "TMAX", 10.0)):
        value = struct.unpack("<f", register(number))[0]
        check(f"{where}: register {number} {name}", value == wanted, value)
    answer = exchange(bus, frame(1, bytes.fromhex("FFFFFFFFFFFFFFFC")), mine)
    check(f"{where}: enabled", answer.data[0] == 0x11, answer.data.hex())
    for k in range(100):
        answer = exchange(bus, frame(1, mit(0.4 * (k + 1) / 100, 22, 0.55, 30, 10)), mine)
        time.sleep(0.01)
    seen = angle(answer.data[1], answer.data[2], 12.5)
    check(f"{where}: follows to 0.4 rad", abs(seen - 0.4) < 0.05, f"{seen:.3f}")
    register(9, 0x55, struct.pack("<I", 100 * 20))
    check(f"{where}: TIMEOUT of 100 ms reads back",
          struct.unpack("<I", register(9))[0] == 2000, 2000)
    time.sleep(0.3)
    # A register read makes no command: ask with a mode command that means nothing.
    answer = exchange(bus, frame(1, bytes.fromhex("FFFFFFFFFFFFFFFD")), mine)
    check(f"{where}: silent for 300 ms, error D", answer.data[0] >> 4 == 0xD, answer.data.hex())
    # Position-velocity mode: at most 1 rad/s, by loops of its own.
    register(9, 0x55, bytes(4))
    register(10, 0x55, struct.pack("<I", 2))
    check(f"{where}: CTRL_MODE 2 reads back", register(10) == struct.pack("<I", 2), 2)
    for last in ("FB", "FC"):
        exchange(bus, frame(1, bytes.fromhex("FFFFFFFFFFFFFF" + last)), mine)
    goal = struct.pack("<ff", -0.4, 1.0)
    began, seen = time.monotonic(), []
    while time.monotonic() - began < 2.0:
        answer = exchange(bus, frame(0x101, goal), mine)
        seen.append((time.monotonic() - began, angle(answer.data[1], answer.data[2], 12.5)))
        time.sleep(0.01)
    halfway = min(seen, key=lambda at: abs(at[1]))[0]
    check(f"{where}: position-velocity mode takes its speed", 0.25 < halfway < 0.8, f"{halfway:.2f} s")
    check(f"{where}: and gets there", abs(seen[-1][1] + 0.4) < 0.05, f"{seen[-1][1]:.3f}")
    before = seen[-1][1]
    answer = exchange(bus, frame(1, mit(0.4, 22, 0.55, 30, 10)), mine)
    time.sleep(0.3)
    answer = exchange(bus, frame(0x101, goal), mine)
    seen = angle(answer.data[1], answer.data[2], 12.5)
    check(f"{where}: a command of MIT mode is not heeded in it", abs(seen - before) < 0.02, f"{seen:.3f}")
    exchange(bus, frame(1, bytes.fromhex("FFFFFFFFFFFFFFFD")), mine)
    register(10, 0x55, struct.pack("<I", 1))


def cubemars(bus):
    def mine(answer):
        return answer.data[0] == 1

    answer = exchange(bus, frame(1, bytes.fromhex("FFFFFFFFFFFFFFFC")), mine)
    check("AK80-9: enable is answered with its id", answer is not None, answer.data.hex())
    for k in range(100):
        answer = exchange(bus, frame(1, mit(-0.3 * (k + 1) / 100, 39.6, 0.99, 50, 18)), mine)
        time.sleep(0.01)
    seen = angle(answer.data[1], answer.data[2], 12.5)
    check("AK80-9: follows to -0.3 rad", abs(seen + 0.3) < 0.05, f"{seen:.3f}")
    exchange(bus, frame(1, bytes.fromhex("FFFFFFFFFFFFFFFD")), mine)
    answer = exchange(bus, frame(1, bytes.fromhex("FFFFFFFFFFFFFFFE")), mine)
    seen = angle(answer.data[1], answer.data[2], 12.5)
    check("AK80-9: where it stands is zero after FE", abs(seen) < 0.01, f"{seen:.4f}")


def robstride(bus):
    host, span = 0xFD, 12.566370614359172

    def ask(kind, data16, data, answered):
        question = frame(kind << 24 | data16 << 8 | 1, data, extended=True)
        accept = lambda a: a.is_extended_id and a.arbitration_id >> 24 == answered
        return exchange(bus, question, accept)

    answer = ask(0, host, bytes(8), 0)
    check("RS02: answers a broadcast of its id", answer.arbitration_id == 0x1FE,
          f"{answer.arbitration_id:08X}")
    answer = ask(17, host, struct.pack("<HHI", 0x701C, 0, 0), 17)
    volts = struct.unpack("<f", answer.data[4:])[0]
    check("RS02: parameter 701C", volts == 48.0, volts)
    answer = ask(17, host, struct.pack("<HHI", 0x1234, 0, 0), 17)
    check("RS02: unknown parameter is refused", answer.arbitration_id >> 16 & 0xFF == 1,
          f"{answer.arbitration_id:08X}")
    answer = ask(3, host, bytes(8), 2)
    check("RS02: enabled, mode 2", answer.arbitration_id >> 22 & 3 == 2,
          f"{answer.arbitration_id:08X}")
    for k in range(100):
        words = (code(0.5 * (k + 1) / 100, span, 16), code(0, 44, 16),
                 round(37.4 / 500 * 65535), round(0.935 / 5 * 65535))
        answer = ask(1, code(0, 17, 16), struct.pack(">4H", *words), 2)
        time.sleep(0.01)
    seen = angle(answer.data[0], answer.data[1], span)
    check("RS02: follows to 0.5 rad", abs(seen - 0.5) < 0.05, f"{seen:.3f}")
    answer = ask(4, host, bytes(8), 2)
    check("RS02: stopped, mode 0", answer.arbitration_id >> 22 & 3 == 0,
          f"{answer.arbitration_id:08X}")
    answer = ask(6, host, bytes([1, 0, 0, 0, 0, 0, 0, 0]), 2)
    seen = angle(answer.data[0], answer.data[1], span)
    check("RS02: where it stands is zero after type 6", abs(seen) < 0.01, f"{seen:.4f}")
    answer = ask(7, 9 << 8 | host, bytes(8), 0)
    check("RS02: type 7 gives it id 9", answer.arbitration_id == 0x9FE,
          f"{answer.arbitration_id:08X}")


def myactuator(bus):
    """Frames as the motion protocol V4.2 writes them."""
    def ask(identifier, data, answered):
        accept = lambda a: a.arbitration_id == answered
        return exchange(bus, frame(identifier, data), accept)

    answer = ask(0x141, bytes.fromhex("9A00000000000000"), 0x241)
    volts, errors = struct.unpack("<HH", answer.data[4:8])
    check("RMD: supply and errors", (volts, errors) == (480, 0), answer.data.hex())
    answer = ask(0x141, bytes.fromhex("B300000064000000"), 0x241)
    check("RMD: time-out of 100 ms is confirmed", answer.data.hex() == "b300000064000000",
          answer.data.hex())
    for k in range(100):
        command = mit(0.3 * (k + 1) / 100, 20, 0.5, 45, 24)
        answer = ask(0x401, command, 0x501)
        time.sleep(0.01)
    seen = angle(answer.data[1], answer.data[2], 12.5)
    check("RMD: motion mode follows to 0.3 rad", abs(seen - 0.3) < 0.05, f"{seen:.3f}")
    answer = ask(0x141, bytes.fromhex("9200000000000000"), 0x241)
    degrees = struct.unpack("<i", answer.data[4:8])[0] / 100
    check("RMD: 92 says the same angle", abs(degrees - 17.2) < 3, f"{degrees} degrees")
    answer = ask(0x141, bytes.fromhex("8000000000000000"), 0x241)
    check("RMD: shut down", answer.data[0] == 0x80, answer.data.hex())
    seen = [ask(0x280, bytes.fromhex("9A00000000000000"), answered) for answered in (0x242,)]
    check("RMD: 280 asks every motor", seen[0].data[0] == 0x9A, seen[0].data.hex())


def odrive_axis(bus):
    node = 1 << 5

    def of(command):
        return lambda a: a.arbitration_id == node | command and not a.is_remote_frame

    def described(name):
        return CANSIMPLE.get_message_by_name(f"Axis1_{name}")

    def tell(name, **signals):
        # The file has every axis at its own ids: nothing here computes them.
        bus.send(frame(described(name).frame_id, described(name).encode(signals)))

    def ask(name):
        wanted = described(name).frame_id
        accept = lambda a: a.arbitration_id == wanted and not a.is_remote_frame
        answer = exchange(bus, frame(wanted, remote=True), accept)
        return described(name).decode(answer.data, decode_choices=False)

    beats, end = [], time.monotonic() + 2
    while time.monotonic() < end:
        message = bus.recv(0.2)
        if message is not None and message.arbitration_id == node | 1:
            beats.append(message)
    check("ODrive: 20 heartbeats in 2 s", 15 <= len(beats) <= 22, len(beats))
    error, state = struct.unpack("<IB", beats[0].data[:5])
    check("ODrive: idle without error",
          (error, state) == (0, odrive.enums.AxisState.IDLE), (error, state))
    beat = described("Heartbeat").decode(beats[0].data, decode_choices=False)
    check("ODrive: heartbeat by the DBC", (beat["Axis_Error"], beat["Axis_State"]) == (0, 1), beat)
    version = ask("Get_Version")
    firmware = tuple(version[f"Fw_Version_{part}"] for part in ("Major", "Minor", "Revision"))
    check("ODrive: firmware", firmware[:2] == (0, 6), firmware)
    supply = ask("Get_Bus_Voltage_Current")["Bus_Voltage"]
    check("ODrive: supply", supply == 24.0, supply)
    warmth = ask("Get_Temperature")["Motor_Temperature"]
    check("ODrive: temperature", 20 < warmth < 40, f"{warmth:.1f}")
    tell("Set_Controller_Mode", Control_Mode=3, Input_Mode=1)
    tell("Set_Limits", Velocity_Limit=10, Current_Limit=20)
    tell("Set_Pos_Gain", Pos_Gain=40)
    tell("Set_Vel_Gains", Vel_Gain=3.5, Vel_Integrator_Gain=0)
    tell("Set_Input_Pos", Input_Pos=0, Vel_FF=0, Torque_FF=0)
    tell("Set_Axis_State", Axis_Requested_State=odrive.enums.AxisState.CLOSED_LOOP_CONTROL)
    for k in range(100):
        tell("Set_Input_Pos", Input_Pos=0.1 * (k + 1) / 100, Vel_FF=0, Torque_FF=0)
        turns = ask("Get_Encoder_Estimates")["Pos_Estimate"]
        time.sleep(0.01)
    check("ODrive: follows to 0.1 turns", abs(turns - 0.1) < 0.01, f"{turns:.4f}")
    torques, powers = ask("Get_Torques"), ask("Get_Powers")
    check("ODrive: torques", abs(torques["Torque_Estimate"]) < 1, torques)
    check("ODrive: powers", abs(powers["Mechanical_Power"]) < 50, powers)
    address = ask("Address")
    check("ODrive: address", address["Node_ID"] == 1 and address["Serial_Number"] > 0, address)
    tell("Set_Controller_Mode", Control_Mode=2, Input_Mode=1)
    for _ in range(50):
        tell("Set_Input_Vel", Input_Vel=0.2, Input_Torque_FF=0)
        speed = ask("Get_Encoder_Estimates")["Vel_Estimate"]
        time.sleep(0.01)
    check("ODrive: velocity mode", abs(speed - 0.2) < 0.03, f"{speed:.3f} turns a second")
    tell("Estop")
    error = ask("Get_Error")["Active_Errors"]
    check("ODrive: an emergency stop is an error", error == odrive.enums.ODriveError.ESTOP_REQUESTED,
          hex(error))
    tell("Set_Axis_State", Axis_Requested_State=odrive.enums.AxisState.CLOSED_LOOP_CONTROL)
    state = ask("Heartbeat")["Axis_State"]
    check("ODrive: and no torque until it is cleared", state == odrive.enums.AxisState.IDLE, state)
    tell("Clear_Errors", Identify=0)
    tell("Set_Controller_Mode", Control_Mode=3, Input_Mode=1)
    tell("Set_Input_Pos", Input_Pos=ask("Get_Encoder_Estimates")["Pos_Estimate"], Vel_FF=0,
         Torque_FF=0)
    tell("Set_Axis_State", Axis_Requested_State=odrive.enums.AxisState.CLOSED_LOOP_CONTROL)
    state = ask("Heartbeat")["Axis_State"]
    check("ODrive: then it drives again",
          state == odrive.enums.AxisState.CLOSED_LOOP_CONTROL, state)
    for endpoint, value in ((153, struct.pack("<f", 0.1)), (154, b"\1\0\0\0")):
        word = struct.unpack("<I", value)[0]
        tell("RxSdo", Opcode=1, Endpoint_ID=endpoint, Reserved=0, Value=word)
        read = described("RxSdo").encode(
            {"Opcode": 0, "Endpoint_ID": endpoint, "Reserved": 0, "Value": 0})
        answer = exchange(bus, frame(described("RxSdo").frame_id, read), of(5))
        check(f"ODrive: endpoint {endpoint} reads back", answer.data[4:] == value,
              answer.data.hex())
    time.sleep(0.3)
    error = ask("Get_Error")["Active_Errors"]
    check("ODrive: silent for 300 ms", error == odrive.enums.ODriveError.WATCHDOG_TIMER_EXPIRED,
          odrive.enums.ODriveError(error).name)


def dictionary():
    objects = canopen.ObjectDictionary()
    sizes = {1: canopen.objectdictionary.UNSIGNED8, 2: canopen.objectdictionary.UNSIGNED16,
             4: canopen.objectdictionary.INTEGER32}
    for index, name, size in ((0x1000, "device", 4), (0x6040, "control", 2),
                              (0x6041, "status", 2), (0x6060, "mode", 1), (0x6061, "shown", 1),
                              (0x6064, "position", 4), (0x607A, "target", 4),
                              (0x6502, "modes", 4), (0x606C, "velocity", 4)):
        variable = canopen.objectdictionary.ODVariable(name, index)
        variable.data_type = sizes[size]
        objects.add_object(variable)
    return objects


def cia402(port):
    network = canopen.Network()
    network.connect(interface="slcan", channel=port, bitrate=1_000_000, sleep_after_open=0.2)
    node = network.add_node(canopen.RemoteNode(1, dictionary()))
    node.sdo.RESPONSE_TIMEOUT = 1.0
    state = node.nmt.wait_for_heartbeat(2)
    check("CiA402: heartbeat", state == "PRE-OPERATIONAL", state)
    device = node.sdo[0x1000].raw
    check("CiA402: device type is profile 402", device & 0xFFFF == 402, hex(device))
    modes = node.sdo[0x6502].raw
    check("CiA402: cyclic position is a supported mode", modes & 1 << 7 != 0, hex(modes))
    check("CiA402: velocity", abs(node.sdo[0x606C].raw) < 100, node.sdo[0x606C].raw)
    for name, code, act in (
        ("an object that is not there", 0x06020000, lambda: node.sdo.upload(0x6503, 0)),
        ("a subindex that is not there", 0x06090011, lambda: node.sdo.upload(0x6041, 7)),
        ("a wrong length", 0x06070010, lambda: node.sdo.download(0x6040, 0, b"\x06\0\0\0")),
        ("a read-only object", 0x06010002, lambda: node.sdo.download(0x6041, 0, b"\0\0")),
    ):
        try:
            seen = act()
        except canopen.SdoAbortedError as abort:
            seen = abort.code
        check(f"CiA402: {name} aborts", seen == code, hex(seen) if isinstance(seen, int) else seen)
    node.sdo[0x6060].raw = 8
    check("CiA402: mode display", node.sdo[0x6061].raw == 8, node.sdo[0x6061].raw)
    node.nmt.state = "OPERATIONAL"
    node.sdo[0x607A].raw = node.sdo[0x6064].raw
    for control, mask, wanted in ((6, 0x6F, 0x21), (7, 0x6F, 0x23), (15, 0x6F, 0x27)):
        node.sdo[0x6040].raw = control
        status = node.sdo[0x6041].raw
        check(f"CiA402: control word {control:02X}", status & mask == wanted, f"{status:04X}")
    position = 0
    for k in range(100):
        target = round(0.3 / 6.283185307179586 * 65536 * (k + 1) / 100)
        network.send_message(0x201, struct.pack("<Hi", 0x0F, target))
        network.sync.transmit()
        time.sleep(0.01)
    time.sleep(0.2)
    position = node.sdo[0x6064].raw * 6.283185307179586 / 65536
    check("CiA402: follows to 0.3 rad on SYNC", abs(position - 0.3) < 0.05, f"{position:.3f}")
    node.sdo[0x6040].raw = 0
    status = node.sdo[0x6041].raw
    check("CiA402: voltage off", status & 0x4F == 0x40, f"{status:04X}")
    network.disconnect()


def main():
    for model, client in (("DM-J4310", lambda bus: damiao(bus, "DM-J4310")),
                          ("AK80-9", cubemars), ("RS02", robstride), ("RMD-V3", myactuator),
                          ("ODrive", odrive_axis)):
        with motors(model) as port, slcan(port) as bus:
            client(bus)
    with motors("CiA402") as port:
        cia402(port)
    group = "239.74.163.2:43977"
    with motors("DM-J4310", group) as port:
        check("multicast: address", port == group, port)
        with can.Bus(interface="udp_multicast", channel="239.74.163.2", port=43977,
                     fd=False) as bus:
            damiao(bus, "DM-J4310 over udp_multicast")
    sys.exit(failed)


main()
