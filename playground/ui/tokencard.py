"""The card of a code: what is like it, where else it stands, what it may be replaced by. HTML text, no model.

Buttons carry data-do and data-code for inspector.py; links carry data-state, so that they open inside the page.
"""

import html
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any
from urllib.parse import urlencode

import numpy as np
from numpy.typing import NDArray

from playground.figures.stage import NOT_FRAMES
from playground.limits import LIMITS
from playground.motion.skeleton import HUMAN22
from playground.systems import row_of
from playground.ui.facts import significant

if TYPE_CHECKING:
    from playground.analysis.bundle import Bundle
    from playground.findings import Neighbours, Swap

LISTED = 4  # clips that are named
LIKE = 6  # codes that are named
BY_SHARE = "Its cell shows its share of time; which frames it really moves has to be measured."
PROBE = (
    "A swap measures which frames a token governs: decode with the other code, compare joint by joint. "
    "LG-Tok's latents are not frames by construction."
)


def swatch(color: NDArray[np.uint8] | None) -> str:
    """The code's colour as in the score; colour is never the only word for it."""
    if color is None:
        return ""
    red, green, blue = (int(channel) for channel in color)
    return f'<i class="mtp-swatch" style="background:rgb({red},{green},{blue})"></i>'


def chip(do: str, code: object, words: str, color: NDArray[np.uint8] | None = None, told: str = "") -> str:
    """One small button. do: what it does; told: what a screen reader says, the words by default."""
    spoken = f' aria-label="{html.escape(told, quote=True)}" title="{html.escape(told, quote=True)}"' if told else ""
    key = html.escape(f"{do}-{code}", quote=True)
    value = html.escape(str(code), quote=True)
    return (
        f'<button type="button" class="mtp-chip" data-do="{do}" data-code="{value}" data-key="{key}"{spoken}>'
        f"{swatch(color)}{html.escape(words)}</button>"
    )


def like_chips(like: "Neighbours", palette: NDArray[np.uint8] | None, do: str) -> str:
    """The nearest codes as buttons, each with the cosine to the code."""
    chips = [
        chip(do, int(code), f"{code}", palette[code] if palette is not None else None,
             f"Code {code}, cosine {near:.2f}")
        for code, near in zip(like.codes[:LIKE], like.similarity, strict=False)
    ]  # fmt: skip
    return f'<div class="mtp-chips">{"".join(chips)}</div>'


def occurrences(bundle: "Bundle | None", scale: int, code: int) -> str:
    """How often a code stands in the stored clips, and links that put some of them on the stage."""
    if bundle is None:
        return '<p class="mtp-aside">There is no stored analysis of this system, so nothing is counted.</p>'
    places = bundle.where_used(scale - 1, code)
    rows = dict.fromkeys(row for row, _ in places)
    total = int(bundle.usage.totals_[scale - 1])
    first = dict(reversed(places))  # row -> its first position
    counted = (
        f"In {len(rows)} of {len(bundle)} {bundle.split} clips of {bundle.data}; {len(places)} of {total:,} tokens of "
        f"scale {scale}."
    )
    kinds = {bundle.clips[row].caption: row for row in reversed(rows)}  # what differs comes first
    shown = list(dict.fromkeys([*(row for row in rows if row in kinds.values()), *rows]))[:LISTED]
    items = "".join(f"<li>{_place(bundle, row, scale, first[row])}</li>" for row in shown)
    return f'<p class="mtp-aside">{html.escape(counted)}</p><ul class="mtp-places">{items}</ul>'


def code_card(bundle: "Bundle", scale: int, code: int, like: "Neighbours | None", palette: Any) -> str:
    """The card of a code of a codebook: how often it is used, what is like it, where it stands."""
    counts = bundle.usage.counts_[scale - 1]
    count, total, codes = int(counts[code]), int(bundle.usage.totals_[scale - 1]), len(counts)
    rank = int((counts > count).sum()) + 1
    used = f"{count:,} of {total:,} tokens, {significant(count * codes / max(total, 1))} times even use, rank {rank}"
    told = f"<strong>Used by {used}</strong> of {codes} codes." if count else "<strong>Dead:</strong> no clip needs it."
    head = (
        f'<div class="mtp-token-head"><h2>{swatch(palette[code] if palette is not None else None)}Code {code}</h2>'
        f"<span>scale {scale}</span></div>"
    )
    alike = f"<h3>Codes most like it</h3>{like_chips(like, palette, 'code')}" if like else ""
    where = f"<h3>Where it stands</h3>{occurrences(bundle, scale, code)}" if count else ""
    return f'<div class="mtp-token">{head}<p>{told}</p>{alike}{where}</div>'


