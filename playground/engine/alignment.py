"""Which words each moment of a generated motion looked at while it was drawn (CASIM's view, arXiv 2502.02063; D4)."""

import json
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from playground.engine.checks import Check
from playground.errors import PlaygroundError
from playground.findings import Alignment
from playground.results import Generation
from playground.systems import SystemRow, checkpoint_path, header

if TYPE_CHECKING:
    from playground.runtime import Runtime

NO_WORDS = "this motion was drawn without words, so no moment looked at any; generate one from a prompt"
DENOISER = "last layer of the denoiser, mean over steps and heads"
GENERATOR = "last layer of the generator, mean over heads"
DETOKENIZER = "detokenizer, mean over layers and heads"


def can_look(assets: Path, row: SystemRow) -> bool:
    """Whether `words_by_time` has something to tell of a system, as the headers of its files say; loads no weight."""
    generator, tokenizer = (_config(assets, row, part) for part in ("generator", "tokenizer"))
    looks = generator.get("casim") in (True, "decoder")
    crossed = tokenizer.get("text_side") in ("both", "detokenizer") and tokenizer.get("text_mixing_out") == "cross"
    return bool(generator) and (looks or crossed)


def words_by_time(runtime: "Runtime", made: Generation, check: Check | None) -> Alignment:
    """The generator's own attention where it looks at single words (CASIM), else the detokenizer's.

    The same seed and sampling are run once more, so that this is the attention that the motion was drawn with.
    """
    from playground.probes import generator_attention, text_attention

    began = time.perf_counter()
    if not made.prompt:
        raise PlaygroundError(NO_WORDS)
    frames = made.motion.frames
    found = generator_attention(runtime, made.prompt, frames, made.levels, made.seed, made.sampling, check)
    if found is not None:
        what, patch = DENOISER if runtime.diffusion is not None else GENERATOR, found.patch
        words, by_step = found.words, found.weights
    elif runtime.codec is not None and hasattr(runtime.tokenizer, "text_attention"):
        words, layers = text_attention(runtime, made.levels, frames, made.prompt)
        what, patch = DETOKENIZER, int(runtime.tokenizer.config.patch)
        by_step = layers.mean(axis=(0, 1))[None]
    else:
        raise PlaygroundError(f"the system {made.system} has no attention to single words to look at")
    return Alignment(
        made.system, runtime.checkpoint, what, words, by_step.mean(axis=0), by_step, patch, time.perf_counter() - began
    )


def _config(assets: Path, row: SystemRow, part: str) -> dict[str, Any]:
    """The config that a part's file states; {} where the system has no such part or the file is absent."""
    head = header(checkpoint_path(assets, row.name, part)) if part in row.parts else None
    return {} if head is None else dict(json.loads(head["__metadata__"]["config"]))
