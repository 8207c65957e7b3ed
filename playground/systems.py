"""The table of systems: name -> tokenizer, generator, text encoder, checkpoint files. A system is a row. No torch.

`SystemInfo` is what the rooms and the command line list; it is read from the headers of the checkpoint files alone.
"""

import json
import struct
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import lru_cache
from math import prod
from pathlib import Path
from typing import Any

from playground.errors import PlaygroundError

MAX_HEADER = 8 * 1024 * 1024  # bytes of a checkpoint's header


@dataclass(frozen=True)
class SamplingDefaults:
    """What a generation uses where nothing else is asked for; the defaults are LG-Tok's on HumanML3D (A8, A10)."""

    guidance: float = 2.0  # g of the detokenizer
    cfg: float = 4.0  # s of the generator, reached at the last scale
    temperature: float = 1.0
    top_k: float = 0.2  # share of the codes kept
    top_p: float = 0.95  # nucleus on what is left


@dataclass(frozen=True)
class SystemRow:
    """One system. Files stand in `assets/checkpoints/<name>/`, unless another system lends its tokenizer."""

    name: str
    title: str  # what the screen calls it
    family: str  # colour family of figures/colors.py
    tokenizer: str | None  # what kind, in the words of its paper
    generator: str | None
    text: str = "minilm"  # text encoder of both
    prompts: str = ""  # text encoder of the generator, where it is another
    command: str = "train"  # the command that makes its files
    latents_are_frames: bool = False  # does a latent stand for a fixed span of frames by construction?
    sampling: SamplingDefaults = SamplingDefaults()
    lends: str = ""  # the system whose tokenizer file is used

    @property
    def parts(self) -> tuple[str, ...]:
        """The parts that it consists of: tokenizer, generator or both. The file of the first one identifies it."""
        there = {"tokenizer": self.tokenizer, "generator": self.generator}
        return tuple(part for part, kind in there.items() if kind is not None)

    @property
    def needed(self) -> tuple[str, ...]:
        """The parts without which there is nothing to show; a tokenizer of its own can stand alone."""
        return self.parts if self.lends else self.parts[:1]

    @property
    def no_tokenizer(self) -> str:
        """The sentence for a person who asks for tokens of a system that has none."""
        return f"the system {self.name} has no tokenizer: it makes motions from text, without tokens"

    @property
    def no_generator(self) -> str:
        """The sentence for a person who asks a system that has no generator to make a motion."""
        return f"the system {self.name} has no generator; it can tokenize and decode only"

    @property
    def absent(self) -> str:
        """The sentence for a person who asks for it where its files are not."""
        state = "is not trained yet: it has" if self.command == "train" else "has"
        return f"the system {self.name} {state} no checkpoint here; the {self.command} command makes one"


def _ours(name: str, title: str, *, scalewise: bool = True, guidance: float = 0.0) -> SystemRow:
    """A row of the LG-Tok family that this repository trains."""
    return SystemRow(
        name,
        title,
        "lgtok",
        "LG-Tok transformer" if scalewise else "LG-Tok transformer, plain residual levels",
        "scale-wise autoregression" if scalewise else None,
        sampling=SamplingDefaults(guidance=guidance, cfg=4.0),  # cfg: by the plain prompts that the flagship obeys
    )


def _theirs(
    name: str,
    title: str,
    family: str,
    tokenizer: str | None,
    generator: str,
    sampling: SamplingDefaults,
    lends: str = "",
    aligned: bool = True,
) -> SystemRow:
    """A row of another paper's system that this repository trains.

    aligned: convolutions over each motion's own length tie latents to spans of frames.
    """
    return SystemRow(
        name, title, family, tokenizer, generator, latents_are_frames=aligned, sampling=sampling, lends=lends
    )


_RVQ, _GPT = "convolutions, residual levels", "GPT, one token after the other"
_SCALES = "convolutions with attention, scales with one codebook"
_MASKED = SamplingDefaults(guidance=0.0, cfg=4.0, top_k=0.1, top_p=1.0)  # B2
_MASKED_SCALES = replace(_MASKED, cfg=5.0)  # E4, HumanML3D
_CAUSAL = SamplingDefaults(guidance=0.0, cfg=2.0)  # the papers guide neither; ours
_DENOISED = SamplingDefaults(guidance=0.0, cfg=2.5)  # D4

_GUIDED = 1.0  # g with the least FID, or nearly, in the sweeps of lgtok and lgtok-lite on the validation split

DEFAULT_SYSTEM = "lgtok"  # where none is named: the flagship
BASE_SYSTEM = "lgtok-lite"  # of LG-Tok's family what the others differ from in one thing each

