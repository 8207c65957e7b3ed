"""Room 2: where motions lie when tokens are read as vectors; a click puts a motion on the stage."""

import html
import time
from typing import TYPE_CHECKING, Any

import gradio as gr
import numpy as np

from playground.analysis.bundle import DECODED_NOTE, Bundle
from playground.errors import PlaygroundError
from playground.figures.embedding import embedding_maps
from playground.figures.theme import percent
from playground.ui.cards import term
from playground.ui.chart import chart
from playground.ui.errors import attach, message_place
from playground.ui.facts import Fact
from playground.ui.layout import panel, room_frame, stage_and_score, words
from playground.ui.links import arrival, asked, commits, link_door
from playground.ui.scenes import clip_scene, token_facts
from playground.ui.services import Services
from playground.ui.view import View

if TYPE_CHECKING:
    from playground.engine import SystemInfo

NAME = "embedding-map"
STAGE = "embedding"
LEAD = (
    "Each point is one recorded motion, placed by what its tokens mean to the decoder. Click one and it steps on the "
    "stage. Do its neighbours move alike?"
)
HEIGHT = 420
NEIGHBOURS = 4
DOING = "Decoding its tokens"
RING = """(id) => {
  document.dispatchEvent(new CustomEvent('mtp-pick', { detail: { chart: 'embedding-map', id } }));
  return id;
}"""


def first_clip(bundle: Bundle) -> int:
    """The clip to open with: of the largest action group, the one nearest to the group's middle."""
    names, counts = np.unique(bundle.actions, return_counts=True)
    rows = np.flatnonzero(np.asarray(bundle.actions) == names[counts.argmax()])
    middle = bundle.means[rows].mean(axis=0)
    return int(rows[np.square(bundle.means[rows] - middle).sum(axis=1).argmin()])


def neighbours(bundle: Bundle, row: int, count: int = NEIGHBOURS) -> list[int]:
    """Rows of the `count` clips nearest to a clip in all dimensions, nearest first."""
    distance = np.square(bundle.means - bundle.means[row]).sum(axis=1)
    distance[row] = np.inf
    return [int(other) for other in np.argsort(distance, kind="stable")[: min(count, len(bundle) - 1)]]


def label_of(bundle: Bundle, row: int) -> str:
    """A clip in a few words: our caption and where it was recorded."""
    clip = bundle.clips[row]
    return f"{clip.caption or clip.action} ({clip.source})"


def maps(bundle: Bundle, picked: str) -> str:
    """Both maps as Plotly JSON text, the clip `picked` ringed; the legend stands below, to leave the maps the width."""
    shadow = f"PCA, {percent(sum(bundle.explained))} of the variance"
    figure = embedding_maps(
        {f"t-SNE, perplexity {bundle.perplexity:g}": bundle.tsne, shadow: bundle.pca},
        bundle.actions,
        bundle.ids,
        notes=[f"{clip.action}<br>{label_of(bundle, row)}" for row, clip in enumerate(bundle.clips)],
        height=HEIGHT,
    )
    figure.update_layout(
        meta={"picked": picked},
        margin={"l": 8, "r": 8, "t": 28, "b": 64},
        legend={"orientation": "h", "x": 0, "y": -0.03, "xanchor": "left", "yanchor": "top"},
    )
    return str(figure.to_json())


def show(services: Services, system: "SystemInfo", bundle: Bundle, row: int) -> View:
    """Decode a clip of the bundle from its tokens and put it on the stage."""
    began = time.perf_counter()
    decoded = services.engine().decode(bundle.token_file(row))
    clip, levels = bundle.clips[row], bundle.levels(row)
    palettes = services.palettes(system.name)
    return View(
        stage=clip_scene(system, decoded.motion, levels, palettes, label_of(bundle, row), DECODED_NOTE),
        facts=(Fact(f"{bundle.errors_mm[row]:.0f} mm", "MPJPE", term("clip error")), *token_facts(levels)),
        controls={"id": clip.id, "label": label_of(bundle, row), "near": _near(bundle, row)},
        seconds=time.perf_counter() - began,
    )


