"""Times training steps of the twin: for every line on standard input one step,
its milliseconds on standard output. `training/examples/train_step.rs` takes turns with it.

    python step_time.py vqvae|motionseq BATCH LENGTH THREADS f32|bf16

Preset `live`; forward, backward, clipping, AdamW, on one batch of random numbers.
"""

import sys
import time

import torch

from config import presets
from losses import motion_terms
from motionseq import MotionSeq, nll
from train import adamw
from vqvae import VqVae


def main():
    stage, precision = sys.argv[1], sys.argv[5]
    batch, length, threads = map(int, sys.argv[2:5])
    torch.manual_seed(1)
    torch.set_num_threads(threads)
    config = presets("live")
    valid = torch.ones(batch, length, dtype=torch.bool)
    if stage == "vqvae":
        model = VqVae(config).train()
        real, mean, std = torch.randn(batch, length, 137), torch.zeros(137), torch.ones(137)

        def loss():
            out, commit, _ = model(real, valid, True, 0.05)
            terms = motion_terms(out, real, mean, std, valid, 6.0)
            return terms["huber"] + 0.5 * terms["velocity"] + 0.1 * terms["jerk"] + 0.2 * commit
    else:
        config["seq"]["styles"] = ["plain"] * 10
        model = MotionSeq(config).train()
        previous, target = (torch.randint(256, (batch, length, 5)) for _ in range(2))
        music, has = torch.randn(batch, length, 39), torch.ones(batch, dtype=torch.bool)
        style = torch.zeros(batch, dtype=torch.long)

        def loss():
            return sum(nll(model(previous, target, music, has, style), target, valid))
    optimiser = adamw(model, 1e-3, 0.01)
    for _ in sys.stdin:
        start = time.perf_counter()
        with torch.autocast("cpu", dtype=torch.bfloat16, enabled=precision == "bf16"):
            value = loss()
        model.zero_grad(set_to_none=True)
        value.backward()
        torch.nn.utils.clip_grad_norm_(model.parameters(), 1.0)
        optimiser.step()
        print(1e3 * (time.perf_counter() - start), flush=True)


if __name__ == "__main__":
    main()
