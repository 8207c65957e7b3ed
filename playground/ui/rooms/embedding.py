"""Room 2: where motions lie when tokens are read as vectors; a click puts one on the stage, a lasso compares groups."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import gradio as gr

from playground.analysis.bundle import DECODED_NOTE, Bundle, stored_systems
from playground.errors import PlaygroundError
from playground.figures import stage as scene
from playground.limits import LIMITS
from playground.systems import row_of
from playground.ui.cards import term
from playground.ui.errors import Noted, attach
from playground.ui.facts import Fact
from playground.ui.layout import panel, room_frame, stage_and_score, words
from playground.ui.links import arrival, asked, commits, link_door
from playground.ui.mapping import (
    COLOURS,
    NEIGHBOURS,
    Shown,
    about,
    compare,
    coordinates,
    first_clip,
    listed,
    maps,
    neighbours,
)  # fmt: skip
from playground.ui.mapviews import FORGET, FREE, KEEP_GROUP, MOST, RING, SAVE, SELECT, Views, panel_views
from playground.ui.placing import Guest, generated_guest, guest_of, guest_scene
from playground.ui.previews import preview_card
from playground.ui.scenes import score, token_facts
from playground.ui.services import Services
from playground.ui.state import OWN_FILE
from playground.ui.tokencard import sentence
from playground.ui.uploads import Source, read_upload
from playground.ui.view import View

NAME = "embedding-map"
STAGE = "embedding"
STAGE_MAP = "embedding-map"  # the chart's element
LEAD = "Each point is a recorded motion, placed by what its tokens mean. Click one: do neighbours move alike?"
DOING, PLACING = "Decoding its tokens", "Placing it"


@dataclass
class Session:
    """What one visitor looks at."""

    guest: Guest | None = None
    groups: dict[str, list[str]] = field(default_factory=dict)  # "A", "B" -> ids of points


def map_systems(services: Services) -> list[str]:
    """The systems whose maps are stored and whose checkpoint is here."""
    stored = stored_systems(services.engine().assets / "analysis")
    return [system.name for system in services.shipped() if system.name in stored]


def first_systems(services: Services) -> list[str]:
    """Whose maps the room shows at first: two side by side, where two are stored."""
    return services.first_few(map_systems(services))[:2]


def show(services: Services, systems: Sequence[str], wanted: str) -> View:
    """A clip of the maps, decoded from its tokens by every system shown that has it, on the stage."""
    began = time.perf_counter()
    infos = {one.name: one for one in services.engine().systems()}
    figures: list[Any] = []
    tracks: list[Any] = []
    for name in systems:
        bundle = services.bundle(name)
        if wanted not in bundle.ids:
            continue
        row = bundle.position(wanted)
        decoded, levels = services.engine().decode(bundle.token_file(row)), bundle.levels(row)
        label = sentence(bundle, row)
        label = label[:1].upper() + label[1:]
        title, note = (label, DECODED_NOTE) if len(systems) == 1 else (infos[name].title, "decoded from its tokens")
        note = note if figures or len(systems) == 1 else f"{label}, {note}"
        figures.append(scene.figure(f"clip-{name}", title, decoded.motion.joints, name, note))
        tracks.append(score(infos[name], decoded.motion.frames, levels, services.palettes(name)))
    first = services.bundle(systems[0])
    row = first.position(wanted)
    return View(
        stage=scene.payload(figures[: LIMITS.max_figures], tracks, scene=wanted),
        facts=(
            *_whose(infos[systems[0]].title, len(systems)),
            Fact(f"{first.errors_mm[row]:.0f} mm", "MPJPE", term("clip error")),
            *token_facts(first.levels(row)),
        ),
        controls={"id": wanted, "near": listed(first, neighbours(first, row))},
        seconds=time.perf_counter() - began,
    )


def _whose(title: str, count: int) -> tuple[Fact, ...]:
    """Which of several systems the numbers and the neighbours are of."""
    card = "The numbers beside this and the neighbours below are of the first system in the list."
    return (Fact(title, "in numbers and neighbours", card),) if count > 1 else ()


def opening_view(services: Services) -> View:
    """The room's first result, maps included."""
    systems = first_systems(services)
    bundles = [services.bundle(name) for name in systems]
    view = show(services, systems, bundles[0].clips[first_clip(bundles[0])].id)
    view.charts["maps"] = maps(bundles, Shown(tuple(systems)), view.controls["id"])
    view.controls.update(about=about(bundles[0]), system=systems)
    return view


