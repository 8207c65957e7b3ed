"""Evaluators: motions and texts -> vectors of one space, from a shipped checkpoint (systems.md E5, F1)."""

from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional as F

from playground.checkpoints import Card, load_model
from playground.engine import ASSETS
from playground.errors import PlaygroundError
from playground.evaluation.networks import ContrastiveNetwork, EvaluatorConfig, TMRNetwork, build_evaluator
from playground.limits import LIMITS
from playground.motion.representation import Normaliser, to_features67
from playground.motion.skeleton import HUMAN22
from playground.text.encoders import check_same, load_encoder
from playground.text.features import TextFeatures, valid_text

EVALUATORS = {"tmr": "TMR-style", "clip": "CLIP-style, text from MiniLM"}  # name -> what the screen calls it
CHUNK = 64  # motions or texts of similar length that one pass takes

Floats = NDArray[np.float32]


class Evaluator:
    """A network with its normaliser and text features. Deterministic, keeps no state of a call, serves threads.

    Embeddings have unit length, so ranking by Euclidean distance and by cosine is the same.
    """

    def __init__(
        self,
        name: str,
        network: TMRNetwork | ContrastiveNetwork,
        normaliser: Normaliser,
        texts: Callable[[Sequence[str]], TextFeatures],
        digest: str = "",
        facts: dict[str, Any] | None = None,
    ) -> None:
        self.name = name
        self.width = network.config.latent
        self.hash = digest  # sha256 of the checkpoint file
        self.facts = facts or {}
        self.normaliser = normaliser
        self._network = network
        self._texts = texts

    def embed_motions(self, joints: Sequence[NDArray[np.floating]]) -> Floats:
        """Canonical motions [F, 22, 3] in metres at 20 fps, of any lengths -> unit vectors [n, D], in their order.

        The first LIMITS.max_frames feature rows count. PlaygroundError if one is no such array, has fewer than
        LIMITS.min_source_frames poses, or holds a number that is not finite.
        """
        return self.embed_rows([to_features67(_checked(motion)) for motion in joints])

    def embed_rows(self, rows: Sequence[NDArray[np.floating]]) -> Floats:
        """The same for un-normalised feature rows [F, 67]."""
        normal = [self.normaliser.apply(row[: LIMITS.max_frames]) for row in rows]

        def run(part: list[int]) -> Tensor:
            lengths = torch.tensor([len(normal[i]) for i in part])
            batch = torch.zeros(len(part), int(lengths.max()), self._network.config.columns)
            for line, i in enumerate(part):
                batch[line, : len(normal[i])] = torch.from_numpy(normal[i])
            return self._network.embed_motion(batch.to(self._device), lengths.to(self._device))

        return self._in_chunks([len(row) for row in normal], run)

    def embed_texts(self, texts: Sequence[str]) -> Floats:
        """Texts -> unit vectors [n, D], in their order. PlaygroundError if one is no string."""
        given = valid_text(texts)
        distinct = list(dict.fromkeys(given))

        def run(part: list[int]) -> Tensor:
            return self._network.embed_text(self._texts([distinct[i] for i in part]).to(self._device))

        found = self._in_chunks([len(text) for text in distinct], run)
        rows = {text: row for row, text in enumerate(distinct)}
        return found[[rows[text] for text in given]] if given else found

    @property
    def _device(self) -> torch.device:
        return next(self._network.parameters()).device

    @torch.no_grad()
    def _in_chunks(self, sizes: Sequence[int], run: Callable[[list[int]], Tensor]) -> Floats:
        """run, called on indices of items of similar size -> unit vectors [n, D] of all items in their order."""
        out = np.zeros((len(sizes), self.width), np.float32)
        order = np.argsort(np.asarray(sizes, np.int64), kind="stable").tolist()
        for start in range(0, len(order), CHUNK):
            part = order[start : start + CHUNK]
            out[part] = F.normalize(run(part).float(), dim=-1).cpu().numpy()
        return out


def _checked(joints: NDArray[np.floating]) -> NDArray[np.floating]:
    array = np.asarray(joints)
    if array.ndim != 3 or array.shape[1:] != (HUMAN22.size, 3) or array.dtype.kind not in "fiu":
        raise PlaygroundError(f"an evaluator takes joints of shape [frames, {HUMAN22.size}, 3], got {array.shape}")
    if len(array) < LIMITS.min_source_frames:
        raise PlaygroundError(
            f"a motion of {len(array)} poses is too short to be measured; {LIMITS.min_source_frames} are needed"
        )
    if not np.isfinite(array).all():
        raise PlaygroundError("a motion holds numbers that are not finite and cannot be measured")
    return array


def evaluator_path(name: str, assets: Path = ASSETS) -> Path:
    """The checkpoint of an evaluator. PlaygroundError for an unknown name."""
    if name not in EVALUATORS:
        raise PlaygroundError(f"unknown evaluator {str(name)[:80]!r}; one of {', '.join(EVALUATORS)} is accepted")
    return assets / "checkpoints" / "evaluators" / f"{name}.safetensors"


def open_evaluator(path: Path, name: str) -> tuple[Evaluator, Card]:
    """The evaluator in a file, with its card. PlaygroundError if the file is none, or of another kind than `name`."""
    network, card = load_model(path, "evaluator", EvaluatorConfig, build_evaluator)
    if card.config.kind != name:
        raise PlaygroundError(f"{path} holds a {card.config.kind} evaluator, a {name} one is needed here")
    if card.normaliser is None:
        raise PlaygroundError(f"{path} lacks the mean and std of the features that the evaluator reads")
    encoder = load_encoder(card.encoder.name)
    check_same(card.encoder, encoder)
    return Evaluator(name, network, card.normaliser, encoder.encode, card.hash, card.facts), card


@lru_cache(maxsize=4)
def load_evaluator(name: str, assets: Path = ASSETS) -> Evaluator:
    """The shipped evaluator "tmr" (the default) or "clip". PlaygroundError if it is unknown, absent or broken."""
    path = evaluator_path(name, assets)
    if not path.is_file():
        raise PlaygroundError(
            f"the evaluator {name} has no checkpoint here; python -m playground train {name}-evaluator makes one"
        )
    return open_evaluator(path, name)[0]
