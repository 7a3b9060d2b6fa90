"""What `robot check`, `robot new` and `dance` make of public robot descriptions, as JSON.

    python tests/robots/gather.py tests/robots/public.txt FOLDER
    python tests/robots/survey.py SERVODANCE tests/robots/public.txt FOLDER --out table.json
        [--guess-only] [--only TEXT] [--song SONG] [--jobs N]

The list has a line a robot: the file, the kind of body that a person sees in it (`refused`:
nothing in it can show a dance), and for bodies like a human's the links that a person takes
as its parts, `part=link`; `-` where it has none. The table has a row a robot: kind and parts
as guessed, what of the pelvis' and the arms' movement stands, F1 at the servos, limits broken,
falls, why it was refused; a summary is printed. With --guess-only nothing dances. Wrong kinds
and parts are listed at the end; the exit code is 1 if there is one, or if a program died of
anything but a refusal.
"""

import argparse
import concurrent.futures
import json
import os
import re
import subprocess
import sys
import tempfile
import time
import wave

from gather import place_of, read_list

SECONDS = 20
GIVE_UP_S = 900


def run(*command):
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=GIVE_UP_S)
    except subprocess.TimeoutExpired:
        return 124, "", f"gave up after {GIVE_UP_S} s"
    return done.returncode, done.stdout, done.stderr


def last_line(text):
    lines = text.strip().splitlines()
    return lines[-1] if lines else ""


def excerpt(servodance, path):
    """The first seconds of the built-in song."""
    code, _, err = run(servodance, "song", "--out", path)
    if code:
        sys.exit(f"no song: {last_line(err)}")
    with wave.open(path) as song:
        rate, form = song.getframerate(), song.getparams()
        sound = song.readframes(SECONDS * rate)
    with wave.open(path, "wb") as song:
        song.setparams(form)
        song.writeframes(sound)


def checked(servodance, path):
    code, out, err = run(servodance, "robot", "check", path, "--json", "--no-world")
    if code not in (0, 1) or not out.strip():
        return {"died": f"robot check: exit code {code}: {last_line(err)}"}
    found = json.loads(out)
    row = {"usable": found["usable"], **(found.get("body") or {})}
    refused = [f for f in found["findings"] if f["severity"] == "refused"]
    if refused:
        row["refused"] = "; ".join(f"{f['code']} {f['subject']}: {f['message']}" for f in refused)
    return row


def drafted(servodance, path, out):
    begin = time.monotonic()
    code, said, err = run(servodance, "robot", "new", path, "--out", out, "--force")
    row = {"new_s": round(time.monotonic() - begin, 1)}
    if code == 1:
        return row | {"refused": last_line(err)}
    if code != 0:
        return row | {"died": f"robot new: exit code {code}: {last_line(err)}"}
    tried = [line[len("tried: "):] for line in said.splitlines() if line.startswith("tried: ")]
    row["tried"] = tried
    shares = re.search(r"(\d+) % of the pelvis's movement and (\d+) % of the arms'", " ".join(tried))
    if shares:
        row["pelvis_share"], row["arms_share"] = (int(share) / 100 for share in shares.groups())
    error = re.search(r"point within (\d+) degrees", " ".join(tried))
    if error:
        row["arms_deg"] = int(error.group(1))
    with open(out) as file:
        row["stance"] = re.search(r'stance = "(\w+)"', file.read()).group(1)
    return row


def danced(servodance, robot, song, report):
    code, _, err = run(servodance, "dance", song, "--robot", robot, "--no-picture", "--quiet", "--report", report)
    row = {"dance_code": code}
    if code not in (0, 1):
        row["died"] = f"dance: exit code {code}: {last_line(err)}"
    elif code == 1:
        row["dance_error"] = last_line(err)
    if os.path.exists(report):
        with open(report) as file:
            told = json.load(file)
        row["f1"] = (told["alignment"]["servos"] or {}).get("f1")
        row["violations"] = sum((told["violations"] or {}).values())
        row["following"] = told["following"]["share"]
        row["fell"] = bool(told["body"] and told["body"]["fell"])
    return row


