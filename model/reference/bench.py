"""A frame of both stages in PyTorch with the same caches, beside `servodance bench model`.

    python bench.py --preset paper --context 300 --threads 2 \
        --servodance ../../target/release/servodance

Takes turns with the Rust program and prints the median of each: what runs on
the machine at the same time disturbs both. Random weights. `int8` is PyTorch's
dynamic quantisation of linear layers.
"""

import argparse
import json
import statistics
import subprocess
import time

import torch
import torch.nn.functional as F

from config import code_names, head_dim, presets
from motionseq import MotionSeq
from vqvae import Decoder


class Ring:
    """Keys and values of the last frames of one layer, written in place."""

    def __init__(self, heads, window, width, dtype):
        self.k = torch.zeros(1, heads, window, width, dtype=dtype)
        self.v = torch.zeros(1, heads, window, width, dtype=dtype)

    def attend(self, attention, q, k, v, slot, bias):
        heads = attention.heads
        q, k, v = (t.view(1, 1, heads, -1).transpose(1, 2) for t in (q, k, v))
        self.k[:, :, slot] = k[:, :, 0]
        self.v[:, :, slot] = v[:, :, 0]
        mixed = F.scaled_dot_product_attention(q, self.k, self.v, attn_mask=bias)
        return attention.out(mixed.transpose(1, 2).reshape(1, -1))


def ages_bias(slopes, window, slot, dtype):
    """ALiBi for a full ring [1, heads, 1, window]."""
    age = (slot - torch.arange(window)) % window
    return (-torch.tensor(slopes)[:, None, None] * age.float())[None].to(dtype)


class Stream:
    """Both stages, a frame at a time; the caches are full from the start."""

    def __init__(self, config, kind):
        self.config, self.vq, self.seq = config, config["vq"], config["seq"]
        self.dtype = torch.bfloat16 if kind == "bf16" else torch.float32
        self.motionseq, self.decoder = MotionSeq(config).eval(), Decoder(config, 0.0).eval()
        if kind == "int8":
            for name in ("motionseq", "decoder"):
                setattr(self, name, torch.ao.quantization.quantize_dynamic(getattr(self, name), {torch.nn.Linear}))
        self.motionseq.to(self.dtype), self.decoder.to(self.dtype)
        self.codebook = torch.randn(config["codes"], len(config["parts"]) * config["code_dim"], dtype=self.dtype)
        width = head_dim(self.seq, self.seq["dim"], self.seq["heads"])
        ring = lambda: Ring(self.seq["heads"], self.seq["window"], width, self.dtype)
        self.own = [ring() for _ in self.motionseq.layers]
        self.heard = [ring() for _ in self.motionseq.layers]
        width = head_dim(self.vq, self.vq["dim"], self.vq["heads"])
        self.rings = [Ring(self.vq["heads"], self.vq["decoder_window"], width, self.dtype)
                      for _ in self.decoder.layers]
        self.codes, self.frame = [0] * len(code_names(config)), 0

    @torch.inference_mode()
    def step(self, music):
        model, seq = self.motionseq, self.seq
        slot = self.frame % seq["window"]
        bias = ages_bias(seq["slopes"], seq["window"], slot, self.dtype)
        slopes = seq["cross_slopes"] if seq["cross_aligned"] else [0.0] * seq["heads"]
        cross_bias = ages_bias(slopes, seq["window"], slot, self.dtype)
        stream = model.music_in(music)
        x = sum(model.embed[p].weight[c][None] for p, c in zip(model.names, self.codes))
        x = x + stream if seq["music_at_input"] else x
        style = model.style.weight[-1:]
        for layer, own, heard in zip(model.layers, self.own, self.heard):
            x = x + own.attend(layer.attn, *layer.attn.qkv(layer.norm1(x)).chunk(3, -1), slot, bias)
            keys_values = layer.cross.kv(stream).chunk(2, -1)
            x = x + heard.attend(layer.cross, layer.cross.q(layer.norm2(x)), *keys_values, slot, cross_bias)
            x = layer.style(x, style).to(self.dtype)
            x = x + layer.ff(layer.norm3(x))
        hidden, chosen = model.norm(x), torch.zeros(1, len(self.codes), dtype=torch.long)
        for i in range(len(self.codes)):
            chosen[0, i] = model.code_logits(i, hidden, chosen)[0, :self.config["codes"]].argmax()
        self.codes = chosen[0].tolist()
        window = self.vq["decoder_window"]
        slot = self.frame % window
        bias = ages_bias(self.vq["decoder_slopes"], window, slot, self.dtype)
        x = self.decoder.input(self.codebook[self.codes[0]][None])
        for layer, ring in zip(self.decoder.layers, self.rings):
            x = x + ring.attend(layer.attn, *layer.attn.qkv(layer.norm1(x)).chunk(3, -1), slot, bias)
            x = x + layer.ff(layer.norm2(x))
        self.frame += 1
        return self.decoder.output(self.decoder.norm(x))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--preset", default="paper")
    parser.add_argument("--context", type=int, help="frames; the preset's own if left out")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--frames", type=int, default=60, help="timed in each turn")
    parser.add_argument("--turns", type=int, default=5)
    parser.add_argument("--kinds", default="f32,bf16,int8", help="what PyTorch computes in")
    parser.add_argument("--dtypes", default="f32,f16,q8_0,q6,q4_0", help="what servodance computes in")
    parser.add_argument("--servodance", default="servodance", help="the program")
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    config = presets(args.preset)
    if args.context:
        config["vq"]["decoder_window"] = config["seq"]["window"] = args.context
    music = torch.randn(1, config["music_dim"])
    kinds = [kind for kind in args.kinds.split(",") if kind]
    streams = {kind: Stream(config, kind) for kind in kinds}
    times = {}
    for _ in range(args.turns):
        for kind, stream in streams.items():
            for i in range(args.frames + 5):
                start = time.perf_counter()
                stream.step(music.to(stream.dtype))
                if i >= 5:
                    times.setdefault(("PyTorch", kind), []).append(1e3 * (time.perf_counter() - start))
        for dtype in filter(None, args.dtypes.split(",")):
            command = [args.servodance, "bench", "model", "--preset", args.preset, "--dtype", dtype, "--json",
                       "--threads", str(args.threads), "--frames", str(args.frames)]
            command += ["--context", str(args.context)] if args.context else []
            found = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
            times.setdefault(("servodance", dtype), []).append((found["ms_p50"], found["limit_ms"], found["read_gbps"]))
    for (who, what), found in times.items():
        if who == "PyTorch":
            print(f"{who:10} {what:5} {statistics.median(found):7.2f} ms a frame")
        else:
            p50, limit, gbps = (statistics.median(column) for column in zip(*found))
            print(f"{who:10} {what:5} {p50:7.2f} ms a frame, limit {limit:.2f} ms ({gbps:.1f} GB/s)")


if __name__ == "__main__":
    main()