def opening_view(services: Services) -> View:
    """The room's first result, maps included."""
    system = services.default_system()
    bundle = services.bundle(system.name)
    row = first_clip(bundle)
    view = show(services, system, bundle, row)
    view.charts["maps"] = maps(bundle, bundle.clips[row].id)
    view.controls["about"] = about(bundle)
    return view


def about(bundle: Bundle) -> str:
    """What the maps show and how far to trust them, as a line of HTML."""
    share, chance = percent(bundle.agreement), percent(bundle.chance)
    shared = f"{share} of the ten nearest neighbours share a clip's action, {chance} by chance"
    return f'<p class="mtp-aside">{html.escape(f"{bundle.provenance}. {shared}.")}</p>'


class Handlers:
    """What a click on the map and a choice among the neighbours do."""

    def __init__(self, services: Services) -> None:
        self.services = services

    def put(self, wanted: object) -> tuple[Any, ...]:
        """The clip of that id on the stage, its numbers, its neighbours."""
        system = self.services.default_system()
        bundle = self.services.bundle(system.name)
        view = show(self.services, system, bundle, bundle.position(str(wanted)))
        near = gr.update(choices=view.controls["near"], value=None)
        return view.stage_json(), view.facts_html(), near, view.controls["id"]

    def click(self, event: gr.EventData) -> tuple[Any, ...]:
        """A point of a map."""
        return self.put(event.id)

    def arrive(self, event: gr.EventData) -> tuple[Any, ...]:
        """The clip that a link asks for, or the one that the room opens with."""
        bundle, wanted = self.services.bundle(self.services.default_system().name), asked(event)["motion"]
        return self.put(wanted if wanted in bundle.ids else bundle.clips[first_clip(bundle)].id)

    def step(self, wanted: str | None) -> tuple[Any, ...]:
        """One of the neighbours."""
        if wanted is None:
            raise PlaygroundError("choose one of the neighbours")
        return self.put(wanted)


def room(services: Services) -> None:
    """Build the room inside the current tab."""
    opening = services.first_view(NAME, opening_view)
    with room_frame(STAGE):
        stage = stage_and_score(STAGE, opening)
        with panel("A map of motions", LEAD):
            plot = chart(
                opening.charts.get("maps"), label="Two maps of the same motions", height=HEIGHT, elem_id="embedding-map"
            )
            message = message_place("embedding-message")
            facts = gr.HTML(opening.facts_html(), elem_id="embedding-facts", apply_default_css=False)
            near = gr.Radio(
                opening.controls.get("near", []),
                value=None,
                label="Its nearest neighbours, in all dimensions; choose one to go there",
                elem_id="embedding-near",
            )
            gr.HTML(opening.controls.get("about", ""), elem_id="embedding-about", apply_default_css=False)
        words(NAME)
        current = gr.Textbox(opening.controls.get("id"), visible="hidden", elem_id="embedding-current")
        door = link_door(NAME)
    do = Handlers(services)
    shown = [stage, facts, near, current]
    attach(plot.pick, do.click, [], shown, message, stage=STAGE, doing=DOING, trigger_mode="always_last")
    current.change(None, [current], None, js=RING, api_visibility="private")
    commits(NAME, {"motion": current}, current.change, forget=("selection",))
    arrival(door, do.arrive, [], shown, message, room=NAME, stage=STAGE, doing=DOING)
    attach(near.input, do.step, [near], shown, message, stage=STAGE, doing=DOING)


def _near(bundle: Bundle, row: int) -> list[tuple[str, str]]:
    rows = neighbours(bundle, row)
    return [(bundle.clips[other].caption or bundle.clips[other].action, bundle.clips[other].id) for other in rows]
