"""Export: what stands on a stage as files: the motion as BVH, GLB or npz, the tokens as JSON, films and pose strips.

The browser sends what it shows (the joints as drawn, so a guidance slider counts; the tokens of the score), it is
checked here, and a file in gradio's cache goes back, which gradio deletes after LIMITS.session_seconds. Pictures are
rendered in a process of their own: it ends when the visitor stops it, leaves, or takes longer than
LIMITS.picture_seconds. A room needs nothing for this but a stage whose element is called `<name>-stage`, and charts
made by `chart.chart`. Plots as PNG, SVG and CSV never leave the browser: export.js.
"""

import base64
import queue
import re
import secrets
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gradio as gr
import numpy as np

from playground.errors import PlaygroundError
from playground.figures.pictures import Actor
from playground.figures.video import write_job
from playground.limits import LIMITS
from playground.motion.motion import Motion
from playground.motion.skeleton import HUMAN22
from playground.systems import row_of
from playground.text.prompts import normalise
from playground.tokenizers.token_file import LevelTokens, TokenFile
from playground.ui.complete import complete
from playground.ui.facts import as_sentence
from playground.ui.services import Services
from playground.ui.state import State, parse

MOTIONS, PICTURES, TOKENS = ("bvh", "glb", "npz"), ("mp4", "gif", "png"), "json"
ROOT = Path(__file__).parents[2]
TOLD_EVERY = 0.3  # seconds between two words about progress
UNREADABLE = "this result cannot be exported; reload the page and try again"
_COLOR = re.compile(r"#[0-9a-fA-F]{6}")
_CHANNEL = """
const open = () => window.mtpExport
  ? mtpExport.channel({
      write: (wish) => trigger("ask_file", { wish }), render: (wish) => trigger("ask_picture", { wish }),
      stop: (run) => trigger("ask_stop", { run }),
    })
  : requestAnimationFrame(open);
open();
watch("value", () => window.mtpExport.hear(props.value));
"""


@dataclass
class Control:
    """What a running export and its "Stop" share."""

    stop: bool = False
    stopped: object = None  # number of the run that was stopped last: "Stop" may arrive before its run begins


@dataclass(frozen=True, eq=False)
class Wish:
    """What is to be written, checked."""

    kind: str
    state: State
    actors: tuple[Actor, ...] = ()
    dark: bool = False
    tokens: TokenFile | None = None

    @property
    def file_name(self) -> str:
        """A name that says what it is and that every system takes."""
        values = self.state.values
        words = [self.state.room, str(values.get("prompt") or values.get("motion") or "")]
        words += [f"seed {values['seed']}"] if "seed" in values else []
        words += [self.actors[0].name] if len(self.actors) == 1 else []
        words += ["strip"] if self.kind == "png" else []
        return f"{slug(' '.join(words))}.{self.kind}"


