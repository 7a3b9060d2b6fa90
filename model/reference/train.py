"""Trains one stage on a time budget, on a CPU or a GPU.

    python train.py vqvae     --data stage1.safetensors --out vq  --minutes 30
    python train.py motionseq --data stage2.safetensors --out seq --vq vq/last.pt --minutes 45

Writes `last.pt` (everything needed to `--resume`; also when told to end by
SIGTERM), `curves.csv` and prints one line a report. Muon and AdamW, warm-up then cosine over the time budget, gradient
clipping.
"""

import argparse
import csv
import math
import os
import signal
import time

import torch
import torch.nn.functional as F

import checkpoint
from config import presets
from data import Crops, Dataset, beat_agreement
from geometry import FEET, displacement, local_joints
from losses import motion_terms
from motionseq import MotionSeq, nll
from vqvae import VqVae


def adamw(model, lr, weight_decay):
    """As `servodance train` uses it: matrices of linear layers decay, nothing else."""
    decays = {id(m.weight) for m in model.modules() if isinstance(m, torch.nn.Linear)}
    groups = [{"params": [p for p in model.parameters() if (id(p) in decays) == shrinks],
               "weight_decay": weight_decay if shrinks else 0.0} for shrinks in (True, False)]
    return torch.optim.AdamW(groups, lr=lr, betas=(0.9, 0.98))


class Run:
    """The parts of a training run that both stages share."""

    def __init__(self, args, model, config, extra):
        self.args, self.model, self.config, self.extra = args, model, config, extra
        self.device = args.device
        model.to(args.device)
        if args.optimiser == "adamw":
            self.optimisers = [adamw(model, args.lr, args.weight_decay)]
        else:
            # Matrices inside the layers learn by Muon (steps of equal size in all
            # directions: fewer steps needed), everything else by AdamW.
            hidden = {id(p) for n, p in model.named_parameters() if p.ndim == 2 and "layers." in n}
            muon = [p for p in model.parameters() if id(p) in hidden]
            rest = [p for p in model.parameters() if id(p) not in hidden]
            self.optimisers = [
                torch.optim.Muon(muon, lr=args.lr, weight_decay=args.weight_decay,
                                 adjust_lr_fn="match_rms_adamw"),
                torch.optim.AdamW(rest, lr=args.lr, betas=(0.9, 0.98), weight_decay=0.0)]
        self.step, self.elapsed, self.sums, self.count = 0, 0.0, {}, 0
        self.stopped = False
        signal.signal(signal.SIGTERM, lambda *_: setattr(self, "stopped", True))
        os.makedirs(args.out, exist_ok=True)
        self.path = os.path.join(args.out, "last.pt")
        if args.resume and os.path.exists(self.path):
            state = torch.load(self.path, weights_only=False)
            model.load_state_dict(state["model"])
            for optimiser, saved in zip(self.optimisers, state["optimisers"]):
                optimiser.load_state_dict(saved)
            self.step, self.elapsed = state["step"], state["elapsed"]
            self.extra = {key: state[key] for key in extra}  # normalisation stays
            torch.set_rng_state(state["rng"])

    def rate(self):
        warm = min(1.0, (self.step + 1) / self.args.warm_up)
        progress = min(1.0, self.elapsed / (60 * self.args.minutes))
        return self.args.lr * warm * (0.02 + 0.98 * 0.5 * (1 + math.cos(math.pi * progress)))

    def save(self):
        state = {"model": self.model.state_dict(), "optimisers": [o.state_dict() for o in self.optimisers],
                 "step": self.step, "elapsed": self.elapsed, "rng": torch.get_rng_state(),
                 "config": self.config, **self.extra}
        torch.save(state, self.path + ".part")
        os.replace(self.path + ".part", self.path)

    def loop(self, losses, validate):
        """`losses()` gives a dict whose `loss` is minimised; the rest is reported."""
        args, start = self.args, time.time() - self.elapsed
        curves = open(os.path.join(args.out, "curves.csv"), "a" if self.step else "w", newline="")
        writer, saved, last_report = None, time.time(), (self.step, time.time())
        while not self.stopped and self.elapsed < 60 * args.minutes and self.step < args.steps:
            for optimiser in self.optimisers:
                for group in optimiser.param_groups:
                    group["lr"] = self.rate()
            self.model.train()
            with torch.autocast(self.device, dtype=torch.bfloat16, enabled=args.bf16):
                report = losses(self.step)
            self.model.zero_grad(set_to_none=True)
            report["loss"].backward()
            norm = torch.nn.utils.clip_grad_norm_(self.model.parameters(), 1.0)
            for optimiser in self.optimisers:
                optimiser.step()
            for key, value in {**report, "grad": norm}.items():
                self.sums[key] = self.sums.get(key, 0.0) + float(torch.as_tensor(value).detach())
            self.count += 1
            self.step += 1
            self.elapsed = time.time() - start
            if self.step % args.report == 0:
                now = time.time()
                row = {"step": self.step, "minutes": round(self.elapsed / 60, 2), "lr": self.rate(),
                       "ms_a_step": 1e3 * (now - last_report[1]) / (self.step - last_report[0])}
                row.update({k: v / self.count for k, v in self.sums.items()})
                self.model.eval()
                with torch.no_grad():
                    row.update(validate())
                if writer is None:
                    writer = csv.DictWriter(curves, row.keys())
                    if self.step == args.report:
                        writer.writeheader()
                writer.writerow(row)
                curves.flush()
                print(" ".join(f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}"
                               for k, v in row.items()), flush=True)
                self.sums, self.count, last_report = {}, 0, (self.step, time.time())
            if time.time() - saved > 120:
                self.save()
                saved = time.time()
        self.save()


