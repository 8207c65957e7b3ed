"""Files that are no release of LG-Tok: one sentence each, nothing run, nothing written."""

import os
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from torch import Tensor

from playground import convert
from playground.convert import convert_lgtok
from playground.errors import PlaygroundError
from playground.limits import LIMITS
from tests.released import State, options_text, refused, release


def _swap(name: str, value: Tensor | None, generator: bool = False) -> Callable[[State, State], None]:
    def change(tokenizer: State, other: State) -> None:
        state = other if generator else tokenizer
        if value is None:
            del state[name]
        else:
            state[name] = value

    return change


QUERY = "encoder.transformer.middle_block.self_attn.query.weight"
STRANGE = {
    "an array missing": (_swap(QUERY, None), QUERY),
    "an array too many": (_swap("encoder.extra", torch.ones(2)), "encoder.extra"),
    "a wrong shape": (_swap(QUERY, torch.ones(16, 17)), "shape|size"),
    "a wrong number of axes": (_swap("latent_tokens", torch.ones(6)), "latent_tokens"),
    "whole numbers": (_swap(QUERY, torch.ones(16, 16, dtype=torch.int64)), "real numbers"),
    "not a number": (_swap(QUERY, torch.full((16, 16), float("nan"))), "finite"),
    "more values than it brings": (_swap(QUERY, torch.ones(1).expand(10**6, 10**6)), "form"),
    "other rotary positions": (
        _swap("encoder.transformer.middle_block.self_attn.rotary_embedding.x_cos", torch.ones(1, 1, 131, 8)),
        "rotary",
    ),
    "a generator of other codes": (_swap("heads.1.weight", torch.ones(11, 16), True), "another tokenizer"),
    "a generator with other positions": (_swap("freqs_cis", torch.ones(10, 4, dtype=torch.complex64), True), "rotary"),
    "a generator with real positions": (_swap("freqs_cis", torch.ones(10, 4), True), "rotary"),
    "attention that is a number": (
        _swap("decoder.transformer.middle_block.multihead_attn.in_proj_bias", torch.tensor(1.0)),
        "in_proj_bias",
    ),
    "a generator without a norm": (_swap("blocks.1.ln2.scale", None, True), "ln2"),
    "a mask vector of another width": (_swap("mask_token", torch.ones(1, 1, 17)), "shape"),
    "a width beyond all": (_swap("latent_tokens", torch.ones(6, 1_000_000)), "no LG-Tok of that size"),
    "no arrays at all": (lambda tokenizer, generator: tokenizer.clear(), "lacks"),
}


@pytest.mark.parametrize("what", STRANGE)
def test_arrays_that_are_not_the_released_ones_are_named(what: str, tmp_path: Path) -> None:
    change, sentence = STRANGE[what]
    paths = release(tmp_path / "in", change)
    with pytest.raises(PlaygroundError, match=sentence):
        convert_lgtok(*paths, tmp_path / "out")
    refused(paths, tmp_path / "out")


class Runs:
    """What a hostile pickle holds: a call."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> tuple[Callable[..., None], tuple[str]]:
        return os.mkdir, (str(self.mark),)


def test_a_file_with_code_is_not_run(tmp_path: Path) -> None:
    paths = release(tmp_path / "in")
    torch.save({"vq_model": Runs(tmp_path / "ran")}, paths[0])
    assert "not opened" in refused(paths, tmp_path / "out")
    assert not (tmp_path / "ran").exists()


def test_files_that_are_no_torch_archives_are_refused(tmp_path: Path) -> None:
    paths = release(tmp_path / "in")
    whole = paths[0].read_bytes()
    for data in (b"", b"weights", whole[: len(whole) // 2], bytes(range(256)) * 40, b"PK\x05\x06" + bytes(18)):
        paths[0].write_bytes(data)
        refused(paths, tmp_path / "out")
    for saved in ([1, 2], {"net": [3]}, {"vq_model": {"a": 1}}, {"t2m_transformer": {}}, torch.ones(3)):
        torch.save(saved, paths[0])
        assert "vq_model" in refused(paths, tmp_path / "out")
    torch.save({"vq_model": {}}, paths[0], _use_new_zipfile_serialization=False)
    assert "torch.save" in refused(paths, tmp_path / "out")
    paths[0].unlink()
    assert "no file" in refused(paths, tmp_path / "out")


def test_a_huge_file_is_refused_unread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    paths = release(tmp_path / "in")
    with zipfile.ZipFile(paths[0], "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("archive/data.pkl", bytes(2_000_000))
    assert paths[0].stat().st_size < 10_000
    monkeypatch.setattr(convert, "LIMITS", replace(LIMITS, max_release_bytes=1_000_000))
    assert "at most" in refused(paths, tmp_path / "out")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "no scales"),
        ("latent_dim: 384\nn_heads: 6\n", "no scales"),
        (options_text(quant_type="momask"), "quant_type"),
        (options_text(dec_latent_text_embed="ctx_crs"), "crs_crs"),
        (options_text(text_model="clip"), "Llama"),
        (options_text(dataset_name="kit"), "kit"),
        (options_text(scales="(3, 1, 6)"), "do not grow"),
        (options_text(scales="(1, 3, 7)"), "belong together"),
        (options_text(scales="9" * 4000), "scales"),
        (options_text(rope_base="1000.0"), "rotary"),
        (options_text(rope_base="much"), "whole number"),
        (options_text(text_max_len="0"), "text_max_len: 0; 77"),
        (options_text(norm="GroupNorm"), "norms"),
    ],
)
def test_options_that_cannot_be_converted_say_why(text: str, sentence: str, tmp_path: Path) -> None:
    paths = release(tmp_path / "in")
    paths[2].write_text(text)
    with pytest.raises(PlaygroundError, match=sentence):
        convert_lgtok(*paths, tmp_path / "out")
    refused(paths, tmp_path / "out")


def test_options_in_other_bytes_are_refused(tmp_path: Path) -> None:
    paths = release(tmp_path / "in")
    for data in (b"\xff\xfe\x00", b"a: b\n" * (LIMITS.max_json_bytes // 4)):
        paths[2].write_bytes(data)
        assert "options text" in refused(paths, tmp_path / "out")
