"""Convolutional encoder and decoder of motions, with or without self-attention (systems.md A9, B1, E3).

Inside, time is the last axis: [B, D, T]. Masks are boolean, True where a step is real, [B, 1, T], or None when all are
real; after every layer that looks along time, what is not real becomes 0 again, so that padding changes nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from torch import Tensor, nn
from torch.nn import functional as F

from playground.nn.attention import SelfAttention
from playground.nn.modules import module_list
from playground.nn.norm import build_norm

BLOCKS = ("dilated", "normed")
GROUPS = 4  # of GroupNorm (A9)
GROWTH = 3  # dilations of a stage are its powers, the largest first (B1)
Masks = Sequence[Tensor | None]  # one a stage boundary, fine to coarse


@dataclass(frozen=True)
class Stage:
    """One stage of an encoder; its decoder runs it backwards."""

    inputs: int  # width before it
    outputs: int  # width after it
    halve: bool  # whether it halves the number of steps
    attention: bool  # self-attention after its blocks


@dataclass(frozen=True)
class Stack:
    """What all stages of one encoder or decoder share."""

    kind: str  # residual blocks: dilated (B1) | normed (A9)
    blocks: int  # residual blocks a stage
    heads: int
    dropout: float  # in residual blocks
    attention_dropout: float
    middle: bool  # block, attention, block at the coarsest steps (A9)
    middle_attention: bool


def clip(x: Tensor, mask: Tensor | None) -> Tensor:
    """x [B, D, T] with zeros where nothing is real."""
    return x if mask is None else x * mask


def conv(inputs: int, outputs: int, dilation: int = 1) -> nn.Conv1d:
    """Kernel 3 along time, as many steps out as in."""
    return nn.Conv1d(inputs, outputs, 3, padding=dilation, dilation=dilation)


class DilatedBlock(nn.Module):
    """ReLU, dilated convolution, ReLU, convolution of kernel 1, dropout, plus the input; no norm (B1)."""

    def __init__(self, width: int, dilation: int, dropout: float) -> None:
        super().__init__()
        self.wide = conv(width, width, dilation)
        self.narrow = nn.Conv1d(width, width, 1)
        self.dropout = dropout

    def forward(self, x: Tensor, mask: Tensor | None) -> Tensor:
        """x [B, D, T] -> [B, D, T]."""
        out = self.narrow(F.relu(self.wide(F.relu(x))))
        return clip(x + F.dropout(out, self.dropout, self.training), mask)


class NormedBlock(nn.Module):
    """Twice GroupNorm, SiLU and convolution, plus the input (A9). The norm sees all steps, so no mask fits it."""

    def __init__(self, inputs: int, outputs: int, dropout: float) -> None:
        super().__init__()
        self.norms = module_list([nn.GroupNorm(GROUPS, inputs), nn.GroupNorm(GROUPS, outputs)])
        self.convs = module_list([conv(inputs, outputs), conv(outputs, outputs)])
        self.shortcut = nn.Identity() if inputs == outputs else nn.Conv1d(inputs, outputs, 1)
        self.dropout = dropout

    def forward(self, x: Tensor, mask: Tensor | None) -> Tensor:
        """x [B, D, T] -> [B, D', T]. ValueError with a mask."""
        if mask is not None:
            raise ValueError("blocks with GroupNorm take motions of one length")
        out = self.convs[0](F.silu(self.norms[0](x)))
        out = F.dropout(F.silu(self.norms[1](out)), self.dropout, self.training)
        return self.shortcut(x) + self.convs[1](out)


class AttentionBlock(nn.Module):
    """x + self-attention of LayerNorm(x), keys that are not real left out (E3)."""

    def __init__(self, width: int, heads: int, dropout: float) -> None:
        super().__init__()
        self.norm = build_norm("layer", width)
        self.attention = SelfAttention(width, heads, dropout=dropout)
        self.dropout = dropout

    def forward(self, x: Tensor, mask: Tensor | None) -> Tensor:
        """x [B, D, T] -> [B, D, T]."""
        keys = None if mask is None else mask[:, 0]
        out = self.attention(self.norm(x.transpose(1, 2)), mask=keys).transpose(1, 2)
        return clip(x + F.dropout(out, self.dropout, self.training), mask)


class Blocks(nn.Module):
    """The blocks of one stage, from one width to another. ValueError for an unknown kind."""

    def __init__(self, stack: Stack, inputs: int, outputs: int, *, count: int, attention: bool) -> None:
        super().__init__()
        blocks: list[nn.Module] = []
        for n, before in enumerate([inputs, *[outputs] * (count - 1)]):
            if stack.kind == "dilated":
                blocks.append(DilatedBlock(outputs, GROWTH ** (count - 1 - n), stack.dropout))
            elif stack.kind == "normed":
                blocks.append(NormedBlock(before, outputs, stack.dropout))
            else:
                raise ValueError(f"unknown residual block {stack.kind!r}; accepted: {', '.join(BLOCKS)}")
        if attention:
            blocks.append(AttentionBlock(outputs, stack.heads, stack.attention_dropout))
        self.blocks = module_list(blocks)

    def forward(self, x: Tensor, mask: Tensor | None) -> Tensor:
        """x [B, inputs, T] -> [B, outputs, T]."""
        for block in self.blocks:
            x = block(x, mask)
        return x


def middle_blocks(stack: Stack, width: int) -> list[Blocks]:
    """Block, attention, block at the coarsest steps, where the stack has a middle (A9)."""
    kinds = (stack.middle_attention, False) if stack.middle else ()
    return module_list(Blocks(stack, width, width, count=1, attention=attention) for attention in kinds)


def edge(kind: str, width: int) -> nn.Module:
    """What stands before the last convolution: ReLU (B1), or GroupNorm and SiLU (A9)."""
    return nn.ReLU() if kind == "dilated" else nn.Sequential(nn.GroupNorm(GROUPS, width), nn.SiLU())


class ConvEncoder(nn.Module):
    """Convolution in, stages that may halve the steps, the middle, convolution out."""

    def __init__(self, inputs: int, outputs: int, stages: Sequence[Stage], stack: Stack) -> None:
        super().__init__()
        self.dilated = stack.kind == "dilated"
        self.stem = conv(inputs, stages[0].inputs)
        self.steps = module_list(_down(stage, self.dilated) for stage in stages)
        self.stages = module_list(
            Blocks(stack, _inner(s, self.dilated), s.outputs, count=stack.blocks, attention=s.attention) for s in stages
        )
        self.middle = middle_blocks(stack, stages[-1].outputs)
        self.edge = nn.Identity() if self.dilated else edge(stack.kind, stages[-1].outputs)
        self.head = conv(stages[-1].outputs, outputs)

    def forward(self, x: Tensor, masks: Masks) -> Tensor:
        """x [B, inputs, F], one mask before the stages and one after each -> [B, outputs, T]."""
        x = self.stem(x)
        x = clip(F.relu(x) if self.dilated else x, masks[0])
        for step, blocks, mask in zip(self.steps, self.stages, masks[1:], strict=True):
            x = blocks(clip(step(x), mask), mask)
        for blocks in self.middle:
            x = blocks(x, masks[-1])
        return clip(self.head(self.edge(x)), masks[-1])


class ConvDecoder(nn.Module):
    """The encoder backwards: convolution in, the middle, stages that may double the steps, convolution out."""

    def __init__(self, inputs: int, outputs: int, stages: Sequence[Stage], stack: Stack) -> None:
        super().__init__()
        self.dilated = stack.kind == "dilated"
        self.stem = conv(inputs, stages[-1].outputs)
        self.middle = middle_blocks(stack, stages[-1].outputs)
        backwards = list(reversed(stages))
        self.stages = module_list(
            Blocks(stack, s.outputs, _inner(s, self.dilated), count=stack.blocks, attention=s.attention)
            for s in backwards
        )
        self.doubles = [stage.halve for stage in backwards]
        self.steps = module_list(_up(stage, self.dilated) for stage in backwards)
        width = stages[0].inputs
        self.last = conv(width, width) if self.dilated else nn.Identity()
        self.edge = edge(stack.kind, width)
        self.head = conv(width, outputs)

    def forward(self, x: Tensor, masks: Masks) -> Tensor:
        """x [B, inputs, T], masks as the encoder's -> [B, outputs, F]."""
        x = self.stem(x)
        x = clip(F.relu(x) if self.dilated else x, masks[-1])
        for blocks in self.middle:
            x = blocks(x, masks[-1])
        fine = list(reversed(masks))
        for blocks, double, step, here, after in zip(
            self.stages, self.doubles, self.steps, fine[:-1], fine[1:], strict=True
        ):
            x = blocks(x, here)
            x = x.repeat_interleave(2, dim=2) if double else x
            x = clip(step(clip(x, after)), after)
        x = clip(self.last(x), masks[0])
        return clip(self.head(self.edge(x)), masks[0])


def _inner(stage: Stage, dilated: bool) -> int:
    """Width between a stage's step and its blocks: dilated blocks keep theirs, so the step changes it."""
    return stage.outputs if dilated else stage.inputs


def _down(stage: Stage, dilated: bool) -> nn.Module:
    if stage.halve:
        return nn.Conv1d(stage.inputs, _inner(stage, dilated), 4, stride=2, padding=1)
    return conv(stage.inputs, stage.outputs) if dilated else nn.Identity()


def _up(stage: Stage, dilated: bool) -> nn.Module:
    return conv(_inner(stage, dilated), stage.inputs) if stage.halve or dilated else nn.Identity()
