"""LG-Tok's generator as its authors release it: which of their arrays is which of ours (facts of eanson023/LG-Tok).

Every size is read off the arrays; the rope base is written into their code.
"""

import torch
from torch import Tensor

from playground.errors import PlaygroundError
from playground.generators.scalewise import GeneratorConfig
from playground.nn.foreign import ForeignState
from playground.nn.rope import rope_angles
from playground.tokenizers.transformer import TokenizerConfig

ROPE_TOLERANCE = 1e-4


def generator_weights(state: ForeignState, tokenizer: TokenizerConfig) -> tuple[GeneratorConfig, dict[str, Tensor]]:
    """The arrays of a release -> config and weights of `ScalewiseTransformer`; consumes the state.

    tokenizer: the one whose tokens it draws. PlaygroundError where something is missing or left over, where it belongs
    to another tokenizer, or where its positions are not the released ones.
    """
    config = _config(state, tokenizer)
    _check_rope(state, config)
    state.drop(r"^(clip_model\.|freqs_cis$|lvl_1L$|attn_mask$)")
    out = {
        "start": state.take("pos_start", 3).flatten(0, 1),
        "level": state.take("lvl_embed.weight"),
        "length": state.take("len_embed.weight"),
    }
    pairs = [("text_proj", "input_emb"), ("sum_proj", "input_process")]
    pairs += [(f"heads.{level}", f"heads.{level}") for level in range(len(config.scales))]
    for layer in range(config.depth):
        ours, theirs = f"layers.{layer}", f"blocks.{layer}"
        pairs += [
            (f"{ours}.cross.query", f"{theirs}.attn0.query"),
            (f"{ours}.cross.out", f"{theirs}.attn0.proj"),
            (f"{ours}.self_attention.out", f"{theirs}.attn.proj"),
        ]
        out[f"{ours}.feed_forward.down.weight"] = state.take(f"{theirs}.mlp.0.c_proj.weight")
        gate_up = [f"{theirs}.mlp.0.{part}.weight" for part in ("c_fc1", "c_fc2")]
        out[f"{ours}.feed_forward.gate_up.weight"] = state.join(gate_up)
        for ours_norm, norm in (("text_norm", "ln0_t"), ("norms.0", "ln0"), ("norms.1", "ln1"), ("norms.2", "ln2")):
            out[f"{ours}.{ours_norm}.weight"] = state.take(f"{theirs}.{norm}.scale")
        for kind in ("weight", "bias"):
            cross = [f"{theirs}.attn0.{part}.{kind}" for part in ("key", "value")]
            whole = [f"{theirs}.attn.{part}.{kind}" for part in ("query", "key", "value")]
            out[f"{ours}.cross.key_value.{kind}"] = state.join(cross)
            out[f"{ours}.self_attention.qkv.{kind}"] = state.join(whole)
    for name, theirs in pairs:
        out |= {f"{name}.{kind}": state.take(f"{theirs}.{kind}") for kind in ("weight", "bias")}
    state.check_empty()
    return config, out


def _config(state: ForeignState, tokenizer: TokenizerConfig) -> GeneratorConfig:
    levels, width = state.shape("lvl_embed.weight", 2)
    codes = tuple(state.shape(f"heads.{level}.weight", 2)[0] for level in range(state.count("heads")))
    code_width = state.shape("input_process.weight", 2)[1]
    first = state.shape("pos_start", 3)[1]
    lengths = state.shape("len_embed.weight", 2)[0]
    half = state.shape("freqs_cis", 2)[1]
    given, wanted = (levels, first, codes, code_width), (
        len(tokenizer.scales), tokenizer.scales[0], tokenizer.codes, tokenizer.code_width
    )  # fmt: skip
    if given != wanted or lengths > tokenizer.max_frames:
        raise PlaygroundError(f"{state.path} draws the tokens of another tokenizer; the two do not belong together")
    if width % (2 * half):
        raise PlaygroundError(f"{state.path} has heads of another kind than the released models")
    return GeneratorConfig(
        width=width,
        depth=state.count("blocks"),
        heads=width // (2 * half),
        hidden=state.shape("blocks.0.mlp.0.c_fc1.weight", 2)[0],
        text_width=state.shape("input_emb.weight", 2)[1],
        text_mask=False,
        length_unit=tokenizer.max_frames // lengths,
        lengths=lengths,
        scales=tokenizer.scales,
        codes=codes,
        code_width=code_width,
        rope_span=2.0 * half,
    )


def _check_rope(state: ForeignState, config: GeneratorConfig) -> None:
    """Their files carry the positions as complex numbers; PlaygroundError unless they are ours."""
    found = state.arrays["freqs_cis"]
    places = [torch.linspace(0.0, config.rope_span, s) if s > 1 else torch.zeros(1) for s in config.scales]
    cos, sin = rope_angles(torch.cat(places), config.width // config.heads, config.rope_base)
    same = found.is_complex() and found.shape == cos.shape
    if not same or not torch.allclose(found.to(torch.complex64), torch.complex(cos, sin), atol=ROPE_TOLERANCE):
        raise PlaygroundError(f"{state.path} has rotary positions of another kind than the released models")
