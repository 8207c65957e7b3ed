"""A tiny system with random weights and a tiny library, for tests that need a real engine."""

from pathlib import Path

import numpy as np

from playground.checkpoints import Card, save_checkpoint
from playground.data.library import Library, LibraryClip, write_library
from playground.motion.representation import canonicalise
from playground.text.encoders import load_encoder
from playground.text.features import EncoderId
from tests.conftest import drifting
from tests.tiny import TINY, tiny_generator, tiny_tokenizer

SCALES, CODES = TINY.scales, TINY.codes
SYSTEM = "lgtok"
PLAN = (  # source, split, action label, captions, poses
    ("A", "test", "walk|happy", ("someone walks to the left", "second"), 60),
    ("A", "test", "raise-up-left-hand", ("raises the left hand",), 61),
    ("A", "test", "wave-both-hands", ("waves",), 47),
    ("B", "test", "run", ("a run",), 199),
    ("B", "test", "Unknowable", (), 40),
    ("B", "test", "walk", ("too short to be measured",), 12),
    ("A", "train", "walk", ("a walk",), 64),
    ("B", "val", "kick", ("a kick",), 50),
)


def swaying(poses: int, seed: int) -> np.ndarray:
    """A drifting body whose joints sway by up to 20 cm, each in its own rhythm; bones are not kept."""
    rng = np.random.default_rng(seed)
    time = np.arange(poses)[:, None, None] / 20.0
    sway = rng.uniform(0.0, 0.2, (22, 3)) * np.sin(
        rng.uniform(1.0, 4.0, (22, 3)) * time + rng.uniform(0.0, 6.0, (22, 3))
    )
    return canonicalise((drifting(poses, seed=seed) + sway).astype(np.float32))


def tiny_library(folder: Path) -> Library:
    """Eight short clips in two sources: six of the test split, one of them without a caption and one too short."""
    clips = [
        LibraryClip(f"clip{i}", source, split, action, captions, swaying(poses, i))
        for i, (source, split, action, captions, poses) in enumerate(PLAN)
    ]
    write_library(folder, clips, name="tiny")
    return Library.open(folder)


def tiny_assets(folder: Path, library: Library) -> Path:
    """An assets folder with a randomly initialised tokenizer and generator of three scales under the name SYSTEM."""
    encoder = load_encoder("minilm")
    identity = EncoderId(encoder.name, encoder.width, encoder.hash)
    tokenizer = tiny_tokenizer(max_frames=196, text_width=encoder.width)
    generator = tiny_generator(text_width=encoder.width, lengths=49).transformer
    place = folder / "checkpoints" / SYSTEM
    card = Card("tokenizer", tokenizer.config, identity, "tiny", {"step": 1}, library.normaliser)
    save_checkpoint(place / "tokenizer.safetensors", tokenizer, card)
    save_checkpoint(
        place / "generator.safetensors", generator, Card("generator", generator.config, identity, "tiny", {"step": 1})
    )
    return folder


def same_numbers(first: object, second: object) -> bool:
    """Whether two nested results hold equal numbers up to 1e-5 relative."""
    if isinstance(first, dict) and isinstance(second, dict):
        return first.keys() == second.keys() and all(same_numbers(first[k], second[k]) for k in first)
    if isinstance(first, list) and isinstance(second, list):
        return len(first) == len(second) and all(map(same_numbers, first, second))
    if isinstance(first, float) and isinstance(second, float):
        return bool(np.isclose(first, second, rtol=1e-5))
    return first == second
