"""Writes the golden files of the paper's ablation: absolute sinusoidal positions,
and sequences that end. With the weights that golden.py wrote; the first part's
head has one row more, whose numbers both sides know.

    python golden_absolute.py ../src/tests/golden ../../training/src/train/golden

`tests/golden/absolute.safetensors`: hidden vectors and logits of golden.py's
inputs. `train/golden/absolute.safetensors`: one training step in which the
first sequence ends, as in golden_step.py.
"""

import os
import sys

import torch
import torch.nn.functional as F
from safetensors.torch import load_file, save_file

import checkpoint
from golden_step import step
from motionseq import MotionSeq

END_BIAS = 0.5


def with_end(folder):
    state = checkpoint.load(os.path.join(folder, "tiny.safetensors"), "seq")
    config = state["config"]
    config["seq"].update(positions="sinusoidal", eos=True)
    first = f"head.{config['parts'][0]}"
    row = 0.2 * torch.sin(torch.arange(config["seq"]["dim"], dtype=torch.float64))
    weight = state["model"][first + ".weight"]
    state["model"][first + ".weight"] = torch.cat([weight, row.float()[None]])
    state["model"][first + ".bias"] = torch.cat([state["model"][first + ".bias"], torch.tensor([END_BIAS])])
    model = MotionSeq(config)
    model.load_state_dict(state["model"])
    return model, config


def forward(folder):
    model, _ = with_end(folder)
    inputs = load_file(os.path.join(folder, "golden.safetensors"))
    codes = inputs["codes"].long()[None]
    previous = torch.cat([codes[:, :1], codes[:, :-1]], 1)
    args = inputs["music"][None], torch.tensor([True]), torch.tensor([1])
    with torch.no_grad():
        golden = {"hidden": model.eval().hidden(previous, *args)[0]}
        for i, logits in enumerate(model(previous, codes, *args)):
            golden[f"logits{i}"] = logits[0]
    save_file({k: v.contiguous() for k, v in golden.items()}, os.path.join(folder, "absolute.safetensors"))


def training(tiny, out):
    model, config = with_end(tiny)
    model.train()
    end = config["codes"]
    target = torch.randint(end, (3, 20, len(model.names)))
    previous = torch.randint(end, (3, 20, len(model.names)))
    music = torch.randn(3, 20, config["music_dim"])
    has_music, style = torch.tensor([True, False, True]), torch.tensor([0, 1, 2])
    lengths = torch.tensor([20, 20, 13])
    valid = torch.arange(20)[None] < lengths[:, None]
    logits = model(previous, target, music, has_music, style)
    # The last frame of the first sequence is beyond its clip: the first part says
    # that it ends, the others say nothing.
    first, others = target[..., 0].clone(), valid.clone()
    first[0, 19], others[0, 19] = end, False
    loss = F.cross_entropy(logits[0][valid], first[valid]) + sum(
        F.cross_entropy(l[others], target[..., 1 + i][others]) for i, l in enumerate(logits[1:]))
    golden = {"in.previous": previous.int(), "in.target": target.int(), "in.music": music,
              "in.has_music": has_music.int(), "in.style": style.int(), "in.lengths": lengths.int(),
              "seq.loss": loss.detach()[None]}
    step("seq", model, loss, golden)
    save_file({k: v.contiguous() for k, v in golden.items()}, os.path.join(out, "absolute.safetensors"))


def main():
    net, train = sys.argv[1:]
    torch.manual_seed(13)
    torch.set_num_threads(1)
    forward(net)
    training(net, train)


if __name__ == "__main__":
    main()
