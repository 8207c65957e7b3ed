"""The item alignment: "A then B" against "B then A" (CASIM): do motions keep the order, and where do models look?

alignment  rows {"prompt", "first", "second": actions, "seconds", "kept": {"mean", "ci95", "n"} share of motions with
           the actions in the order of the sentence, "words" [W], "weights" [steps][W] of the motion of the first seed,
           "what": which attention that is, "lag": how much later the second clause is looked at}; words, weights and
           lag are null, and "why" says it, where a system has no attention to single words

Sentences are ours; nothing of a data set is stored.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from playground.analysis.order import attention_lag, clauses, in_order
from playground.analysis.results import Result
from playground.engine import Engine
from playground.errors import PlaygroundError
from playground.evaluation.published.base import Progress, Settings, about, measured
from playground.results import Generation

SECONDS = 6.0
ACTIONS = {"walk": "walks forward", "hands": "raises both hands", "squat": "squats down"}
ORDERS = (("walk", "hands"), ("hands", "walk"), ("walk", "squat"), ("squat", "walk"), ("hands", "squat"),
          ("squat", "hands"))  # fmt: skip
STEPS = 30  # of the stored maps

Floats = NDArray[np.float64]


def alignment(system: str, settings: Settings, engine: Engine, progress: Progress | None) -> Result:
    """Some motions a sentence; settings.motions in all. PlaygroundError if it cannot draw."""
    each = max(settings.motions // len(ORDERS), 1)
    rows: list[dict[str, Any]] = []
    for number, (first, second) in enumerate(ORDERS, 1):
        prompt = f"a person {ACTIONS[first]} and then {ACTIONS[second]}"
        made = [
            engine.generate(prompt, SECONDS, system, seed=settings.seed + place, deadline=None) for place in range(each)
        ]
        kept = [in_order(first, second, one.motion.joints) for one in made]
        row = {"prompt": prompt, "first": first, "second": second, "seconds": made[0].motion.seconds}
        row |= {"kept": measured([np.nan if one is None else float(one) for one in kept])}
        rows.append(row | _looked(engine, made[0], prompt))
        if progress:
            progress(number, len(ORDERS))
    facts = {"seed": settings.seed, "motions": settings.motions, "sampling": vars(made[0].sampling)}
    return Result("alignment", "", about(engine, system) | facts, rows)


def _looked(engine: Engine, made: Generation, prompt: str) -> dict[str, Any]:
    """The attention to words of one motion, as a row holds it."""
    try:
        what, words, weights = attention_of(engine, made, prompt)
    except PlaygroundError as error:
        return {"words": None, "weights": None, "what": None, "lag": None, "why": str(error)}
    lag = attention_lag(weights, *clauses(words))
    return {
        "words": words,
        "weights": np.round(coarse(weights, STEPS), 4).tolist(),
        "what": what,
        "lag": lag if np.isfinite(lag) else None,
    }


def attention_of(engine: Engine, made: Generation, prompt: str) -> tuple[str, list[str], Floats]:
    """Which attention it is, the word pieces [W] and the weights [frames or tokens, W] of a motion of one prompt.

    The generator's own where it looks at words (CASIM), else the detokenizer's. PlaygroundError where neither does.
    """
    runtime = engine.runtime(made.system)
    source = runtime.generator if runtime.diffusion is None else runtime.diffusion
    reads, text = getattr(source, "alignment", None), runtime.prompt(prompt)
    if reads is None or text is None:
        seen = engine.attention(made, prompt)
        return "detokenizer, mean over layers and heads", seen.words, np.asarray(seen.weights, np.float64)
    import torch

    from playground.nn.sampling import Sampling
    from playground.tokenizers.base import Tokens

    lengths = torch.tensor([made.motion.frames])
    try:
        if runtime.diffusion is not None:
            drawing = {key: value for key, value in vars(made.sampling).items() if key != "guidance"}
            weights = reads(text, lengths, Sampling(**drawing, seeds=(made.seed,))).mean(dim=0)
            what = "last layer of the denoiser, mean over steps and heads"
        else:
            ids = tuple(torch.from_numpy(level.ids.copy())[None] for level in made.levels)
            weights = reads(Tokens(ids, tuple(level.codes for level in made.levels)), text, lengths)[0]
            what = "last layer of the generator, mean over heads"
    except ValueError:
        raise PlaygroundError(f"the system {made.system} has no attention to single words to look at") from None
    words = text.words[0]
    return what, list(words), weights[:, : len(words)].double().numpy()


def coarse(weights: Floats, steps: int) -> Floats:
    """Means over at most `steps` equal parts of the time axis, [steps, W]."""
    parts = np.array_split(np.asarray(weights, np.float64), min(steps, len(weights)))
    return np.stack([part.mean(axis=0) for part in parts])
