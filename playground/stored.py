"""Stored analysis of one system: maps, code counts, tokens of test clips. Read by engine, rooms, notebooks. numpy only.

Two files a system, in `assets/analysis/` where it is shipped:

    <system>.json   {"format": 2, "system", "checkpoint", "data", "split", "seed", "perplexity", "explained": [2],
                     "agreement", "chance", "sizes": [N], "codes": [N], "versions": {...}, "note",
                     "clips": [{"id", "index", "source", "action", "caption", "frames"}, ...]}
    <system>.npz    means float32 [n, D], tsne float32 [n, 2], pca float32 [n, 2], tokens int16 [n, sum of sizes],
                    each level filled up with -1 where a motion has fewer tokens than one of full length,
                    counts int32 [sum of codes], energy float32 [n, N + 1], errors_mm float32 [n],
                    pca_centre float32 [D], pca_axes float32 [2, D]: pca = (means - centre) @ axes.T
                    token_index int32 [m, 3]: row, scale from 1 and position of each token of the map of tokens
                    token_centre float32 [D], token_axes float32 [k, D]: main axes of what tokens add to the embedding
                    token_scores float16 [m, k] along them (the first two are the PCA map), token_tsne float32 [m, 2]

Row i of every array but the token ones is entry i of "clips". The recorded motions are not in it: a click decodes the
token sequence of a clip on the fly. `caption` is a sentence written for this project (`analysis/phrases.py`), not one
of the data set.
"""

import json
import zipfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from playground.errors import PlaygroundError
from playground.tokenizers.token_file import LevelTokens, TokenFile

FORMAT = 2
_FACTS = ("system", "checkpoint", "data", "split", "seed", "perplexity", "explained", "agreement", "chance", "sizes",
          "codes", "versions", "note")  # fmt: skip
_ARRAYS = ("means", "tsne", "pca", "tokens", "counts", "energy", "errors_mm", "pca_centre", "pca_axes", "token_index",
           "token_centre", "token_axes", "token_scores", "token_tsne")  # fmt: skip

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class StoredClip:
    """One clip of a stored analysis."""

    id: str
    index: int  # clip of the library it was built from
    source: str
    action: str  # action group
    caption: str  # our sentence, which also guides the decoder
    frames: int  # feature rows, and poses of the decoded motion