def clip_weights(data, clips, args):
    """Dance counts 1, anything else, rendered choreography and clips without
    music as told; dance with music more, the better it meets the beat; the
    clips of a rare style more than those of a frequent one."""
    weights = torch.where(data.dance[clips] == 1, 1.0, args.other)
    weights = torch.where(data.synthetic[clips] == 1, args.synthetic, weights)
    heard = data.has_music[clips] == 1
    weights = torch.where(heard, weights, args.silent * weights)
    if args.follow:
        agreement = torch.tensor([beat_agreement(data, c) if h else 0.0 for c, h in zip(clips, heard)])
        weights = torch.where(heard, weights * (agreement / agreement[heard].mean()) ** args.follow, weights)
    minutes = weights * data.clip_length[clips]
    of_style = torch.zeros(len(data.styles)).index_add_(0, data.style[clips], minutes)
    return weights * of_style[data.style[clips]] ** -args.balance


def usage(codes, total):
    """Share of codes used, and perplexity."""
    share = torch.bincount(codes.flatten(), minlength=total).float()
    share = share / share.sum()
    entropy = -(share * share.clamp(min=1e-12).log()).sum()
    return float((share > 0).float().mean()), float(entropy.exp())


def train_vqvae(args):
    data = Dataset(args.data)
    config = presets(args.preset)
    if args.parts:
        config["parts"] = args.parts.split("/")
    mean, std = data.normalisation()
    model = VqVae(config, args.dropout)
    run = Run(args, model, config, {"mean": mean, "std": std})
    mean, std = run.extra["mean"], run.extra["std"]
    clips = data.of_split(0)
    crops = Crops(data, clips, clip_weights(data, clips, args), args.length, args.seed + run.step)

    def losses(step):
        index, valid, _ = crops.batch(args.batch)
        real = data.motion[index]
        motion = (real - mean) / std
        quantise = step >= args.free_steps
        if quantise and not model.codebook[model.parts[0]].ready:
            z = [model.latents((data.motion[i] - mean) / std) for i in
                 (crops.batch(args.batch)[0] for _ in range(12))]
            left = {p: torch.cat([a[p].flatten(0, 1) for a in z]) for p in model.parts}
            for part, name in zip(model.part_of, model.names):
                book = model.codebook[name]
                book.k_means(left[part])
                left[part] = left[part] - F.embedding(book.nearest(left[part]), book.embed)
        out, commit, codes = model(motion, valid, quantise, args.code_noise)
        terms = motion_terms(out, real, mean, std, valid, args.slide)
        loss = (terms["huber"] + args.position * terms["position"] + args.move * terms["velocity"]
                + args.jerk * terms["jerk"] + 0.2 * commit)
        return {"loss": loss, **terms, "commit": commit}

    held = [c for c in data.of_split(1) if data.dance[c] == 1 and data.variant[c] == 0
            and data.synthetic[c] == 0]

    def validate():
        return score_vqvae(model, data, mean, std, held[:24])

    run.loop(losses, validate)


