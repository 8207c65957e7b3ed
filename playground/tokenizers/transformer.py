"""LG-Tok's tokenizer and detokenizer (arXiv 2602.08337; systems.md A3-A8), read from config to decoding.

encode: text, learned latents and motion frames go through one transformer; the latents that come out are quantized over
growing scales. decode: frame queries look at the de-quantized latents and at the text; guidance decodes with and
without text and extrapolates.
"""

from dataclasses import dataclass, replace
from typing import Literal

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from playground.limits import LIMITS
from playground.nn.attention import Memory
from playground.nn.blocks import UStack
from playground.nn.linear import Conv3, Linear
from playground.nn.modules import WordTable
from playground.nn.rope import Rotation, rope_angles
from playground.nn.seams import Seams
from playground.nn.sequences import join_masks, put_before
from playground.text.encoders import TextFeatures
from playground.tokenizers.base import Quantized, Tokens, TrainingOutput
from playground.tokenizers.quantizers import MultiScaleQuantizer

FULL_SCALES = (3, 6, 10, 15, 20, 25, 30, 36, 42, 49)  # 236 tokens
MID_SCALES = (2, 4, 6, 9, 12, 16, 20, 25, 30, 36)  # 160 tokens
MINI_SCALES = (1, 2, 3, 5, 7, 10, 13, 17, 21, 25)  # 104 tokens; the list itself is not published (systems.md I1)
TextSide = Literal["both", "tokenizer", "detokenizer", "none"]
Mixing = Literal["in-context", "cross"]


def linear_codes(first: int, last: int, levels: int) -> tuple[int, ...]:
    """Codebook sizes growing linearly from coarse to fine, rounded (A6: 256 to 768 over 10 scales)."""
    return tuple(round(first + (last - first) * n / (levels - 1)) for n in range(levels))


@dataclass(frozen=True)
class TokenizerConfig:
    """Every number of the LG-Tok tokenizer; the defaults are the published model."""

    columns: int = 67  # feature columns C
    heading: str = "body"  # rule by which the columns' heading is read off the body (motion/representation.py)
    max_frames: int = LIMITS.max_frames  # longest motion
    patch: int = 1  # frames a motion token
    width: int = 256
    depth: int = 9  # blocks a side, odd where skips are on
    heads: int = 4
    hidden: int = 1024  # feed-forward width
    dropout: float = 0.1
    scales: tuple[int, ...] = FULL_SCALES
    codes: tuple[int, ...] = linear_codes(256, 768, 10)
    code_width: int = 512
    metric: str = "cosine"  # code look-up: cosine | euclidean
    phi: str = "conv"  # conv | residual | identity
    draw: float = 0.0  # Gumbel temperature of the look-ups in training; MoMask's quantizer has 0.5 (A11)
    level_drop: float = 0.0  # share of training steps that use a prefix of the levels; 0.2 there
    text_width: int = 2048  # width of the text encoder's token states
    text_table: int = 0  # above 0: the encoder gives word numbers below it, and their vectors are learned (Table 4f)
    text_positions: int = LIMITS.max_text_positions  # positions reserved for text in front of the latents
    text_side: TextSide = "both"  # Table 4e
    text_mixing: Mixing = "in-context"  # tokenizer, Table 4g
    motion_mixing: Mixing = "in-context"  # tokenizer, Table 4g
    text_mixing_out: Mixing = "cross"  # detokenizer, Table 4g
    latent_mixing_out: Mixing = "cross"  # detokenizer, Table 4g
    norm: str = "rms"  # rms | layer, Table 4a-c
    pre_norm: bool = False  # the released code is post-norm
    feed: str = "swiglu"  # swiglu | gelu, Table 4a-c
    skips: bool = True  # Table 4a-c
    positions: Literal["rope", "learned"] = "rope"  # Table 4d
    rope_base: float = 100.0  # Table 4d
    aligned: bool = (
        False  # True: latents share the frames' rotary axis, on both sides; ours, learns time in fewer steps
    )
    small_init: bool = (
        True  # weights from a normal of std 0.02 (A3); False: torch's own, which learns faster when pre-norm
    )
    seam: int = 0  # width of the convolutions that join the patches' frames (nn/seams.py), 0: none; ours

    @property
    def latents(self) -> int:
        """Number of latents T."""
        return self.scales[-1]


