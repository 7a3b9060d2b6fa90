"""Transformer parts shared by both stages: attention with ALiBi bias, feed-forward.

The bias is made once per length: `-slope * |i - j|` per head, minus infinity
outside the window. So a rotating cache of keys and values gives the same output
as one pass over everything; the sinusoidal positions are the paper's ablation.
"""

import torch
import torch.nn as nn
import torch.nn.functional as F


def alibi_bias(length, slopes, window, ahead=0):
    """Bias [heads, length, length]: query i sees key j when
    i - window < j <= i + ahead."""
    i = torch.arange(length)[:, None]
    j = torch.arange(length)[None, :]
    distance = (i - j).abs().float()
    bias = -torch.tensor(slopes)[:, None, None] * distance
    seen = (j <= i + ahead) & (j > i - window)
    return bias.masked_fill(~seen, float("-inf"))


def attend(q, k, v, bias):
    """Softmax attention over [batch, heads, length, width]. Plain matrix
    products: on a CPU their backward pass is far quicker than that of
    `scaled_dot_product_attention` in bfloat16."""
    batch, heads, length, width = q.shape
    q, k, v = (t.reshape(batch * heads, -1, width) for t in (q, k, v))
    bias = bias.to(q.dtype).expand(batch, *bias.shape).reshape(batch * heads, *bias.shape[1:])
    scores = torch.baddbmm(bias, q, k.transpose(1, 2), alpha=width**-0.5)
    return (scores.softmax(-1).to(v.dtype) @ v).view(batch, heads, length, width)


def sinusoids(length, dim):
    """Absolute positions [length, dim]: sine and cosine by turns."""
    angle = torch.arange(length)[:, None] * 10_000.0 ** (-torch.arange(0, dim, 2, dtype=torch.float64) / dim)
    return torch.stack([angle.sin(), angle.cos()], -1).flatten(1)[:, :dim].float()


class ChannelDropout(nn.Module):
    """Drops whole channels of a sequence: cheap, and the same at every frame."""

    def __init__(self, rate):
        super().__init__()
        self.rate = rate

    def forward(self, x):
        if not self.training or self.rate == 0.0:
            return x
        keep = torch.rand(x.shape[0], 1, x.shape[2], device=x.device) >= self.rate
        return x * (keep / (1 - self.rate)).to(x.dtype)


class Attention(nn.Module):
    """Multi-head attention; `memory` gives keys and values when not `x` itself."""

    def __init__(self, dim, heads, width, cross=False):
        super().__init__()
        self.heads = heads
        wide = heads * width
        if cross:
            self.q = nn.Linear(dim, wide)
            self.kv = nn.Linear(dim, 2 * wide)
        else:
            self.qkv = nn.Linear(dim, 3 * wide)
        self.out = nn.Linear(wide, dim)
        self.cross = cross

    def forward(self, x, bias, memory=None):
        if self.cross:
            q, (k, v) = self.q(x), self.kv(memory).chunk(2, -1)
        else:
            q, k, v = self.qkv(x).chunk(3, -1)
        q, k, v = (t.unflatten(-1, (self.heads, -1)).transpose(1, 2) for t in (q, k, v))
        return self.out(attend(q, k, v, bias).transpose(1, 2).flatten(2))


class FeedForward(nn.Module):
    """Two linear layers; between them GELU (the paper's) or the squared ReLU,
    which costs a tenth of it on a CPU in bfloat16."""

    def __init__(self, dim, hidden, activation):
        super().__init__()
        self.up = nn.Linear(dim, hidden)
        self.down = nn.Linear(hidden, dim)
        self.gelu = activation == "gelu"

    def forward(self, x):
        x = self.up(x)
        return self.down(F.gelu(x, approximate="tanh") if self.gelu else F.relu(x).square())


class Layer(nn.Module):
    """Pre-norm self-attention and feed-forward."""

    def __init__(self, dim, heads, width, hidden, activation, dropout=0.0):
        super().__init__()
        self.norm1 = nn.LayerNorm(dim)
        self.attn = Attention(dim, heads, width)
        self.norm2 = nn.LayerNorm(dim)
        self.ff = FeedForward(dim, hidden, activation)
        self.drop = ChannelDropout(dropout)

    def forward(self, x, bias):
        x = x + self.drop(self.attn(self.norm1(x), bias))
        return x + self.drop(self.ff(self.norm2(x)))
