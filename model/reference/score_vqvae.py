"""Scores stage 1 on held-out clips: `python score_vqvae.py CHECKPOINT DATA`.

Prints reconstruction error, displacement error and codes used for captured
dance, choreography and other motion of the test split (originals only).
"""

import sys

import torch

import checkpoint
from data import Dataset
from train import score_vqvae
from vqvae import VqVae


@torch.no_grad()
def main():
    torch.set_num_threads(1)
    state, data = checkpoint.load(sys.argv[1], "vq"), Dataset(sys.argv[2])
    model = VqVae(state["config"])
    model.load_state_dict(state["model"])
    model.eval()
    for name, dance, synthetic in [("captured dance", 1, 0), ("choreography", 1, 1), ("other", 0, 0)]:
        clips = [c for c in data.of_split(2) if data.dance[c] == dance
                 and data.synthetic[c] == synthetic and data.variant[c] == 0]
        row = score_vqvae(model, data, state["mean"], state["std"], clips)
        used = [v for k, v in row.items() if k.endswith("_used")]
        perplexity = [v for k, v in row.items() if k.endswith("_perplexity")]
        print(f"{name}: {len(clips)} clips, MPJPE {row['val_mpjpe_mm']:.1f} mm, displacement error "
              f"{row['val_move_mm']:.1f} mm a frame, standing feet move {row['val_slide_mm']:.1f} mm a frame, "
              f"codes used {100 * sum(used) / len(used):.0f} %, perplexity {sum(perplexity) / len(perplexity):.0f}")


if __name__ == "__main__":
    main()