def residual_levels(config: TokenizerConfig, levels: int = 6, codes: int = 512) -> TokenizerConfig:
    """The same transformer with MoMask's plain residual quantizer: every level holds a token a latent (A11, B1)."""
    return replace(
        config, scales=(config.latents,) * levels, codes=(codes,) * levels, metric="euclidean", phi="identity",
        draw=0.5, level_drop=0.2,
    )  # fmt: skip


PRESETS: dict[str, TokenizerConfig] = {
    "full": TokenizerConfig(),
    "mid": TokenizerConfig(scales=MID_SCALES),
    "mini": TokenizerConfig(scales=MINI_SCALES),
    "tiny": TokenizerConfig(depth=3),
    "rvq": residual_levels(TokenizerConfig()),
    "lite": TokenizerConfig(
        patch=4, width=192, depth=5, heads=3, hidden=512, dropout=0.0, scales=MID_SCALES,
        codes=linear_codes(128, 384, 10), code_width=192, phi="residual", text_width=384, pre_norm=True,
        small_init=False, aligned=True,
    ),
}  # fmt: skip


def length_mask(lengths: Tensor, size: int) -> Tensor | None:
    """Boolean [B, size], True where real; None where every row is full (on a GPU, asking would wait for it)."""
    if lengths.device.type == "cpu" and bool((lengths >= size).all()):
        return None
    return torch.arange(size, device=lengths.device)[None] < lengths[:, None]


