"""A Plotly figure on the page: our own small component, so that charts follow light and dark and report clicks.

Gradio's own plot neither tells which point was clicked nor knows our colours. The browser half is `chart.js`; Plotly's
script is the one inside the installed `plotly` package, served by us.
"""

from importlib.util import find_spec
from pathlib import Path

import gradio as gr

_TEMPLATE = """
<figure class="mtp-figure"><figcaption ${titled ? "" : "hidden"}>${label}</figcaption>
<div class="mtp-chart ${value ? 'is-coming' : ''}" role="img" aria-label="${label}"
 style="height:${height}px;min-width:${narrowest}px"></div></figure>
"""
_START = """
const start = () => window.mtpChart ? window.mtpChart(element, props, trigger, watch) : requestAnimationFrame(start);
start();  // triggers 'pick' with {id} at a click on a point, 'lasso' with {group, ids} when points are drawn round
"""


def plotly_script() -> Path:
    """The `plotly.min.js` of the installed plotly package, found without importing it."""
    spec = find_spec("plotly")
    if spec is None or not spec.submodule_search_locations:
        raise RuntimeError("the plotly package is not installed")
    return Path(spec.submodule_search_locations[0]) / "package_data" / "plotly.min.js"


def chart_script() -> str:
    """The browser half, to be put into the page's head once."""
    return (Path(__file__).parent / "chart.js").read_text(encoding="utf-8")


def chart(
    value: str | None = None,
    *,
    label: str,
    height: int,
    elem_id: str = "",
    show_label: bool = False,
    narrowest: int = 0,
) -> gr.HTML:
    """One chart. Its value is a Plotly figure as JSON text (`figure.to_json()`), or None for an empty place.

    label is read out to people who do not see the chart, and stands above it with show_label; height in pixels.
    Where the page is narrower than `narrowest` pixels, the chart scrolls sideways inside itself.
    `chart.pick(handler)` is called with event data whose `id` is the customdata of the clicked point;
    `chart.lasso(handler)` with the `group` that the page draws (chart.js, 'mtp-lasso') and the `ids` in it.
    """
    return gr.HTML(
        value=value,
        label=label,
        html_template=_TEMPLATE,
        js_on_load=_START,
        apply_default_css=False,
        elem_id=elem_id or None,
        elem_classes=["mtp-chart-block"],
        height=height,
        titled=show_label,
        narrowest=narrowest,
        plotly_url=f"gradio_api/file={plotly_script()}",
    )
