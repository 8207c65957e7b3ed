"""Our models written out in the layout of LG-Tok's released files: their key names, recorded from the public code.

Written from the recorded names, not from playground's own mapping, so that the two can be held against each other.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
import torch
from torch import Tensor

from playground.convert import convert_lgtok
from playground.errors import PlaygroundError
from playground.generators.scalewise import ScalewiseTransformer
from playground.tokenizers.transformer import LGTok
from tests.tiny import tiny_generator, tiny_tokenizer

State = dict[str, Tensor]
TOKENIZER, GENERATOR = tiny_tokenizer(), tiny_generator(text_mask=False, rope_span=8.0)

# sha256 over the sorted lines "name [shape]" of the full-size models that the public code builds
TOKENIZER_LAYOUT = (528, "c4bbe0dcf19ec73d33449bacd080cdb912a484aa281070637ca0c239c9fc3db9")
GENERATOR_LAYOUT = (214, "f7ed39e30d6c211de97a1b67e80380527f63b91e05d539d535b24f2de9c318f7")
OPTIONS = {
    "dataset_name": "t2m", "scales": "(1, 3, 6)", "nb_code_st": "8", "nb_code_ed": "12", "quant_type": "mosa",
    "pos_embed": "rope1d", "enc_moiton_text_embed": "ctx_ctx", "dec_latent_text_embed": "crs_crs", "patch_size": "1",
    "qk_norm": "False", "phi_k": "3", "phi_depth": "2", "text_model": "Llama-3.2-1B", "using_znorm": "True",
    "norm": "RMS", "norm_first": "False", "rope_base": "100.0", "text_max_len": "77", "name": "a trial: with a colon",
    "milestones": "[180]", "activation": "gelu",
}  # fmt: skip


def options_text(**changes: str) -> str:
    """The text that their option parser writes."""
    lines = [f"{key}: {value}" for key, value in sorted((OPTIONS | changes).items())]
    return "\n".join(["------------ Options -------------", *lines, "-------------- End ----------------", ""])


def layer(out: dict[str, Tensor], name: str, weights: Mapping[str, Tensor], ours: str) -> None:
    """Copy weight and bias of one layer."""
    for kind in ("weight", "bias"):
        out[f"{name}.{kind}"] = weights[f"{ours}.{kind}"].clone()


def rotary(length: int, width: int, base: float) -> tuple[Tensor, Tensor]:
    """Cosines and sines [1, 1, length, width] of interleaved pairs."""
    angles = torch.zeros(length, width)
    for pair in range(width // 2):
        angles[:, 2 * pair] = angles[:, 2 * pair + 1] = torch.arange(length) * base ** (-2 * pair / width)
    return angles.cos()[None, None], angles.sin()[None, None]


def block(out: dict[str, Tensor], name: str, w: Mapping[str, Tensor], ours: str, length: int, heads: int) -> None:
    """One block of theirs; with two cross-attentions where ours has them."""
    width = w[f"{ours}.self_attention.out.weight"].shape[0]
    for kind in ("weight", "bias"):
        stacked = w[f"{ours}.self_attention.qkv.{kind}"]
        for place, part in enumerate(("query", "key", "value")):
            out[f"{name}.self_attn.{part}.{kind}"] = stacked[place * width : (place + 1) * width].clone()
        gate_up = w[f"{ours}.feed_forward.gate_up.{kind}"]
        hidden = len(gate_up) // 2
        out[f"{name}.linear1_swi.{kind}"] = gate_up[:hidden].clone()
        out[f"{name}.linear1.{kind}"] = gate_up[hidden:].clone()
    layer(out, f"{name}.self_attn.proj", w, f"{ours}.self_attention.out")
    layer(out, f"{name}.linear2", w, f"{ours}.feed_forward.down")
    cosines, sines = rotary(length, width // heads, 100.0)
    out[f"{name}.self_attn.rotary_embedding.x_cos"] = cosines
    out[f"{name}.self_attn.rotary_embedding.x_sin"] = sines
    crossed = f"{ours}.norms.3.weight" in w
    for number, place in {1: 0, 2: 1, 3: 3, 4: 2}.items() if crossed else {1: 0, 2: 1}.items():
        out[f"{name}.norm{number}.scale"] = w[f"{ours}.norms.{place}.weight"].clone()
    for place, attention in enumerate(("multihead_attn", "multihead_attn2") if crossed else ()):
        memory = f"{ours}.cross_attentions.{place}"
        for kind in ("weight", "bias"):
            parts = [w[f"{memory}.query.{kind}"], w[f"{memory}.key_value.{kind}"]]
            out[f"{name}.{attention}.in_proj_{kind}"] = torch.cat(parts)
        layer(out, f"{name}.{attention}.out_proj", w, f"{memory}.out")


def official_tokenizer(model: LGTok, masked_motion: bool = True) -> dict[str, Tensor]:
    """Every array that their tokenizer of this size has; masked_motion: trained with their motion masking."""
    w, c = model.state_dict(), model.config
    out = {
        "latent_tokens": w["latent_tokens"].clone(),
        "mask_token": w["mask_vector"][None, None].clone(),
        "decoder.de_position_embedding.pos_embed": w["query_positions"].clone(),
        "encoder.to_patch_embedding.weight": w["motion_in.weight"][:, :, None].clone(),
        "encoder.to_patch_embedding.bias": w["motion_in.bias"].clone(),
        "decoder.conv_out.0.weight": w["motion_out.weight"].T[:, :, None].contiguous(),
        "decoder.conv_out.0.bias": w["motion_out.bias"].clone(),
    }
    if masked_motion:
        out["encoder.mask_token"] = torch.zeros_like(out["mask_token"])
    layer(out, "text_embed", w, "text_proj")
    layer(out, "encoder.conv_out", w, "to_code")
    layer(out, "decoder.conv_in_l", w, "from_code")
    for level, size in enumerate(c.codes):
        book = f"quantizer.layers.{level}"
        out[f"{book}.codebook"] = w[f"quantizer.codebooks.{level}.vectors"].clone()
        out[f"{book}.code_sum"] = torch.zeros_like(out[f"{book}.codebook"])
        out[f"{book}.code_count"] = torch.ones(size)
        out[f"{book}.initted"] = torch.ones(1)
        for place in (0, 1):
            layer(out, f"quantizer.phis.{level}.phi.{place}.0", w, f"quantizer.phis.{level}.convs.{place}")
    half = c.depth // 2
    for side, length in (("encoder", 77 + c.latents + c.max_frames), ("decoder", c.max_frames)):
        out[f"{side}.transformer.norm_pre.scale"] = w[f"{side}.entry.weight"].clone()
        out[f"{side}.transformer.norm_post.scale"] = w[f"{side}.exit.weight"].clone()
        for place in range(c.depth):
            name = f"input_blocks.{place}" if place < half else f"output_blocks.{place - half - 1}"
            name = "middle_block" if place == half else name
            block(out, f"{side}.transformer.{name}", w, f"{side}.blocks.{place}", length, c.heads)
        for place in range(half):
            layer(out, f"{side}.transformer.linear_blocks.{place}", w, f"{side}.merges.{place}")
    return out


def official_generator(network: ScalewiseTransformer) -> dict[str, Tensor]:
    """Every array that their generator of this size has, without CLIP."""
    w, c = network.state_dict(), network.config
    out = {
        "pos_start": w["start"][None].clone(),
        "lvl_embed.weight": w["level"].clone(),
        "len_embed.weight": w["length"].clone(),
    }
    layer(out, "input_emb", w, "text_proj")
    layer(out, "input_process", w, "sum_proj")
    half = c.width // c.heads // 2
    places = torch.cat([torch.arange(s) * (2.0 * half / max(s - 1, 1)) for s in c.scales])
    angles = places[:, None] * 100.0 ** (-torch.arange(half) / half)
    levels = torch.cat([torch.full((s,), n) for n, s in enumerate(c.scales)])
    out["freqs_cis"] = torch.polar(torch.ones_like(angles), angles)
    out["lvl_1L"] = levels[None]
    out["attn_mask"] = (levels[:, None] >= levels[None]).float()[None, None]
    for level in range(len(c.scales)):
        layer(out, f"heads.{level}", w, f"heads.{level}")
    for number in range(c.depth):
        name, ours = f"blocks.{number}", f"layers.{number}"
        norms = {"ln0": "norms.0", "ln0_t": "text_norm", "ln1": "norms.1", "ln2": "norms.2"}
        for norm, place in norms.items():
            out[f"{name}.{norm}.scale"] = w[f"{ours}.{place}.weight"].clone()
        for kind in ("weight", "bias"):
            key_value = w[f"{ours}.cross.key_value.{kind}"]
            out[f"{name}.attn0.query.{kind}"] = w[f"{ours}.cross.query.{kind}"].clone()
            out[f"{name}.attn0.key.{kind}"] = key_value[: c.width].clone()
            out[f"{name}.attn0.value.{kind}"] = key_value[c.width :].clone()
            for place, part in enumerate(("query", "key", "value")):
                rows = slice(place * c.width, (place + 1) * c.width)
                out[f"{name}.attn.{part}.{kind}"] = w[f"{ours}.self_attention.qkv.{kind}"][rows].clone()
        layer(out, f"{name}.attn0.proj", w, f"{ours}.cross.out")
        layer(out, f"{name}.attn.proj", w, f"{ours}.self_attention.out")
        gate_up = w[f"{ours}.feed_forward.gate_up.weight"]
        out[f"{name}.mlp.0.c_fc1.weight"] = gate_up[: c.hidden].clone()
        out[f"{name}.mlp.0.c_fc2.weight"] = gate_up[c.hidden :].clone()
        out[f"{name}.mlp.0.c_proj.weight"] = w[f"{ours}.feed_forward.down.weight"].clone()
    return out


def write_release(folder: Path, tokenizer: Mapping[str, Tensor], generator: Mapping[str, Tensor]) -> list[Path]:
    """Tokenizer file, generator file and options, with the training state that their trainers save beside weights."""
    folder.mkdir(parents=True, exist_ok=True)
    optimiser = {"state": {0: {"step": torch.tensor(5.0)}}, "param_groups": [{"lr": 2e-4, "betas": (0.9, 0.99)}]}
    rest = {
        "scheduler": {"milestones": Counter([180]), "gamma": 0.1, "last_epoch": 199, "_last_lr": [2e-5]},
        "scaler": {"scale": 65536.0, "growth_factor": 2.0, "_growth_tracker": 3},
        "ep": 199,
        "total_it": 12345,
    }
    paths = [folder / name for name in ("net_best_fid.tar", "generator.tar", "opt.txt")]
    torch.save({"vq_model": tokenizer, "opt_vq_model": optimiser, **rest}, paths[0])
    torch.save({"t2m_transformer": generator, "opt_t2m_transformer": optimiser, **rest}, paths[1])
    paths[2].write_text(options_text())
    return paths


def release(folder: Path, change: Callable[[State, State], None] | None = None) -> list[Path]:
    """The tiny models as a release; `change` edits the arrays of tokenizer and generator first."""
    states = official_tokenizer(TOKENIZER), official_generator(GENERATOR.transformer)
    if change:
        change(*states)
    return write_release(folder, *states)


def refused(paths: list[Path], out: Path, **options: object) -> str:
    """The one sentence; nothing is written."""
    with pytest.raises(PlaygroundError) as caught:
        convert_lgtok(*paths, out, **options)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 600
    assert not out.exists() or not list(out.iterdir())
    return str(caught.value)