class LGTok(nn.Module):
    """Tokenizer and detokenizer of LG-Tok. Plain arguments come from a TokenizerConfig through `build_tokenizer`."""

    def __init__(self, config: TokenizerConfig) -> None:
        super().__init__()
        c = self.config = config
        if c.aligned and c.positions != "rope":
            raise ValueError("aligned latents need rotary positions")
        self.frames = -(-c.max_frames // c.patch)
        self.text_in = c.text_side in ("both", "tokenizer")
        self.text_out = c.text_side in ("both", "detokenizer")
        crossed_in = (c.motion_mixing == "cross") + (self.text_in and c.text_mixing == "cross")
        crossed_out = (c.latent_mixing_out == "cross") + (self.text_out and c.text_mixing_out == "cross")
        self.motion_in = Linear(c.patch * c.columns, c.width)
        self.text_proj = WordTable(c.text_table, c.width) if c.text_table else Linear(c.text_width, c.width)
        self.latent_tokens = nn.Parameter(torch.randn(c.latents, c.width) * c.width**-0.5)
        self.mask_vector = nn.Parameter(torch.randn(c.width) * c.width**-0.5)  # frame query and null text
        self.query_positions = nn.Parameter(torch.randn(self.frames, c.width) * c.width**-0.5)
        self.encoder = _build_stack(c, crossed_in)
        self.decoder = _build_stack(c, crossed_out)
        self.to_code = Conv3(c.width, c.code_width)
        self.from_code = Conv3(c.code_width, c.width)
        self.motion_out = Linear(c.width, c.patch * c.columns)
        self.quantizer = MultiScaleQuantizer(
            c.scales, c.codes, c.code_width, metric=c.metric, phi=c.phi, draw=c.draw, level_drop=c.level_drop
        )
        if c.positions == "learned":
            total = c.text_positions + c.latents + self.frames
            self.table_in = nn.Parameter(torch.randn(total, c.width) * c.width**-0.5)
        if c.small_init:
            self.apply(_init)
        self.seams = Seams(c.columns, c.seam, c.patch) if c.seam else None

    # ---- positions and masks -------------------------------------------------------------------------------------

    def _rotation(self, positions: Tensor) -> Rotation | None:
        if self.config.positions != "rope":
            return None
        return rope_angles(positions, self.config.width // self.config.heads, self.config.rope_base)

    def _latent_places(self, lengths: Tensor) -> Tensor:
        """Where the latents stand among the motion tokens when they are spread evenly over each motion: [B, T]."""
        count = self._patched(lengths)[:, None]
        return (torch.arange(self.config.latents, device=lengths.device) + 0.5) * count / self.config.latents - 0.5

    def _positions(self, parts: list[Tensor], starts: list[int], lengths: Tensor) -> Tensor:
        """Rotary positions of the tokenizer's sequence: [S], or [B, 1, S] where latents are aligned with frames."""
        c = self.config
        places = [torch.arange(p.shape[1], device=lengths.device) + s for p, s in zip(parts, starts, strict=True)]
        if not c.aligned:
            return torch.cat(places)
        latents = self._latent_places(lengths) + c.text_positions + c.latents
        rows = [
            latents if s == c.text_positions else p.expand(len(lengths), -1)
            for p, s in zip(places, starts, strict=True)
        ]
        return torch.cat(rows, dim=1)[:, None]

    def _cross_rotations(self, places: Tensor, lengths: Tensor) -> tuple[Rotation, Rotation] | None:
        """Rotations of frame queries and of latents in the detokenizer, where they share an axis."""
        if not self.config.aligned:
            return None
        queries = self._rotation(places.expand(len(lengths), -1)[:, None])
        latents = self._rotation(self._latent_places(lengths)[:, None])
        return None if queries is None or latents is None else (queries, latents)

    def _patched(self, lengths: Tensor) -> Tensor:
        return (lengths + self.config.patch - 1) // self.config.patch

    def _text(self, text: TextFeatures, dropped: Tensor | None) -> Tensor:
        """Projected text [B, W, D]; dropped rows (bool [B]) hold the mask vector in every position (A5)."""
        states = self.text_proj(text.tokens)
        if dropped is None:
            return states
        return torch.where(dropped[:, None, None], self.mask_vector.to(states.dtype), states)

    # ---- tokenizer ------------------------------------------------------------------------------------------------

    def latents(
        self, features: Tensor, lengths: Tensor, text: TextFeatures | None, dropped: Tensor | None = None
    ) -> Tensor:
        """features [B, F, C] -> latents z [B, T, code width] before quantization. Dropped rows see no text."""
        c = self.config
        batch, frames = features.shape[:2]
        short = -frames % c.patch
        patches = F.pad(features, (0, 0, 0, short)).reshape(batch, -1, c.patch * c.columns)
        motion = self.motion_in(patches)  # (B, F / patch, D)
        motion_mask = length_mask(self._patched(lengths), motion.shape[1])
        parts = [self.latent_tokens.to(motion.dtype).expand(batch, -1, -1)]
        masks: list[Tensor | None] = [None]
        starts = [c.text_positions]
        memories = []
        if c.motion_mixing == "in-context":
            parts.append(motion)
            masks.append(motion_mask)
            starts.append(c.text_positions + c.latents)
        else:
            memories.append(Memory(motion, motion_mask))
        if self.text_in and text is not None:
            states, mask = self._text(text, dropped), text.mask
            if c.text_mixing == "in-context":
                parts.insert(0, states)
                masks.insert(0, mask if dropped is None else mask & ~dropped[:, None])
                starts.insert(0, 0)
            else:
                memories.append(Memory(states, mask))
        elif self.text_in and c.text_mixing == "cross":
            memories.append(Memory(self.mask_vector.to(motion.dtype).expand(batch, 1, -1)))
        positions = self._positions(parts, starts, lengths)
        sequence = torch.cat(parts, dim=1)
        if c.positions == "learned":
            sequence = sequence + self.table_in[positions]
        out = self.encoder(sequence, self._rotation(positions), join_masks(masks, parts), memories)
        first = parts[0].shape[1] if starts[0] == 0 else 0
        kept = out[:, first : first + c.latents]
        return self.to_code(kept)  # (B, T, code width)

    @torch.no_grad()
    def encode(self, features: Tensor, lengths: Tensor, text: TextFeatures | None) -> Quantized:
        """features [B, F, C] normalised, lengths int64 [B] -> Quantized. text None tokenizes without language."""
        return self.quantizer.encode(self.latents(features, lengths, text))

    def sizes(self, frames: int) -> tuple[int, ...]:
        """Tokens a level: the same for every motion, `frames` change nothing."""
        return self.config.scales

    @torch.no_grad()
    def embed(self, tokens: Tokens, levels: int | None = None, lengths: Tensor | None = None) -> Tensor:
        """Tokens -> embedding [B, T, code width] of the coarsest `levels` scales; `lengths` change nothing."""
        return self.quantizer.embed(tokens, levels)

    # ---- detokenizer ----------------------------------------------------------------------------------------------

    def _detokenize(
        self, embedding: Tensor, lengths: Tensor, text_memory: Memory | None, frames: int | None = None
    ) -> Tensor:
        """embedding [B, T, code width] -> features [B, F, C], or [2B, F, C] where the memory asks for a null branch.

        F is `frames`, or else the longest length.
        """
        c = self.config
        batch, frames = len(lengths), int(lengths.max()) if frames is None else frames
        latents = self.from_code(embedding)
        tokens = self._patched(lengths)
        count = -(-frames // c.patch)
        queries = (self.mask_vector + self.query_positions[:count]).to(latents.dtype).expand(batch, -1, -1)
        parts, masks, memories = [queries], [length_mask(tokens, count)], []
        places = [torch.arange(count, device=queries.device)]
        if c.latent_mixing_out == "cross":
            memories.append(Memory(latents, rotations=self._cross_rotations(places[0], lengths)))
        else:
            put_before(parts, masks, places, latents, None, c.latents)
        if text_memory is not None and c.text_mixing_out == "cross":
            memories.append(text_memory)
        elif text_memory is not None:
            put_before(parts, masks, places, text_memory.states, text_memory.mask, c.text_positions)
        sequence = torch.cat(parts, dim=1)
        positions = torch.cat(places)
        out = self.decoder(sequence, self._rotation(positions), join_masks(masks, parts), memories)
        motion = self.motion_out(out[:, -count:])  # (B or 2B, F / patch, patch * C)
        motion = motion.reshape(len(out), count * c.patch, c.columns)[:, :frames]
        real = length_mask(lengths, frames)
        real = None if real is None else real.repeat(len(out) // batch, 1)[..., None]
        motion = motion if self.seams is None else self.seams(motion, real)
        return motion if real is None else motion * real

    def _memory(self, batch: int, text: TextFeatures | None, dropped: Tensor | None) -> Memory | None:
        if not self.text_out:
            return None
        if text is None:
            return Memory(self.mask_vector.expand(batch, 1, -1))
        return Memory(self._text(text, dropped), text.mask)

    @torch.no_grad()
    def branches(self, embedding: Tensor, lengths: Tensor, text: TextFeatures | None) -> tuple[Tensor, Tensor]:
        """The decodes with text and with the null text, [B, F, C] each (A8); computed together."""
        if text is None or not self.text_out:
            plain = self.decode(embedding, lengths, text)
            return plain, plain
        if self.config.text_mixing_out == "in-context":
            return self.decode(embedding, lengths, text), self.decode(embedding, lengths, None)
        states = self._text(text, None)
        memory = Memory(states, text.mask, None, self.mask_vector, len(lengths))
        conditional, unconditional = self._detokenize(embedding, lengths, memory).chunk(2)
        return conditional, unconditional

    @torch.no_grad()
    def decode(
        self,
        embedding: Tensor,
        lengths: Tensor,
        text: TextFeatures | None,
        guidance: float = 0.0,
        edit_mask: Tensor | None = None,
    ) -> Tensor:
        """embedding [B, T, code width] -> normalised features [B, F, C], F = longest length.

        guidance g gives (1 + g) m_c - g m_u (A8). edit_mask: bool [B, F], text acts where True (Eq. 7); with patches, a
        patch counts as edited if any of its frames is.
        """
        if guidance and edit_mask is None:
            conditional, unconditional = self.branches(embedding, lengths, text)
            return (1 + guidance) * conditional - guidance * unconditional
        gate = None if edit_mask is None else self._gate(edit_mask, lengths)

        def branch(words: TextFeatures | None) -> Tensor:
            memory = self._memory(len(lengths), words, None)
            if memory is not None and gate is not None:
                memory = Memory(memory.states, memory.mask, gate)
            return self._detokenize(embedding, lengths, memory)

        conditional = branch(text)
        return conditional if not guidance else (1 + guidance) * conditional - guidance * branch(None)

    @torch.no_grad()
    def text_attention(self, embedding: Tensor, lengths: Tensor, text: TextFeatures) -> Tensor:
        """Cross-attention of frame queries to words while decoding: [layers, B, H, F / patch, W], rows sum to 1 (A4).

        ValueError where the detokenizer has no cross-attention to text (Table 4e, 4g).
        """
        memory = self._memory(len(lengths), text, None)
        if memory is None or self.config.text_mixing_out != "cross":
            raise ValueError("this detokenizer has no cross-attention to text")
        record: list[Tensor] = []
        self._detokenize(embedding, lengths, replace(memory, record=record))
        return torch.stack(record)

    def _gate(self, edit_mask: Tensor, lengths: Tensor) -> Tensor:
        short = int(self._patched(lengths).max()) * self.config.patch - edit_mask.shape[1]
        padded = F.pad(edit_mask.bool(), (0, max(short, 0)))[:, : edit_mask.shape[1] + short]
        patches = padded.reshape(len(edit_mask), -1, self.config.patch).any(dim=-1)
        return patches[..., None].float()

    # ---- training -------------------------------------------------------------------------------------------------

    def forward(
        self, features: Tensor, lengths: Tensor, text: TextFeatures | None, dropped: Tensor | None = None
    ) -> TrainingOutput:
        """One training pass: encode, quantize with straight-through gradients, decode. dropped: bool [B], no text."""
        z = self.latents(features, lengths, text, dropped)
        quantized = self.quantizer(z)
        out = self.detokenize(quantized.embedding.to(z.dtype), lengths, text, dropped, features.shape[1])
        return TrainingOutput(out, quantized.commitment, quantized.ids)

    def detokenize(
        self, embedding: Tensor, lengths: Tensor, text: TextFeatures | None, dropped: Tensor | None, frames: int
    ) -> Tensor:
        """The second half of a training pass: embedding [B, T, code width] -> features [B, frames, C]."""
        return self._detokenize(embedding, lengths, self._memory(len(lengths), text, dropped), frames)


def _build_stack(c: TokenizerConfig, memories: int) -> UStack:
    return UStack(
        c.width,
        c.heads,
        c.hidden,
        c.depth,
        memories=memories,
        dropout=c.dropout,
        norm=c.norm,
        pre=c.pre_norm,
        feed=c.feed,
        skips=c.skips,
    )


def _init(module: nn.Module) -> None:
    """Linear and convolution weights truncated normal std 0.02, biases 0 (A3)."""
    if isinstance(module, nn.Linear | nn.Conv1d):
        nn.init.trunc_normal_(module.weight, std=0.02)
        if module.bias is not None:
            nn.init.zeros_(module.bias)


def build_tokenizer(config: TokenizerConfig) -> LGTok:
    """The module for a config, randomly initialised, in training mode."""
    return LGTok(config)
