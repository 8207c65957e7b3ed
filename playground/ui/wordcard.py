"""What language does, in numbers: how many tokens change with the caption, and what that costs. HTML text, no model."""

import html
from typing import TYPE_CHECKING

from playground.ui.facts import millimetres, table

if TYPE_CHECKING:
    from playground.findings import Language

MARKS = [("without words", "bare"), ("with the wrong ones", "misled")]
ABOUT = (
    "The tokenizer reads the caption when it writes tokens and again when it reads them. What the words already say "
    "need not stand in the tokens, so other words give other tokens. The same text stands at both ends, g = 0."
)
NO_ATTENTION = "This system has no attention to words to show."


def words_card(language: "Language", title: str, attention: bool) -> str:
    """Three rows: with the caption, with none, with a wrong one; and what they mean."""
    tokens = sum(len(flips) for flips in language.bare_flips)
    bare, misled = (round(share * tokens) for share in (language.bare_share, language.misled_share))
    rows = [
        ["its caption", "–", millimetres(language.mpjpe_mm[0])],
        ["no words", f"{bare} of {tokens}", millimetres(language.mpjpe_mm[1])],
        ["the wrong words", f"{misled} of {tokens}", millimetres(language.mpjpe_mm[2])],
    ]
    told = table(["tokenized with", "other tokens", "MPJPE"], rows, f"Measured on this clip with {title}")
    note = "" if attention else f'<p class="mtp-aside">{NO_ATTENTION}</p>'
    return f'<div class="mtp-language">{told}<p class="mtp-aside">{html.escape(ABOUT)}</p>{note}</div>'
