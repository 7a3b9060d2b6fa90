"""Model configuration: one JSON object, the same in Rust (`model/src/config/mod.rs`).

Lengths are frames (20 a second). The presets: `live` is what ships, `paper`
has the sizes of the MAGMA paper, `tiny` is for the golden files of the tests.
"""

import json
from pathlib import Path

PRESETS = Path(__file__).parent.parent / "src" / "config" / "presets"


def presets(name):
    """A fresh copy of the preset `live`, `paper` or `tiny`."""
    if name not in ("live", "paper", "tiny"):
        raise SystemExit(f"unknown preset {name!r}: choose live, paper or tiny")
    return json.loads((PRESETS / f"{name}.json").read_text())


def head_dim(stage, dim, heads):
    """Width of a head: the stage's own, or its share of the model width."""
    return stage.get("head_dim") or dim // heads


def code_places(config):
    """Part and level (from 0) of the codes of a frame, in sampling order: the parts, then
    what the first codes left where a part has more codebooks."""
    levels = config.get("levels") or [1] * len(config["parts"])
    return [(part, level) for level in range(max(levels))
            for part, count in zip(config["parts"], levels) if level < count]


def code_names(config):
    """Names of the codes of a frame: `trunk`, `trunk_2`."""
    return [part if level == 0 else f"{part}_{level + 1}" for part, level in code_places(config)]


def classes(config, name):
    """Classes of a code's head: the first also knows the end of the sequence."""
    return config["codes"] + (1 if config["seq"].get("eos") and name == config["parts"][0] else 0)


def to_json(config):
    return json.dumps(config, separators=(",", ":"))


def part_channels(part):
    """Which of the 137 channels a body part's encoder sees.

    Layout: 0 yaw step, 1-2 root velocity, 3 root height, 4-66 positions of
    joints 1-21, 67-132 velocities of joints 0-21, 133-136 contacts.
    """
    legs = {0, 1, 2, 4, 5, 7, 8, 10, 11}
    joints, contacts = {
        "whole": (set(range(22)), [0, 1, 2, 3]),
        "lower": (legs, [0, 1, 2, 3]),
        "upper": (set(range(22)) - legs, []),
        "trunk": ({0, 1, 2, 3, 6, 9, 12, 13, 14, 15, 16, 17}, []),
        "left_leg": ({4, 7, 10}, [0, 1]),
        "right_leg": ({5, 8, 11}, [2, 3]),
        "left_arm": ({18, 20}, []),
        "right_arm": ({19, 21}, []),
    }[part]
    # Whatever touches the floor also knows how the root moves.
    channels = [0, 1, 2, 3] if contacts or 0 in joints else []
    channels += [4 + 3 * (j - 1) + a for j in sorted(joints - {0}) for a in range(3)]
    channels += [67 + 3 * j + a for j in sorted(joints) for a in range(3)]
    channels += [133 + c for c in contacts]
    return channels


def position_channels(part):
    """Which of the 137 channels are quantised without an encoder: the positions of the
    part's own joints, and with the pelvis the root's numbers."""
    channels = part_channels(part)
    return [c for c in channels if 4 <= c < 67 or (67 in channels and c < 4)]
