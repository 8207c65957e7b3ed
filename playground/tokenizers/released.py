"""LG-Tok's tokenizer as its authors release it: which of their arrays is which of ours (facts of eanson023/LG-Tok).

Sizes are read off the arrays; what arrays cannot say (rope base, norm placement, look-up) comes from the options text.
"""

from collections.abc import Mapping

import torch
from torch import Tensor

from playground.errors import PlaygroundError
from playground.motion.representation import COLUMNS
from playground.nn.foreign import ForeignState
from playground.nn.rope import rope_angles
from playground.tokenizers.transformer import TokenizerConfig

Weights = dict[str, Tensor]
UNUSED = r"^text_model\.|^encoder\.mask_token$|\.(initted|code_sum|code_count)$"  # frozen, of training only
ROPE_TOLERANCE = 1e-4
NORMS = {"RMS": "rms", "LN": "layer"}  # their names -> ours
FIRST_BLOCK = "encoder.transformer.middle_block.self_attn"


def tokenizer_weights(state: ForeignState, settings: Mapping[str, str]) -> tuple[TokenizerConfig, Weights]:
    """The arrays of a release -> config and weights of `LGTok`; consumes the state.

    settings: the options text, as text. PlaygroundError where something is missing or left over, or where options and
    arrays contradict each other.
    """
    config = _config(state, settings)
    _check_rope(state, config)
    state.drop(UNUSED)
    state.drop(r"\.rotary_embedding\.x_(cos|sin)$")
    out: Weights = {
        "latent_tokens": state.take("latent_tokens"),
        "mask_vector": state.take("mask_token").reshape(-1),
        "query_positions": state.take("decoder.de_position_embedding.pos_embed"),
        "motion_in.weight": state.take("encoder.to_patch_embedding.weight", 3).flatten(1),
        "motion_in.bias": state.take("encoder.to_patch_embedding.bias"),
        "motion_out.weight": state.take("decoder.conv_out.0.weight", 3).flatten(1).t().contiguous(),
        "motion_out.bias": state.take("decoder.conv_out.0.bias"),
    }
    for ours, theirs in (
        ("text_proj", "text_embed"),
        ("to_code", "encoder.conv_out"),
        ("from_code", "decoder.conv_in_l"),
        *(
            (f"quantizer.phis.{n}.convs.{k}", f"quantizer.phis.{n}.phi.{k}.0")
            for n in range(len(config.scales))
            for k in (0, 1)
        ),
    ):
        out |= _pair(state, ours, theirs)
    for level in range(len(config.scales)):
        out[f"quantizer.codebooks.{level}.vectors"] = state.take(f"quantizer.layers.{level}.codebook")
    for side, crossed in (("encoder", False), ("decoder", True)):
        out |= _stack(state, side, config, crossed)
    state.check_empty()
    return config, out


def _config(state: ForeignState, settings: Mapping[str, str]) -> TokenizerConfig:
    latents, width = state.shape("latent_tokens", 2)
    frames = state.shape("decoder.de_position_embedding.pos_embed", 2)[0]
    _, columns, _ = state.shape("encoder.to_patch_embedding.weight", 3)
    head_width = state.shape(f"{FIRST_BLOCK}.rotary_embedding.x_cos", 4)[3]
    if columns != COLUMNS:
        raise PlaygroundError(
            f"{state.path} reads motions of {columns} columns; models of {COLUMNS} columns are needed"
        )
    norm = NORMS.get(settings.get("norm", "RMS"))
    depth = 1 + 2 * state.count("encoder.transformer.input_blocks")
    scales = _scales(settings)
    levels = state.count("quantizer.layers")
    if norm is None or width % head_width or head_width % 2:
        raise PlaygroundError(f"{state.path} has norms or heads of another kind than the released models")
    if len(scales) != levels or scales[-1] != latents:
        raise PlaygroundError(
            f"the options text states {len(scales)} scales up to {scales[-1]}, but {state.path} has {levels} codebooks"
            f" and {latents} latents; the two do not belong together"
        )
    return TokenizerConfig(
        columns=columns,
        heading="humanml3d",
        max_frames=frames,
        width=width,
        depth=depth,
        heads=width // head_width,
        hidden=state.shape("encoder.transformer.middle_block.linear1.weight", 2)[0],
        scales=scales,
        codes=tuple(state.shape(f"quantizer.layers.{n}.codebook", 2)[0] for n in range(levels)),
        code_width=state.shape("encoder.conv_out.weight", 3)[0],
        metric="cosine" if settings.get("using_znorm") == "True" else "euclidean",
        text_width=state.shape("text_embed.weight", 2)[1],
        text_positions=_whole(settings, "text_max_len", 77),
        norm=norm,
        pre_norm=settings.get("norm_first") == "True",
        rope_base=float(_whole(settings, "rope_base", 100)),
        dropout=0.1,
    )


