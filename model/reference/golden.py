"""Writes the golden files of the Rust tests: a tiny random model and what the
twin computes with it.

    python golden.py ../src/tests/golden

`tiny.safetensors` is a weights file, `golden.safetensors` holds inputs and
outputs: codes, music, decoded motion, hidden vectors and logits, and poses
with the codes that the encoders give them.
"""

import os
import sys

import torch
from safetensors.torch import save_file

from config import code_names, presets, to_json
from export import flat
from motionseq import MotionSeq
from vqvae import VqVae


def main():
    out = sys.argv[1]
    os.makedirs(out, exist_ok=True)
    torch.manual_seed(11)
    config = presets("tiny")
    vq, seq = VqVae(config).eval(), MotionSeq(config).eval()
    for p in seq.parameters():  # nothing stays at zero: every weight is tested
        p.data += 0.2 * torch.randn_like(p)
    for p in [*vq.decoder.parameters(), *vq.encoder.parameters()]:
        p.data += 0.1 * torch.randn_like(p)
    frames = 30  # several windows long
    poses = torch.randn(1, frames, config["motion_dim"])
    wide = len(code_names(config))
    codes = torch.randint(config["codes"], (1, frames, wide))
    previous = torch.cat([codes[:, :1], codes[:, :-1]], 1)
    music = torch.randn(1, frames, config["music_dim"])
    style, null_style = torch.tensor([1]), torch.tensor([2])
    with torch.no_grad():
        has = torch.tensor([True])
        golden = {"codes": codes[0].int(), "music": music[0], "motion": vq.decode(codes)[0],
                  "poses": poses[0], "encoded": vq.encode(poses)[0].int()}
        for name, h, s in [("heard", has, style), ("deaf", ~has, null_style)]:
            golden[f"{name}_hidden"] = seq.hidden(previous, music, h, s)[0]
            for i, logits in enumerate(seq(previous, codes, music, h, s)):
                golden[f"{name}_logits{i}"] = logits[0]
    norms = {"motion_mean": 0.01 * torch.randn(137), "motion_std": 0.05 + 0.01 * torch.rand(137),
             "music_mean": torch.randn(39), "music_std": 1 + torch.rand(39)}
    starts = (torch.randint(config["codes"], (4, wide)), torch.tensor([0, 0, 1, 1]))
    tensors = flat(vq.state_dict(), seq.state_dict(), norms, starts, torch.float32)
    save_file(tensors, os.path.join(out, "tiny.safetensors"), metadata={
        "format": "servodance-model-1", "config": to_json(config),
        "default_style": "wild", "provenance": "{}"})
    save_file({k: v.contiguous() for k, v in golden.items()}, os.path.join(out, "golden.safetensors"))


if __name__ == "__main__":
    main()
