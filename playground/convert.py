"""The files that the authors of LG-Tok release -> our checkpoints. The one place that reads torch files.

A release is a tokenizer file and a generator file (torch archives with a state dict under `vq_model` and under
`t2m_transformer`) and the options text of the tokenizer (`key: value` a line), as the public code of eanson023/LG-Tok
writes them. Which array is which of ours stands in tokenizers/released.py and generators/released.py. The mean and std
of the features are in neither file: the authors read Mean.npy and Std.npy in the folder of the data set.
"""

import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TypeVar

import torch
from torch import Tensor, nn

from playground.checkpoints import TRAINING_ONLY, Card, load_tokenizer, save_checkpoint
from playground.errors import PlaygroundError
from playground.generators.released import generator_weights
from playground.generators.scalewise import GeneratorConfig, build_generator
from playground.limits import LIMITS
from playground.motion.arrays import open_arrays
from playground.motion.features263 import COLUMNS263
from playground.motion.representation import COLUMNS, Normaliser
from playground.nn.foreign import ForeignState
from playground.text.encoders import EncoderId
from playground.text.pretrained import identify_folder
from playground.tokenizers.released import tokenizer_weights
from playground.tokenizers.transformer import TokenizerConfig, build_tokenizer

ENTRIES = {"tokenizer": ("vq_model", "net"), "generator": ("t2m_transformer",)}  # where the weights are, by kind
WANTED = {  # options that the released models share, spelt as in the authors' option files
    "quant_type": "mosa",
    "pos_embed": "rope1d",
    "enc_moiton_text_embed": "ctx_ctx",
    "dec_latent_text_embed": "crs_crs",
    "patch_size": "1",
    "qk_norm": "False",
    "phi_k": "3",
    "phi_depth": "2",
    "text_model": "Llama-3.2-1B",
    "text_max_len": "77",
}
DATA = {"t2m": "HumanML3D", "motionx": "Motion-X", "cmp": "CMP"}  # dataset_name -> the name on the card
STATISTICS = ("Mean.npy", "Std.npy")
ROOM = 2  # times the published sizes that a release may have
Config = TypeVar("Config", TokenizerConfig, GeneratorConfig)


@dataclass(frozen=True)
class Converted:
    """What was written, and sentences that a person should read."""

    files: tuple[Path, ...]
    notes: tuple[str, ...]


def convert_lgtok(
    tokenizer: Path,
    generator: Path,
    options: Path,
    out: Path,
    *,
    statistics: Path | None = None,
    llama: str | None = None,
    clip: str | None = None,
) -> Converted:
    """Write `tokenizer.safetensors` and `generator.safetensors` (float32) to the folder `out`.

    statistics: folder with Mean.npy and Std.npy; by default they are looked for beside tokenizer and options.
    llama, clip: folders of the text encoders, whose weights are then noted on the cards; without them any weights of
    the right width are accepted later. PlaygroundError, with nothing written, for files that are not of the release.
    """
    settings = read_options(options)
    normaliser = read_statistics(statistics) if statistics else find_statistics(tokenizer.parent, options.parent)
    state, other = read_state(tokenizer, "tokenizer"), read_state(generator, "generator")
    config, weights = tokenizer_weights(state, settings)
    config_generator, weights_generator = generator_weights(other, config)
    _check_size(config, TokenizerConfig(), state)
    _check_size(config_generator, GeneratorConfig(), other)
    model, network = build_tokenizer(config), build_generator(config_generator)
    _fill(model, weights, state)
    _fill(network, weights_generator, other)
    encoders = _encoder("llama", llama, config.text_width), _encoder("clip", clip, config_generator.text_width)
    data = DATA[settings.get("dataset_name", "t2m")]
    facts = {"origin": "released by the authors of LG-Tok", "options": settings.get("name", "")}
    files = out / "tokenizer.safetensors", out / "generator.safetensors"
    save_checkpoint(files[0], model, Card("tokenizer", config, encoders[0], data, facts, normaliser), torch.float32)
    facts |= {"tokenizer": load_tokenizer(files[0])[1].hash[:12]}
    save_checkpoint(files[1], network, Card("generator", config_generator, encoders[1], data, facts), torch.float32)
    return Converted(files, tuple(_notes(normaliser, data)))


def _check_size(config: Config, published: Config, state: ForeignState) -> None:
    """PlaygroundError for a model whose sizes are beyond the published ones, before memory is taken for it."""
    for size in (field.name for field in fields(published) if type(getattr(published, field.name)) is int):
        if getattr(config, size) > ROOM * getattr(published, size):
            raise PlaygroundError(
                f"{state.path} has {size} {getattr(config, size)}; no LG-Tok of that size was released"
            )


