"""docs/adding-a-system.md, followed: one module (here) and rows make a system that trains, ships and generates."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from playground.architectures import ARCHITECTURES, Architecture
from playground.data.library import LibraryClip, write_library
from playground.engine import Engine
from playground.generators.base import Edit, Step, TokenBatch, redraw_masks
from playground.motion.motion import Motion
from playground.nn.sampling import Sampling, draw, entropy_bits
from playground.systems import SYSTEMS, SamplingDefaults, SystemRow
from playground.text.encoders import TextFeatures
from playground.tokenizers.base import Tokenizer, Tokens
from playground.tokenizers.quantizers import MultiScaleQuantizer
from playground.training import ship
from playground.training.configs import GeneratorTraining, Schedule
from playground.training.loop import Launch
from playground.training.others import OTHERS
from playground.training.run import train
from tests.conftest import drifting
from tests.tiny_systems import shrunk

NAME = "unigram"
PAGE = Path(__file__).resolve().parent.parent / "docs" / "adding-a-system.md"

# ---- 1. the module --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class UnigramConfig:
    """Every token drawn alone, from the text and its place."""

    width: int = 8
    text_width: int = 384
    scales: tuple[int, ...] = (49,)
    codes: tuple[int, ...] = (512,)


class Unigram(nn.Module):
    def __init__(self, config: UnigramConfig) -> None:
        super().__init__()
        self.config = config
        self.text = nn.Linear(config.text_width, config.width)
        self.places = nn.ParameterList(torch.zeros(size, config.width) for size in config.scales)
        self.heads = nn.ModuleList(nn.Linear(config.width, codes) for codes in config.codes)

    def forward(self, pooled: Tensor, sizes: list[int]) -> list[Tensor]:
        """Pooled text [B, D] -> logits [B, s_n, V_n] a level."""
        own = self.text(pooled)[:, None]
        return [head(own + at[:size]) for head, at, size in zip(self.heads, self.places, sizes, strict=True)]

    def training_loss(
        self, batch: TokenBatch, quantizer: MultiScaleQuantizer, rng: torch.Generator
    ) -> tuple[Tensor, Tensor]:
        logits = self(batch.text.pooled * ~batch.dropped[:, None], [ids.shape[1] for ids in batch.ids])
        targets = [ids.masked_fill(~real, -1) for ids, real in zip(batch.ids, batch.masks, strict=True)]
        pairs = list(zip(logits, targets, strict=True))
        loss = sum(F.cross_entropy(part.flatten(0, 1), ids.flatten(), ignore_index=-1) for part, ids in pairs)
        right = sum((part.argmax(-1) == ids).sum() for part, ids in pairs) / sum((ids >= 0).sum() for _, ids in pairs)
        return loss, right


@dataclass(frozen=True, eq=False)
class UnigramGenerator:
    likelihood: ClassVar[bool] = False
    network: Unigram = field(repr=False)
    tokenizer: Tokenizer = field(repr=False)

    @property
    def quantizer(self) -> MultiScaleQuantizer:
        return self.tokenizer.quantizer

    @torch.no_grad()
    def steps(
        self, text: TextFeatures | None, lengths: Tensor, sampling: Sampling, edit: Edit | None = None
    ) -> Iterator[Step]:
        pooled = torch.zeros(len(lengths), self.network.config.text_width) if text is None else text.pooled
        sizes, rng = list(self.tokenizer.sizes(int(lengths.max()))), sampling.rng()
        logits = self.network(pooled, sizes)
        ids = [draw(part, sampling, rng) for part in logits]
        ids = ids if edit is None else [edit.mix(level, drawn) for level, drawn in enumerate(ids)]
        tokens = Tokens(tuple(ids), self.quantizer.codes)
        shown = torch.cat(logits, dim=1)
        yield Step(len(ids), tokens, self.tokenizer.embed(tokens, None, lengths), entropy_bits(shown), shown)

    def generate(self, text: TextFeatures | None, lengths: Tensor, sampling: Sampling) -> Step:
        *_, last = self.steps(text, lengths, sampling)
        return last

    def edit(
        self, tokens: Tokens, keep: Tensor, text: TextFeatures | None, lengths: Tensor, sampling: Sampling
    ) -> Tokens:
        *_, last = self.steps(text, lengths, sampling, Edit(tokens, redraw_masks(keep, tokens.sizes)))
        return last.tokens


# ---- 2. the rows, 3. training and shipping --------------------------------------------------------------------------


@pytest.fixture
def library(tmp_path) -> Path:
    clips = [LibraryClip(f"c{n}", "A", "train", "walk", ("walks",), drifting(40 + n, n)) for n in range(6)]
    write_library(tmp_path / "library", clips, "tiny library")
    return tmp_path / "library"


def test_a_row_and_a_module_make_a_system(library, tmp_path, monkeypatch):
    monkeypatch.setitem(ARCHITECTURES, NAME, Architecture("generator", UnigramConfig, Unigram, UnigramGenerator))
    row = SystemRow(NAME, "Unigram", "momask", "convolutions", "every token alone", sampling=SamplingDefaults(0.0))
    monkeypatch.setitem(SYSTEMS, NAME, row)
    plan = Schedule(steps=3, warmup=1)
    tokenizer = OTHERS["momask-tokenizer"]
    small = replace(tokenizer, model=shrunk(tokenizer.model), schedule=plan, synthetic=0.0)
    monkeypatch.setitem(OTHERS, f"{NAME}-tokenizer", small)
    generator = GeneratorTraining(
        UnigramConfig(), f"{NAME}-tokenizer", schedule=plan, size=4, variants=1, synthetic=0.0
    )
    monkeypatch.setitem(OTHERS, f"{NAME}-generator", generator)

    launch = Launch(accelerator="cpu", precision="32-true")
    for part in ("tokenizer", "generator"):
        train(f"{NAME}-{part}", library, tmp_path / NAME, launch=launch)
    ship.ship(tmp_path / NAME, NAME, tmp_path / "assets")

    engine = Engine(tmp_path / "assets")
    info = next(info for info in engine.systems() if info.name == NAME)
    assert (info.checkpoint, info.generator, info.data) == ("shipped", "every token alone", "tiny library")
    made = engine.generate("a person walks", 2.0, NAME, seed=1)
    assert [level.size for level in made.levels] == [10] * 6 and made.motion.frames == 40
    tokenized = engine.tokenize(Motion(drifting(61)), "", NAME)
    np.testing.assert_array_equal(
        engine.reconstruct(tokenized).features, engine.decode(tokenized.token_file()).features
    )
    edited = engine.edit(Motion(drifting(61)), (16, 40), "a person jumps", system=NAME)
    assert edited.kept.sum() == 36


def test_every_file_and_name_of_the_page_is_there():
    text = PAGE.read_text(encoding="utf-8")
    root = PAGE.parent.parent
    paths = set(re.findall(r"`((?:playground|tests)/[\w/.]+)`", text))
    assert len(paths) >= 6 and all((root / path).exists() for path in paths)
    code = "\n".join((root / f"playground/{part}/base.py").read_text() for part in ("tokenizers", "generators"))
    for name in ("Tokenizer", "TokenNetwork", "Generator", "FeatureNetwork", "FeatureGenerator"):
        assert f"`{name}`" in text or f"`{name}:" in text
        assert f"class {name}(" in code
    for module in re.findall(r"python -m (playground\.[\w.]+)", text):
        assert (root / Path(*module.split("."))).with_suffix(".py").is_file()
