"""Room 3: which codes are used, how evenly, at which scale; which are dead; what one of them stands for."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import gradio as gr

from playground.analysis.bundle import Bundle, stored_systems
from playground.errors import PlaygroundError
from playground.figures import stage as scene
from playground.figures.coverage import usage_lines
from playground.figures.theme import percent, readable
from playground.figures.usage import usage_panels
from playground.systems import row_of
from playground.ui.cards import term
from playground.ui.chart import chart
from playground.ui.errors import attach, error_line, message_place
from playground.ui.facts import Fact, facts_line, table
from playground.ui.inspector import inspector
from playground.ui.layout import panel, room_frame, words
from playground.ui.links import arrival, asked, commits, link_door
from playground.ui.services import Services
from playground.ui.stage.component import stage_component
from playground.ui.state import control
from playground.ui.tokencard import code_card
from playground.ui.uploads import checked_number
from playground.ui.view import View

NAME = "codebooks"
LEAD = (
    "Every scale has its own list of codes; a panel shows how often each is used. The dashed line is even use. "
    "Click a curve: what does that code stand for?"
)
ORDERS = [("most used first", "sorted"), ("by number", "index")]
PANELS, LINES, FIGURE = 410, 200, 196  # pixels
DOING = "Decoding the code"
PROTOTYPE = "its scale alone, all tokens this code, no words"


@dataclass(frozen=True)
class Wish:
    """What the controls ask for."""

    systems: tuple[str, ...]
    order: str
    k: int

    @classmethod
    def checked(cls, services: Services, systems: Sequence[str], order: object, k: object) -> "Wish":
        """From the controls. PlaygroundError for what the room does not have."""
        known = shown_systems(services)
        if not systems or any(name not in known for name in systems):
            raise PlaygroundError("choose at least one of the systems whose code usage is stored")
        if order not in [value for _, value in ORDERS]:
            raise PlaygroundError("codes are ordered by use or by number")
        low, high = control(NAME, "k").low, control(NAME, "k").high
        return cls(tuple(name for name in known if name in systems), str(order), int(checked_number(k, "k", low, high)))


def shown_systems(services: Services) -> list[str]:
    """The systems whose analysis is stored and whose checkpoint is here, in the order of the table."""
    stored = stored_systems(services.engine().assets / "analysis")
    return [system.name for system in services.shipped() if system.name in stored]


def panels(services: Services, wish: Wish) -> str:
    """How often each code is used, scale by scale, as Plotly JSON text: all systems that have as many scales as the
    first one."""
    bundles = [services.bundle(name) for name in wish.systems]
    alike = [bundle for bundle in bundles if len(bundle.sizes) == len(bundles[0].sizes)]
    titles = {bundle.system: row_of(bundle.system).title for bundle in alike}
    usages = {bundle.system: bundle.usage for bundle in alike}
    sizes = [
        found.pop() if len(found) == 1 else None for found in map(set, zip(*(b.sizes for b in alike), strict=True))
    ]
    figure = usage_panels(usages, sizes, order=wish.order, titles=titles)
    figure.update_layout(hoverdistance=60)
    return str(figure.to_json())


def lines(services: Services, wish: Wish) -> str:
    """Codes used, perplexity and share of the top k over the scales, as Plotly JSON text."""
    usages = {name: services.bundle(name).usage for name in wish.systems}
    titles = {name: row_of(name).title for name in wish.systems}
    return str(usage_lines(usages, wish.k, titles=titles, height=LINES).to_json())


def scale_table(services: Services, wish: Wish) -> str:
    """One row a scale of every system, as HTML tables."""
    return "".join(_table(services.bundle(name), wish.k) for name in wish.systems)


def _table(bundle: Bundle, k: int) -> str:
    usage, covered = bundle.usage, bundle.usage.coverage(k)
    rows = [
        [str(n + 1), str(size), str(codes), percent(usage.used_[n]), str(len(usage.dead_[n])),
         readable(usage.perplexity_[n]), percent(covered[n])]
        for n, (size, codes) in enumerate(zip(bundle.sizes, bundle.codes, strict=True))
    ]  # fmt: skip
    heads = ["scale", "tokens", "codes", "used", "dead", "perplexity", f"top {k} cover"]
    return table(heads, rows, f"Measured on {bundle.provenance}")


def facts(services: Services, wish: Wish) -> tuple[Fact, ...]:
    """Numbers of the first system over all its scales."""
    bundle = services.bundle(wish.systems[0])
    usage = bundle.usage
    dead = sum(len(codes) for codes in usage.dead_)
    return (
        *_whose(services, wish),
        Fact(percent(usage.used_all_), f"of {sum(bundle.codes):,} codes used", term("codes used")),
        Fact(f"{dead:,}", "dead", term("dead code")),
        Fact(f"{int(usage.totals_.sum()):,}", "tokens counted"),
    )


def _whose(services: Services, wish: Wish) -> tuple[Fact, ...]:
    """Which of several systems the numbers are of, and which ones have no panels."""
    if len(wish.systems) == 1:
        return ()
    bundles = [services.bundle(name) for name in wish.systems]
    other = [row_of(one.system).title for one in bundles if len(one.sizes) != len(bundles[0].sizes)]
    card = "The numbers beside this are of the first system in the list; the lines and the table show all."
    card += f" Panels show as many scales as it has: none for {' and '.join(other)}." if other else ""
    return (Fact(row_of(wish.systems[0]).title, "in numbers and panels", card),)


def code_view(services: Services, system: str, scale: int, code: int) -> View:
    """The motion that a code stands for, and its card."""
    began = time.perf_counter()
    engine, bundle = services.engine(), services.bundle(system)
    made = engine.prototype(system, scale, code)
    palette = services.palettes(system)[scale - 1]
    like = engine.neighbours(system, scale, code) if len(palette) > 1 else None
    title = f"Code {code} of scale {scale}, {row_of(system).title}"
    shown = scene.figure("prototype", title, made.motion.joints, system, PROTOTYPE)
    return View(
        stage=scene.payload([shown], scene=f"{system}.{scale}.{code}"),
        controls={"code": f"{system}.{scale}.{code}", "card": code_card(bundle, scale, code, like, palette)},
        seconds=time.perf_counter() - began,
    )


def opening_view(services: Services) -> View:
    """All that the room shows at first: the usual system, and the code that its first scale uses most."""
    systems = services.first_few(shown_systems(services))
    first = systems[0]
    wish = Wish(tuple(systems), "sorted", int(control(NAME, "k").default))
    view = code_view(services, *place_of(first_code(services, first)))
    charts = {"panels": panels(services, wish), "lines": lines(services, wish)}
    told = {**view.controls, "table": scale_table(services, wish), "system": systems}
    return View(view.stage, facts(services, wish), charts, told, "stored", view.seconds)


def first_code(services: Services, system: str) -> str:
    """The code that the first scale of a system uses most, as "system.scale.code"."""
    return f"{system}.1.{int(services.bundle(system).usage.counts_[0].argmax())}"


def place_of(text: object) -> tuple[str, int, int]:
    """("lgtok", 5, 201) from "lgtok.5.201". PlaygroundError for anything else."""
    system, *numbers = str(text).rsplit(".", 2)
    if len(numbers) != 2 or not all(number.isascii() and number.isdigit() and len(number) < 7 for number in numbers):
        raise PlaygroundError("choose a code by a click on a curve")
    return row_of(system).name, int(numbers[0]), int(numbers[1])


class Handlers:
    """What the controls do."""

    def __init__(self, services: Services, opening: View) -> None:
        self.services = services
        self.opening = opening

    def draw(self, systems: Sequence[str], order: str, k: float) -> tuple[Any, ...]:
        """Both charts, the numbers and the table."""
        services, wish = self.services, Wish.checked(self.services, systems, order, k)
        told = facts_line(facts(services, wish))
        return panels(services, wish), lines(services, wish), told, scale_table(services, wish)

    def choose(self, systems: Sequence[str], order: str, k: float, current: str) -> tuple[Any, ...]:
        """Other systems: what `draw` gives, and a code of one of them on the stage."""
        drawn, shown = self.draw(systems, order, k), [name for name in shown_systems(self.services) if name in systems]
        kept = current.rsplit(".", 2)[0] in shown
        return *drawn, *self.show(current if kept else first_code(self.services, shown[0]))

    def show(self, text: object) -> tuple[Any, ...]:
        """A code by its "system.scale.code": the stage, the card, and the same text for the address."""
        view = code_view(self.services, *place_of(text))
        return view.stage_json(), view.controls["card"], view.controls["code"]

    def pick(self, event: gr.EventData) -> tuple[Any, ...]:
        """A point of a curve."""
        return self.show(event.id)

    def act(self, current: str, event: gr.EventData) -> tuple[Any, ...]:
        """A button of the card: a code of the same scale."""
        system, scale, _ = place_of(current)
        return self.show(f"{system}.{scale}.{event.code}")

    def arrive(self, event: gr.EventData) -> tuple[Any, ...]:
        """What a link asks for; what is not stored here gives way to what the room opens with."""
        state = asked(event)
        known = shown_systems(self.services)
        systems = [name for name in state["system"] or () if name in known] or self.services.first_few(known)
        drawn = self.draw(systems, state["order"], state["k"])
        try:
            shown = self.show(state["code"] or self.opening.controls.get("code"))
        except PlaygroundError:
            shown = self.show(self.opening.controls.get("code"))
        return systems, state["order"], state["k"], *drawn, *shown


def room(services: Services) -> None:
    """Build the room inside the current tab."""
    opening = services.first_view(NAME, opening_view)
    trouble = opening.stage.get("message", "")
    with room_frame(NAME):
        with gr.Column(elem_classes=["mtp-main"], min_width=0):
            plot = chart(opening.charts.get("panels"), label="How often each code is used, one panel a scale",
                         height=PANELS, elem_id="codebooks-panels", narrowest=820)  # fmt: skip
            over = chart(opening.charts.get("lines"), label="Codes used, perplexity and top codes, by scale",
                         height=LINES, elem_id="codebooks-summary", narrowest=720)  # fmt: skip
            with gr.Accordion("All numbers, scale by scale", open=False, elem_classes=["mtp-fold"]):
                numbers = gr.HTML(opening.controls.get("table", ""), elem_id="codebooks-table", apply_default_css=False)
        with panel("Which codes are used", LEAD, compare=True):
            system, order, k = _controls(services, opening)
            message = message_place("codebooks-message")
            known = gr.HTML(error_line(trouble) if trouble else facts_line(opening.facts), elem_id="codebooks-facts",
                            apply_default_css=False)  # fmt: skip
            stage = stage_component(NAME, opening.stage_json(), FIGURE, elem_id="codebooks-stage", container=False,
                                    elem_classes=["mtp-small-stage"])  # fmt: skip
            card = inspector(opening.controls.get("card", ""), elem_id="codebooks-card")
            current = gr.Textbox(opening.controls.get("code"), visible="hidden", elem_id="codebooks-current")
        words(NAME)
        door = link_door(NAME)
    do = Handlers(services, opening)
    drawn, shown = [plot, over, known, numbers], [stage, card, current]
    look: dict[str, Any] = {"message": message, "stage": NAME, "doing": DOING, "trigger_mode": "always_last"}
    attach(system.input, do.choose, [system, order, k, current], [*drawn, *shown], **look)
    for event in (order.input, k.release):
        attach(event, do.draw, [system, order, k], drawn, message, model=False, trigger_mode="always_last")
    attach(plot.pick, do.pick, [], shown, **look)
    attach(card.act, do.act, [current], shown, **look)
    arrival(door, do.arrive, [], [system, order, k, *drawn, *shown], message, room=NAME, stage=NAME, doing=DOING)
    commits(NAME, {"system": system}, system.input)
    commits(NAME, {"order": order}, order.input)
    commits(NAME, {"k": k}, k.release)
    commits(NAME, {"code": current}, current.change)


def _controls(services: Services, opening: View) -> tuple[gr.Dropdown, gr.Radio, gr.Slider]:
    """Systems (where there are several), order and k."""
    names = shown_systems(services)
    row = control(NAME, "k")
    system = gr.Dropdown(
        [(row_of(name).title, name) for name in names], value=opening.controls.get("system", []), multiselect=True,
        label="Systems", elem_id="codebooks-system", elem_classes=["mtp-several"], visible=len(names) > 1,
    )  # fmt: skip
    with gr.Row(elem_classes=["mtp-line", "mtp-scales"]):
        order = gr.Radio(
            ORDERS, value="sorted", label=control(NAME, "order").label, elem_id="codebooks-order",
            elem_classes=["mtp-segments"], min_width=0,
        )  # fmt: skip
        k = gr.Slider(
            row.low, row.high, value=row.default, step=1, label=row.label, elem_id="codebooks-k", min_width=80
        )
    return system, order, k