class Handlers:
    """What the room's controls do. `shown` of the room: stage, facts, neighbours and the id of the point."""

    def __init__(self, services: Services) -> None:
        self.services = services

    def draw(
        self, systems: Sequence[str], each: str, colour: str, kind: str, current: str, held: Session | None
    ) -> tuple[Any, ...]:
        """The maps again, the choice of colours, the groups and what is told of the maps."""
        held = held or Session()
        shown, bundles = self._shown(systems, each, colour, kind)
        held = replace(held, groups={})
        choices = gr.update(choices=COLOURS[shown.each], value=shown.colour)
        return held, self._maps(held, shown, bundles, current), choices, "", about(bundles[0])

    def choose(
        self, systems: Sequence[str], each: str, colour: str, kind: str, current: str, held: Session | None
    ) -> tuple[Any, ...]:
        """Other systems: the maps, and what was on the stage as these systems have it."""
        drawn = self.draw(systems, each, colour, kind, current, held)
        guest = drawn[0].guest
        if guest is None:
            return *drawn, *self.put(current, systems)
        return *drawn, *self._of_guest(guest, self._known(systems)), current

    def put(self, wanted: object, systems: Sequence[str]) -> tuple[Any, ...]:
        """A point by its id (for a token "clip/scale/position"): its clip on the stage, its numbers, its neighbours."""
        text = str(wanted)
        view = show(self.services, self._known(systems), text.split("/")[0])
        near = gr.update(choices=view.controls["near"], value=None, label=NEAR)
        return view.stage_json(), view.facts_html(), near, text

    def click(self, systems: Sequence[str], event: gr.EventData) -> tuple[Any, ...]:
        """A point of a map."""
        return self.put(event.id, systems)

    def step(self, wanted: str | None, systems: Sequence[str]) -> tuple[Any, ...]:
        """One of the neighbours."""
        if wanted is None:
            raise PlaygroundError("choose one of the neighbours")
        return self.put(wanted, systems)

    def lasso(self, systems: Sequence[str], each: str, held: Session | None, event: gr.EventData) -> tuple[Any, ...]:
        """A group that was drawn round points."""
        held = held or Session()
        if event.group not in ("A", "B") or not isinstance(event.ids, list):
            raise PlaygroundError("draw round some points to make a group")
        groups = {**held.groups, event.group: [str(id) for id in event.ids[:100_000]]}
        held = replace(held, groups=groups)
        bundle = self.services.bundle(self._known(systems)[0])
        return held, compare(bundle, each, groups.get("A", []), groups.get("B", []))

    def forget(self, held: Session | None) -> tuple[Any, ...]:
        """No groups any more."""
        return replace(held or Session(), groups={}), "", "off"

    def place_example(self, wanted: str, *rest: Any) -> tuple[Any, ...]:
        """An example as a new point."""
        found = self.services.example(wanted)
        source = Source(found.motion(), found.title)
        return self._place(lambda system: guest_of(self.services, source, found.caption, system), *rest)

    def place_upload(self, path: str | None, *rest: Any) -> tuple[Any, ...]:
        """A file of the visitor's own as a new point."""
        source = read_upload(path)
        return self._place(lambda system: guest_of(self.services, source, source.caption, system), *rest)

    def place_prompt(self, prompt: str, *rest: Any) -> tuple[Any, ...]:
        """A generation as a new point."""
        return self._place(lambda system: generated_guest(self.services, prompt, system), *rest)

    def _place(
        self, make: Any, systems: Sequence[str], each: str, colour: str, kind: str, current: str, held: Session | None
    ) -> tuple[Any, ...]:
        shown, bundles = self._shown(systems, each, colour, kind)
        guest: Guest = make(shown.systems[0])
        told = self._of_guest(guest, shown.systems)
        held = replace(held or Session(), guest=guest)
        return held, self._maps(held, shown, bundles, ""), *told

    def _of_guest(self, guest: Guest, systems: Sequence[str]) -> tuple[Any, ...]:
        """A new point on the stage, its numbers and its neighbours, as the first of the systems has them."""
        first, bundle = guest.on(self.services, tuple(systems), "clip")[systems[0]], self.services.bundle(systems[0])
        told = (*_whose(row_of(systems[0]).title, len(systems)), *token_facts(guest.results[systems[0]].levels))
        view = View(guest_scene(self.services, guest, tuple(systems)), told, seconds=first.seconds)
        rows = [bundle.position(id) for id in first.nearest if id in bundle.ids][:NEIGHBOURS]
        near = gr.update(choices=listed(bundle, rows), value=None, label=f"Nearest in all dimensions to: {guest.title}")
        return view.stage_json(), view.facts_html(), near

    def csv(self, systems: Sequence[str], each: str) -> tuple[Any, ...]:
        """All coordinates as CSV text."""
        return (coordinates([self.services.bundle(name) for name in self._known(systems)], each),)

    def arrive(self, held: Session | None, event: gr.EventData) -> tuple[Any, ...]:
        """What a link asks for."""
        state = asked(event)
        systems = [name for name in state["system"] or () if name in map_systems(self.services)]
        systems = systems[:MOST] or first_systems(self.services)
        bundle, wanted = self.services.bundle(systems[0]), state["motion"]
        wanted = wanted if wanted in bundle.ids else bundle.clips[first_clip(bundle)].id
        drawn = self.draw(systems, state["each"], state["colour"], state["map"], wanted, held)
        kept = [systems, state["each"], state["map"], *drawn, *self.put(wanted, systems)]
        settings = (systems, state["each"], state["colour"], state["map"], wanted, kept[3])
        known, own = {example.id for example in self.services.examples()}, str(state["place"] or "")
        if state["prompt"]:
            kept[3], kept[4], *kept[8:11] = self.place_prompt(state["prompt"], *settings)
        elif own in known:
            kept[3], kept[4], *kept[8:11] = self.place_example(own, *settings)
        elif own.startswith(OWN_FILE):
            kept[8] = Noted(kept[8], f"The point placed here was its maker's own, {own.removeprefix(OWN_FILE)}.")
        return *kept, state["prompt"] or ""

    def _maps(self, held: Session, shown: Shown, bundles: list[Bundle], current: str) -> str:
        placed = held.guest.on(self.services, shown.systems, shown.each) if held.guest else {}
        return maps(bundles, shown, current, placed)

    def _known(self, systems: Sequence[str]) -> list[str]:
        known = [name for name in map_systems(self.services) if name in systems]
        if not known:
            raise PlaygroundError("choose at least one of the systems whose maps are stored")
        return known[:MOST]

    def _shown(self, systems: Sequence[str], each: str, colour: str, kind: str) -> tuple[Shown, list[Bundle]]:
        shown = Shown(tuple(self._known(systems)), str(each), str(colour), str(kind)).checked()
        return shown, [self.services.bundle(name) for name in shown.systems]


