"""The stage as a Gradio component and as a page of its own. The browser modules beside this file are the same in both.

In a room:

    stage = stage_component("tokenize", value=first_payload, height=320)   # figures, controls and score in one
    slot = score_slot("tokenize")                                          # optional: the score goes here instead

    button.click(run, inputs, stage, show_progress="hidden")    # run returns figures.stage.payload() or .message()
    button.click(None, None, None, js=stage_call("tokenize", "busy", "Tokenizing"))     # at once, in the browser
    slider.input(None, slider, None, js=stage_call("guidance", "setGuidance"))          # g: no server call
    stage.select(on_token, None, ...)       # def on_token(event: gr.EventData): event.selection is
                                            #   {"system", "scale" (1-based), "position" (0-based)} or None
    stage.span(on_span, None, ...)          # event.span: {"start", "stop"} (frames, stop not included) or None
    stage.pick_scale(on_scale, None, ...)   # event.scale: 1-based (keys 1-9) or None
    stage.hungry(on_hungry, None, stage)    # a motion that grows (payload's growing) wants its next piece; event.have:
                                            #   the frame that it begins with

In a notebook: IPython.display.HTML(stage_frame(payload)), or stage_page(payload) for a whole page.
In the browser: MotionStage.get(name) has setPayload, busy, fail, setGuidance, setScale, play, pause, finish, seek,
select, selectSpan, setSpanMode, getState, setState, snapshot, on, state. One name, one stage; hidden ones rest.

Links: getState() -> {frame, scale, mode, selection, span, speed}; on("state", listener) tells of it once it has come to
rest, and so does the DOM event "motion-stage-state" with detail {name, state}. setState(part of it) puts it back and
passes over what does not fit. MotionStage.restore(name, state) does so at every result until the visitor does
something, and may come before the stage; before MotionStage is there, push [name, state] to window.motionStageWishes.
"""

import html
import json
import re
from functools import lru_cache
from pathlib import Path
from typing import Any

import gradio as gr

from playground.figures.colors import css_variables
from playground.figures.stage import Json

_HERE = Path(__file__).parent
_MODULES = (
    "decode", "guidance", "colour", "store", "dom", "camera", "skeleton", "floor", "paint", "labels", "lanes", "rows",
    "strips", "figures", "cells", "heads", "light", "cursor", "score", "brush", "timeline", "toolbar", "gestures",
    "keys", "notices", "links", "pace", "snapshot", "remote", "surroundings", "growth", "ribbon", "stage", "index",
)  # fmt: skip
# The first stage that is shown fetches the modules, once a page; with stage_script() in its head a page has them.
_ON_LOAD = """
const start = () => {
  const options = JSON.parse(props.options);
  options.onEvent = (event, detail) => {
    if (event === "select") trigger("select", { selection: detail });
    if (event === "span") trigger("span", { span: detail });
    if (event === "scale") trigger("pick_scale", { scale: detail.scale });
    if (event === "hungry") trigger("hungry", detail);
  };
  const stage = MotionStage.mount(element.querySelector(".ms-host"), props.value || null, options);
  watch("value", () => stage.setPayload(props.value || null));
};
if (window.MotionStage) start();
else (window.motionStageLoading ??= server.stage_source().then((source) => new Function(source)())).then(start);
"""
_SLOT_ON_LOAD = """
const slot = [props.stage, element.querySelector(".ms-host")];
if (window.MotionStage) MotionStage.adoptScore(...slot);
else (window.motionStageSlots ??= []).push(slot);
"""
_HOST = '<div class="ms-host"></div>'


def stage_component(
    name: str,
    value: Json | str | None = None,
    height: int = 320,
    empty: str | None = None,
    autoplay: bool = True,
    **settings: Any,
) -> gr.HTML:
    """A stage inside a Blocks context: a gr.HTML whose value is a payload, as a dict or as JSON text.

    name: one word, unique on the page, by which stage_call and score_slot find it; height: of the figures, CSS pixels;
    empty: what to say while there is nothing; settings go to gr.HTML.
    """
    options: dict[str, Any] = {"name": name, "height": height, "autoplay": autoplay}
    if empty is not None:
        options["empty"] = empty
    return gr.HTML(
        value=value,
        html_template=_HOST,
        js_on_load=_ON_LOAD,
        server_functions=[stage_source],
        apply_default_css=False,
        options=json.dumps(options),
        **settings,
    )


