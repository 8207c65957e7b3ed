"""Room 3: which codes are used, how evenly, at which scale; which are dead."""

from typing import Any

import gradio as gr

from playground.analysis.bundle import Bundle
from playground.errors import PlaygroundError
from playground.figures.theme import percent, readable
from playground.figures.usage import usage_panels, usage_summary
from playground.ui.cards import term
from playground.ui.chart import chart
from playground.ui.errors import attach, error_line, message_place
from playground.ui.facts import Fact, facts_line, table
from playground.ui.layout import panel, room_frame, words
from playground.ui.links import arrival, asked, commits, link_door
from playground.ui.services import Services
from playground.ui.view import View

NAME = "codebooks"
LEAD = (
    "Every scale has its own list of codes; a panel shows how often each of them is used. At the dashed line all would "
    "be used alike, on the ground a code is never used."
)
ORDERS = [("most used first", "sorted"), ("by number", "index")]
PANELS, SUMMARY = 410, 216


def panels(bundle: Bundle, title: str, order: str) -> str:
    """The histograms of all scales as Plotly JSON text. order: "sorted" or "index"."""
    return str(
        usage_panels({bundle.system: bundle.usage}, bundle.sizes, order=order, titles={bundle.system: title}).to_json()
    )


def summary(bundle: Bundle, title: str) -> str:
    """Share of codes used and perplexity over the scales, as Plotly JSON text."""
    figure = usage_summary({bundle.system: bundle.usage}, bundle.sizes, titles={bundle.system: title}, height=SUMMARY)
    return str(figure.to_json())


def scale_table(bundle: Bundle) -> str:
    """One row a scale, as an HTML table."""
    usage = bundle.usage
    rows = [
        [
            str(n + 1),
            str(size),
            str(codes),
            percent(usage.used_[n]),
            str(len(usage.dead_[n])),
            readable(usage.perplexity_[n]),
        ]
        for n, (size, codes) in enumerate(zip(bundle.sizes, bundle.codes, strict=True))
    ]
    return table(["scale", "tokens", "codes", "used", "dead", "perplexity"], rows, f"Measured on {bundle.provenance}")


def opening_view(services: Services) -> View:
    """All that the room shows."""
    system = services.default_system()
    bundle = services.bundle(system.name)
    usage = bundle.usage
    dead = sum(len(codes) for codes in usage.dead_)
    facts = (
        Fact(percent(usage.used_all_), f"of {sum(bundle.codes):,} codes used", term("codes used")),
        Fact(f"{dead:,}", "dead", term("dead code")),
        Fact(f"{int(usage.totals_.sum()):,}", "tokens counted"),
    )
    return View(
        stage={},
        facts=facts,
        charts={order: panels(bundle, system.title, order) for _, order in ORDERS}
        | {"summary": summary(bundle, system.title)},
        controls={"table": scale_table(bundle)},
        kind="stored",
    )


def room(services: Services) -> None:
    """Build the room inside the current tab."""
    opening = services.first_view(NAME, opening_view)
    trouble = opening.stage.get("message", "")
    with room_frame("codebooks"):
        with gr.Column(elem_classes=["mtp-main"], min_width=0):
            plot = chart(opening.charts.get("sorted"), label="How often each code is used, one panel a scale",
                         height=PANELS, elem_id="codebooks-panels", narrowest=820)  # fmt: skip
            chart(opening.charts.get("summary"), label="Share of codes used and perplexity, by scale", height=SUMMARY,
                  elem_id="codebooks-summary", narrowest=560)  # fmt: skip
        with panel("Which codes are used", LEAD):
            order = gr.Radio(ORDERS, value="sorted", label="Order of the codes", elem_id="codebooks-order")
            message = message_place("codebooks-message")
            gr.HTML(error_line(trouble) if trouble else facts_line(opening.facts), elem_id="codebooks-facts",
                    apply_default_css=False)  # fmt: skip
            gr.HTML(opening.controls.get("table", ""), elem_id="codebooks-table", apply_default_css=False)
        words("codebooks")
        door = link_door(NAME)

    def reorder(wanted: str) -> tuple[Any, ...]:
        if wanted not in opening.charts:
            raise PlaygroundError("codes are ordered by use or by number")
        return (opening.charts[wanted],)

    def arrive(event: gr.EventData) -> tuple[Any, ...]:
        wanted = asked(event)["order"]
        return wanted, *reorder(wanted)

    attach(order.input, reorder, [order], [plot], message, model=False)
    arrival(door, arrive, [], [order, plot], message, room=NAME, model=False)
    commits(NAME, {"order": order}, order.input)