def slug(text: str) -> str:
    """Text as a part of a file name: lower case letters, digits and dashes, 60 at most, never empty."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode().lower()
    return re.sub(r"[^a-z0-9]+", "-", plain).strip("-")[:60].strip("-") or "motion"


def read_wish(services: Services, detail: Any) -> Wish:
    """What the browser asks for. PlaygroundError if it is nothing that a stage can hold.

    detail: {"kind", "query", "dark", "figures": [{"name", "caption", "color", "joints": base64 of float32 [F, 22, 3]}],
    "track": {"system", "frames", "levels": [{"codes", "ids"}]}}; figures for a motion or a picture, track for tokens.
    """
    try:
        kind, state = str(detail["kind"]), parse(str(detail["query"]))
        if kind not in (*MOTIONS, *PICTURES, TOKENS):
            raise PlaygroundError(f"{kind[:12]!r} is nothing that can be exported")
        if kind == TOKENS:
            return Wish(kind, state, tokens=_tokens(services, detail["track"], state))
        most = LIMITS.max_figures if kind in PICTURES else 1
        actors = tuple(_actor(figure) for figure in detail["figures"][:most])
        if not actors:
            raise PlaygroundError("there is no figure to export")
        return Wish(kind, state, actors, bool(detail.get("dark")))
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        if isinstance(error, PlaygroundError):
            raise
        raise PlaygroundError(UNREADABLE) from error


def _actor(figure: dict[str, Any]) -> Actor:
    text, width = str(figure["joints"]), 3 * HUMAN22.size
    if len(text) > 4 * (LIMITS.max_frames + 1) * width * 4 // 3 + 8:
        raise PlaygroundError(f"a figure has at most {LIMITS.max_frames + 1} frames to export")
    values = np.frombuffer(base64.b64decode(text, validate=True), "<f4")
    color = str(figure["color"])
    if not _COLOR.fullmatch(color):
        raise PlaygroundError(UNREADABLE)
    return Actor(_line(figure["name"]), values.reshape(-1, HUMAN22.size, 3), color, _line(figure.get("caption", "")))


def _line(text: Any) -> str:
    return " ".join("".join(c if c.isprintable() else " " for c in str(text)).split())[:60]


def _tokens(services: Services, track: dict[str, Any], state: State) -> TokenFile:
    """The token file of a track of the score; its caption is what the state says."""
    system, frames = row_of(str(track["system"])).name, int(track["frames"])
    levels = [
        LevelTokens(len(row["ids"]), int(row["codes"]), np.array(row["ids"], np.int64)) for row in track["levels"]
    ]
    given = [(level.size, level.codes) for level in levels]
    if not levels or not 1 <= frames <= LIMITS.max_frames or given != services.sizes(system, frames):
        raise PlaygroundError("only a motion with the tokens of all scales can be exported; let it finish first")
    file = TokenFile(system, services.checkpoint(system), caption_of(services, state), frames, tuple(levels))
    return TokenFile.from_json(file.to_json(), "this score")


def caption_of(services: Services, state: State) -> str:
    """The text that goes with the motion that a room shows."""
    full = complete(services, state)
    if state.room == "embedding-map":
        bundle = services.bundle(str(full.system))
        return bundle.clips[bundle.position(full["motion"])].caption
    if state.room == "generate":
        return "" if full["free"] else normalise(full["prompt"])
    return normalise(full["caption"], what="caption", allow_empty=True)


def write(wish: Wish, folder: Path) -> tuple[Path, list[str]]:
    """Write a motion or a token file into the folder; returns its path and what was changed to fit the format."""
    path = folder / wish.file_name
    if wish.tokens is not None:
        path.write_text(wish.tokens.to_json(), encoding="utf-8")
        return path, []
    from playground.motion.formats import write_motion

    actor = wish.actors[0]
    return path, write_motion(Motion(actor.joints.astype(np.float32), name=actor.name), path)


def render(wish: Wish, folder: Path, control: Control) -> Iterator[tuple[int, int] | Path]:
    """Render a picture in a process of its own: (done, total) from time to time, then the path of the file.

    PlaygroundError if it was stopped, took too long or failed. The process never outlives this generator.
    """
    path, end = folder / wish.file_name, time.monotonic() + LIMITS.picture_seconds
    with tempfile.TemporaryDirectory(prefix="picture-") as own:
        job = Path(own) / "job.npz"
        write_job(job, wish.actors, wish.dark, _note(wish))
        command = [sys.executable, "-m", "playground.figures.video", str(job), str(path)]
        with open(Path(own) / "said", "w+", encoding="utf-8") as said:
            process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=said, text=True)
            try:
                yield from _watch(process, control, end)
            finally:
                process.kill()
                process.communicate()
            said.seek(0)
            last = (said.read().strip().splitlines() or [""])[-1]
    if process.returncode or not path.is_file():
        raise PlaygroundError(last if process.returncode == 2 else "the picture could not be rendered on this machine")
    yield path


def _watch(process: "subprocess.Popen[str]", control: Control, end: float) -> Iterator[tuple[int, int]]:
    """What a rendering process says of its progress, until it ends. PlaygroundError if it is to end before."""
    lines: queue.Queue[str | None] = queue.Queue()

    def listen() -> None:
        for line in process.stdout or ():
            lines.put(line)
        lines.put(None)

    threading.Thread(target=listen, daemon=True).start()
    told = 0.0
    while True:
        if control.stop:
            raise PlaygroundError("stopped; nothing was saved")
        if time.monotonic() > end:
            raise PlaygroundError(f"rendering took longer than {LIMITS.picture_seconds:g} s and was stopped")
        try:
            line = lines.get(timeout=TOLD_EVERY)
        except queue.Empty:
            continue
        if line is None:
            process.wait(timeout=20)
            return
        done, total = (int(word) for word in line.split())
        if time.monotonic() - told > TOLD_EVERY or done == total:
            told = time.monotonic()
            yield done, total


def _note(wish: Wish) -> str:
    """The line at the foot of a picture: where it comes from."""
    values = wish.state.values
    parts = [f"“{_line(values['prompt'])}”"] if values.get("prompt") else []
    parts += [f"seed {values['seed']}"] if "seed" in values else []
    return " · ".join([*parts, "Motion Token Playground"])


class Handlers:
    """What the export menu does; every answer is a value of the channel, read by export.js."""

    def __init__(self, services: Services, cache: str) -> None:
        self.services = services
        self.cache = Path(cache)

    def write(self, control: Control, event: gr.EventData) -> dict[str, Any]:
        """A motion file or tokens, at once."""
        try:
            wish = read_wish(self.services, event.wish)
            path, changes = write(wish, self._folder())
            return _done(path, " ".join(map(as_sentence, changes)))
        except PlaygroundError as error:
            return _failed(error)

    def render(self, control: Control, event: gr.EventData) -> Iterator[dict[str, Any]]:
        """A film or a strip, with progress."""
        wish = event.wish if isinstance(event.wish, dict) else {}
        control.stop = control.stopped is not None and control.stopped == wish.get("run")
        folder, finished = self._folder(), False
        try:
            yield {"state": "working", "done": 0, "total": 0}
            for news in render(read_wish(self.services, event.wish), folder, control):
                finished = isinstance(news, Path)
                yield _done(news) if isinstance(news, Path) else {"state": "working", "done": news[0], "total": news[1]}
        except PlaygroundError as error:
            yield _failed(error)
        finally:  # stopped, failed, or the visitor has left
            if not finished:
                shutil.rmtree(folder, ignore_errors=True)

    def stop(self, control: Control, event: gr.EventData) -> None:
        """Ask a rendering to end, whether it runs or still waits for its turn."""
        control.stop, control.stopped = True, event.run

    def _folder(self) -> Path:
        folder = self.cache / secrets.token_hex(16)
        folder.mkdir(parents=True)
        return folder


def _done(path: Path, note: str = "") -> dict[str, Any]:
    file = gr.FileData(path=str(path), orig_name=path.name, size=path.stat().st_size)
    return {"state": "done", "file": file.model_dump(), "name": path.name, "note": note}


def _failed(error: Exception) -> dict[str, Any]:
    return {"state": "error", "message": as_sentence(str(error))}


def export_channel(services: Services) -> None:
    """What the export menu of the bar talks to; takes no place on the page."""
    channel = gr.HTML(None, html_template="", js_on_load=_CHANNEL, apply_default_css=False, elem_classes=["mtp-unseen"])
    control = gr.State(Control(), time_to_live=LIMITS.session_seconds)
    do = Handlers(services, channel.GRADIO_CACHE)
    quiet: dict[str, Any] = {"api_visibility": "private", "show_progress": "hidden"}
    channel.ask_file(do.write, [control], [channel], **quiet)
    channel.ask_picture(do.render, [control], [channel], concurrency_id="pictures", concurrency_limit=1, **quiet)
    channel.ask_stop(do.stop, [control], None, queue=False, **quiet)