NEAR = "Its nearest neighbours, in all dimensions; choose one to go there"


def room(services: Services) -> None:
    """Build the room inside the current tab."""
    opening = services.first_view(NAME, opening_view)
    session = gr.State(Session(), time_to_live=LIMITS.session_seconds)
    with room_frame(STAGE):
        stage = stage_and_score(STAGE, opening)
        with panel("A map of motions", LEAD, compare=True):
            views = panel_views(services, map_systems(services), opening, NEAR)
        words(NAME)
        door = link_door(NAME)
        preview_card(services, STAGE_MAP)
    _bind(Handlers(services), views, session, stage, door)


def _bind(do: Handlers, views: Views, session: gr.State, stage: gr.HTML, door: gr.HTML) -> None:
    how: dict[str, Any] = {"message": views.message}
    settings = [views.system, views.each, views.colour, views.map, views.current, session]
    drawn = [session, views.plot, views.colour, views.groups, views.about]
    shown = [stage, views.facts, views.near, views.current]
    busy: dict[str, Any] = {**how, "stage": STAGE, "doing": DOING}
    attach(views.system.input, do.choose, settings, [*drawn, *shown], trigger_mode="always_last", **busy)
    for event in (views.each.input, views.colour.input, views.map.input):
        attach(event, do.draw, settings, drawn, **how)
    for event in (views.system.input, views.each.input, views.colour.input, views.map.input):
        event(None, None, None, js=FORGET, api_visibility="private")
    clicked = attach(views.plot.pick, do.click, [views.system], shown, trigger_mode="always_last", **busy)
    clicked.then(None, [views.current], None, js=SELECT, api_visibility="private")
    attach(views.near.input, do.step, [views.near, views.system], shown, **busy)
    views.current.change(None, [views.current], None, js=RING, api_visibility="private")
    views.drag.input(None, [views.drag], None, js=KEEP_GROUP, api_visibility="private")
    attach(views.plot.lasso, do.lasso, [views.system, views.each, session], [session, views.groups], model=False, **how)
    attach(views.clear.click, do.forget, [session], [session, views.groups, views.drag], model=False, **how)
    views.clear.click(None, None, None, js=FREE, api_visibility="private")
    placed = [session, views.plot, stage, views.facts, views.near]
    placing: dict[str, Any] = {**busy, "doing": PLACING}
    attach(views.example.input, do.place_example, [views.example, *settings], placed, **placing)
    attach(views.upload.upload, do.place_upload, [views.upload, *settings], placed, **placing)
    for event in (views.go.click, views.prompt.submit):
        attach(event, do.place_prompt, [views.prompt, *settings], placed, **placing)
    saved = attach(views.csv.click, do.csv, [views.system, views.each], [views.text], model=False, **how)
    saved.then(None, [views.text], None, js=SAVE, api_visibility="private")
    everything = [views.system, views.each, views.map, *drawn, *shown, views.prompt]
    arrival(door, do.arrive, [session], everything, room=NAME, **busy)
    commits(NAME, {"motion": views.current}, views.current.change, forget=("selection",))
    commits(NAME, {"system": views.system}, views.system.input)
    commits(NAME, {"each": views.each}, views.each.input)
    commits(NAME, {"colour": views.colour}, views.colour.change)
    commits(NAME, {"map": views.map}, views.map.input)
    commits(NAME, {"place": views.example}, views.example.input, forget=("prompt", "selection"))
    commits(NAME, {"place": views.upload}, views.upload.upload, forget=("prompt", "selection"))
    commits(NAME, {"prompt": views.prompt}, views.go.click, views.prompt.submit, forget=("place", "selection"))
