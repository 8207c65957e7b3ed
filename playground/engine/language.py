"""What language does: tokens that change with the caption, and the words that the detokenizer looks at."""

import time
from typing import TYPE_CHECKING

from playground.engine.checks import Check
from playground.errors import PlaygroundError
from playground.findings import Attention, Language
from playground.motion.measures import mpjpe
from playground.motion.motion import Motion
from playground.motion.representation import from_features67
from playground.results import Generation, Tokenized

if TYPE_CHECKING:
    from playground.runtime import Runtime


def compare_captions(runtime: "Runtime", tokenized: Tokenized, wrong: str, check: Check | None) -> Language:
    """The same motion tokenized with its caption, without any and with a wrong one, each decoded with the same text."""
    began = time.perf_counter()
    caption = tokenized.caption
    if not caption:
        raise PlaygroundError("the motion was tokenized without a caption; write one to see what it changes")
    if wrong == caption:
        raise PlaygroundError("the wrong caption is the right one; write another one to see what it changes")
    if not len(tokenized.features):
        raise PlaygroundError(
            "the motion itself is not at hand, only its tokens; tokenize a motion to compare captions"
        )
    levels, motions, errors = [], [], []
    for text in (caption, "", wrong):
        if check:
            check()
        found = tokenized.levels if text == caption else runtime.encode(tokenized.features, text)[0]
        features = runtime.decode(found, tokenized.motion.frames, text, 0.0, len(found))
        motion = Motion(from_features67(runtime.normaliser.invert(features)), caption=text)
        levels.append(found)
        motions.append(motion)
        errors.append(mpjpe(tokenized.motion.joints, motion.joints))
    flips = [tuple(a.ids != b.ids for a, b in zip(levels[0], other, strict=True)) for other in levels[1:]]
    return Language(
        caption=caption,
        wrong=wrong,
        captioned=levels[0],
        bare=levels[1],
        misled=levels[2],
        bare_flips=flips[0],
        misled_flips=flips[1],
        mpjpe_mm=(errors[0], errors[1], errors[2]),
        motions=(motions[0], motions[1], motions[2]),
        seconds=time.perf_counter() - began,
    )


def words_by_frames(runtime: "Runtime", result: Tokenized | Generation, caption: str) -> Attention:
    """Where the detokenizer's frame queries look in a caption while it decodes a motion."""
    from playground.probes import text_attention

    began = time.perf_counter()
    if not caption:
        raise PlaygroundError("there are no words to look at; write a caption first")
    words, weights = text_attention(runtime, result.levels, result.motion.frames, caption)
    patch = int(runtime.tokenizer.config.patch)
    return Attention(words, weights.mean(axis=(0, 1)), weights, patch, time.perf_counter() - began)
