"""Stage 2, MotionSeq: the next codes of all body parts, from the codes before,
the music up to now and a style.

Position i reads the codes of frame i-1 and the music of frame i, and predicts
the codes of frame i. There is no start token: the codes before the first
frame are given or random, so sequences chain.
"""

import torch
import torch.nn as nn
import torch.nn.functional as F

from blocks import Attention, ChannelDropout, FeedForward, alibi_bias, sinusoids
from config import classes, code_names, head_dim


class Style(nn.Module):
    """Eq. 5 as a residual branch: style vector times the normalised stream."""

    def __init__(self, style_dim, dim):
        super().__init__()
        self.scale = nn.Linear(style_dim, dim)
        nn.init.zeros_(self.scale.weight)
        nn.init.zeros_(self.scale.bias)

    def forward(self, x, style):
        unit = x * torch.rsqrt((x.float() ** 2).sum(-1, keepdim=True) + 1e-6) * x.shape[-1] ** 0.5
        return x + self.scale(style) * unit


class SeqLayer(nn.Module):
    def __init__(self, seq, activation, dropout):
        super().__init__()
        dim, heads = seq["dim"], seq["heads"]
        width = head_dim(seq, dim, heads)
        self.norm1 = nn.LayerNorm(dim)
        self.attn = Attention(dim, heads, width)
        self.norm2 = nn.LayerNorm(dim)
        self.cross = Attention(dim, heads, width, cross=True)
        self.style = Style(seq["style_dim"], dim)
        self.norm3 = nn.LayerNorm(dim)
        self.ff = FeedForward(dim, seq["ff"], activation)
        self.drop = ChannelDropout(dropout)

    def forward(self, x, music, style, bias, cross_bias):
        x = x + self.drop(self.attn(self.norm1(x), bias))
        x = x + self.drop(self.cross(self.norm2(x), cross_bias, music))
        x = self.style(x, style)
        return x + self.drop(self.ff(self.norm3(x)))


class MotionSeq(nn.Module):
    def __init__(self, config, dropout=0.0):
        super().__init__()
        seq = config["seq"]
        self.seq, self.names, self.codes = seq, code_names(config), config["codes"]
        dim = seq["dim"]
        self.embed = nn.ModuleDict({p: nn.Embedding(self.codes, dim) for p in self.names})
        self.music_in = nn.Linear(config["music_dim"], dim)
        self.music_null = nn.Parameter(torch.zeros(dim))
        # The last row is the null style.
        self.style = nn.Embedding(len(seq["styles"]) + 1, seq["style_dim"])
        self.layers = nn.ModuleList(SeqLayer(seq, config["activation"], dropout) for _ in range(seq["layers"]))
        self.norm = nn.LayerNorm(dim)
        self.head = nn.ModuleDict({p: nn.Linear(dim, classes(config, p)) for p in self.names})
        # Codes after the first also see those already chosen for this frame.
        # Residual codes have one table for both, and no layers of their own.
        firsts = self.names[:len(config["parts"])]
        self.given = nn.ModuleDict({p: nn.Embedding(self.codes, dim) for p in firsts if p != self.names[-1]})
        self.refine = nn.ModuleDict({p: FeedForward(dim, dim, config["activation"]) for p in firsts[1:]})
        self.refine_norm = nn.ModuleDict({p: nn.LayerNorm(dim) for p in firsts[1:]})
        for table in [*self.embed.values(), *self.given.values()]:
            nn.init.normal_(table.weight, std=0.02 * 16)

    def music_stream(self, music, has_music):
        """Projected music [B, T, dim]; the null vector where there is none."""
        stream = self.music_in(music)
        return torch.where(has_music[:, None, None], stream, self.music_null.to(stream.dtype))

    def hidden(self, previous, music, has_music, style):
        seq = self.seq
        stream = self.music_stream(music, has_music)
        x = sum(self.embed[p](previous[..., i]) for i, p in enumerate(self.names))
        if seq["music_at_input"]:
            x = x + stream
        length, none = x.shape[1], [0.0] * seq["heads"]
        absolute = seq.get("positions") == "sinusoidal"
        if absolute:
            positions = sinusoids(length, seq["dim"]).to(x)
            x, stream = x + positions, stream + positions
        bias = alibi_bias(length, none if absolute else seq["slopes"], seq["window"])
        if seq["cross_aligned"]:
            slopes = none if absolute else seq["cross_slopes"]
            cross_bias = alibi_bias(length, slopes, seq["window"], seq["lookahead"])
        else:
            cross_bias = torch.zeros(seq["heads"], length, length)
        style = self.style(style)[:, None]
        for layer in self.layers:
            x = layer(x, stream, style, bias, cross_bias)
        return self.norm(x)

    def told(self, name):
        """The table that tells later codes of the frame this one."""
        return self.given[name] if name in self.given else self.embed[name]

    def code_logits(self, index, hidden, codes):
        """Logits of one code, given those of the frame [.., names] before it."""
        name = self.names[index]
        if index:
            chosen = enumerate(self.names[:index])
            hidden = hidden + sum(self.told(p)(codes[..., i]) for i, p in chosen)
            if name in self.refine:
                hidden = hidden + self.refine[name](self.refine_norm[name](hidden))
        return self.head[name](hidden)

    def forward(self, previous, target, music, has_music, style):
        """Logits [B, T, codes] of every code of a frame; `target` feeds the later ones."""
        hidden = self.hidden(previous, music, has_music, style)
        return [self.code_logits(i, hidden, target).float() for i in range(len(self.names))]


def nll(logits, target, valid, smoothing=0.0):
    """Mean negative log likelihood per code of a frame."""
    return [F.cross_entropy(l[valid], target[..., i][valid], label_smoothing=smoothing)
            for i, l in enumerate(logits)]
