"""The only door of the app, the command line and the notebooks: load once, run, mind the deadline. numpy throughout.

    engine = default_engine()
    tokenized = engine.tokenize(motion, "a person walks", "lgtok")
    decoded = engine.reconstruct(tokenized, guidance=2.0)

torch is imported at the first call that needs a model, so that importing this package is quick. Scales count from 1
(as on the screen), positions of tokens, codes and frames from 0.
"""

from playground.engine.base import ASSETS
from playground.engine.checks import UNIT, check_generation, check_guidance, prepare
from playground.engine.core import Engine, default_engine
from playground.engine.editing import KINDS as EDIT_KINDS
from playground.engine.editing import benchmark_span
from playground.results import Decoded, Example, Generation, GenerationStep, GuidancePair, Tokenized
from playground.systems import SystemInfo

__all__ = [
    "ASSETS",
    "EDIT_KINDS",
    "UNIT",
    "Decoded",
    "Engine",
    "Example",
    "Generation",
    "GenerationStep",
    "GuidancePair",
    "SystemInfo",
    "Tokenized",
    "benchmark_span",
    "check_generation",
    "check_guidance",
    "default_engine",
    "prepare",
]
