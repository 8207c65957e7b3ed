"""How much each level of a tokenizer carries: error, energy and coupling when 0, 1, ... N levels are kept."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from playground.analysis.levels import LevelMoments
from playground.analysis.passes import ClipBatch, clip_batches
from playground.analysis.residual import ScaleEnergy
from playground.data.library import Library
from playground.errors import PlaygroundError
from playground.evaluation.metrics import Missing, fid
from playground.motion.measures import mpjpe
from playground.motion.representation import from_features67

if TYPE_CHECKING:
    from playground.evaluation.evaluators import Evaluator
    from playground.runtime import Runtime

Progress = Callable[[int, int], None]


def measure_levels(
    runtime: "Runtime",
    library: Library,
    indices: Sequence[int],
    captions: Sequence[str],
    evaluator: "Evaluator | None" = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """{"rows", "between", "vectors"} of clips that are tokenized and rebuilt from the first 0, 1, ... N levels.

    rows: {"kept", "tokens": of those levels at full length, "mpjpe_mm" [clips], "energy" [clips]: share of the latent's
    that is left, "low", "high": its 10th and 90th percentile, "fid": rebuilt against recorded motions, "coupling": of
    level number `kept` with what it leaves}; None where a number does not exist. between: coupling of the levels
    [N][N]. vectors: latents behind the couplings.

    True caption at both ends, g = 0, whole clips. PlaygroundError if no clip is long enough.
    """
    scales = runtime.tokenizer.config.scales
    found = _Found(len(scales), runtime.tokenizer.config.code_width)
    for batch in clip_batches(runtime, library, indices, captions):
        _one(runtime, batch, evaluator, found)
        if progress:
            progress(len(found.errors), len(indices))
    if not found.errors:
        raise PlaygroundError(f"{library.path} holds no clip long enough to be measured here")
    energy = ScaleEnergy().fit(np.array(found.energies))
    left = [None, *(_number(value) for value in found.moments.left_coupling())]
    errors = np.array(found.errors)  # (clips, N + 1)
    rows = [
        {
            "kept": kept,
            "tokens": sum(scales[:kept]),
            "mpjpe_mm": errors[:, kept].tolist(),
            "energy": [one[kept] for one in found.energies],
            "low": float(energy.low_[kept]),
            "high": float(energy.high_[kept]),
            "fid": None if evaluator is None else _fid(found.recorded, found.rebuilt[kept]),
            "coupling": left[kept],
        }
        for kept in range(len(scales) + 1)
    ]
    between = [[_number(value) for value in line] for line in found.moments.between()]
    return {"rows": rows, "between": between, "vectors": found.moments.count_}


class _Found:
    """What the batches gave so far."""

    def __init__(self, levels: int, width: int) -> None:
        self.errors: list[list[float]] = []
        self.energies: list[list[float]] = []
        self.moments = LevelMoments(levels, width)
        self.recorded: list[Any] = []  # embeddings [n, D], one a batch
        self.rebuilt: list[list[Any]] = [[] for _ in range(levels + 1)]


def _one(runtime: "Runtime", batch: ClipBatch, evaluator: "Evaluator | None", found: _Found) -> None:
    import torch

    tokenizer = runtime.tokenizer
    quantized = tokenizer.encode(batch.features, batch.lengths, batch.text)
    with torch.no_grad():
        latent = tokenizer.latents(batch.features, batch.lengths, batch.text).float()
    norm = quantized.residual_norm.double().numpy()
    found.energies.extend((norm / np.maximum(norm[0], 1e-12)).T.tolist())
    shares = quantized.per_level
    counts = [tokenizer.sizes(rows)[-1] for rows in batch.rows]
    real = torch.arange(latent.shape[1])[None] < torch.tensor(counts)[:, None]
    found.moments.add(latent[real].numpy(), shares[:, real].numpy())
    true = [from_features67(rows) for rows in batch.given]
    errors: list[list[float]] = [[] for _ in true]
    if evaluator is not None:
        found.recorded.append(evaluator.embed_motions(true))
    kept = torch.zeros_like(quantized.embedding)
    for level in range(len(shares) + 1):
        decoded = runtime.normaliser.invert(tokenizer.decode(kept, batch.lengths, batch.text).numpy())
        made = [from_features67(one[:rows]) for one, rows in zip(decoded, batch.rows, strict=True)]
        for line, (first, second) in enumerate(zip(true, made, strict=True)):
            errors[line].append(mpjpe(first, second))
        if evaluator is not None:
            found.rebuilt[level].append(evaluator.embed_motions(made))
        kept = kept + shares[level] if level < len(shares) else kept
    found.errors.extend(errors)


def _fid(recorded: list[Any], rebuilt: list[Any]) -> float | None:
    value = fid(np.concatenate(recorded), np.concatenate(rebuilt))
    return None if isinstance(value, Missing) else value


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
