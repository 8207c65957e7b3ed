"""The passes of an evaluation: recorded, rebuilt and generated motions through the evaluators and the measures.

Every pass runs over the batches of its items (items.portions), those of this process alone, and returns arrays over all
items, the same on every process (spread.py).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from playground.data.library import Library
from playground.evaluation.items import Item, portions
from playground.evaluation.judges import judge_motion
from playground.evaluation.prompts_obeyed import Prompt
from playground.evaluation.spread import Spread, Tally
from playground.motion.measures import bone_drift, foot_sliding, joint_errors, path_drift
from playground.motion.representation import from_features67

if TYPE_CHECKING:
    from torch import Tensor

    from playground.engine.refining import Refiner
    from playground.evaluation.evaluators import Evaluator
    from playground.runtime import Runtime

Floats = NDArray[np.float64]
Rows = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Motions:
    """Measured on n motions. embeddings: evaluator -> [n, D]; sliding [n] mm/s, nan without contact; drift [n] mm.

    path: [n] metres between the way over the ground and what it was before the root refiner; 0 without one.
    """

    embeddings: dict[str, Floats]
    sliding: Floats
    drift: Floats
    path: Floats


@dataclass(frozen=True, eq=False)
class Rebuilt:
    """n motions tokenized and decoded, their caption at both ends.

    errors_mm: [n] mean of a motion; ids, predictions: a scale int64 [n, s_n], -1 where a motion has fewer tokens;
    likelihood: a scale [n, s_n], ln p of the true tokens. The last two are empty without a generator that has a
    likelihood.
    """

    motions: Motions
    errors_mm: Floats
    ids: list[NDArray[np.int64]]
    likelihood: list[Floats]
    predictions: list[NDArray[np.int64]]


@dataclass(frozen=True)
class Reading:
    """A way to decode drawn tokens: with the caption or without any text, and the guidance scale g."""

    text: bool
    guidance: float = 0.0


class Passes:
    """One system, one library, the evaluators that are there, and the processes that share the work."""

    def __init__(
        self,
        runtime: "Runtime",
        library: Library,
        evaluators: dict[str, "Evaluator"],
        guidance: float,
        sampling: dict[str, Any],
        spread: Spread,
        refiner: "Refiner | None" = None,
    ) -> None:
        self.runtime = runtime
        self.library = library
        self.evaluators = evaluators
        self.guidance = guidance  # of the detokenizer, for generated motions; rebuilt ones are decoded with 0
        self.sampling = sampling  # of the generator: cfg, temperature, top_k, top_p
        self.spread = spread
        self.refiner = refiner  # of generated motions
        self.tally = Tally(None, 0)

    # ---- passes ---------------------------------------------------------------------------------------------------

    def texts(self, items: Sequence[Item]) -> dict[str, Floats]:
        """Embeddings [n, D] of the captions by every evaluator; zeros where a caption is empty."""
        out = self._nothing(len(items)).embeddings
        for part in self._mine(items):
            if items[part[0]].caption:
                for name, evaluator in self.evaluators.items():
                    out[name][part] = evaluator.embed_texts([items[place].caption for place in part])
        return {name: self.spread.total(array) for name, array in out.items()}

    def recorded(self, items: Sequence[Item]) -> Motions:
        """The recorded motions themselves."""
        motions = self._nothing(len(items))
        for part in self._mine(items):
            self._fill(motions, part, self._cut([items[place] for place in part]), made=False)
            self.tally.add(len(part))
        return self._shared(motions)

    def generated(self, items: Sequence[Item]) -> Motions:
        """Motions made from the captions, as long as the recorded ones."""
        motions = self._nothing(len(items))
        for part in self._mine(items):
            made = self._generate([items[place] for place in part])
            refined = self._refined(made)
            self._fill(motions, part, refined)
            for place, before, after in zip(part, made, refined, strict=True):
                motions.path[place] = path_drift(from_features67(before), from_features67(after))
            self.tally.add(len(part))
        return self._shared(motions)

    def swept(self, items: Sequence[Item], scales: Sequence[float]) -> list[Motions]:
        """The same tokens decoded at every guidance scale g, one entry a scale; both branches are decoded once (A8)."""
        import torch

        motions = [self._nothing(len(items)) for _ in scales]
        for part in self._mine(items):
            batch = [items[place] for place in part]
            lengths = torch.tensor([i.rows for i in batch], device=self.runtime.device)
            text = self.runtime.texts([i.caption for i in batch])
            with_text, without = (
                branch.cpu().numpy() for branch in self.runtime.tokenizer.branches(self.draw(batch), lengths, text)
            )
            for g, filled in zip(scales, motions, strict=True):
                rows = self.runtime.normaliser.invert((1 + g) * with_text - g * without)
                self._fill(filled, part, [one[: item.rows] for one, item in zip(rows, batch, strict=True)])
            self.tally.add(len(part))
        return [self._shared(filled) for filled in motions]

    def read(self, items: Sequence[Item], prompted: bool, readings: Sequence[Reading]) -> list[Motions]:
        """Tokens drawn from the captions, or without any text (free-form), decoded in several ways (Table 8)."""
        motions = [self._nothing(len(items)) for _ in readings]
        for part in self._mine(items):
            batch = [items[place] for place in part]
            bare = [replace(item, caption="") for item in batch]
            drawn = self.draw(batch if prompted else bare)
            for reading, filled in zip(readings, motions, strict=True):
                self._fill(filled, part, self.decode(batch if reading.text else bare, drawn, reading.guidance))
            self.tally.add(len(part))
        return [self._shared(filled) for filled in motions]

    def samples(self, items: Sequence[Item], name: str) -> Floats:
        """Embeddings [n, D] by one evaluator of motions made from the captions."""
        out = np.zeros((len(items), self.evaluators[name].width))
        for part in self._mine(items):
            out[part] = self.embed(name, self._refined(self._generate([items[place] for place in part])))
            self.tally.add(len(part))
        return self.spread.total(out)

    def obeyed(self, prompts: Sequence[Prompt], items: Sequence[Item]) -> Floats:
        """1 for every prompt that its generated motion obeys, else 0; [n]."""
        out = np.zeros(len(items))
        for part in self._mine(items):
            made = self._refined(self._generate([items[place] for place in part]))
            for place, rows in zip(part, made, strict=True):
                out[place] = not judge_motion(prompts[place].judge, from_features67(rows))
            self.tally.add(len(part))
        return self.spread.total(out)

    def rebuilt(self, items: Sequence[Item]) -> Rebuilt:
        """Recorded motions tokenized and decoded again; with a generator, how it would have predicted their tokens."""
        scales, heading = self.runtime.tokenizer.config.scales, self.runtime.heading
        motions, errors = self._nothing(len(items)), np.zeros(len(items))
        ids, predictions = np.zeros((2, len(items), sum(scales)))
        likelihood = np.zeros((len(items), sum(scales)))
        for part in self._mine(items):
            batch = [items[place] for place in part]
            given = self._cut(batch, heading)
            tokens, made = self._rebuild(batch, given)
            self._fill(motions, part, made)
            for place, rows, true in zip(part, made, given, strict=True):
                errors[place] = joint_errors(from_features67(true), from_features67(rows)).mean()
            real = self._real(batch)
            ids[part] = _padded(tokens.ids, real, scales)
            if self.predicts:
                chances, best = self._predict(batch, tokens)
                likelihood[part], predictions[part] = (_padded(one, real, scales) for one in (chances, best))
            self.tally.add(len(part))
        cuts = np.cumsum(scales)[:-1]
        return Rebuilt(
            self._shared(motions),
            self.spread.total(errors),
            np.split(self.spread.total(ids).astype(np.int64), cuts, axis=1),
            np.split(self.spread.total(likelihood), cuts, axis=1) if self.predicts else [],
            np.split(self.spread.total(predictions).astype(np.int64), cuts, axis=1) if self.predicts else [],
        )

    @property
    def predicts(self) -> bool:
        """Whether the generator says how likely given tokens are."""
        return self.runtime.generator is not None and self.runtime.generator.likelihood

    # ---- batches --------------------------------------------------------------------------------------------------

    def draw(self, batch: Sequence[Item]) -> "Tensor":
        """Embeddings [B, T, D] of tokens drawn for the captions of a batch."""
        captions, rows, seeds = [i.caption for i in batch], [i.rows for i in batch], [i.seed for i in batch]
        return self.runtime.generate_batch(captions, rows, seeds, self.sampling).embedding

    def decode(self, batch: Sequence[Item], embedding: "Tensor", guidance: float) -> list[Rows]:
        """Un-normalised rows of the motions of a batch."""
        return self.runtime.decode_batch(embedding, [i.rows for i in batch], [i.caption for i in batch], guidance)

    def _generate(self, batch: Sequence[Item]) -> list[Rows]:
        captions, rows, seeds = [i.caption for i in batch], [i.rows for i in batch], [i.seed for i in batch]
        return self.runtime.make_batch(captions, rows, seeds, self.sampling, self.guidance)

    def _refined(self, made: list[Rows]) -> list[Rows]:
        return made if self.refiner is None else self.refiner.rows(made)

    def _cut(self, batch: Sequence[Item], heading: str = "body") -> list[Rows]:
        return [self.library.features(i.index, heading)[i.start : i.start + i.rows] for i in batch]

    def _rebuild(self, batch: Sequence[Item], given: Sequence[Rows]) -> tuple[Any, list[Rows]]:
        import torch

        runtime, captions, rows = self.runtime, [i.caption for i in batch], [i.rows for i in batch]
        padded = np.zeros((len(given), max(rows), given[0].shape[1]), np.float32)
        for line, values in enumerate(given):
            padded[line, : len(values)] = runtime.normaliser.apply(values)
        features, lengths = torch.from_numpy(padded).to(runtime.device), torch.tensor(rows, device=runtime.device)
        quantized = runtime.tokenizer.encode(features, lengths, runtime.texts(captions))
        return quantized.tokens, runtime.decode_batch(quantized.embedding, rows, captions, 0.0)

    def _real(self, batch: Sequence[Item]) -> "tuple[Tensor, ...]":
        """Which tokens of a batch are real, bool [B, s_n] a scale."""
        import torch

        from playground.tokenizers.base import level_masks

        return level_masks(self.runtime.tokenizer, torch.tensor([i.rows for i in batch], device=self.runtime.device))

    def _predict(self, batch: Sequence[Item], tokens: Any) -> "tuple[tuple[Tensor, ...], tuple[Tensor, ...]]":
        """ln p [B, s_n] of the true tokens and the arg-max predictions [B, s_n], a scale each, teacher-forced."""
        import torch

        generator: Any = self.runtime.generator
        text = self.runtime.texts([i.caption for i in batch], prompts=True)
        lengths = torch.tensor([i.rows for i in batch], device=self.runtime.device)
        logits = generator.logits(tokens, text, lengths)
        pairs = zip(logits, tokens.ids, strict=True)
        true = (level.double().log_softmax(dim=-1).gather(-1, ids[..., None])[..., 0] for level, ids in pairs)
        return tuple(true), tuple(level.argmax(dim=-1) for level in logits)

    # ---- arrays ---------------------------------------------------------------------------------------------------

    def _mine(self, items: Sequence[Item]) -> list[list[int]]:
        return self.spread.mine(portions(items))

    def embed(self, name: str, rows: Sequence[Rows], made: bool = True) -> NDArray[np.float32]:
        """Embeddings of motions given as un-normalised rows, made by the system or cut from the library.

        The evaluators read rows whose heading is read off the body; those of a system with another rule take the way
        over the joints.
        """
        if made and self.runtime.heading != "body":
            return self.evaluators[name].embed_motions([from_features67(one) for one in rows])
        return self.evaluators[name].embed_rows(rows)

    def _nothing(self, count: int) -> Motions:
        embeddings = {name: np.zeros((count, evaluator.width)) for name, evaluator in self.evaluators.items()}
        return Motions(embeddings, *np.zeros((3, count)))

    def _fill(self, motions: Motions, part: list[int], rows: list[Rows], made: bool = True) -> None:
        for name in self.evaluators:
            motions.embeddings[name][part] = self.embed(name, rows, made)
        for place, one in zip(part, rows, strict=True):
            joints = from_features67(one)
            motions.sliding[place], motions.drift[place] = foot_sliding(joints), bone_drift(joints)

    def _shared(self, motions: Motions) -> Motions:
        embeddings = {name: self.spread.total(array) for name, array in motions.embeddings.items()}
        rest = (motions.sliding, motions.drift, motions.path)
        return Motions(embeddings, *(self.spread.total(array) for array in rest))


def _padded(values: "Sequence[Tensor]", real: "Sequence[Tensor]", scales: Sequence[int]) -> NDArray[Any]:
    """[B, s_n] a scale, of tokens -> [B, sum of scales]; every scale filled up to full length, -1 for no token."""
    parts = [
        np.pad(level.masked_fill(~mask, -1).cpu().numpy(), ((0, 0), (0, scale - level.shape[1])), constant_values=-1)
        for level, mask, scale in zip(values, real, scales, strict=True)
    ]
    return np.concatenate(parts, axis=1)
