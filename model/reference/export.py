"""Joins the checkpoints of both stages into the weights file that ships.

    python export.py --vq vq/last.pt --seq seq/last.pt --data stage2.safetensors \
        --note "trained ..." --out ../weights/live.safetensors

f16 tensors; configuration, style names and provenance in the metadata. The
encoders are a third of it; `generate --start` and `reconstruct` need them.
"""

import argparse
import datetime
import hashlib
import json

import torch
from safetensors.torch import save_file

import checkpoint
from config import to_json
from data import Dataset
from vqvae import VqVae


def flat(vq, seq, norms, starts, dtype):
    """All tensors under the names that `model/src/weights` asks for."""
    out = {}
    for name, value in vq.items():
        if name.startswith(("encoder.", "decoder.")):
            out["vq." + name] = value
        if name.endswith(".embed"):
            out["vq." + name.removesuffix(".embed")] = value
    out.update({"seq." + name: value for name, value in seq.items()})
    out = {name: value.to(dtype).contiguous() for name, value in out.items()}
    out.update({"norm." + name: value.float().contiguous() for name, value in norms.items()})
    codes, styles = starts
    out["start.codes"] = codes.to(torch.int32).contiguous()
    out["start.styles"] = styles.to(torch.int32)[:, None].contiguous()
    return out


@torch.no_grad()
def starts_of(data, vq, mean, std, count=24):
    """Codes of `count` moments of each style to begin from: in the middle of
    the dance (with music where there is some), not faster than half of it."""
    codes, styles, around = [], [], 60
    for style in range(len(data.styles)):
        clips = [c for c in data.of_split(0) if data.style[c] == style]
        if not clips:
            continue  # a style of other data
        clips = [c for c in clips if data.has_music[c]] or clips
        frames = torch.cat([torch.arange(len(data.motion))[data.frames(c)][around:-around] for c in clips])
        speed = data.motion[frames, 67:133].unflatten(-1, (22, 3)).norm(dim=-1).mean(-1)
        middle = frames[speed.argsort()[int(0.3 * len(frames)): int(0.5 * len(frames))]]
        pick = middle[torch.linspace(0, len(middle) - 1, count).long()]
        crops = data.motion[pick[:, None] + torch.arange(-around, around + 1)]
        codes.append(vq.encode((crops - mean) / std)[:, around])
        styles.append(torch.full((count,), style))
    return torch.cat(codes), torch.cat(styles)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    for name in ("vq", "seq", "data", "out"):
        parser.add_argument("--" + name, required=True)
    parser.add_argument("--default-style", required=True, help="danced when none is asked for")
    parser.add_argument("--note", default="", help="goes into the provenance")
    args = parser.parse_args()
    torch.set_num_threads(1)
    vq, seq = checkpoint.load(args.vq, "vq"), checkpoint.load(args.seq, "seq")
    config, data = seq["config"], Dataset(args.data)
    if args.default_style not in config["seq"]["styles"]:
        parser.error(f"--default-style: choose one of {', '.join(config['seq']['styles'])}")
    model = VqVae(config)
    model.load_state_dict(vq["model"])
    model.eval()
    starts = starts_of(data, model, vq["mean"], vq["std"])
    norms = {"motion_mean": vq["mean"], "motion_std": vq["std"],
             "music_mean": seq["music_mean"], "music_std": seq["music_std"]}
    provenance = {
        "date": datetime.date.today().isoformat(),
        "data_sha256": hashlib.sha256(open(args.data, "rb").read()).hexdigest(),
        "data_recipe": data.recipe, "vq_steps": vq["step"], "vq_minutes": vq["elapsed"] / 60,
        "seq_steps": seq["step"], "seq_minutes": seq["elapsed"] / 60, "note": args.note}
    tensors = flat(vq["model"], seq["model"], norms, starts, torch.float16)
    for name, value in tensors.items():
        if not torch.isfinite(value.float()).all():
            raise SystemExit(f"tensor {name} is not finite in float16")
    save_file(tensors, args.out, metadata={
        "format": "servodance-model-1", "config": to_json(config),
        "default_style": args.default_style, "provenance": json.dumps(provenance)})
    count = sum(v.numel() for v in tensors.values())
    print(f"{args.out}: {len(tensors)} tensors, {count / 1e6:.2f} M numbers")


if __name__ == "__main__":
    main()