@dataclass(frozen=True, eq=False)
class StoredAnalysis:
    """Stored analysis of one system on n clips; every array has one row a clip but counts, axes and tokens."""

    system: str
    checkpoint: str  # the tokenizer checkpoint the tokens belong to
    data: str
    split: str
    seed: int
    perplexity: float  # of t-SNE
    explained: tuple[float, float]  # share of the variance along the PCA axes
    agreement: float  # share of the 10 nearest neighbours of the same action, in all D dimensions
    chance: float  # the same for shuffled actions
    sizes: tuple[int, ...]  # tokens a scale at full length
    codes: tuple[int, ...]  # codebook size a scale
    versions: dict[str, str]  # of the packages that computed it
    note: str
    clips: tuple[StoredClip, ...]
    means: Floats  # [n, D]
    tsne: Floats  # [n, 2]
    pca: Floats  # [n, 2]
    tokens: NDArray[np.int16]  # [n, sum of sizes], -1 where a motion has fewer
    counts: NDArray[np.int32]  # [sum of codes]
    energy: Floats  # [n, N + 1]
    errors_mm: Floats  # [n] mean error of each clip, caption of the data set at both ends, g = 0
    pca_centre: Floats  # [D]
    pca_axes: Floats  # [2, D]
    token_index: NDArray[np.int32]  # [m, 3] row, scale from 1, position
    token_centre: Floats  # [D]
    token_axes: Floats  # [k, D]
    token_scores: NDArray[np.float16]  # [m, k]
    token_tsne: Floats  # [m, 2]

    def __post_init__(self) -> None:
        n = len(self.clips)
        shapes = {"tsne": (n, 2), "pca": (n, 2), "tokens": (n, sum(self.sizes)), "counts": (sum(self.codes),)}
        width, (m, k) = self.means.shape[-1], (len(self.token_index), len(self.token_axes))
        shapes |= {"energy": (n, len(self.sizes) + 1), "errors_mm": (n,), "means": (n, width)}
        shapes |= {"pca_centre": (width,), "pca_axes": (2, width), "token_centre": (width,), "token_axes": (k, width)}
        shapes |= {"token_index": (m, 3), "token_scores": (m, k), "token_tsne": (m, 2)}
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise PlaygroundError(
                    f"the stored analysis of {self.system} has {name} of another shape than {list(shape)}"
                )
        if not n or len(self.sizes) != len(self.codes):
            raise PlaygroundError(f"the stored analysis of {self.system} has no clip, or scales without codes")

    def __len__(self) -> int:
        return len(self.clips)

    @property
    def actions(self) -> list[str]:
        """Action group of every clip."""
        return [clip.action for clip in self.clips]

    @property
    def ids(self) -> list[str]:
        """Id of every clip: what a click on a map reports."""
        return [clip.id for clip in self.clips]

    @property
    def provenance(self) -> str:
        """One line for the caption of a figure."""
        return (
            f"{self.system}, checkpoint {self.checkpoint[:8]}, {len(self)} {self.split} clips of {self.data}, "
            f"seed {self.seed}, stored"
        )

    @property
    def token_pca(self) -> Floats:
        """[m, 2] places of the sampled tokens along their two main axes."""
        return np.asarray(self.token_scores[:, :2], np.float32)

    def position(self, id: str) -> int:
        """Row of a clip by its id; PlaygroundError if it is not there."""
        for row, clip in enumerate(self.clips):
            if clip.id == id:
                return row
        raise PlaygroundError(f"there is no clip {str(id)[:80]!r} in the stored analysis of {self.system}")

    def levels(self, row: int) -> tuple[LevelTokens, ...]:
        """Tokens of one clip, one entry a scale."""
        parts = np.split(self.tokens[row].astype(np.int64), np.cumsum(self.sizes)[:-1])
        real = [ids[ids >= 0] for ids in parts]
        return tuple(LevelTokens(len(ids), codes, ids) for ids, codes in zip(real, self.codes, strict=True))

    def count(self, row: int, scale: int) -> int:
        """Tokens of one clip on a scale (0-based)."""
        start = sum(self.sizes[:scale])
        return int((self.tokens[row, start : start + self.sizes[scale]] >= 0).sum())

    def token_file(self, row: int) -> TokenFile:
        """One clip as a token file, for `engine.decode`; its caption is ours."""
        clip = self.clips[row]
        return TokenFile(self.system, self.checkpoint, clip.caption, clip.frames, self.levels(row))

    def where_used(self, scale: int, code: int) -> list[tuple[int, int]]:
        """(row, position) of every token of scale `scale` (0-based) that has the code."""
        start = sum(self.sizes[:scale])
        found = np.argwhere(self.tokens[:, start : start + self.sizes[scale]] == code)
        return [(int(row), int(position)) for row, position in found]

    @classmethod
    def read(cls, folder: Path, system: str) -> Self:
        """The stored analysis of a system. PlaygroundError if it is absent or broken."""
        if not (folder / f"{system}.json").is_file():
            raise PlaygroundError(
                f"there is no stored analysis of {system}; `python -m playground.analysis.store` makes one"
            )
        try:
            head = json.loads((folder / f"{system}.json").read_text(encoding="utf-8"))
            if head["format"] != FORMAT:
                raise PlaygroundError(
                    f"the stored analysis of {system} has format {head['format']}; {FORMAT} is read, build it again"
                )
            with np.load(folder / f"{system}.npz", allow_pickle=False) as file:
                arrays = {name: file[name] for name in _ARRAYS}
            facts = {name: head[name] for name in _FACTS}
            facts |= {name: tuple(facts[name]) for name in ("explained", "sizes", "codes")}
            return cls(**facts, clips=tuple(StoredClip(**clip) for clip in head["clips"]), **arrays)
        except (
            OSError,
            ValueError,
            KeyError,
            TypeError,
            AttributeError,
            IndexError,
            EOFError,
            zipfile.BadZipFile,
        ) as error:
            if isinstance(error, PlaygroundError):
                raise
            raise PlaygroundError(f"the stored analysis of {system} is broken; build it again") from error

    def write(self, folder: Path) -> None:
        """Write both files into `folder`, made if absent."""
        folder.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(folder / f"{self.system}.npz", **{name: getattr(self, name) for name in _ARRAYS})
        head: dict[str, Any] = {"format": FORMAT} | {name: getattr(self, name) for name in _FACTS}
        whole = head | {"clips": [asdict(clip) for clip in self.clips]}
        text = json.dumps(whole, ensure_ascii=False, separators=(",", ":"))
        (folder / f"{self.system}.json").write_text(text + "\n", encoding="utf-8")
