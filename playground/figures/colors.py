"""The one table of colours: systems, surfaces, and perceptual conversion. numpy only.

A family of systems has a hue (Okabe and Ito's colour-blind-safe set), a variant a lightness step and a dash; the
original motion is neutral. Plots, stage and page all read this table, so a system looks the same wherever it stands.
"""

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from playground.errors import PlaygroundError

# Neutral tokens: name -> (light, dark). Text on its ground keeps a contrast of 4.5 or more in both.
TOKENS: dict[str, tuple[str, str]] = {
    "bg": ("#f7f7f5", "#141517"),
    "surface": ("#ffffff", "#1c1d20"),
    "sunken": ("#f0f0ed", "#25272b"),
    "line": ("#dededa", "#34363b"),
    "line-strong": ("#8b8c88", "#787b82"),
    "text": ("#1b1c1e", "#ececea"),
    "muted": ("#5c5e62", "#a6a8ad"),
    "ink": ("#1b1c1e", "#ececea"),
    "on-ink": ("#ffffff", "#141517"),
    "focus": ("#0b6bcb", "#7fb8f5"),
    "error": ("#a8200d", "#ff9d8a"),
    "live": ("#0f6b3c", "#7fd3a2"),
    "stored": ("#5c5e62", "#a6a8ad"),
}
FONTS = ("system-ui", "-apple-system", "Segoe UI", "Roboto", "Helvetica Neue", "Arial", "sans-serif")


@dataclass(frozen=True)
class SystemColor:
    """A system's colour on a light page, on a dark page, and its dash in line charts (a plotly dash name)."""

    light: str
    dark: str
    dash: str = "solid"


ORIGINAL = SystemColor("#6b7684", "#aab4c0")

FAMILIES: dict[str, SystemColor] = {
    "lgtok": SystemColor("#0072b2", "#3b9fe0"),
    "mosa": SystemColor("#56b4e9", "#8fd0f5"),
    "momask": SystemColor("#e69f00", "#f2b53a"),
    "momask++": SystemColor("#d55e00", "#f0843c"),
    "mogo": SystemColor("#009e73", "#2fc296"),
    "t2mgpt": SystemColor("#cc79a7", "#e09cc2"),
    "mdm": SystemColor("#a3860a", "#b0a040"),
}
_VARIANT_STEPS = {"mid": 1, "mini": 2, "tiny": 3, "notext": 1, "withouttext": 1, "nolanguage": 1, "casim": 1,
                  "decoder": 1, "cross": 1, "momasklgtok": 1}  # fmt: skip
_STEP_LIGHTNESS = (0.0, 0.11, -0.11, 0.18)
_STEP_DASH = ("solid", "dash", "dot", "dashdot")


def family_of(system: str | None) -> str | None:
    """The family that a system's name starts with: "momask++-lite" -> "momask++"; None where it is none of ours."""
    name = re.sub(r"[^a-z0-9+]", "", (system or "").lower())
    name = re.sub(r"^momask(pp|plusplus)", "momask++", name)
    found = [family for family in FAMILIES if name.startswith(family)]
    return max(found, key=len) if found else None


def system_color(system: str | None) -> SystemColor:
    """Colour of a system by name; None, or a name of no known family, gets the neutral colour of the original."""
    family = family_of(system)
    if family is None:
        return ORIGINAL
    rest = re.sub(r"[^a-z0-9]", "", (system or "").lower())
    step = sum(size for word, size in _VARIANT_STEPS.items() if word in rest) % len(_STEP_DASH)
    base = FAMILIES[family]
    if not step:
        return base
    shift = _STEP_LIGHTNESS[step]
    return SystemColor(_shift_lightness(base.light, shift), _shift_lightness(base.dark, shift / 2), _STEP_DASH[step])


def hex_to_rgb(color: str) -> NDArray[np.uint8]:
    """'#rrggbb' -> uint8 [3]."""
    return np.array([int(color[i : i + 2], 16) for i in (1, 3, 5)], np.uint8)


def rgb_to_hex(rgb: NDArray[np.uint8]) -> str:
    """uint8 [3] -> '#rrggbb'."""
    return "#" + "".join(f"{int(channel):02x}" for channel in rgb)