def _fill(model: nn.Module, weights: Mapping[str, Tensor], state: ForeignState) -> None:
    state.check_shapes(model.state_dict(), weights)
    missing = model.load_state_dict(dict(weights), strict=False).missing_keys
    if lacking := [name for name in missing if name.rsplit(".", 1)[-1] not in TRAINING_ONLY]:
        raise PlaygroundError(f"{state.path} gives no values for {lacking[0]}, so it is not of the released kind")


def _notes(normaliser: Normaliser | None, data: str) -> list[str]:
    notes = []
    if normaliser is None:
        notes.append(
            "no Mean.npy and Std.npy were found, so the system cannot read or show a motion yet; convert again with"
            " --statistics and the folder of the data set"
        )
    if data == "Motion-X":
        notes.append(
            "Motion-X has 30 frames a second, the playground works at 20: motions that it makes look slow, and those"
            " that it tokenizes move faster than what it was trained on"
        )
    return notes


def read_state(path: Path, kind: str) -> ForeignState:
    """The weights in a torch archive, kind `tokenizer` or `generator`. No code that the file may hold is run.

    PlaygroundError for a missing or huge file, for one that is no torch archive, and for one that holds anything else.
    """
    if not path.is_file():
        raise PlaygroundError(f"there is no file {path}")
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(member.file_size for member in archive.infolist())
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        raise PlaygroundError(f"{path} is not a file that torch.save writes") from error
    most = LIMITS.max_release_bytes
    if max(size, path.stat().st_size) > most:
        raise PlaygroundError(f"{path} holds {size / 1e9:.1f} GB; at most {most / 1e9:.1f} GB are read")
    try:
        saved = torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:  # whatever a stranger's file makes the reader raise; a person needs one sentence
        raise PlaygroundError(f"{path} is damaged, or holds more than arrays and numbers; it was not opened") from error
    entries = ENTRIES[kind]
    found = next((saved[key] for key in entries if key in saved), None) if isinstance(saved, Mapping) else None
    if not isinstance(found, Mapping) or not all(isinstance(value, Tensor) for value in found.values()):
        raise PlaygroundError(f"{path} has no entry {' or '.join(entries)} with the weights of an LG-Tok {kind}")
    return ForeignState.checked(path, found)


def read_options(path: Path) -> dict[str, str]:
    """The options text as the authors write it: key -> value, both text. PlaygroundError if it cannot be converted."""
    try:
        if path.stat().st_size > LIMITS.max_json_bytes:
            raise ValueError("size")
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError) as error:
        raise PlaygroundError(f"{path} is not an options text; the released tokenizer's opt.txt is needed") from error
    settings = {key.strip(): value.strip() for key, colon, value in (line.partition(": ") for line in lines) if colon}
    if "scales" not in settings:
        raise PlaygroundError(f"{path} states no scales; the options of the tokenizer are needed (its opt.txt)")
    for key, wanted in WANTED.items():
        if settings.get(key, wanted) != wanted:
            raise PlaygroundError(f"{path} says {key}: {settings[key][:40]}; {wanted} can be converted, as released")
    name = settings.get("dataset_name", "t2m")
    if name not in DATA:
        raise PlaygroundError(f"{path} is of a model for {name[:40]!r}; {', '.join(DATA)} can be converted")
    return settings


def read_statistics(folder: Path) -> Normaliser:
    """Mean.npy and Std.npy of a folder: [67], or [263] of which 67 are kept. PlaygroundError if they are not there."""
    parts = []
    for path in (folder / name for name in STATISTICS):
        if not path.is_file():
            raise PlaygroundError(f"{path} is missing; the folder of the data set with Mean.npy and Std.npy is needed")
        values = open_arrays(path).values("")
        if values.ndim != 1 or values.dtype.kind != "f" or len(values) not in (COLUMNS, COLUMNS263):
            raise PlaygroundError(f"{path} holds values {list(values.shape)}; [{COLUMNS}] or [{COLUMNS263}] is needed")
        parts.append(values[:COLUMNS].astype("float32"))
    mean, std = parts
    if not (abs(mean) < LIMITS.max_metres).all() or not ((std > 0) & (std < LIMITS.max_metres)).all():
        raise PlaygroundError(f"Mean.npy and Std.npy of {folder} are no mean and no standard deviation of motions")
    return Normaliser(mean, std)


def find_statistics(*folders: Path) -> Normaliser | None:
    """The statistics in the first of the folders that has them."""
    return next((read_statistics(one) for one in folders if all((one / name).is_file() for name in STATISTICS)), None)


def _encoder(family: str, folder: str | None, width: int) -> EncoderId:
    """What a card says of its text encoder; no weights where no folder was named."""
    if folder is None:
        return EncoderId(family, width, "")
    who = identify_folder(family, folder)
    if who.width != width:
        raise PlaygroundError(f"the {family} encoder in {folder} has width {who.width}; this model reads width {width}")
    return who
