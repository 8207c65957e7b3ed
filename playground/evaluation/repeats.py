"""One repeat of an evaluation: every metric on recorded, rebuilt and generated motions; the mean of many repeats."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from playground.evaluation import items as draws
from playground.evaluation import metrics
from playground.evaluation.items import draw_items, draw_samples, prompt_items, stream
from playground.evaluation.metrics import SAMPLE_PAIRS, Missing, Value, average
from playground.evaluation.passes import Motions, Passes, Reading, Rebuilt

MAIN, CLIP = "tmr", "clip"  # evaluator of all metrics, and that of the CLIP-style score
SMALL = 512  # motions below which a FID is called a small-sample one (F2)
SAME = "_same_caption"  # ending of R-Precision in its second reading: any motion with the same caption is right
PRECISION = {  # key -> (top, pool, second reading)
    f"r_precision_top{top}_pool{pool}{SAME * same}": (top, pool, same)
    for same in (False, True)
    for pool in (32, 100)
    for top in (1, 2, 3)
}
BY_MAIN = ("fid", *PRECISION, "mm_dist", "diversity")
DRAWN = ("multimodality", "prompts_obeyed")  # of generated motions alone
TOKENS = ("mpjpe_mm", "usage", "code_perplexity", "model_perplexity_nll", "model_perplexity_argmax")
KEYS = (*BY_MAIN, *DRAWN, "clip_score", *TOKENS, "foot_sliding", "bone_drift")
REFINED = "path_drift"  # of generated motions whose root was refined, beside KEYS: metres

Floats = NDArray[np.float64]
Table = dict[str, dict[str, Any]]  # metric -> {"value", "n"}, or {"value": None, "n": 0, "why"}


@dataclass(frozen=True)
class Plan:
    """What is asked of every repeat."""

    seed: int = 0
    mm_texts: int = 96
    mm_samples: int = 30

    def motions(self, clips: int, generator: bool) -> int:
        """Motions that one repeat works on."""
        if not generator:
            return 3 * clips
        samples = self.mm_texts * self.mm_samples if self.mm_samples >= SAMPLE_PAIRS else 0
        return 4 * clips + samples + len(prompt_items(0, 0)[1])


class Repeat:
    """One repeat; its random numbers come from (plan.seed, number) alone."""

    def __init__(self, passes: Passes, clips: Sequence[int], plan: Plan, number: int) -> None:
        self.passes = passes
        self.plan = plan
        self.number = number
        self.items = draw_items(passes.library, clips, self._stream(draws.ITEMS))
        self.again = draw_items(passes.library, clips, self._stream(draws.AGAIN))  # other windows of the same clips
        self.captioned = [place for place, item in enumerate(self.items) if item.caption]
        self.texts: dict[str, Floats] = {}

    def run(self) -> dict[str, Table]:
        """{"metrics": generated motions and tokens, "real", "reconstruction"}, every key of KEYS in each.

        The FID of generated and of rebuilt motions is against the recorded windows they belong to, that of the
        recorded ones against other windows of the same clips.
        """
        recorded, real = self._recorded()
        real |= _absent((*DRAWN, *TOKENS), "recorded motions are not made from a text or from tokens")
        runtime = self.passes.runtime
        if runtime.codec is None:
            why = f"the system {runtime.name} has no tokenizer"
            tokens, reconstruction = _absent(TOKENS, why), _absent(KEYS, why)
        else:
            rebuilt = self.passes.rebuilt(self.items)
            tokens = self._tokens(rebuilt)
            reconstruction = self._motions(rebuilt.motions, recorded) | tokens
            reconstruction |= _absent(DRAWN, "a rebuilt motion is not drawn from a text")
        return {"metrics": self._generated(recorded) | tokens, "real": real, "reconstruction": reconstruction}

    def sweep(self, scales: Sequence[float]) -> dict[str, Table]:
        """{"real", and for every guidance scale g of the detokenizer a table named by it}; tokens are drawn once."""
        recorded, real = self._recorded()
        swept = self.passes.swept(self.items, scales)
        return {"real": real} | {name_of(g): self._motions(m, recorded) for g, m in zip(scales, swept, strict=True)}

    def read(self, readings: Mapping[str, Reading]) -> dict[str, Table]:
        """{"real", and for every way to draw and to read tokens a table named by `drawn_name`} (Table 8)."""
        recorded, real = self._recorded()
        tables = {"real": real}
        for prompted in (False, True):
            done = self.passes.read(self.items, prompted, list(readings.values()))
            for name, motions in zip(readings, done, strict=True):
                tables[drawn_name(prompted, name)] = self._motions(motions, recorded)
        return tables

    # ---- tables ---------------------------------------------------------------------------------------------------

    def _recorded(self) -> tuple[Motions, Table]:
        self.texts = self.passes.texts(self.items)
        recorded = self.passes.recorded(self.items)
        return recorded, self._motions(recorded, self.passes.recorded(self.again))

    def _generated(self, recorded: Motions) -> Table:
        if not self.passes.runtime.generates:
            return _absent(KEYS, f"the system {self.passes.runtime.name} has no generator")
        prompts, asked = prompt_items(self.plan.seed, self.number)
        motions = self.passes.generated(self.items)
        table = self._motions(motions, recorded)
        if self.passes.refiner is not None:
            table[REFINED] = _entry(average(motions.path, what="path drift"), len(self.items))
        table["prompts_obeyed"] = _entry(average(self.passes.obeyed(prompts, asked)), len(asked))
        return table | {"multimodality": self._multimodality()}

    def _motions(self, motions: Motions, reference: Motions) -> Table:
        """What is measured on any set of motions; reference: the other side of the FID."""
        n, there = len(self.items), self.captioned
        table = {
            "foot_sliding": _entry(average(motions.sliding, what="foot sliding"), n),
            "bone_drift": _entry(average(motions.drift, what="bone drift"), n),
        }
        if CLIP in self.passes.evaluators:
            score = metrics.clip_score(self.texts[CLIP][there], motions.embeddings[CLIP][there])
            table["clip_score"] = _entry(score, len(there))
        else:
            table |= _absent(["clip_score"], f"the evaluator {CLIP} has no checkpoint here")
        if MAIN in self.passes.evaluators:
            return table | self._embedded(motions.embeddings[MAIN], reference.embeddings[MAIN])
        return table | _absent(BY_MAIN, f"the evaluator {MAIN} has no checkpoint here")

    def _embedded(self, motions: Floats, reference: Floats) -> Table:
        """The metrics of the main evaluator; embeddings [n, D]."""
        n, there = len(motions), self.captioned
        texts, moves, captions = self.texts[MAIN][there], motions[there], [self.items[place].caption for place in there]
        table = {
            "fid": _entry(metrics.fid(reference, motions), n),
            "diversity": _entry(metrics.diversity(motions, self._stream(draws.PAIRS)), n),
            "mm_dist": _entry(metrics.mm_dist(texts, moves), len(there)),
        }
        if n < SMALL:
            width = motions.shape[1]
            table["fid"]["note"] = f"a small sample: {n} motions a side in {width} dimensions, which raises the FID"
        for key, (top, pool, same) in PRECISION.items():  # every key with the same pools
            groups = captions if same else None
            value = metrics.r_precision(texts, moves, pool, top, self._stream(draws.POOLS), groups)
            table[key] = _entry(value, len(there) // pool * pool)
        return table

    def _tokens(self, rebuilt: Rebuilt) -> Table:
        """What is measured on the tokens of recorded motions."""
        n, runtime = len(self.items), self.passes.runtime
        codes, ids = runtime.tokenizer.quantizer.codes, [level[level >= 0] for level in rebuilt.ids]
        table = {
            "mpjpe_mm": _entry(average(rebuilt.errors_mm, [item.rows for item in self.items]), n),
            "usage": _entry(metrics.code_usage(ids, codes), n),
            "code_perplexity": _entry(metrics.code_perplexity(ids, codes), n),
        }
        if not self.passes.predicts:
            why = "has no generator" if runtime.generator is None else "has a generator without a likelihood"
            absent = ("model_perplexity_nll", "model_perplexity_argmax")
            return table | _absent(absent, f"the system {runtime.name} {why}")
        best = [level[level >= 0] for level in rebuilt.predictions]
        true = [chances[level >= 0] for chances, level in zip(rebuilt.likelihood, rebuilt.ids, strict=True)]
        table["model_perplexity_nll"] = _entry(metrics.model_perplexity_nll(true), n)
        table["model_perplexity_argmax"] = _entry(metrics.model_perplexity_argmax(best, codes), n)
        return table

    def _multimodality(self) -> dict[str, Any]:
        count = self.plan.mm_samples
        if MAIN not in self.passes.evaluators:
            return _entry(Missing(f"the evaluator {MAIN} has no checkpoint here"))
        if count < SAMPLE_PAIRS:
            return _entry(Missing(f"MultiModality draws {SAMPLE_PAIRS} pairs a text, {count} motions were asked for"))
        samples = draw_samples(self.items, self.plan.mm_texts, count, self._stream(draws.SAMPLES))
        made = self.passes.samples(samples, MAIN).reshape(-1, count, self.passes.evaluators[MAIN].width)
        return _entry(metrics.multimodality(made, self._stream(draws.TEXT_PAIRS)), len(samples))

    def _stream(self, what: int) -> np.random.Generator:
        return stream(self.plan.seed, self.number, what)


def drawn_name(prompted: bool, reading: str) -> str:
    """The name of a way to draw and to read tokens in stored tables."""
    return f"{'prompted' if prompted else 'free'}, {reading}"


def name_of(g: float) -> str:
    """The name of a guidance scale in stored tables."""
    return f"g={g:g}"


def _entry(value: Value, n: int = 0) -> dict[str, Any]:
    """A value as it is stored; what is not finite has no place in JSON."""
    if isinstance(value, float) and not math.isfinite(value):
        value = Missing("the value is not a finite number")
    return {"value": None, "n": 0, "why": value.why} if isinstance(value, Missing) else {"value": value, "n": n}


def _absent(keys: Iterable[str], why: str) -> Table:
    return {key: _entry(Missing(why)) for key in keys}


def summarise(tables: Sequence[Table]) -> Table:
    """Repeats of one table -> {metric: {"mean", "ci95", "n"}}, with "why" where there is no mean, "note" as it was.

    ci95 is 1.96 * std / sqrt(repeats), std with the number of repeats in the denominator (F2): 0 for a single repeat,
    which says nothing of the spread. n is the sample of one repeat. A metric that one repeat lacks has no mean.
    """
    out: Table = {}
    for key in [key for key in (*KEYS, REFINED) if key in tables[0]]:
        entries = [table[key] for table in tables]
        missing = next((entry for entry in entries if entry["value"] is None), None)
        if missing is not None:
            out[key] = {"mean": None, "ci95": None, "n": 0, "why": missing["why"]}
            continue
        values = np.array([entry["value"] for entry in entries])
        half = float(1.96 * values.std() / math.sqrt(len(values)))
        out[key] = {"mean": float(values.mean()), "ci95": half, "n": entries[0]["n"]}
        if "note" in entries[0]:
            out[key]["note"] = entries[0]["note"]
    return out