SYSTEMS: dict[str, SystemRow] = {
    row.name: row
    for row in (
        _ours("lgtok", "LG-Tok", guidance=_GUIDED),
        _ours("lgtok-lite", "LG-Tok lite", guidance=_GUIDED),
        _ours("lgtok-mid", "LG-Tok mid", guidance=_GUIDED),
        _ours("lgtok-mini", "LG-Tok mini", guidance=_GUIDED),
        _ours("lgtok-notext", "LG-Tok without text"),
        _ours("lgtok-nodrop", "LG-Tok without language drop"),
        _ours("lgtok-rvq", "LG-Tok with MoMask's quantizer", scalewise=False),
        SystemRow(
            "lgtok-humanml3d",
            "LG-Tok, the authors' HumanML3D weights",
            "lgtok",
            "LG-Tok transformer",
            "scale-wise autoregression",
            text="llama",
            prompts="clip",
            command="convert",
        ),
        SystemRow(
            "lgtok-motionx",
            "LG-Tok, the authors' Motion-X weights",
            "lgtok",
            "LG-Tok transformer",
            "scale-wise autoregression",
            text="llama",
            prompts="clip",
            command="convert",
            sampling=SamplingDefaults(guidance=1.0, cfg=2.0),
        ),
        _theirs(
            "mosa", "MoSa", "mosa", "convolutions with attention, scales", "scale-wise autoregression",
            SamplingDefaults(guidance=0.0, cfg=4.0), aligned=False,
        ),
        _theirs("momask", "MoMask", "momask", _RVQ, "masked and residual transformers", _MASKED),
        _theirs(
            "momask-lgtok", "MoMask on LG-Tok's tokenizer", "momask", "LG-Tok transformer, plain residual levels",
            "masked and residual transformers", _MASKED, lends="lgtok-rvq", aligned=False,
        ),
        _theirs("momaskpp", "MoMask++", "momask++", _SCALES, "one masked transformer, text in front", _MASKED_SCALES),
        _theirs(
            "momaskpp-cross", "MoMask++ with cross-attention", "momask++", _SCALES,
            "one masked transformer, cross-attention to text", _MASKED_SCALES, lends="momaskpp",
        ),
        _theirs("t2mgpt", "T2M-GPT", "t2mgpt", "convolutions, one level", f"{_GPT}, pooled text", _CAUSAL),
        _theirs(
            "t2mgpt-casim", "T2M-GPT with CASIM", "t2mgpt", "convolutions, one level", f"{_GPT}, all words", _CAUSAL,
            lends="t2mgpt",
        ),
        _theirs("mdm", "MDM", "mdm", None, "diffusion, pooled text", _DENOISED, aligned=False),
        _theirs("mdm-casim", "MDM with CASIM", "mdm", None, "diffusion, all words in front", _DENOISED, aligned=False),
        _theirs(
            "mdm-casim-decoder", "MDM with CASIM, decoder", "mdm", None, "diffusion, cross-attention to words",
            _DENOISED, aligned=False,
        ),
        _theirs(
            "mogo", "MOGO", "mogo", f"{_RVQ} with learned scale and bias", "one causal transformer a level", _CAUSAL
        ),
    )
}  # fmt: skip


@dataclass(frozen=True)
class SystemInfo:
    """A row with what its checkpoints say."""

    name: str
    title: str
    family: str
    tokenizer: str | None
    generator: str | None
    text: str
    parameters: int  # trainable numbers and codebooks of the files that are there
    data: str  # library it was trained on, "" if absent
    checkpoint: str  # shipped | absent
    facts: dict[str, Any]  # of the tokenizer: steps, seconds, seed, last validation
    sampling: SamplingDefaults = SamplingDefaults()


def checkpoint_path(assets: Path, name: str, part: str) -> Path:
    """The file of a system's `tokenizer` or `generator`; another system's where that one lends its tokenizer."""
    row = SYSTEMS.get(name)
    owner = row.lends if row is not None and row.lends and part == "tokenizer" else name
    return assets / "checkpoints" / owner / f"{part}.safetensors"


def check_here(assets: Path, row: SystemRow) -> None:
    """PlaygroundError where a file that the system needs is absent."""
    if not all(checkpoint_path(assets, row.name, part).is_file() for part in row.needed):
        raise PlaygroundError(row.absent)


def row_of(name: str) -> SystemRow:
    """A row of the table. PlaygroundError for an unknown name."""
    if name not in SYSTEMS:
        near = get_close_matches(str(name)[:80], SYSTEMS, 3) or list(SYSTEMS)[:3]
        raise PlaygroundError(
            f"unknown system {str(name)[:80]!r}; {', '.join(near)} and others are accepted, see the systems command"
        )
    return SYSTEMS[name]


@lru_cache(maxsize=64)
def _header(path: Path, changed: int) -> dict[str, Any]:
    """The JSON header of a safetensors file: 8 bytes of length, then the text. `changed` keys the cache."""
    try:
        with open(path, "rb") as file:
            (size,) = struct.unpack("<Q", file.read(8))
            if size > MAX_HEADER:
                raise ValueError("header")
            return dict(json.loads(file.read(size)))
    except (OSError, ValueError, struct.error) as error:
        raise PlaygroundError(
            f"{path} is not a checkpoint of the playground (a .safetensors file with a card)"
        ) from error


def header(path: Path) -> dict[str, Any] | None:
    """Header of a checkpoint, or None where there is no file. PlaygroundError if it is broken."""
    return _header(path, path.stat().st_mtime_ns) if path.is_file() else None


def describe(assets: Path, row: SystemRow) -> SystemInfo:
    """What a system's checkpoint files say, without loading a weight.

    It is absent unless every file that it needs is there.
    """
    heads = {part: header(checkpoint_path(assets, row.name, part)) for part in row.parts}
    if any(heads[part] is None for part in row.needed):
        heads = dict.fromkeys(row.parts)
    numbers = 0
    for head in heads.values():
        shapes = [v["shape"] for k, v in (head or {}).items() if k.startswith("model.")]
        numbers += sum(prod(shape) for shape in shapes)
    metadata = next((head["__metadata__"] for head in heads.values() if head is not None), None)
    return SystemInfo(
        name=row.name,
        title=row.title,
        family=row.family,
        tokenizer=row.tokenizer,
        generator=row.generator if metadata is None or heads.get("generator") is not None else None,
        text=f"{row.text}, {row.prompts}" if row.prompts else row.text,
        parameters=numbers,
        data=metadata["data"] if metadata else "",
        checkpoint="shipped" if metadata else "absent",
        facts=json.loads(metadata["facts"]) if metadata else {},
        sampling=row.sampling,
    )