def score_vqvae(model, data, mean, std, clips):
    """Reconstruction error on whole clips, millimetres; codes used."""
    error, moved_error, slide, stood, codes = [], [], [], [], []
    for clip in clips:
        real = data.motion[data.frames(clip)][:800]
        code = model.encode(((real - mean) / std)[None])
        out = model.decode(code)[0] * std + mean
        codes.append(code[0])
        error.append((local_joints(out) - local_joints(real)).norm(dim=-1).mean(-1))
        moved, true = displacement(out), displacement(real)
        moved_error.append((moved - true).norm(dim=-1).mean(-1))
        stand = real[:-1, 133:137] * real[1:, 133:137]
        slide.append((moved[:, FEET][..., [0, 2]].norm(dim=-1) * stand).sum())
        stood.append(stand.sum())
    codes = torch.cat(codes)
    row = {"val_mpjpe_mm": 1e3 * float(torch.cat(error).mean()),
           "val_move_mm": 1e3 * float(torch.cat(moved_error).mean()),
           "val_slide_mm": 1e3 * float(sum(slide) / sum(stood).clamp(min=1))}
    for i, name in enumerate(model.names):
        used, perplexity = usage(codes[:, i], model.config["codes"])
        row[f"{name}_used"], row[f"{name}_perplexity"] = used, perplexity
    return row


@torch.no_grad()
def tokenise(model, data, mean, std):
    """Codes [N, names] of every frame; clips are encoded in overlapping pieces."""
    margin, piece = model.config["vq"]["encoder_window"] * model.config["vq"]["encoder_layers"], 2000
    codes = torch.zeros(len(data.motion), len(model.names), dtype=torch.long)
    for clip in range(len(data.clip_start)):
        frames = data.frames(clip)
        motion = (data.motion[frames] - mean) / std
        for a in range(0, len(motion), piece):
            low, high = max(0, a - margin), min(len(motion), a + piece + margin)
            part = model.encode(motion[None, low:high])[0]
            end = min(a + piece, len(motion))
            codes[frames.start + a:frames.start + end] = part[a - low:end - low]
    return codes


def corrupt(previous, rate, neighbours):
    """Replaces a share of codes: half by a near code, half by one from
    elsewhere in the batch, so that generation survives its own mistakes."""
    noisy = previous.clone()
    shape = previous.shape[:2]
    for i in range(previous.shape[-1]):
        codes = previous[..., i]
        near = neighbours[i][codes, torch.randint(neighbours[i].shape[1], shape)]
        far = codes.flatten()[torch.randint(codes.numel(), shape)]
        other = torch.where(torch.rand(shape) < 0.5, near, far)
        noisy[..., i] = torch.where(torch.rand(shape) < rate[:, None], other, codes)
    return noisy


