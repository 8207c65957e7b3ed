"""Stored analysis and example library of a tiny system: what they hold, and that broken ones are refused."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from playground.analysis import examples as builder
from playground.analysis import store
from playground.analysis.bundle import Bundle, read_bundle, stored_systems, write_bundle
from playground.analysis.examples import build_examples
from playground.analysis.phrases import _SENTENCES
from playground.analysis.store import build_bundle
from playground.analysis.usage import CodeUsage
from playground.data.examples import ExampleStore, write_examples
from playground.data.library import Library
from playground.engine import Engine
from playground.errors import PlaygroundError
from playground.evaluation.run import evaluate
from tests.analysis.tiny import CODES, PLAN, SCALES, SYSTEM, tiny_assets, tiny_library


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> tuple[Engine, Library]:
    folder = tmp_path_factory.mktemp("tiny")
    library = tiny_library(folder / "library")
    return Engine(tiny_assets(folder / "assets", library)), library


@pytest.fixture(scope="module")
def bundle(place: tuple[Engine, Library]) -> Bundle:
    return build_bundle(SYSTEM, place[1].path, engine=place[0])


def test_a_bundle_agrees_with_the_evaluation(place: tuple[Engine, Library], bundle: Bundle) -> None:
    result = evaluate(SYSTEM, place[1].path, "test", engine=place[0])
    np.testing.assert_allclose(bundle.usage.used_, result["usage"])
    np.testing.assert_allclose(bundle.usage.perplexity_, result["perplexity"])
    frames = np.array([clip.frames for clip in bundle.clips])
    assert (bundle.errors_mm * frames).sum() / frames.sum() == pytest.approx(result["mpjpe_mm"], rel=1e-5)
    assert len(bundle) == result["n"] and bundle.checkpoint == result["checkpoint"]


def test_counts_are_those_of_the_tokens(bundle: Bundle) -> None:
    levels = [bundle.levels(row) for row in range(len(bundle))]
    ids = [np.stack([row[n].ids for row in levels]) for n in range(len(SCALES))]
    for counted, stored in zip(CodeUsage().fit(ids, CODES).counts_, bundle.usage.counts_, strict=True):
        np.testing.assert_array_equal(counted, stored)
    code = int(ids[2][0, 4])
    assert (0, 4) in bundle.where_used(2, code)
    assert len(bundle.where_used(2, code)) == bundle.usage.counts_[2][code]


def test_axes_give_the_stored_places(bundle: Bundle) -> None:
    np.testing.assert_allclose((bundle.means - bundle.pca_centre) @ bundle.pca_axes.T, bundle.pca, atol=1e-4)
    np.testing.assert_allclose(bundle.pca_axes @ bundle.pca_axes.T, np.eye(2), atol=1e-5)


def test_the_token_map_holds_what_tokens_add(place: tuple[Engine, Library], bundle: Bundle) -> None:
    quantizer = place[0].runtime(SYSTEM).tokenizer.quantizer
    assert {int(scale) for scale in bundle.token_index[:, 1]} == {1, 2, 3}
    assert len(np.unique(bundle.token_index, axis=0)) == len(bundle.token_index)
    for (row, scale, position), scores in zip(bundle.token_index[::7], bundle.token_scores[::7], strict=True):
        level = bundle.levels(int(row))[scale - 1]
        share = quantizer.share(scale - 1, torch.from_numpy(level.ids)[None])[0].numpy()
        edges = [position * len(share) / level.size, (position + 1) * len(share) / level.size]  # whole numbers here
        vector = share[int(edges[0]) : int(edges[1])].mean(axis=0)
        expected = (vector - bundle.token_centre) @ bundle.token_axes.T
        np.testing.assert_allclose(scores, expected, atol=2e-3 * float(np.abs(bundle.token_scores).max()))


def test_a_click_decodes_the_clip(place: tuple[Engine, Library], bundle: Bundle) -> None:
    row = bundle.position("clip3")
    decoded = place[0].decode(bundle.token_file(row))
    assert decoded.motion.frames == bundle.clips[row].frames == 196
    assert bundle.clips[row].caption == "a person is running forward"


def test_nothing_of_the_data_set_is_kept_but_ids_and_tokens(bundle: Bundle, tmp_path: Path) -> None:
    write_bundle(tmp_path, bundle)
    text = (tmp_path / f"{SYSTEM}.json").read_text(encoding="utf-8")
    for _, _, label, captions, _ in PLAN:
        assert all(f'"{caption}"' not in text for caption in captions)
        assert "|" not in label or label not in text
    assert {clip.caption for clip in bundle.clips} <= set(_SENTENCES.values())


def test_what_is_written_comes_back(bundle: Bundle, tmp_path: Path) -> None:
    assert stored_systems(tmp_path) == []
    write_bundle(tmp_path, bundle)
    read = read_bundle(tmp_path, SYSTEM)
    for name, value in vars(bundle).items():
        if isinstance(value, np.ndarray):
            np.testing.assert_array_equal(getattr(read, name), value)
        elif name in Bundle.__dataclass_fields__:
            assert getattr(read, name) == value
    assert stored_systems(tmp_path) == [SYSTEM]


def test_limit_takes_clips_over_the_whole_split(place: tuple[Engine, Library]) -> None:
    small = build_bundle(SYSTEM, place[1].path, limit=2, engine=place[0])
    assert len(small) <= 2 and small.clips[0].id == "clip0"
    assert np.isfinite(small.tsne).all()


def test_unknown_clip_is_one_sentence(bundle: Bundle) -> None:
    with pytest.raises(PlaygroundError, match="no clip"):
        bundle.position("nobody")


@pytest.mark.parametrize(
    "field", ["tsne", "tokens", "counts", "energy", "errors_mm", "pca_axes", "token_scores", "token_tsne"]
)
def test_arrays_that_do_not_fit_are_refused(bundle: Bundle, field: str) -> None:
    with pytest.raises(PlaygroundError, match=field):
        replace(bundle, **{field: getattr(bundle, field)[1:]})


@pytest.mark.parametrize("how", ["absent", "format", "text", "npz", "missing", "clip"])
def test_a_broken_bundle_is_refused(bundle: Bundle, tmp_path: Path, how: str) -> None:
    write_bundle(tmp_path, bundle)
    file, arrays = tmp_path / f"{SYSTEM}.json", tmp_path / f"{SYSTEM}.npz"
    head = json.loads(file.read_text())
    if how == "absent":
        file.unlink()
    elif how == "text":
        file.write_bytes(b"\x00\xff")
    elif how == "npz":
        arrays.write_bytes(arrays.read_bytes()[:200])
    else:
        {"format": lambda: head.update(format=9), "missing": lambda: head.pop("codes"),
         "clip": lambda: head["clips"][0].update(colour="red")}[how]()  # fmt: skip
        file.write_text(json.dumps(head))
    with pytest.raises(PlaygroundError) as error:
        read_bundle(tmp_path, SYSTEM)
    assert "\n" not in str(error.value)


def test_examples_of_all_three_kinds(place: tuple[Engine, Library], bundle: Bundle, tmp_path: Path) -> None:
    engine, _ = place
    made = build_examples(SYSTEM, bundle, engine=engine)
    write_examples(engine.assets / "examples", made)
    listed = engine.examples()
    assert [example.id for example in listed] == [example.id for example in made]
    kinds = {kind: [e for e in listed if e.kind == kind] for kind in ("synthetic", "generated", "decoded clip")}
    assert len(kinds["synthetic"]) == 8 and len(kinds["generated"]) == 8 and len(kinds["decoded clip"]) == 2
    for example in listed:
        assert 16 < example.motion().frames <= 196 and example.origin.endswith(".")
    again = build_examples(SYSTEM, bundle, engine=engine)
    for before, after in zip(made, again, strict=True):
        assert before.joints is None or np.array_equal(before.joints, after.joints)


def test_examples_of_another_checkpoint_are_refused(place: tuple[Engine, Library], bundle: Bundle) -> None:
    with pytest.raises(PlaygroundError, match="another checkpoint"):
        build_examples(SYSTEM, replace(bundle, checkpoint="0" * 12), engine=place[0])


def test_both_commands(place: tuple[Engine, Library], tmp_path: Path, monkeypatch, capsys) -> None:
    engine, library = place
    for module in (store, builder):
        monkeypatch.setattr(module, "default_engine", lambda: engine)
    wanted = ["--system", SYSTEM, "--library", str(library.path), "--out", str(tmp_path / "analysis")]
    assert store.main(wanted) == 0
    arguments = ["--system", SYSTEM, "--analysis", str(tmp_path / "analysis"), "--out", str(tmp_path / "examples")]
    assert builder.main(arguments) == 0
    assert len(ExampleStore.open(tmp_path / "examples")) == 18
    assert store.main([*wanted[:3], str(tmp_path / "nowhere"), *wanted[4:]]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
