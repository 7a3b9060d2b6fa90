"""Runs every independent client of this folder against the simulated servos, and makes the table
of what passes.

    cargo build --release && cargo build --release -p servodance-sim --example serve
    python sim/reference/clients.py             # all of them; writes docs/measurements/clients.md
    python sim/reference/clients.py lerobot     # those with this word in their name; writes nothing

Each client gets a virtual environment of its own under target/clients, with pinned packages. The
exit status is 1 if any fact is not as it should be.
"""

import datetime
import os
import platform
import subprocess
import sys
import time
import venv
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
TABLE = ROOT / "docs/measurements/clients.md"
LONGEST_S = 600

CAN = ["python-can==4.6.1", "pyserial", "msgpack", "canopen==2.4.1", "odrive", "cantools",
       "odrive-can==2.1.0"]
LEROBOT = ["dynamixel-sdk==3.7.31", "feetech-servo-sdk==1.0.0", "python-can==4.6.1", "pyserial",
           "deepdiff", "tqdm", "numpy"]
# Name, what it drives, packages, packages without what they ask for, script, program.
CLIENTS = [
    ("dynamixel-sdk 4.1.0", "X series, Protocol 2.0", ["dynamixel-sdk==4.1.0"], [],
     "vendor_sdk.py", "serve"),
    ("dynamixel-sdk 3.7.31", "X series, Protocol 2.0", ["dynamixel-sdk==3.7.31"], [],
     "vendor_sdk.py", "serve"),
    ("dynamixel-sdk 4.1.0, Protocol 1.0", "AX and MX", ["dynamixel-sdk==4.1.0"], [],
     "vendor_sdk1.py", "serve"),
    ("dynamixel-sdk 3.7.31, Protocol 1.0", "AX and MX", ["dynamixel-sdk==3.7.31"], [],
     "vendor_sdk1.py", "serve"),
    ("feetech-servo-sdk 1.0.0", "STS", ["feetech-servo-sdk==1.0.0"], [], "feetech_sdk.py", "serve"),
    ("dynamixel-sdk and rustypot, setting servos up", "ids, rates, watchdog",
     ["dynamixel-sdk==4.1.0", "rustypot==1.13.1"], [], "set_up_clients.py", "servodance"),
    ("rustypot 1.13.1", "XL430, XL330, MX, AX, STS", ["rustypot==1.13.1"], [],
     "rustypot_servos.py", "serve"),
    ("lerobot 0.4.4", "Dynamixel, Feetech, Damiao, RobStride", LEROBOT, ["lerobot==0.4.4"],
     "lerobot_motors.py", "serve"),
    ("python-can 4.6.1, canopen 2.4.1, ODrive's DBC 0.6.10",
     "Damiao, CubeMars, RobStride, MyActuator, ODrive, CiA 402", CAN, [], "python_can.py", "serve"),
    ("moteus 1.1.1", "moteus, CAN FD over fdcanusb", ["moteus==1.1.1"], [], "moteus_client.py",
     "serve"),
]


def environment(packages, bare):
    """The Python of a virtual environment with these packages."""
    wanted = "\n".join(packages + bare)
    folder = TARGET / "clients" / "".join(c if c.isalnum() else "-" for c in "-".join(packages + bare))
    python, complete = folder / "bin/python", folder / "complete"
    if complete.exists() and complete.read_text() == wanted:
        return python
    venv.create(folder, with_pip=True, clear=True)
    for options, names in ((["--no-deps"], bare), ([], packages)):
        if names:
            install = [python, "-m", "pip", "install", "--quiet", *options, *names]
            subprocess.run(install, check=True, stdout=subprocess.DEVNULL)
    complete.write_text(wanted)
    return python


def run(client):
    """The facts of one client, and how long it took."""
    _, _, packages, bare, script, program = client
    programs = {"serve": TARGET / "release/examples/serve",
                "servodance": TARGET / "release/servodance"}
    command = [environment(packages, bare), HERE / script, programs[program]]
    began = time.monotonic()
    try:
        ended = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST_S)
        said, status = ended.stdout, ended.returncode
        last = ended.stderr.strip().splitlines()[-1:]
    except subprocess.TimeoutExpired as late:
        said, status, last = (late.stdout or b"").decode(), 124, [f"not done after {LONGEST_S} s"]
    facts = [line for line in said.splitlines() if line[:5] in ("ok   ", "FAIL ")]
    failures = [line for line in facts if line.startswith("FAIL")]
    if status != 0 and not failures:
        failures = [f"FAIL the script: {' '.join(last) or status}"]
    return facts, failures, time.monotonic() - began


def table(results, revision):
    lines = [
        "# Independent clients against the simulated servos",
        "",
        f"{datetime.date.today()}, revision {revision}, {platform.machine()}, Python "
        f"{platform.python_version()}, in real time; made by `python sim/reference/clients.py`.",
        "Each line of a script is one fact as its client saw it.",
        "",
        "| client | servos | facts | pass | fail | s | script |",
        "|---|---|---|---|---|---|---|",
    ]
    for (name, what, _, _, script, _), (facts, failures, took_s) in results:
        passed = sum(line.startswith("ok") for line in facts)
        row = (name, what, len(facts), passed, len(failures), f"{took_s:.0f}", script)
        lines.append("| " + " | ".join(map(str, row)) + " |")
    failures = [(name, line) for (name, *_), (_, failures, _) in results for line in failures]
    lines += ["", "Failures:" if failures else "No failure.", ""]
    lines += [f"- {name}: {line.removeprefix('FAIL ')}" for name, line in failures]
    return "\n".join(lines).rstrip() + "\n"


def main():
    words = sys.argv[1:]
    chosen = [client for client in CLIENTS if all(word in client[0] for word in words)]
    git = ["git", "-C", ROOT, "describe", "--always", "--dirty", "--exclude=*"]
    revision = subprocess.run(git, capture_output=True, text=True).stdout.strip() or "unknown"
    results = []
    for client in chosen:
        result = run(client)
        results.append((client, result))
        facts, failures, took_s = result
        print(f"{client[0]}: {len(facts)} facts, {len(failures)} failures, {took_s:.0f} s", flush=True)
        for failure in failures:
            print(f"  {failure}", flush=True)
    if not words:
        TABLE.write_text(table(results, revision))
        print(f"{TABLE.relative_to(ROOT)} written")
    sys.exit(any(failures for _, (_, failures, _) in results))


main()
