"""The example library: what is written comes back, what is broken is refused in one sentence."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from playground.data.examples import ExampleStore, StoredExample, StoredTokens, write_examples
from playground.errors import PlaygroundError


def tokens(sizes: list[int], codes: list[int], seed: int = 0) -> StoredTokens:
    rng = np.random.default_rng(seed)
    ids = tuple(rng.integers(0, count, size) for size, count in zip(sizes, codes, strict=True))
    return StoredTokens("lgtok", "abc123", ids, tuple(codes))


def example(id: str, kind: str = "synthetic", frames: int = 20, **changes: object) -> StoredExample:
    joints = np.random.default_rng(frames).normal(size=(frames, 22, 3)).astype(np.float32)
    fields: dict[str, object] = {
        "title": f"Title {id}",
        "caption": "A person walks.",
        "action": "walk",
        "origin": "made",
    }
    fields |= {"frames": frames, "joints": None if kind == "decoded clip" else joints}
    fields |= {"tokens": None if kind == "synthetic" else tokens([3, 6, 10], [16, 32, 300])}
    return StoredExample(id=id, kind=kind, **(fields | changes))  # type: ignore[arg-type]


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.tuples(st.sampled_from(["synthetic", "generated", "decoded clip"]), st.integers(1, 196)), max_size=6)
)
def test_what_is_written_comes_back(tmp_path: Path, plan: list[tuple[str, int]]) -> None:
    written = [example(f"e{i}", kind, frames) for i, (kind, frames) in enumerate(plan)]
    write_examples(tmp_path, written, note="written for this project")
    read = ExampleStore.open(tmp_path)
    assert [item.id for item in read] == [item.id for item in written]
    assert read.note == "written for this project"
    for before, after in zip(written, read, strict=True):
        assert (after.title, after.caption, after.kind, after.frames) == (
            before.title, before.caption, before.kind, before.frames,
        )  # fmt: skip
        assert (before.joints is None) == (after.joints is None)
        if before.joints is not None:
            np.testing.assert_array_equal(after.joints, before.joints)
            np.testing.assert_array_equal(after.motion().joints, before.joints)
        if before.tokens is not None:
            assert after.tokens is not None and after.tokens.codes == before.tokens.codes
            for left, right in zip(before.tokens.ids, after.tokens.ids, strict=True):
                np.testing.assert_array_equal(left, right)
                assert right.dtype == np.int64


def test_decoded_clip_has_no_motion_of_its_own() -> None:
    with pytest.raises(PlaygroundError, match="decode them"):
        example("a", "decoded clip").motion()


@pytest.mark.parametrize(
    "changes",
    [
        {"kind": "recorded"},
        {"kind": "decoded clip", "joints": np.zeros((20, 22, 3), np.float32)},
        {"joints": None},
        {"joints": np.zeros((19, 22, 3), np.float32)},
        {"frames": 0, "joints": np.zeros((0, 22, 3), np.float32)},
        {"frames": 197, "joints": np.zeros((197, 22, 3), np.float32)},
    ],
)
def test_entries_that_cannot_be_are_refused(changes: dict[str, object]) -> None:
    kind = changes.pop("kind", "synthetic")
    with pytest.raises(PlaygroundError) as error:
        example("a", str(kind), **changes)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("ids, codes", [((), ()), (([0, 5],), (5,)), (([-1],), (5,)), (([],), (5,)), (([0],), (5, 6))])
def test_tokens_outside_their_codebook_are_refused(ids: tuple[list[int], ...], codes: tuple[int, ...]) -> None:
    with pytest.raises(PlaygroundError):
        StoredTokens("s", "c", tuple(np.array(level, np.int64) for level in ids), codes)


def test_two_examples_of_one_id_are_refused(tmp_path: Path) -> None:
    with pytest.raises(PlaygroundError, match="different id"):
        write_examples(tmp_path, [example("a"), example("a")])


def test_unknown_id_names_the_known_ones(tmp_path: Path) -> None:
    write_examples(tmp_path, [example("walk"), example("run")])
    with pytest.raises(PlaygroundError, match="walk, run"):
        ExampleStore.open(tmp_path)["jump"]


def damage(index: dict, how: str) -> dict:
    entry = index["examples"][0]
    if how == "rows":
        entry["joints"] = [10, 9_999]
    if how == "ids":
        entry["tokens"]["start"] = 9_999
    if how == "size":
        entry["tokens"]["sizes"][0] = -3
    if how == "missing":
        del entry["title"]
    if how == "list":
        index = {"format": 1, "examples": [3]}
    if how == "format":
        index["format"] = 2
    return index


@pytest.mark.parametrize("how", ["rows", "ids", "size", "missing", "list", "format", "text", "npz", "absent"])
def test_a_damaged_library_gives_one_sentence(tmp_path: Path, how: str) -> None:
    write_examples(tmp_path, [example("a", "generated"), example("b")])
    file = tmp_path / "index.json"
    file.write_text(json.dumps(damage(json.loads(file.read_text()), how)))
    if how == "text":
        file.write_bytes(b"\xff\x00{")
    if how == "npz":
        (tmp_path / "examples.npz").write_bytes((tmp_path / "examples.npz").read_bytes()[:100])
    if how == "absent":
        (tmp_path / "examples.npz").unlink()
    with pytest.raises(PlaygroundError) as error:
        ExampleStore.open(tmp_path)
    assert "\n" not in str(error.value)
