"""The extractors that text-to-motion papers score with, in the layout that
`servodance evaluate --texts` reads (docs/metrics.md).

    python convert_t2m.py --checkpoint t2m/text_mot_match/model/finest.tar \\
        --mean MEAN.npy --std STD.npy --glove glove --kinds utils/word_vectorizer.py --out t2m

All of it are files of `EricGuo5513/text-to-motion` and what its README links
to: the checkpoint of the text-motion matching model, mean and deviation of the
extractors (`t2m/Comp_v6_KLD01/meta/{mean,std}.npy` there: not those of the data
set), the folder with `our_vab_data.npy`, `our_vab_words.pkl` and
`our_vab_idx.pkl`, and the script in which words have their kinds. Writes
`OUT/model.safetensors` and `OUT/words.json`. Nothing of a pickle is executed
but tensors and plain lists, nothing of the script at all.
"""

import argparse
import ast
import json
import os
import pickle

import numpy as np
import torch
from safetensors.torch import save_file

NETWORKS = ("movement_encoder", "motion_encoder", "text_encoder")


class Plain(pickle.Unpickler):
    """Lists, dictionaries, texts and numbers; no objects."""

    def find_class(self, module, name):
        raise pickle.UnpicklingError(f"holds {module}.{name}, expected plain data")


def plain(path):
    with open(path, "rb") as file:
        return Plain(file).load()


def kinds_of_words(path):
    """The 15 kinds in their order, and the kind of each word that has its own:
    the dictionaries `POS_enumerator` and `VIP_dict` of the script."""
    found = {}
    for node in ast.parse(open(path, encoding="utf-8").read()).body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            found[node.targets[0].id] = node.value
    try:
        order = ast.literal_eval(found["POS_enumerator"])
        table = found["VIP_dict"]
        values = [ast.literal_eval(found[v.id] if isinstance(v, ast.Name) else v) for v in table.values]
        table = dict(zip([ast.literal_eval(k) for k in table.keys], values))
    except (KeyError, ValueError) as error:
        raise SystemExit(f"{path}: no POS_enumerator and VIP_dict as text-to-motion has them: {error}")
    kind_of = {}
    for kind, words in table.items():
        for word in words:
            kind_of.setdefault(word, kind)  # the first that has it
    return sorted(order, key=order.get), kind_of


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    for name in ("checkpoint", "mean", "std", "glove", "kinds", "out"):
        parser.add_argument("--" + name, required=True)
    args = parser.parse_args()
    state = torch.load(args.checkpoint, map_location="cpu", weights_only=True)
    tensors = {"mean": torch.from_numpy(np.load(args.mean)), "std": torch.from_numpy(np.load(args.std))}
    for network in NETWORKS:
        if network not in state:
            raise SystemExit(f"{args.checkpoint}: no `{network}`, expected {', '.join(NETWORKS)}")
        tensors.update({f"{network}.{key}": value for key, value in state[network].items()})
    row_of = plain(os.path.join(args.glove, "our_vab_idx.pkl"))
    words = plain(os.path.join(args.glove, "our_vab_words.pkl"))
    rows = np.load(os.path.join(args.glove, "our_vab_data.npy"))
    tensors["words.weight"] = torch.from_numpy(rows[[row_of[word] for word in words]])
    kinds, kind_of = kinds_of_words(args.kinds)
    os.makedirs(args.out, exist_ok=True)
    save_file({name: tensor.float().contiguous() for name, tensor in tensors.items()},
              os.path.join(args.out, "model.safetensors"))
    with open(os.path.join(args.out, "words.json"), "w", encoding="utf-8") as file:
        json.dump({"words": words, "kinds": kinds, "kind_of": kind_of}, file)
    print(f"{len(tensors)} tensors, {len(words)} words, {len(kind_of)} of them with a kind of their own: {args.out}")


if __name__ == "__main__":
    main()