def wrong_parts(row, wanted):
    """Parts that are on another link than a person takes."""
    found = row.get("parts") or {}
    tips = {tip["name"]: tip["link"] for tip in row.get("tips") or []}
    wrong = []
    for part, link in wanted.items():
        taken = row.get(part, "-") if part in ("forward", "up") else found.get(part) or "-"
        taken = tips.get(taken, taken)
        if taken not in link.split("|"):
            wrong.append(f"{part} is {link}, taken as {taken}")
    return wrong


def survey(servodance, folder, song, guess_only, listed):
    path = str(place_of(folder, listed))
    name = f"{listed['repository']}: {listed['file']}"
    row = {"file": name, "wanted": listed["kind"], **checked(servodance, path)}
    row["wrong_parts"] = wrong_parts(row, listed["parts"])
    if guess_only or "died" in row:
        return row
    with tempfile.TemporaryDirectory() as place:
        robot = os.path.join(place, "robot.toml")
        row.update(drafted(servodance, path, robot))
        if os.path.exists(robot):
            row.update(danced(servodance, robot, song, os.path.join(place, "report.json")))
    return row


def kind_of(row):
    return "refused" if "refused" in row else row.get("kind", "none")


def summary(rows):
    """Means over the humanoids that danced."""
    danced = [row for row in rows if row.get("f1") is not None]
    if not danced:
        return
    mean = sum(row["f1"] for row in danced) / len(danced)
    planted = sum(row["stance"] != "hung" for row in danced)
    fell, broken = sum(row["fell"] for row in danced), sum(row["violations"] for row in danced)
    print(f"{len(danced)} humanoids danced, {planted} on their feet: mean F1 {mean:.2f}, {fell} fell, "
          f"{broken} limits broken")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("servodance")
    parser.add_argument("list")
    parser.add_argument("folder")
    parser.add_argument("--out", required=True)
    parser.add_argument("--song", help="a WAV file; the built-in song, its first 20 s, if left out")
    parser.add_argument("--guess-only", action="store_true")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--only", default="", help="robots whose file has this text in it")
    args = parser.parse_args()
    robots = [row for row in read_list(args.list) if args.only in row["file"]]
    with tempfile.TemporaryDirectory() as place:
        song = args.song or os.path.join(place, "song.wav")
        if not args.song and not args.guess_only:
            excerpt(args.servodance, song)
        with concurrent.futures.ThreadPoolExecutor(args.jobs) as pool:
            jobs = [pool.submit(survey, args.servodance, args.folder, song, args.guess_only, robot)
                    for robot in robots]
            rows = []
            for job in jobs:
                rows.append(job.result())
                print(json.dumps({k: rows[-1].get(k) for k in
                                  ("file", "wanted", "kind", "stance", "f1", "fell", "refused", "died")}))
                with open(args.out, "w") as file:
                    json.dump(rows, file, indent=1)
    wrong = [row for row in rows if kind_of(row) != row["wanted"]]
    parts = [row for row in rows if row["wrong_parts"]]
    died = [row for row in rows if "died" in row]
    for row in wrong:
        print(f"kind: {row['file']} is {row['wanted']}, taken as {kind_of(row)}")
    for row in parts:
        print(f"parts: {row['file']}: " + "; ".join(row["wrong_parts"]))
    for row in died:
        print(f"died: {row['file']}: {row['died']}")
    checked_parts = sum(len(robot["parts"]) for robot in robots)
    print(f"{len(rows)} robots, {len(wrong)} kinds wrong, {len(died)} died; of {checked_parts} parts "
          f"{sum(len(row['wrong_parts']) for row in parts)} wrong")
    summary([row for row in rows if row.get("kind") == "humanoid"])
    sys.exit(1 if wrong or died or parts else 0)


if __name__ == "__main__":
    main()