def sentence(bundle: "Bundle", row: int) -> str:
    """A clip in a few words: our caption and where it was recorded."""
    clip = bundle.clips[row]
    return f"{clip.caption or clip.action} ({clip.source})"


def _place(bundle: "Bundle", row: int, scale: int, position: int) -> str:
    clip = bundle.clips[row]
    step = clip.frames / bundle.count(row, scale - 1) / LIMITS.fps
    when = f"{position * step:.1f} to {(position + 1) * step:.1f} s"
    words = {"room": "embedding-map", "system": bundle.system, "motion": clip.id}
    query = urlencode({**words, "selection": f"{bundle.system}.{scale}.{position}"})
    name = html.escape(sentence(bundle, row))
    return f'<a data-state href="?{html.escape(query, quote=True)}">{name}</a> <span>{when}</span>'


def token_card(
    system: str,
    scale: int,
    position: int,
    size: int,
    code: int,
    frames: int,
    like: "Neighbours | None",
    palette: NDArray[np.uint8] | None,
    span: Sequence[int] | None,
    swap: "Swap | None",
    bundle: "Bundle | None",
) -> str:
    """The card of a selected token. span: measured frames, None while they are not; swap: what replaced it, if so."""
    color = palette[code] if palette is not None else None
    head = (
        f'<div class="mtp-token-head"><h2>{swatch(color)}Code {code}</h2>'
        f"<span>scale {scale}, token {position + 1} of {size}</span>"
        '<button type="button" class="mtp-quiet" data-deselect="tokenize">Back to the motion</button></div>'
    )
    share = (position * frames / size, (position + 1) * frames / size)
    return (
        f'<div class="mtp-token">{head}{_governs(span, share, system)}'
        f"<h3>Replace it by</h3>{_choices(like, palette, code)}{_outcome(swap)}"
        + (f"<h3>Codes most like it</h3>{like_chips(like, palette, 'replace')}" if like else "")
        + f"<h3>Where else it stands</h3>{occurrences(bundle, scale, code)}</div>"
    )


def _governs(span: Sequence[int] | None, share: tuple[float, float], system: str) -> str:
    nominal = f"Its share of time is {_when(share)}."
    if span is None:
        words = "Measuring which frames it governs …"
    elif span[1] <= span[0]:
        words = "Measured: replacing it moves nothing here."
    else:
        words = f"<strong>Governs {_when(span)}</strong>, measured."
    aside = "" if row_of(system).latents_are_frames else f' title="{html.escape(NOT_FRAMES, quote=True)}"'
    return f'<p class="mtp-governs"{aside}>{words} {nominal}</p>'


def _choices(like: "Neighbours | None", palette: NDArray[np.uint8] | None, code: int) -> str:
    chips = []
    if like is not None:
        near, far = int(like.codes[0]), like.opposite
        chips.append(chip("replace", near, f"nearest, {near}", palette[near] if palette is not None else None))
        chips.append(chip("replace", far, f"opposite, {far}", palette[far] if palette is not None else None))
    chips.append(chip("random", "", "random"))
    most = "" if palette is None else f' max="{len(palette) - 1}"'
    number = (
        f'<span class="mtp-number"><input type="number" min="0"{most} step="1" inputmode="numeric" placeholder="code"'
        ' aria-label="Code to put in" id="tokenize-code"><button type="button" class="mtp-chip" data-do="number" '
        'data-key="number">put in</button></span>'
    )
    return f'<div class="mtp-chips">{"".join(chips)}{number}</div>'


def _outcome(swap: "Swap | None") -> str:
    """What a swap did, or what it would tell."""
    if swap is None:
        return f'<p class="mtp-aside">{PROBE}</p>'
    if not swap.difference.max() > 0:
        told = f"Code {swap.before} became {swap.code}: nothing moves."
    else:
        frame, joint = np.unravel_index(int(swap.difference.argmax()), swap.difference.shape)
        name = HUMAN22.joints[int(joint)].replace("l_", "left ").replace("r_", "right ")
        told = (
            f"Code {swap.before} became {swap.code}: at most {significant(1000 * float(swap.difference.max()))} mm "
            f"({name}, {frame / LIMITS.fps:.2f} s); {_when(swap.span)} hold 80 % of the change."
        )
    undo = '<button type="button" class="mtp-chip" data-do="undo" data-key="undo">Undo</button>'
    shown = '<p class="mtp-aside">The map under the score shows it joint by joint. ' + PROBE + "</p>"
    return f'<div class="mtp-outcome" role="status"><p>{html.escape(told)}</p>{undo}</div>{shown}'


def _when(span: Sequence[float]) -> str:
    return f"{span[0] / LIMITS.fps:.2f} to {span[1] / LIMITS.fps:.2f} s"
