"""The token file: what is written is read back, and nothing else is accepted."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.tokenizers.token_file import LevelTokens, TokenFile

GOOD = {
    "format": 1,
    "system": "lgtok",
    "checkpoint": "abc",
    "caption": "a person hops",
    "frames": 40,
    "fps": 20,
    "levels": [{"size": 2, "codes": 8, "ids": [0, 7]}, {"size": 3, "codes": 16, "ids": [1, 2, 15]}],
}


@st.composite
def token_files(draw: st.DrawFn) -> TokenFile:
    levels = []
    for _ in range(draw(st.integers(1, 5))):
        codes = draw(st.integers(1, 500))
        ids = draw(st.lists(st.integers(0, codes - 1), min_size=1, max_size=50))
        levels.append(LevelTokens(len(ids), codes, np.asarray(ids, np.int64)))
    text = st.text(st.characters(exclude_categories=["Cs"]), max_size=60)
    return TokenFile(draw(text), draw(text), draw(text), draw(st.integers(1, LIMITS.max_frames)), tuple(levels))


@given(token_files())
def test_what_is_written_is_read_back(written: TokenFile) -> None:
    read = TokenFile.from_json(written.to_json())
    for name in ("system", "checkpoint", "caption", "frames", "fps"):
        assert getattr(read, name) == getattr(written, name)
    assert [(a.size, a.codes, a.ids.tolist()) for a in read.levels] == [
        (b.size, b.codes, b.ids.tolist()) for b in written.levels
    ]
    assert all(level.ids.dtype == np.int64 and len(level.ids) == level.size for level in read.levels)


def test_the_file_has_the_keys_that_are_promised() -> None:
    level = LevelTokens(2, 8, np.array([0, 7]))
    written = json.loads(TokenFile("s", "c", "t", 40, (level,)).to_json())
    assert written == {
        "format": 1, "system": "s", "checkpoint": "c", "caption": "t", "frames": 40, "fps": 20,
        "levels": [{"size": 2, "codes": 8, "ids": [0, 7]}],
    }  # fmt: skip


BROKEN = {
    "not JSON": "{",
    "a list": "[]",
    "a number": "3",
    "deep": "[" * 100_000,
    "a huge number": json.dumps(GOOD).replace('"frames": 40', '"frames": ' + "9" * 5000),
    "NaN frames": json.dumps(GOOD | {"frames": float("nan")}),
    "another format": json.dumps(GOOD | {"format": 2}),
    "format true": json.dumps(GOOD | {"format": True}),
    "no frames": json.dumps(GOOD | {"frames": 0}),
    "too many frames": json.dumps(GOOD | {"frames": LIMITS.max_frames + 1}),
    "frames as text": json.dumps(GOOD | {"frames": "40"}),
    "30 fps": json.dumps(GOOD | {"fps": 30}),
    "system a number": json.dumps(GOOD | {"system": 1}),
    "a long caption": json.dumps(GOOD | {"caption": "a" * (LIMITS.max_prompt_chars + 1)}),
    "no levels": json.dumps(GOOD | {"levels": []}),
    "levels a number": json.dumps(GOOD | {"levels": 3}),
    "a level without ids": json.dumps(GOOD | {"levels": [{"size": 1, "codes": 8}]}),
    "an id out of range": json.dumps(GOOD | {"levels": [{"size": 1, "codes": 8, "ids": [8]}]}),
    "a negative id": json.dumps(GOOD | {"levels": [{"size": 1, "codes": 8, "ids": [-1]}]}),
    "a fractional id": json.dumps(GOOD | {"levels": [{"size": 1, "codes": 8, "ids": [1.5]}]}),
    "an id true": json.dumps(GOOD | {"levels": [{"size": 1, "codes": 8, "ids": [True]}]}),
    "nested ids": json.dumps(GOOD | {"levels": [{"size": 1, "codes": 8, "ids": [[1]]}]}),
    "a wrong size": json.dumps(GOOD | {"levels": [{"size": 2, "codes": 8, "ids": [1]}]}),
    "no ids": json.dumps(GOOD | {"levels": [{"size": 0, "codes": 8, "ids": []}]}),
    "no codes": json.dumps(GOOD | {"levels": [{"size": 1, "codes": 0, "ids": [0]}]}),
}


@pytest.mark.parametrize("text", BROKEN.values(), ids=BROKEN.keys())
def test_a_broken_file_is_one_sentence(text: str, tmp_path: Path) -> None:
    path = tmp_path / "tokens.json"
    path.write_text(text)
    with pytest.raises(PlaygroundError) as caught:
        TokenFile.read(path)
    message = str(caught.value)
    assert str(path) in message and "\n" not in message and len(message) < 300 + len(str(path))


@pytest.mark.parametrize("missing", sorted(GOOD))
def test_every_key_is_needed(missing: str) -> None:
    text = json.dumps({key: value for key, value in GOOD.items() if key != missing})
    with pytest.raises(PlaygroundError, match=missing):
        TokenFile.from_json(text)


def test_missing_binary_and_huge_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(PlaygroundError, match="cannot be read"):
        TokenFile.read(tmp_path / "none.json")
    with pytest.raises(PlaygroundError, match="cannot be read"):
        TokenFile.read(tmp_path)
    (tmp_path / "binary.json").write_bytes(bytes(range(256)))
    with pytest.raises(PlaygroundError, match="not JSON"):
        TokenFile.read(tmp_path / "binary.json")
    with open(tmp_path / "huge.json", "wb") as file:
        file.truncate(LIMITS.max_json_bytes + 1)
    with pytest.raises(PlaygroundError, match="larger than"):
        TokenFile.read(tmp_path / "huge.json")