def shaken_history(index, valid, data, clips, share, reach):
    """Frame indices whose clock runs off the music's: in `share` of the
    sequences the past is shown early or late by up to `reach` frames, changing
    every second or so. What comes next is still due on the music's time, so
    the model learns to follow the beat it hears and not the habit of the past."""
    batch, length = index.shape
    piece = (torch.rand(batch, length) < 0.05).long().cumsum(1)
    offsets = torch.randint(-reach, reach + 1, (batch, int(piece.max()) + 1))
    offset = offsets.gather(1, piece) * (torch.rand(batch, 1) < share)
    first = data.clip_start[clips][:, None]
    last = first + data.clip_length[clips][:, None] - 1
    return torch.maximum(torch.minimum(index + offset, last), first)


def veiled(music, share):
    """Hides or blurs timbre and chroma (channels 2-32): few songs are many
    frames long, and a model that can tell them apart learns them by heart."""
    veil = torch.zeros(music.shape[-1], dtype=torch.bool)
    veil[2:33] = True
    hidden = (torch.rand(len(music), 1, 1) < share) & veil
    blurred = music + torch.randn_like(music) * veil
    return torch.where(hidden, torch.zeros_like(music), blurred)


def train_motionseq(args):
    data = Dataset(args.data)
    state = checkpoint.load(args.vq, "vq")
    config, mean, std = state["config"], state["mean"], state["std"]
    before = checkpoint.load(args.start, "seq") if args.start else None
    config["seq"] = before["config"]["seq"] if before else presets(args.preset)["seq"]
    config["seq"]["styles"] = data.styles
    vq = VqVae(config)
    vq.load_state_dict(state["model"])
    vq.eval()
    codes = tokenise(vq, data, mean, std)
    neighbours = [vq.codebook[p].distances(vq.codebook[p].embed).topk(9, largest=False).indices[:, 1:]
                  for p in vq.names]
    # Weights that go on learning keep the scale of the music that they know.
    music_mean, music_std = ((before["music_mean"], before["music_std"]) if before
                             else data.music_normalisation())
    music = ((data.music - music_mean) / music_std).clamp(-6, 6)
    music[:, 35:] = data.music[:, 35:]
    has_music = data.has_music == 1
    model = MotionSeq(config, args.dropout)
    null_style = len(data.styles)
    if before:
        model.load_state_dict(before["model"])
    run = Run(args, model, config, {"music_mean": music_mean, "music_std": music_std})
    clips = data.of_split(0)
    crops = Crops(data, clips, clip_weights(data, clips, args),
                  args.length + 1, args.seed + run.step)

    def gather(index, clip):
        return (codes[index[:, :-1]], codes[index[:, 1:]], music[index[:, 1:]], has_music[clip],
                data.style[clip])

    def losses(step):
        index, valid, clip = crops.batch(args.batch)
        previous, target, heard, has, style = gather(index, clip)
        has = has & (torch.rand(len(has)) >= args.music_drop)
        shaken = shaken_history(index[:, :-1], valid, data, clip, args.shake, 4)
        previous = torch.where(has[:, None, None], codes[shaken], previous)
        heard = veiled(heard, args.veil)
        style = torch.where(torch.rand(len(style)) < args.style_drop, null_style, style)
        rate = torch.rand(len(has)) * 2 * args.token_noise
        rate = torch.where(torch.rand(len(has)) < 0.15, 0.2 + 0.6 * torch.rand(len(has)), rate)
        noisy = corrupt(previous, rate, neighbours)
        logits = model(noisy, target, heard, has, style)
        parts = nll(logits, target, valid[:, 1:], args.smoothing)
        return {"loss": sum(parts), **{f"nll_{p}": v for p, v in zip(model.names, parts)}}

    held = [c for c in data.of_split(1) if data.has_music[c] == 1][:48]
    rng = torch.Generator().manual_seed(7)

    def validate():
        """Likelihood of held-out clips with their music, with another clip's
        and with none: what the music is worth."""
        rng.manual_seed(7)
        fixed = Crops(data, torch.stack(held), torch.ones(len(held)), args.length + 1, seed=7)
        index, valid, clip = fixed.batch(32)
        previous, target, heard, has, style = gather(index, clip)
        row = {}
        for name, m, h in [("val", heard, has), ("wrong", heard.roll(1, 0), has),
                           ("silent", heard, torch.zeros_like(has))]:
            with torch.autocast(args.device, dtype=torch.bfloat16, enabled=args.bf16):
                logits = model(previous, target, m, h, style)
            row[f"{name}_nll"] = float(sum(nll(logits, target, valid[:, 1:])))
            if name == "val":
                for i, p in enumerate(model.names):
                    hit = (logits[i].argmax(-1) == target[..., i])[valid[:, 1:]]
                    row[f"acc_{p}"] = float(hit.float().mean())
        return row

    run.loop(losses, validate)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("stage", choices=["vqvae", "motionseq"])
    parser.add_argument("--data", required=True)
    parser.add_argument("--out", required=True, help="folder for checkpoints and curves")
    parser.add_argument("--vq", help="stage 1, for stage 2: checkpoint or weights file")
    parser.add_argument("--start", help="stage 2: checkpoint or weights file to go on from, with a new optimiser")
    parser.add_argument("--preset", default="live")
    parser.add_argument("--parts", help="body parts, e.g. whole or lower/upper")
    parser.add_argument("--minutes", type=float, default=30)
    parser.add_argument("--steps", type=int, default=10**9)
    parser.add_argument("--batch", type=int, default=32)
    parser.add_argument("--length", type=int, help="frames of a crop (96 for stage 1, 240 for stage 2)")
    parser.add_argument("--lr", type=float, default=1e-3)
    parser.add_argument("--warm-up", type=int, default=200)
    parser.add_argument("--optimiser", choices=["muon", "adamw"], default="muon")
    parser.add_argument("--weight-decay", type=float, default=0.01)
    parser.add_argument("--dropout", type=float, default=0.0)
    parser.add_argument("--other", type=float, default=0.4, help="weight of clips that are no dance")
    parser.add_argument("--synthetic", type=float, default=0.5, help="weight of rendered choreography")
    parser.add_argument("--silent", type=float, default=1.0, help="weight of clips without music")
    parser.add_argument("--follow", type=float, default=0.0, help="power of a clip's beat agreement in its weight")
    parser.add_argument("--balance", type=float, default=0.0, help="0: styles count by their minutes, 1: all alike")
    parser.add_argument("--free-steps", type=int, default=300, help="stage 1: steps before quantising")
    parser.add_argument("--code-noise", type=float, default=0.05, help="stage 1: share of codes replaced")
    parser.add_argument("--position", type=float, default=0.0, help="stage 1: weight of joint positions once more")
    parser.add_argument("--move", type=float, default=0.5, help="stage 1: weight of displacement")
    parser.add_argument("--slide", type=float, default=6.0, help="stage 1: extra weight of standing feet")
    parser.add_argument("--jerk", type=float, default=0.1, help="stage 1: weight of second differences")
    parser.add_argument("--token-noise", type=float, default=0.08, help="stage 2: mean share of input codes replaced")
    parser.add_argument("--shake", type=float, default=0.6, help="stage 2: share of sequences whose past is off the beat")
    parser.add_argument("--veil", type=float, default=0.8, help="stage 2: share of sequences without timbre and chroma")
    parser.add_argument("--music-drop", type=float, default=0.1)
    parser.add_argument("--style-drop", type=float, default=0.15)
    parser.add_argument("--smoothing", type=float, default=0.0)
    parser.add_argument("--report", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--no-bf16", dest="bf16", action="store_false")
    parser.add_argument("--resume", action="store_true")
    args = parser.parse_args()
    args.length = args.length or (96 if args.stage == "vqvae" else 240)
    torch.manual_seed(args.seed)
    torch.set_num_threads(args.threads)
    {"vqvae": train_vqvae, "motionseq": train_motionseq}[args.stage](args)


if __name__ == "__main__":
    main()
