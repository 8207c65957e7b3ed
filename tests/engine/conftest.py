"""A tiny engine with stored maps and examples, made once; its numbers mean nothing, its shapes are real."""

import numpy as np
import pytest

from playground.analysis.bundle import write_bundle
from playground.analysis.store import build_bundle
from playground.data.examples import StoredExample, StoredTokens, write_examples
from playground.engine import Engine
from playground.motion.motion import Motion
from tests.analysis.tiny import CODES, SCALES, SYSTEM, swaying, tiny_assets, tiny_library

PROMPT = "a person strolls along"


@pytest.fixture(scope="session")
def engine(tmp_path_factory):
    folder = tmp_path_factory.mktemp("studies")
    library = tiny_library(folder / "library")
    made = Engine(tiny_assets(folder / "assets", library))
    bundle = build_bundle(SYSTEM, library.path, engine=made)
    write_bundle(made.assets / "analysis", bundle)
    ids = tuple(np.arange(size) % codes for size, codes in zip(SCALES, CODES, strict=True))
    kept = StoredTokens(SYSTEM, bundle.checkpoint, ids, CODES)
    stale = StoredTokens(SYSTEM, "0" * 12, ids, CODES)
    facts = {"caption": "a person sways", "action": "other", "kind": "decoded clip", "origin": "Made up."}
    write_examples(
        made.assets / "examples",
        [
            StoredExample("sway", "A sway", frames=48, tokens=kept, **facts),
            StoredExample("old", "An old one", frames=48, tokens=stale, **facts),
        ],
    )
    return made


@pytest.fixture(scope="session")
def tokenized(engine):
    return engine.tokenize(Motion(swaying(61, 3)), PROMPT)


@pytest.fixture(scope="session")
def generation(engine):
    return engine.generate(PROMPT, 3.0, seed=4, top_k=0.9)
