"""Stage 1: motion to codes of body parts, frame by frame, and back.

Encoders (one per part) see `encoder_window` frames to both sides; the decoder
is causal and sees all parts. Motion here is normalised, [batch, frames, 137].
"""

import torch
import torch.nn as nn
import torch.nn.functional as F

from blocks import Layer, alibi_bias
from config import code_names, code_places, head_dim, part_channels, position_channels


class Codebook(nn.Module):
    """Codes learned by exponential moving averages, restarted when unused."""

    def __init__(self, codes, dim, decay=0.98, dead_below=0.5, eps=1e-5):
        super().__init__()
        self.decay, self.dead_below, self.eps = decay, dead_below, eps
        self.register_buffer("embed", torch.randn(codes, dim))
        self.register_buffer("embed_avg", torch.randn(codes, dim))
        self.register_buffer("cluster_size", torch.ones(codes))
        self.register_buffer("ready", torch.tensor(False))

    @torch.autocast("cpu", enabled=False)
    def distances(self, x):
        return (x * x).sum(-1, keepdim=True) - 2 * x @ self.embed.t() + (self.embed**2).sum(-1)

    def nearest(self, x):
        """Index of the nearest code of each row."""
        return self.distances(x).argmin(-1)

    @torch.no_grad()
    def k_means(self, x, rounds=20):
        """First codes: k-means over the rows of `x`."""
        codes = len(self.embed)
        centres = x[torch.randperm(len(x))[:codes]].clone()
        for _ in range(rounds):
            self.embed.copy_(centres)
            index = self.nearest(x)
            count = torch.bincount(index, minlength=codes).float()
            sums = torch.zeros_like(centres).index_add_(0, index, x)
            centres = torch.where(count[:, None] > 0, sums / count.clamp(min=1)[:, None],
                                  x[torch.randint(len(x), (codes,))])
        self.reset(torch.ones(codes, dtype=torch.bool), centres)
        self.ready.fill_(True)

    @torch.no_grad()
    def reset(self, which, rows):
        """Moves codes to `rows`, all three buffers together: a restart that
        left `embed_avg` alone would be undone by the next update."""
        self.embed[which] = rows
        self.embed_avg[which] = rows
        self.cluster_size[which] = 1.0

    @torch.no_grad()
    def update(self, x, index):
        """One moving-average step, then dead codes restart at rows of `x`."""
        count = torch.bincount(index, minlength=len(self.embed)).float()
        sums = torch.zeros_like(self.embed).index_add_(0, index, x)
        self.cluster_size.lerp_(count, 1 - self.decay)
        self.embed_avg.lerp_(sums, 1 - self.decay)
        size = self.cluster_size.clamp(min=self.eps)[:, None]
        self.embed.copy_(self.embed_avg / size)
        dead = self.cluster_size < self.dead_below
        if dead.any():
            self.reset(dead, x[torch.randint(len(x), (int(dead.sum()),))])


class Encoder(nn.Module):
    def __init__(self, channels, config, dropout):
        super().__init__()
        vq = config["vq"]
        dim, heads = vq["encoder_dim"], len(vq["encoder_slopes"])
        self.input = nn.Linear(len(channels), dim)
        self.layers = nn.ModuleList(
            Layer(dim, heads, head_dim(vq, dim, heads), 4 * dim, config["activation"], dropout) for _ in range(vq["encoder_layers"]))
        self.norm = nn.LayerNorm(dim)
        self.output = nn.Linear(dim, config["code_dim"])
        self.skip = nn.Linear(len(channels), config["code_dim"]) if vq.get("skip") else None

    def forward(self, x, bias):
        skipped = self.skip(x) if self.skip else 0
        x = self.input(x)
        for layer in self.layers:
            x = layer(x, bias)
        return self.output(self.norm(x)) + skipped


