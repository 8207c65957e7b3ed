"""How an action group looks in a plot: a colour of a colour-blind-safe set and a marker, no two groups sharing both.

Groups that are easily confused, or that hold most motions, have a hue of their own; the marker tells the rest apart.
"""

from dataclasses import dataclass

_HUES: dict[str, tuple[str, str]] = {  # on a light page, on a dark page; each keeps a contrast of 3 or more
    "blue": ("#0072b2", "#3b9fe0"),
    "indigo": ("#332288", "#9a90f0"),
    "sky": ("#3a9bce", "#8fd0f5"),
    "vermilion": ("#d55e00", "#f0843c"),
    "orange": ("#b87d00", "#f2b53a"),
    "green": ("#009e73", "#2fc296"),
    "purple": ("#c065a0", "#e09cc2"),
    "wine": ("#882255", "#e0709c"),
    "olive": ("#7d7600", "#d3c93c"),
    "grey": ("#80868e", "#9ca7b3"),
}

_STYLES: dict[str, tuple[str, str]] = {  # in legend order
    "walk": ("blue", "circle"),
    "walk and turn": ("indigo", "square"),
    "turn": ("sky", "square"),
    "run": ("vermilion", "triangle-up"),
    "step": ("indigo", "cross"),
    "jump": ("olive", "triangle-up"),
    "raise hands": ("green", "diamond"),
    "wave": ("orange", "star"),
    "gesture": ("green", "cross"),
    "reach": ("sky", "diamond"),
    "kick": ("wine", "triangle-right"),
    "fight": ("wine", "x"),
    "play ball": ("sky", "hexagon"),
    "dance": ("purple", "pentagon"),
    "squat or bow": ("purple", "triangle-down"),
    "sit": ("olive", "square"),
    "climb": ("olive", "cross"),
    "floor": ("purple", "x"),
    "stand": ("grey", "square"),
    "other": ("grey", "circle"),
}


@dataclass(frozen=True)
class ActionStyle:
    """Marker of an action group: colour on a light and on a dark page, and a plotly symbol."""

    light: str
    dark: str
    symbol: str
    rank: int  # place in a legend


def action_style(action: str) -> ActionStyle:
    """The style of an action group; a group without a row looks like "other"."""
    hue, symbol = _STYLES.get(action, _STYLES["other"])
    light, dark = _HUES[hue]
    names = list(_STYLES)
    return ActionStyle(light, dark, symbol, names.index(action) if action in _STYLES else len(names))


def known_actions() -> tuple[str, ...]:
    """The groups that have a style of their own, in legend order."""
    return tuple(_STYLES)
