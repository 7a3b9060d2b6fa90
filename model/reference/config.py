"""Model configuration: one JSON object, the same in Rust (`model/src/config/mod.rs`).

Lengths are frames (20 a second). The presets: `live` is what ships, `paper`
has the sizes of the MAGMA paper, `tiny` is for the golden files of the tests.
"""

import copy
import json

MOTION_DIM = 137
MUSIC_DIM = 39


def alibi_slopes(heads, scale=1.0):
    """A geometric sequence from 1/2 to 1/256, whatever the number of heads."""
    if heads == 1:
        return [0.5 * scale]
    return [scale * 2.0 ** -(1 + 7 * h / (heads - 1)) for h in range(heads)]


LIVE = {
    "preset": "live",
    "motion_dim": MOTION_DIM,
    "music_dim": MUSIC_DIM,
    "parts": ["trunk", "left_leg", "right_leg", "left_arm", "right_arm"],
    "codes": 256,
    "code_dim": 32,
    "activation": "relu2",
    "vq": {
        "dim": 192,
        "heads": 6,
        "ff": 768,
        "encoder_dim": 128,
        "encoder_layers": 3,
        "encoder_window": 16,
        "encoder_slopes": alibi_slopes(4),
        "decoder_layers": 4,
        "decoder_window": 64,
        "decoder_slopes": alibi_slopes(6),
    },
    "seq": {
        "dim": 256,
        "heads": 8,
        "ff": 1024,
        "layers": 4,
        "window": 160,
        "slopes": alibi_slopes(8),
        "cross_slopes": alibi_slopes(8),
        "cross_aligned": True,
        "lookahead": 0,
        "music_at_input": True,
        "style_dim": 64,
        "styles": [],
    },
}


def presets(name):
    """A fresh copy of the preset `live`, `paper` or `tiny`."""
    config = copy.deepcopy(LIVE)
    config["preset"] = name
    vq, seq = config["vq"], config["seq"]
    if name == "live":
        return config
    if name == "paper":
        config.update(parts=["whole"], codes=1024, code_dim=768, activation="gelu")
        # Eq. 1 puts the bias inside the division by sqrt(d_k); 8 heads of 64, as
        # in the released code.
        slopes = alibi_slopes(8, scale=64 ** -0.5)
        vq.update(dim=768, heads=8, head_dim=64, ff=3072, encoder_dim=768, encoder_layers=12, encoder_window=400,
                  encoder_slopes=slopes, decoder_layers=12, decoder_window=400, decoder_slopes=slopes)
        seq.update(dim=768, heads=8, head_dim=64, ff=3072, layers=12, window=400, slopes=slopes,
                   cross_slopes=[0.0] * 8, cross_aligned=False, music_at_input=False, style_dim=512,
                   eos=True)
        return config
    if name == "tiny":
        config.update(parts=["lower", "upper"], codes=16, code_dim=8)
        vq.update(dim=32, heads=4, ff=64, encoder_dim=32, encoder_layers=1, encoder_window=4,
                  encoder_slopes=alibi_slopes(4), decoder_layers=2, decoder_window=6,
                  decoder_slopes=alibi_slopes(4))
        seq.update(dim=32, heads=4, ff=64, layers=2, window=8, slopes=alibi_slopes(4),
                   cross_slopes=alibi_slopes(4), style_dim=8, styles=["plain", "wild"])
        return config
    raise SystemExit(f"unknown preset {name!r}: choose live, paper or tiny")


def head_dim(stage, dim, heads):
    """Width of a head: the stage's own, or its share of the model width."""
    return stage.get("head_dim") or dim // heads


def classes(config, part):
    """Classes of a part's head: the first also knows the end of the sequence."""
    return config["codes"] + (1 if config["seq"].get("eos") and part == config["parts"][0] else 0)


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
