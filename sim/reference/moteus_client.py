"""Drives simulated moteus controllers with the vendor's own client, in real time.

    pip install moteus==1.1.1
    cargo build --release -p servodance-sim --example serve
    python sim/reference/moteus_client.py target/release/examples/serve
"""

import asyncio
import math
import sys

import moteus
from moteus import Mode, Register

from served import Served, attempt, check, done


async def drive(served):
    transport = moteus.Fdcanusb(served.port)
    pan, tilt = (moteus.Controller(id=number, transport=transport) for number in (1, 2))
    # A deadline, where the vendor's client would wait for ever for an answer that is lost.
    within = lambda answer: asyncio.wait_for(answer, 5)

    state = (await within(pan.set_stop(query=True))).values
    check("stopped", state[Register.MODE] == Mode.STOPPED, state[Register.MODE])
    check("supply", state[Register.VOLTAGE] == 24.0, state[Register.VOLTAGE])
    began = state[Register.POSITION]
    for step in range(100):
        turns = began + 0.05 * (step + 1) / 100
        state = (await within(pan.set_position(
            position=turns, watchdog_timeout=0.5, maximum_torque=2.0, query=True))).values
        await asyncio.sleep(0.01)
    check("position mode", state[Register.MODE] == Mode.POSITION, state[Register.MODE])
    off = abs(state[Register.POSITION] - turns)
    check("follows", off < 0.005, f"{off:.4f} turns off")
    other = (await within(tilt.query())).values
    check("the other one rests", other[Register.MODE] == Mode.STOPPED, other[Register.MODE])

    for kind in (moteus.INT8, moteus.INT16, moteus.INT32, moteus.F32):
        wanted = {Register.POSITION: kind, Register.VOLTAGE: kind, Register.COMMAND_TIMEOUT: kind}
        seen = (await within(pan.custom_query(wanted))).values
        passed = (abs(seen[Register.POSITION] - turns) < 0.02
                  and abs(seen[Register.COMMAND_TIMEOUT] - 0.5) < 0.011)
        check(f"registers as kind {kind}", passed, seen)

    await asyncio.sleep(0.7)
    state = (await within(pan.query())).values
    check("silent for longer than its watchdog", state[Register.MODE] == Mode.TIMEOUT,
          state[Register.MODE])
    state = (await within(pan.set_position(position=turns, query=True))).values
    check("then positions are not taken", state[Register.MODE] == Mode.TIMEOUT,
          state[Register.MODE])
    state = (await within(pan.set_stop(query=True))).values
    check("until it is stopped", state[Register.MODE] == Mode.STOPPED, state[Register.MODE])

    for _ in range(50):
        state = (await within(pan.set_position(
            position=math.nan, velocity=0.1, watchdog_timeout=0.5, query=True))).values
        await asyncio.sleep(0.01)
    check("a velocity alone", abs(state[Register.VELOCITY] - 0.1) < 0.02,
          f"{state[Register.VELOCITY]:.3f} turns a second")
    await within(pan.set_stop())
    await within(pan.set_output_exact(position=0.0))
    state = (await within(pan.query())).values
    check("where it stands is zero", abs(state[Register.POSITION]) < 1e-3,
          state[Register.POSITION])


def main():
    with Served(sys.argv[1], "moteus") as served:
        attempt("all of it", None, lambda: asyncio.run(drive(served)))
    done()


main()
