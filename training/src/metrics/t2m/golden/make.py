"""Writes the golden file of this folder: what PyTorch's own layers make of the
T2M extractors with weights that both sides compute from their names.

    python make.py .          # run with torch 2.15

`t2m.safetensors`: the points of three motions and four texts; its metadata
lists each tensor's shape, base and scale (values are base + scale *
noise(name)), the words, the texts, and R-Precision and MM-Dist of 64 pairs by
numpy. No trained number is in it.
"""

import json
import os
import sys

import numpy as np
import torch
from safetensors.torch import save_file
from torch import nn
from torch.nn.functional import leaky_relu
from torch.nn.utils.rnn import pack_padded_sequence, pad_sequence

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../../conditioning/golden"))
from noise import noise  # noqa: E402

KINDS = ["VERB", "NOUN", "DET", "ADP", "NUM", "AUX", "PRON", "ADJ", "ADV",
         "Loc_VIP", "Body_VIP", "Obj_VIP", "Act_VIP", "Desc_VIP", "OTHER"]
WORDS = ["sos", "eos", "unk", "a", "person", "walk", "left", "slowly", "the", "and"]
KIND_OF = {"walk": "Act_VIP", "left": "Loc_VIP", "slowly": "Desc_VIP"}
# Unknown words, kinds that are none, more tokens than count, no token at all.
TEXTS = ["a/DET person/NOUN walk/VERB slowly/ADV", "", "left/ADJ zebra/NOUN the/XYZ and/OTHER",
         " ".join(["walk/VERB and/CCONJ"] * 15)]
FRAMES = [40, 196, 103]


class Reader(nn.Module):
    def __init__(self, size, width):
        super().__init__()
        self.input_emb = nn.Linear(size, width)
        self.gru = nn.GRU(width, width, batch_first=True, bidirectional=True)
        self.output_net = nn.Sequential(nn.Linear(2 * width, width), nn.LayerNorm(width),
                                        nn.LeakyReLU(0.2), nn.Linear(width, 512))
        self.hidden = nn.Parameter(torch.zeros(2, 1, width))

    def forward(self, rows):
        lengths = [len(r) for r in rows]
        packed = pack_padded_sequence(self.input_emb(pad_sequence(rows, batch_first=True)), lengths,
                                      batch_first=True, enforce_sorted=False)
        _, last = self.gru(packed, self.hidden.repeat(1, len(rows), 1))
        return self.output_net(torch.cat([last[0], last[1]], -1))


class Movement(nn.Module):
    def __init__(self):
        super().__init__()
        self.main = nn.Sequential(nn.Conv1d(259, 512, 4, 2, 1), nn.Dropout(0.2), nn.LeakyReLU(0.2),
                                  nn.Conv1d(512, 512, 4, 2, 1), nn.Dropout(0.2), nn.LeakyReLU(0.2))
        self.out_net = nn.Linear(512, 512)

    def forward(self, x):
        return self.out_net(self.main(x.transpose(1, 2)).transpose(1, 2))


def fill(module, prefix, manifest):
    state = module.state_dict()
    for key, value in state.items():
        name = f"{prefix}.{key}"
        wide = value.shape[1] if value.dim() == 2 else value[0].numel() if value.dim() == 3 else 0
        base = 1.0 if key == "output_net.1.weight" else 0.0
        scale = 1.0 if key == "hidden" else (3 / wide) ** 0.5 if wide else 0.1
        state[key] = filled(name, value.shape, base, scale, manifest)
    module.load_state_dict(state)
    return module.eval()


def filled(name, shape, base, scale, manifest):
    manifest[name] = [list(shape), base, scale]
    values = np.float32(base) + np.float32(scale) * noise(name, int(np.prod(shape)))
    return torch.from_numpy(values.reshape(shape))


def retrieval(texts, motions):
    """T2M's way: argsort of each text's distances to the motions of its pool."""
    top, far = np.zeros(3), 0.0
    for start in range(0, len(texts), 32):
        t, m = texts[start:start + 32].astype(np.float64), motions[start:start + 32].astype(np.float64)
        distances = np.linalg.norm(t[:, None] - m[None], axis=-1)
        place = (np.argsort(distances, axis=1) == np.arange(32)[:, None]).argmax(1)
        top += [(place <= k).sum() for k in range(3)]
        far += np.trace(distances)
    return [*(top / len(texts)), far / len(texts)]


def main(out):
    manifest = {}
    mean, std = (filled(n, (263,), b, s, manifest) for n, b, s in (("mean", 0.0, 0.5), ("std", 1.0, 0.5)))
    vectors = filled("words.weight", (len(WORDS), 300), 0.0, 1.0, manifest)
    movement = fill(Movement(), "movement_encoder", manifest)
    motion = fill(Reader(512, 1024), "motion_encoder", manifest)
    text = fill(Reader(300, 512), "text_encoder", manifest)
    pos = nn.Linear(15, 300)
    pos = fill(pos, "text_encoder.pos_emb", manifest)
    with torch.no_grad():
        # All of one batch, filled up to the longest with frames that are 0 once normalised.
        batch = torch.zeros(len(FRAMES), 196, 263)
        for i, frames in enumerate(FRAMES):
            values = torch.from_numpy(noise(f"motion {i}", frames * 263).reshape(frames, 263))
            used = frames // 4 * 4
            batch[i, :used] = ((values - mean) / std)[:used]
        steps = movement(batch[..., :-4])
        points = motion([s[:n // 4] for s, n in zip(steps, FRAMES)])
        rows = []
        for line in TEXTS:
            tokens = ["sos/OTHER", *line.split()[:20], "eos/OTHER"]
            row = []
            for token in tokens:
                word, kind = token.split("/")
                known = word in WORDS
                kind = KIND_OF.get(word, kind if kind in KINDS else "OTHER") if known else "OTHER"
                chosen = torch.eye(15)[KINDS.index(kind)]
                row.append(vectors[WORDS.index(word if known else "unk")] + pos(chosen))
            rows.append(torch.stack(row))
        told = text(rows)
    print("points", points.std(), "apart", torch.cdist(points, points).max(), torch.cdist(told, told).max())
    near = noise("text points", 64 * 3).reshape(64, 3)
    there = near + np.float32(0.3) * noise("motion points", 64 * 3).reshape(64, 3)
    metadata = {"weights": manifest, "words": WORDS, "kinds": KINDS, "kind_of": KIND_OF, "texts": TEXTS,
                "frames": FRAMES, "retrieval": retrieval(near, there)}
    print(metadata["retrieval"])
    save_file({"motions": points.contiguous(), "texts": told.contiguous()}, os.path.join(out, "t2m.safetensors"),
              metadata={key: json.dumps(value) for key, value in metadata.items()})


main(sys.argv[1])