class Decoder(nn.Module):
    """Causal: frame i is made from the codes of frames up to i."""

    def __init__(self, config, dropout):
        super().__init__()
        vq = config["vq"]
        self.vq = vq
        self.input = nn.Linear(len(config["parts"]) * config["code_dim"], vq["dim"])
        self.layers = nn.ModuleList(
            Layer(vq["dim"], vq["heads"], head_dim(vq, vq["dim"], vq["heads"]), vq["ff"], config["activation"],
                  dropout) for _ in range(vq["decoder_layers"]))
        self.norm = nn.LayerNorm(vq["dim"])
        self.output = nn.Linear(vq["dim"], config["motion_dim"])
        wide = len(config["parts"]) * config["code_dim"]
        self.skip = nn.Linear(wide, config["motion_dim"]) if vq.get("skip") else None

    def forward(self, codes):
        bias = alibi_bias(codes.shape[1], self.vq["decoder_slopes"], self.vq["decoder_window"])
        skipped = self.skip(codes) if self.skip else 0
        x = self.input(codes)
        for layer in self.layers:
            x = layer(x, bias)
        return self.output(self.norm(x)) + skipped


class VqVae(nn.Module):
    def __init__(self, config, dropout=0.0):
        super().__init__()
        self.config, self.parts, self.names = config, config["parts"], code_names(config)
        self.part_of = [part for part, _ in code_places(config)]
        self.plain = config["vq"].get("encoder") == "positions"
        of_part = position_channels if self.plain else part_channels
        self.channels = {part: of_part(part) for part in self.parts}
        self.encoder = nn.ModuleDict({} if self.plain else {
            part: Encoder(self.channels[part], config, dropout)
            for part in self.parts})
        self.codebook = nn.ModuleDict(
            {name: Codebook(config["codes"], config["code_dim"]) for name in self.names})
        self.decoder = Decoder(config, dropout)

    def latents(self, motion):
        """Continuous codes before quantisation, per part [B, T, code_dim]."""
        vq = self.config["vq"]
        if self.plain:
            wide = self.config["code_dim"]
            return {part: F.pad(motion[..., c], (0, wide - len(c))) for part, c in self.channels.items()}
        window = vq["encoder_window"]
        bias = alibi_bias(motion.shape[1], vq["encoder_slopes"], window, ahead=window)
        return {part: self.encoder[part](motion[..., self.channels[part]], bias).float()
                for part in self.parts}

    def encode(self, motion):
        """Codes [B, T, names] of normalised motion: each level codes what is left."""
        left, codes = self.latents(motion), []
        for part, name in zip(self.part_of, self.names):
            book = self.codebook[name]
            codes.append(book.nearest(left[part]))
            left[part] = left[part] - F.embedding(codes[-1], book.embed)
        return torch.stack(codes, -1)

    def embed(self, codes):
        """Of each part the sum of its codes' vectors, side by side."""
        vectors = [F.embedding(codes[..., i], self.codebook[name].embed)
                   for i, name in enumerate(self.names)]
        return torch.cat([sum(v for of, v in zip(self.part_of, vectors) if of == part)
                          for part in self.parts], -1)

    def decode(self, codes):
        """Normalised motion from codes [B, T, names]."""
        return self.decoder(self.embed(codes)).float()

    def forward(self, motion, valid, quantise=True, noise=0.0):
        """Reconstruction, commit loss, codes. `valid` [B, T] keeps padding out
        of the codebook; `noise` is the share of frames that get one of their
        nearest eight codes instead of the nearest."""
        latents = self.latents(motion)
        if not quantise:
            return self.decoder(torch.cat(list(latents.values()), -1)).float(), 0.0, None
        chosen, commit, indices = {part: 0.0 for part in self.parts}, 0.0, []
        left = dict(latents)
        for part, name in zip(self.part_of, self.names):
            book = self.codebook[name]
            z = left[part]
            with torch.no_grad():
                distance = book.distances(z)
                index = distance.argmin(-1)
                if self.training:
                    book.update(z[valid], index[valid])
            shown = target = F.embedding(index, book.embed)
            commit = commit + F.mse_loss(z[valid], target[valid])
            if noise:
                near = distance.topk(8, largest=False).indices
                pick = near.gather(-1, torch.randint(8, index.shape)[..., None])[..., 0]
                shown = torch.where((torch.rand(index.shape) < noise)[..., None],
                                    F.embedding(pick, book.embed), target)
            chosen[part] = chosen[part] + shown
            left[part] = z - target
            indices.append(index)
        quantised = [z + (chosen[part] - z).detach() for part, z in latents.items()]
        return self.decoder(torch.cat(quantised, -1)).float(), commit, torch.stack(indices, -1)
