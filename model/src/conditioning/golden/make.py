"""Writes the golden files of this folder: what the reference library makes of
weights that both sides compute from their names.

    pip install torch transformers safetensors     # run with torch 2.15, transformers 5.23
    python make.py .
    python make.py --full DIR     # CLIP in its public size, for the test that is ignored

`encodec.safetensors`: EncodecModel in the size of facebook/encodec_24khz on two
seconds of sound: latents before the quantiser, codes, the sum of the first
eight codebooks. `clip.safetensors` and `tokenizer.json`: a small
CLIPTextModelWithProjection with a tokenizer of CLIP's layout. No trained number
is in them: the metadata lists each tensor's shape, base and scale, and its
values are base + scale * noise(name).
"""

import json
import os
import sys

import numpy as np
import torch
from safetensors.torch import save_file
from transformers import CLIPTextConfig, CLIPTextModelWithProjection, CLIPTokenizer
from transformers import EncodecConfig, EncodecModel

from noise import noise


def filled(manifest, name, shape, base, scale):
    manifest[name] = [list(shape), base, scale]
    values = np.float32(base) + np.float32(scale) * noise(name, int(np.prod(shape)))
    return torch.from_numpy(values.reshape(shape))


def encodec(out):
    model = EncodecModel(EncodecConfig()).eval()
    manifest, state = {}, model.state_dict()
    for key, value in state.items():
        name = key.replace("parametrizations.weight.original0", "weight_g")
        name = name.replace("parametrizations.weight.original1", "weight_v")
        if name.startswith("encoder."):
            base, scale = 0.0, 0.1
            if name.endswith("weight_g"):
                base, scale = 1.2, 0.3
            elif name.endswith("weight_v"):
                scale = 1.0
        elif name.endswith("codebook.embed") and int(name.split(".")[2]) < 9:
            # Each codebook codes what the ones before left over; the ninth is
            # there to show that it is not used.
            base, scale = 0.0, 0.5 * 0.5 ** (int(name.split(".")[2]) // 2)
        else:
            continue
        state[key] = filled(manifest, name, value.shape, base, scale)
    model.load_state_dict(state)
    frames, hop = 40, 320
    sound = np.cumsum(noise("sound", frames * hop)).astype(np.float32)  # brown, so that it is music-like
    sound = 0.5 * torch.from_numpy(sound / np.abs(sound).max())
    with torch.no_grad():
        latents = model.encoder(sound[None, None])
        codes = model.quantizer.encode(latents, bandwidth=6.0)  # [8, 1, frames]
        assert codes.shape == (8, 1, frames), codes.shape
        total = model.quantizer.decode(codes)
        whole = model.encode(sound[None, None], bandwidth=6.0).audio_codes
        assert torch.equal(whole[0, 0], codes[:, 0])
        rest = latents[0].T
        for layer, chosen in zip(model.quantizer.layers, codes[:, 0]):
            nearest = torch.cdist(rest, layer.codebook.embed).topk(2, largest=False).values
            # No choice is so close that rounding could decide it.
            assert (nearest[:, 1] - nearest[:, 0]).min() > 1e-4
            rest = rest - layer.codebook.embed[chosen]
    print("latents", latents.std(), "left over", (latents - total).std(),
          "codes used", [len(set(row.tolist())) for row in codes[:, 0]])
    save_file({"sound": sound.contiguous(), "latents": latents[0].T.contiguous(),
               "codes": codes[:, 0].T.int().contiguous(), "sum": total[0].T.contiguous()},
              os.path.join(out, "encodec.safetensors"), metadata={"weights": json.dumps(manifest)})


TEXTS = ["street dance", "Ballet jazz, slow & 7 tender turns; it's floating", "",
         "krump " * 100, "naïve  \u3000 東京 dance"]


def clip(out, full=False):
    byte_tokens = CLIPTokenizer().backend_tokenizer.pre_tokenizer  # only to be sure it loads
    assert byte_tokens is not None
    from tokenizers.pre_tokenizers import ByteLevel
    letters = sorted(ByteLevel.alphabet())
    merges = [("s", "t"), ("st", "r"), ("d", "a"), ("n", "c"), ("da", "nc"), ("danc", "e</w>"), ("e", "t</w>")]
    words = letters + [letter + "</w>" for letter in letters] + ["".join(pair) for pair in merges]
    if full:
        words += [f"<unused {i}>" for i in range(49406 - len(words))]
    words += ["<|startoftext|>", "<|endoftext|>"]
    tokenizer = CLIPTokenizer(vocab={w: i for i, w in enumerate(words)}, merges=merges)
    tokenizer.backend_tokenizer.save(os.path.join(out, "tokenizer.json"), pretty=False)
    small = dict(hidden_size=128, intermediate_size=512, num_hidden_layers=2, num_attention_heads=2)
    config = CLIPTextConfig(
        vocab_size=len(words), projection_dim=512, bos_token_id=len(words) - 2,
        eos_token_id=len(words) - 1, **({} if full else small))
    model = CLIPTextModelWithProjection(config).eval()
    manifest, state = {}, model.state_dict()
    for name, value in state.items():
        if not value.dtype.is_floating_point:
            continue
        base, scale = (1.0, 0.3) if "norm" in name and name.endswith("weight") else (0.0, 0.15)
        if full and "norm" not in name:
            scale = 0.06
        state[name] = filled(manifest, name, value.shape, base, scale)
    model.load_state_dict(state)
    if full:
        save_file(dict(state), os.path.join(out, "model.safetensors"))
    result, ids = {}, []
    for i, text in enumerate(TEXTS):
        tokens = tokenizer(text, return_tensors="pt", truncation=True, max_length=77)
        with torch.no_grad():
            result[f"embed{i}"] = model(**tokens).text_embeds[0].contiguous()
        ids.append(tokens["input_ids"][0].tolist())
    print([len(row) for row in ids], result["embed0"][:4], result["embed0"].std())
    save_file(result, os.path.join(out, "clip.safetensors"), metadata={
        "weights": json.dumps(manifest), "texts": json.dumps(TEXTS), "ids": json.dumps(ids),
        "vocabulary": str(len(words))})


if __name__ == "__main__":
    torch.set_num_threads(1)
    if sys.argv[1] == "--full":
        clip(sys.argv[2], full=True)
    else:
        encodec(sys.argv[1])
        clip(sys.argv[1])
