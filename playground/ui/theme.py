"""The look of the page: one table of design tokens, a Gradio theme made from it, and the page's style sheet.

Every colour, radius and type size of the page is a CSS variable `--mtp-*`: the neutral ones come from
figures/colors.py, a few more are declared here, each for light and dark. The stage,
the charts and the rooms use the variables and never a number of their own (ui.md, "Visual language"). Fonts are the
system's own; nothing is fetched.
"""

import inspect
from pathlib import Path

import gradio as gr
from gradio.themes.utils import colors, sizes

from playground.figures.colors import FONTS, css_variables

MONO = ("ui-monospace", "SF Mono", "Menlo", "Consolas", "Liberation Mono", "monospace")

# What a page needs beyond the neutral tokens of figures/colors.py: (light, dark).
EXTRA: dict[str, tuple[str, str]] = {
    "error-bg": ("#fdefec", "#351c18"),
    "note-bg": ("#eef3f8", "#1c2731"),
}

# Gradio's variable: our token. Each is set for light and dark, so Gradio's own palette never shows through.
GRADIO: dict[str, str] = {
    "body_background_fill": "bg",
    "body_text_color": "text",
    "body_text_color_subdued": "muted",
    "background_fill_primary": "surface",
    "background_fill_secondary": "sunken",
    "border_color_primary": "line",
    "border_color_accent": "line-strong",
    "border_color_accent_subdued": "line",
    "color_accent": "ink",
    "color_accent_soft": "sunken",
    "link_text_color": "focus",
    "link_text_color_hover": "focus",
    "link_text_color_active": "focus",
    "link_text_color_visited": "focus",
    "block_background_fill": "surface",
    "block_border_color": "line",
    "block_info_text_color": "muted",
    "block_label_background_fill": "surface",
    "block_label_border_color": "line",
    "block_label_text_color": "muted",
    "block_title_text_color": "muted",
    "panel_background_fill": "surface",
    "input_background_fill": "surface",
    "input_background_fill_focus": "surface",
    "input_background_fill_hover": "surface",
    "input_border_color": "line",
    "input_border_color_focus": "focus",
    "input_border_color_hover": "line-strong",
    "input_placeholder_color": "muted",
    "checkbox_background_color": "surface",
    "checkbox_background_color_selected": "ink",
    "checkbox_border_color": "muted",
    "checkbox_label_background_fill": "surface",
    "checkbox_label_background_fill_selected": "sunken",
    "checkbox_label_text_color": "ink",
    "error_background_fill": "error-bg",
    "error_border_color": "error",
    "error_text_color": "error",
    "error_icon_color": "error",
    "loader_color": "ink",
    "slider_color": "ink",
    "stat_background_fill": "ink",
    "table_border_color": "line",
    "table_even_background_fill": "surface",
    "table_odd_background_fill": "surface",
    "code_background_fill": "sunken",
    "button_primary_background_fill": "ink",
    "button_primary_background_fill_hover": "ink",
    "button_primary_border_color": "ink",
    "button_primary_text_color": "on-ink",
    "button_primary_text_color_hover": "on-ink",
    "button_secondary_background_fill": "surface",
    "button_secondary_background_fill_hover": "sunken",
    "button_secondary_border_color": "line",
    "button_secondary_border_color_hover": "line-strong",
    "button_secondary_text_color": "ink",
    "button_secondary_text_color_hover": "ink",
    "button_cancel_background_fill": "surface",
    "button_cancel_background_fill_hover": "sunken",
    "button_cancel_border_color": "line",
    "button_cancel_text_color": "ink",
    "button_cancel_text_color_hover": "ink",
}

PLAIN: dict[str, str] = {
    "block_border_width": "0px",
    "block_padding": "0px",
    "block_shadow": "none",
    "block_title_text_size": "12px",
    "block_title_text_weight": "500",
    "block_label_text_size": "12px",
    "form_gap_width": "0px",
    "layout_gap": "12px",
    "input_padding": "5px 8px",
    "input_border_width": "1px",
    "input_shadow": "none",
    "input_shadow_focus": "none",
    "button_large_padding": "6px 12px",
    "button_large_text_size": "14px",
    "button_large_text_weight": "500",
    "button_medium_padding": "6px 12px",
    "button_medium_text_size": "14px",
    "button_small_padding": "4px 10px",
    "button_small_text_size": "13px",
    "button_primary_shadow": "none",
    "button_secondary_shadow": "none",
    "button_transition": "background-color 0.12s",
    "shadow_drop": "none",
    "shadow_drop_lg": "0 4px 16px rgba(0, 0, 0, 0.16)",
}

_TEXT = sizes.Size(name="mtp_text", xxs="11px", xs="12px", sm="13px", md="14px", lg="16px", xl="20px", xxl="24px")
_RADIUS = sizes.Size(name="mtp_radius", xxs="4px", xs="4px", sm="4px", md="4px", lg="4px", xl="4px", xxl="4px")


def token_css() -> str:
    """The `--mtp-*` variables for light and dark, as CSS text: the shared table first, then the page's own."""
    light = "".join(f"  --mtp-{name}: {value};\n" for name, (value, _) in EXTRA.items())
    dark = "".join(f"  --mtp-{name}: {value};\n" for name, (_, value) in EXTRA.items())
    return f"{css_variables()}\n:root {{\n{light}}}\n:root.dark, .dark {{\n{dark}}}\n"


def style_sheet() -> str:
    """The whole style sheet of the page: the tokens, then `page.css`, then the other sheets beside it by name."""
    here = Path(__file__).parent
    names = ["page", *sorted(path.stem for path in here.glob("*.css") if path.stem != "page")]
    sheets = [(here / f"{name}.css").read_text(encoding="utf-8") for name in names]
    return token_css() + "".join(sheets)


def theme() -> gr.themes.Base:
    """The Gradio theme; every value points to a design token, so it follows light and dark by itself."""
    base = gr.themes.Base(
        primary_hue=colors.neutral,
        secondary_hue=colors.neutral,
        neutral_hue=colors.neutral,
        text_size=_TEXT,
        spacing_size=sizes.spacing_sm,
        radius_size=_RADIUS,
        font=FONTS,
        font_mono=MONO,
    )
    values = dict(PLAIN)
    for name, token in GRADIO.items():
        values[name] = values[f"{name}_dark"] = f"var(--mtp-{token})"
    accepted = inspect.signature(base.set).parameters  # a few names have no dark twin; theirs follow the token anyway
    return base.set(**{key: value for key, value in values.items() if key in accepted})
