"""Writes the golden file of one training step of both stages, for the tests of
`model/src/train`: from the weights that golden.py wrote.

    python golden_step.py ../src/tests/golden/tiny.safetensors ../../training/src/train/golden

Inputs, losses, codebooks after the step; gradients and parameters after one step
of AdamW, every fifth number of each. f32, no dropout, no noise.
"""

import os
import sys

import torch
from safetensors.torch import save_file

import checkpoint
from losses import motion_terms
from motionseq import MotionSeq, nll
from train import adamw
from vqvae import VqVae

EVERY = 5


def step(prefix, model, loss, golden):
    """Gradients of a loss, and parameters after clipping and one AdamW step."""
    optimiser = adamw(model, 1e-3, 0.1)
    loss.backward()
    for name, p in model.named_parameters():
        golden[f"gradient.{prefix}.{name}"] = p.grad.flatten()[::EVERY].clone()
    torch.nn.utils.clip_grad_norm_(model.parameters(), 1.0)
    optimiser.step()
    for name, p in model.named_parameters():
        golden[f"after.{prefix}.{name}"] = p.detach().flatten()[::EVERY].clone()


def stage_one(tiny, golden):
    state = checkpoint.load(tiny, "vq")
    model, mean, std = VqVae(state["config"]), state["mean"], state["std"]
    model.load_state_dict(state["model"])
    model.train()
    real = torch.randn(3, 20, 137) * std + mean
    valid = torch.ones(3, 20, dtype=torch.bool)
    out, commit, _ = model((real - mean) / std, valid)
    terms = motion_terms(out, real, mean, std, valid, slide=6.0)
    loss = terms["huber"] + 0.5 * terms["position"] + 0.5 * terms["velocity"] + 0.1 * terms["jerk"] + 0.2 * commit
    for name, value in {"loss": loss, **terms, "commit": commit}.items():
        golden[f"vq.{name}"] = value.detach()[None]
    golden["in.motion"] = real
    step("vq", model, loss, golden)
    for part, book in model.codebook.items():
        for name in ("embed", "embed_avg", "cluster_size"):
            golden[f"book.{part}.{name}"] = getattr(book, name).clone()


def stage_two(tiny, golden):
    state = checkpoint.load(tiny, "seq")
    config = state["config"]
    model = MotionSeq(config)
    model.load_state_dict(state["model"])
    model.train()
    target = torch.randint(config["codes"], (3, 20, len(model.names)))
    previous = torch.randint(config["codes"], (3, 20, len(model.names)))
    music = torch.randn(3, 20, config["music_dim"])
    has_music, style = torch.tensor([True, False, True]), torch.tensor([0, 1, 2])
    lengths = torch.tensor([20, 20, 13])
    valid = torch.arange(20)[None] < lengths[:, None]
    loss = sum(nll(model(previous, target, music, has_music, style), target, valid))
    golden.update({"in.previous": previous.int(), "in.target": target.int(), "in.music": music,
                   "in.has_music": has_music.int(), "in.style": style.int(),
                   "in.lengths": lengths.int(), "seq.loss": loss.detach()[None]})
    step("seq", model, loss, golden)


def main():
    tiny, out = sys.argv[1:]
    os.makedirs(out, exist_ok=True)
    torch.manual_seed(12)
    torch.set_num_threads(1)
    golden = {}
    stage_one(tiny, golden)
    stage_two(tiny, golden)
    save_file({k: v.contiguous() for k, v in golden.items()}, os.path.join(out, "step.safetensors"))


if __name__ == "__main__":
    main()