def score_slot(name: str, **settings: Any) -> gr.HTML:
    """A place for the score (with its time axis) of the stage `name`, apart from its figures: across the page, say."""
    return gr.HTML(
        value="",
        html_template=_HOST,
        js_on_load=_SLOT_ON_LOAD,
        apply_default_css=False,
        stage=name,
        **settings,
    )


def stage_call(name: str, method: str, *arguments: Any) -> str:
    """JavaScript for `js=` of a Gradio listener that calls a method of a stage in the browser. Without arguments the
    listener's inputs are passed on; the inputs are returned unchanged, so Python may follow (Gradio reads an
    array as all inputs, so a single input that is a list stays inside one)."""
    given = json.dumps(list(arguments)) if arguments else "inputs"
    return (
        "(...inputs) => { "
        f"window.MotionStage?.get({json.dumps(name)})?.{method}(...{given}); "
        "return inputs.length === 1 && !Array.isArray(inputs[0]) ? inputs[0] : inputs; }"
    )


def stage_source(_: Any = None) -> str:
    """What the first stage of a page asks the server for."""
    return stage_script()


@lru_cache(maxsize=1)
def stage_script() -> str:
    """All modules as one classic script: it defines window.MotionStage once a page and brings its style sheet along."""
    modules = "".join(_module(name) for name in _MODULES)
    style = json.dumps((_HERE / "stage.css").read_text(encoding="utf-8")).replace("</", "<\\/")
    return (
        f"window.MotionStage ??= (() => {{\n{modules}"
        f"document.head.append(module_dom.el('style', {{ text: {style} }}));\n"
        "return { ...module_index, ...module_guidance };\n})();\n"
        "for (const slot of window.motionStageSlots || []) MotionStage.adoptScore(...slot);\n"
        "for (const wish of window.motionStageWishes || []) MotionStage.restore(...wish);\n"
    )


def _module(name: str) -> str:
    """One ES module as a function of its own scope: imports become constants, exports the object that it returns."""
    source = (_HERE / f"{name}.js").read_text(encoding="utf-8")
    source = re.sub(r'^import (\{[^}]*\}) from "\./(\w+)\.js";$', r"const \1 = module_\2;", source, flags=re.MULTILINE)
    exports = re.findall(r"^export (?:function|class|const) (\w+)", source, flags=re.MULTILINE)
    source = re.sub(r"^export (?=function|class|const)", "", source, flags=re.MULTILINE)
    return f"const module_{name} = (() => {{\n{source}return {{ {', '.join(exports)} }};\n}})();\n"


def stage_page(payload: Json, title: str = "Motion stage", height: int = 320, autoplay: bool = True) -> str:
    """A self-contained HTML page that shows a payload: no other file, no other host. Light or dark as the system is."""
    data = json.dumps(payload, separators=(",", ":")).replace("<", "\\u003c")
    options = json.dumps({"name": "page", "height": height, "autoplay": autoplay})
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{html.escape(title)}</title><link rel="icon" href="data:,">
<style>{css_variables()}
body{{margin:0;padding:8px;background:var(--mtp-bg)}}</style></head>
<body><main id="stage"></main>
<script type="application/json" id="payload">{data}</script>
<script>
const dark = matchMedia("(prefers-color-scheme: dark)");
const dress = () => document.documentElement.classList.toggle("dark", dark.matches);
dark.addEventListener("change", dress);
dress();
{stage_script()}
MotionStage.mount(document.getElementById("stage"), document.getElementById("payload").textContent, {options});
</script></body></html>
"""


def stage_frame(payload: Json, title: str = "Motion stage", height: int = 320, room: int | None = None) -> str:
    """The page in an iframe, for IPython.display.HTML. room: height of the frame in CSS pixels; by default all fits."""
    rows = sum(36 + 16 * len(track["levels"]) for track in payload.get("tracks", []))
    rows += sum(36 + (7 if strip["groups"] else 15) * len(strip["rows"]) for strip in payload.get("strips", []))
    page = html.escape(stage_page(payload, title, height), quote=True)
    tall = room or height + 130 + rows
    return f'<iframe title="{html.escape(title)}" srcdoc="{page}" style="width:100%;height:{tall}px;border:0"></iframe>'