def contrast(first: str, second: str) -> float:
    """WCAG contrast ratio of two '#rrggbb' colours, 1 to 21."""
    light, dark = sorted((_luminance(first), _luminance(second)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def oklch_to_rgb(
    lightness: NDArray[np.float64], chroma: NDArray[np.float64], hue: NDArray[np.float64]
) -> NDArray[np.uint8]:
    """OKLCH (Ottosson 2020; lightness 0-1, hue in radians; arrays [...]) -> sRGB uint8 [..., 3].

    Chroma outside sRGB is lowered until the colour exists, so lightness and hue stay what was asked for.
    """
    lightness, chroma, hue = np.broadcast_arrays(lightness, chroma, hue)
    low, high = np.zeros(chroma.shape), np.array(chroma, np.float64)
    for _ in range(14):
        middle = (low + high) / 2
        linear = _oklch_to_linear(lightness, middle, hue)
        fits = ((linear >= -1e-6) & (linear <= 1 + 1e-6)).all(axis=-1)
        low, high = np.where(fits, middle, low), np.where(fits, high, middle)
    linear = np.clip(_oklch_to_linear(lightness, low, hue), 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.round(encoded * 255).astype(np.uint8)


def rgb_to_oklab(rgb: NDArray[np.uint8]) -> NDArray[np.float64]:
    """sRGB uint8 [..., 3] -> OKLab [..., 3]."""
    return np.asarray(np.cbrt(_decode(rgb) @ _TO_LMS.T) @ _TO_LAB.T)


def code_colors(codebook: ArrayLike) -> NDArray[np.uint8]:
    """Colours of a codebook [V, D] -> uint8 [V, 3]: near codes look near, equal codes are equal.

    First principal component to hue, second to lightness (both by rank, so that colours spread evenly), in OKLCH.
    Lightness stays between 0.62 and 0.86: it shows on a light and on a dark page, and dark digits read on all of it.
    PlaygroundError if the codebook is not a finite matrix.
    """
    codes = np.asarray(codebook, np.float64)
    if codes.ndim != 2 or not codes.size or not np.isfinite(codes).all():
        raise PlaygroundError(f"a codebook must be a finite matrix [codes, width], got {list(codes.shape)}")
    centred = codes - codes.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    axes = axes[:, ::-1][:, :2]
    strongest = np.abs(axes).argmax(axis=0)
    axes = axes * np.where(axes[strongest, np.arange(axes.shape[1])] < 0, -1.0, 1.0)
    places = [_rank(column) for column in (centred @ axes).T]
    first, second = places[0], places[1] if len(places) > 1 else np.full(len(codes), 0.5)
    return oklch_to_rgb(0.62 + 0.24 * second, np.full(len(codes), 0.125), np.deg2rad(25.0 + 305.0 * first))


def css_variables() -> str:
    """The neutral tokens as CSS custom properties --mtp-*, light on :root and dark under .dark."""
    blocks = []
    for selector, mode in ((":root", 0), (":root.dark, .dark", 1)):
        lines = "".join(f"--mtp-{name}:{values[mode]};" for name, values in TOKENS.items())
        blocks.append(f"{selector}{{{lines}}}")
    sans = ", ".join(f'"{font}"' if " " in font else font for font in FONTS)
    return "\n".join([*blocks, f":root{{--mtp-sans:{sans};--mtp-radius:4px;}}"])


def _rank(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Place of each value among the distinct values, 0 to 1; 0.5 where all are equal."""
    spread = float(values.max() - values.min())
    if spread <= 1e-9 * max(1.0, float(np.abs(values).max())):
        return np.full(len(values), 0.5)
    distinct, inverse = np.unique(np.round(values / spread, 9), return_inverse=True)
    return np.asarray(inverse / (len(distinct) - 1), np.float64)


_TO_LMS = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
_TO_LAB = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)


def _decode(rgb: NDArray[np.uint8]) -> NDArray[np.float64]:
    value = np.asarray(rgb, np.float64) / 255
    return np.asarray(np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4))


def _oklch_to_linear(
    lightness: NDArray[np.float64], chroma: NDArray[np.float64], hue: NDArray[np.float64]
) -> NDArray[np.float64]:
    lab = np.stack([lightness, chroma * np.cos(hue), chroma * np.sin(hue)], axis=-1)
    return np.asarray((lab @ np.linalg.inv(_TO_LAB).T) ** 3 @ np.linalg.inv(_TO_LMS).T)


def _luminance(color: str) -> float:
    return float(_decode(hex_to_rgb(color)) @ np.array([0.2126, 0.7152, 0.0722]))


def _shift_lightness(color: str, shift: float) -> str:
    lightness, a, b = rgb_to_oklab(hex_to_rgb(color))
    moved = np.float64(np.clip(lightness + shift, 0.25, 0.92))
    return rgb_to_hex(oklch_to_rgb(np.asarray(moved), np.asarray(np.hypot(a, b)), np.asarray(np.arctan2(b, a))))
