"""How a room runs something that may fail: one sentence under the control, the last result stays on the screen.

Every handler of every room goes through `attach`, which gives all of them the same treatment: one model slot for the
whole app, no public API of its own, and every error turned into one sentence in the room's message line.
"""

import html
import inspect
import logging
from collections.abc import Callable, Iterator, Sequence
from functools import wraps
from typing import Any, Literal

import gradio as gr

from playground.errors import PlaygroundError
from playground.ui.facts import as_sentence
from playground.ui.stage.component import stage_call

log = logging.getLogger(__name__)

MODEL_SLOT = "model"  # the one concurrency_id of everything that uses a model
OUR_FAULT = "Something went wrong on our side; your last result is still here, please try again."


def error_line(sentence: str) -> str:
    """HTML of the message line for an error, escaped."""
    return f'<p class="mtp-message mtp-error" role="alert">{html.escape(as_sentence(sentence) or OUR_FAULT)}</p>'


def note_line(sentence: str) -> str:
    """HTML of the message line for something worth knowing that is not an error; "" clears the line."""
    if not sentence:
        return ""
    return f'<p class="mtp-message mtp-note" role="status">{html.escape(sentence)}</p>'


def message_place(elem_id: str) -> gr.HTML:
    """The empty message line of a room; `attach` writes into it."""
    return gr.HTML(value="", elem_id=elem_id, elem_classes=["mtp-message-place"], apply_default_css=False)


def guarded(handler: Callable[..., Any], outputs: int) -> Callable[..., Any]:
    """`handler` with its errors turned into a message.

    handler returns (or, being a generator, yields) a tuple of `outputs` values. The wrapped one gives them with the
    message line in front: "" or what `Note` says when all is well, the sentence of a PlaygroundError with every other
    output left as it is. Anything else that is raised is logged and shown as one plain sentence.
    """

    def failed(error: Exception) -> tuple[Any, ...]:
        if isinstance(error, PlaygroundError):
            sentence = str(error)
        else:
            log.exception("a handler of the page failed", exc_info=error)
            sentence = OUR_FAULT
        return (error_line(sentence), *(gr.skip() for _ in range(outputs)))

    def passed(values: Any) -> tuple[Any, ...]:
        found = tuple(values)
        if len(found) != outputs:
            raise RuntimeError(f"{handler.__qualname__} gave {len(found)} values for {outputs} outputs")
        note = next((value.text for value in found if isinstance(value, Noted)), "")
        return (note_line(note), *(value.value if isinstance(value, Noted) else value for value in found))

    @wraps(handler)
    def once(*args: Any) -> tuple[Any, ...]:
        try:
            return passed(handler(*args))
        except Exception as error:
            return failed(error)

    @wraps(handler)
    def stream(*args: Any) -> Iterator[tuple[Any, ...]]:
        try:
            for values in handler(*args):
                yield passed(values)
        except Exception as error:
            yield failed(error)

    return stream if inspect.isgeneratorfunction(handler) else once


class Noted:
    """One output value that also sets the message line to `text`."""

    def __init__(self, value: Any, text: str) -> None:
        self.value = value
        self.text = text


def attach(
    event: Callable[..., Any],
    handler: Callable[..., Any],
    inputs: Sequence[Any],
    outputs: Sequence[Any],
    message: gr.HTML,
    *,
    stage: str = "",
    doing: str = "Working",
    model: bool = True,
    trigger_mode: Literal["once", "multiple", "always_last"] = "once",
) -> Any:
    """Bind `handler` to a Gradio event such as `button.click`, guarded. Returns the dependency.

    stage: name of the stage that is dimmed under a progress line while the handler runs, with `doing` written on it.
    model: whether it waits for the model slot; what only picks among stored results does not.
    """
    run = event(
        fn=guarded(handler, len(outputs)),
        inputs=list(inputs),
        outputs=[message, *outputs],
        concurrency_id=MODEL_SLOT if model else None,
        concurrency_limit=1 if model else None,
        api_visibility="private",
        show_progress="hidden",
        trigger_mode=trigger_mode,
        js=stage_call(stage, "busy", doing) if stage else None,
    )
    if stage:
        run.then(None, None, None, js=stage_call(stage, "say", "ready"), api_visibility="private")
    return run
