"""The state of a stage: a checkpoint `last.pt` of train.py, or what a weights
file (`*.safetensors`, export.py) keeps of it: no optimiser, f16 precision, the
codebooks without their moving averages.
"""

import json

import torch
from safetensors import safe_open


def load(path, stage):
    """Stage `vq` or `seq` as train.py saves it: `model`, `config`, its norms,
    `step` and `elapsed` seconds so far."""
    if not path.endswith(".safetensors"):
        return torch.load(path, weights_only=False)
    with safe_open(path, "pt") as f:
        meta = f.metadata()
        tensors = {name: f.get_tensor(name).float() for name in f.keys()}
    prefix = stage + "."
    model = {name.removeprefix(prefix): t for name, t in tensors.items() if name.startswith(prefix)}
    if stage == "vq":
        norms = {"mean": tensors["norm.motion_mean"], "std": tensors["norm.motion_std"]}
        for name in [name for name in model if name.startswith("codebook.")]:
            embed = model.pop(name)
            model.update({name + ".embed": embed, name + ".embed_avg": embed.clone(),
                          name + ".cluster_size": torch.ones(len(embed)),
                          name + ".ready": torch.tensor(True)})
    else:
        norms = {key: tensors["norm." + key] for key in ("music_mean", "music_std")}
    provenance = json.loads(meta["provenance"])
    return {"model": model, "config": json.loads(meta["config"]), **norms,
            "step": provenance.get(stage + "_steps", 0), "elapsed": 60 * provenance.get(stage + "_minutes", 0)}