def _scales(settings: Mapping[str, str]) -> tuple[int, ...]:
    """`(3, 6, 10)` or `3_6_10` -> growing numbers of tokens."""
    parts = settings.get("scales", "").strip("()").replace("_", ",").replace("-", ",").split(",")
    words = [part.strip() for part in parts if part.strip()]
    if not words or not all(word.isdecimal() and len(word) < 5 for word in words):
        raise PlaygroundError(
            "the options text states no scales; the options of the tokenizer are needed (its opt.txt)"
        )
    scales = tuple(int(word) for word in words)
    if scales[0] < 1 or any(a >= b for a, b in zip(scales, scales[1:], strict=False)):
        raise PlaygroundError(f"the scales {', '.join(words)} of the options text do not grow from one to the next")
    return scales


def _whole(settings: Mapping[str, str], key: str, default: int) -> int:
    word = settings.get(key, str(default)).removesuffix(".0")
    if not (word.isdecimal() and 0 < len(word) < 8 and int(word)):
        raise PlaygroundError(f"the options text says {key}: {word[:40]}; a whole number above 0 is needed")
    return int(word)


def _check_rope(state: ForeignState, config: TokenizerConfig) -> None:
    """Their files carry the cosines of all positions; PlaygroundError unless they are those of the options' base."""
    name = f"{FIRST_BLOCK}.rotary_embedding.x_cos"
    found = state.arrays[name].float()[0, 0]
    needed = config.text_positions + config.latents + config.max_frames
    cosines = rope_angles(torch.arange(len(found)), config.width // config.heads, config.rope_base)[0]
    same = len(found) == needed and torch.allclose(found[:, 0::2], cosines, atol=ROPE_TOLERANCE)
    if not same:
        raise PlaygroundError(
            f"{state.path} has rotary positions of another base or length than the options text says; the two do not"
            " belong together"
        )


def _pair(state: ForeignState, ours: str, theirs: str) -> Weights:
    return {f"{ours}.{kind}": state.take(f"{theirs}.{kind}") for kind in ("weight", "bias")}


def _stack(state: ForeignState, side: str, config: TokenizerConfig, crossed: bool) -> Weights:
    """One transformer; crossed: with attention to latents (their multihead_attn) and to text (multihead_attn2)."""
    theirs, half = f"{side}.transformer", config.depth // 2
    out = _norm(state, f"{side}.entry", f"{theirs}.norm_pre") | _norm(state, f"{side}.exit", f"{theirs}.norm_post")
    names = [f"input_blocks.{n}" for n in range(half)] + ["middle_block"] + [f"output_blocks.{n}" for n in range(half)]
    for index, name in enumerate(names):
        out |= _block(state, f"{side}.blocks.{index}", f"{theirs}.{name}", crossed)
    for index in range(half):
        out |= _pair(state, f"{side}.merges.{index}", f"{theirs}.linear_blocks.{index}")
    return out


def _norm(state: ForeignState, ours: str, theirs: str) -> Weights:
    if f"{theirs}.scale" in state.arrays:
        return {f"{ours}.weight": state.take(f"{theirs}.scale")}
    return _pair(state, ours, theirs)


def _block(state: ForeignState, ours: str, theirs: str, crossed: bool) -> Weights:
    """Their norm3 stands before or after the feed-forward, norm4 at the text: the order of ours is 1, 2, 4, 3."""
    out: Weights = {}
    for kind in ("weight", "bias"):
        parts = [f"{theirs}.self_attn.{part}.{kind}" for part in ("query", "key", "value")]
        out[f"{ours}.self_attention.qkv.{kind}"] = state.join(parts)
        gate_up = [f"{theirs}.{part}.{kind}" for part in ("linear1_swi", "linear1")]
        out[f"{ours}.feed_forward.gate_up.{kind}"] = state.join(gate_up)
    out |= _pair(state, f"{ours}.self_attention.out", f"{theirs}.self_attn.proj")
    out |= _pair(state, f"{ours}.feed_forward.down", f"{theirs}.linear2")
    for index, number in enumerate((1, 2, 4, 3) if crossed else (1, 2)):
        out |= _norm(state, f"{ours}.norms.{index}", f"{theirs}.norm{number}")
    for index, name in enumerate(("multihead_attn", "multihead_attn2") if crossed else ()):
        memory = f"{ours}.cross_attentions.{index}"
        for kind, axes in (("weight", 2), ("bias", 1)):
            state.shape(f"{theirs}.{name}.in_proj_{kind}", axes)
            query, key_value = _thirds(state.take(f"{theirs}.{name}.in_proj_{kind}"))
            out[f"{memory}.query.{kind}"], out[f"{memory}.key_value.{kind}"] = query, key_value
        out |= _pair(state, f"{memory}.out", f"{theirs}.{name}.out_proj")
    return out


def _thirds(stacked: Tensor) -> tuple[Tensor, Tensor]:
    """Query, key and value stacked in one array -> the query's part and the part of key and value."""
    size = len(stacked) // 3
    return stacked[:size].contiguous(), stacked[size:].contiguous()
