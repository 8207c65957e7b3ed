"""How a room runs a handler: results pass, PlaygroundError becomes one sentence, nothing else reaches the page."""

import logging
from collections.abc import Iterator

import gradio as gr
import pytest

from playground.errors import PlaygroundError
from playground.ui.errors import OUR_FAULT, Noted, guarded

SKIP = gr.skip()


def test_results_pass_with_an_empty_message() -> None:
    assert guarded(lambda a, b: (a + b, a), 2)(3, 4) == ("", 7, 3)


def test_a_note_goes_to_the_message_line() -> None:
    message, value = guarded(lambda: (Noted(5, "cut to <4> frames"),), 1)()
    assert value == 5 and "cut to &lt;4&gt; frames" in message and 'role="status"' in message


def test_an_error_of_the_visitor_is_one_sentence_and_changes_nothing_else() -> None:
    def refuse() -> tuple[int, int]:
        raise PlaygroundError("the prompt is empty; write something")

    message, *rest = guarded(refuse, 2)()
    assert "The prompt is empty; write something." in message and 'role="alert"' in message
    assert rest == [SKIP, SKIP]


def test_our_own_fault_is_logged_and_not_shown(caplog: pytest.LogCaptureFixture) -> None:
    def stumble() -> tuple[int]:
        raise RuntimeError("secret path /home/somebody")

    with caplog.at_level(logging.ERROR):
        message, rest = guarded(stumble, 1)()
    assert OUR_FAULT in message and "secret" not in message and rest == SKIP
    assert "secret path" in caplog.text


def test_a_handler_with_too_few_values_is_our_fault(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.CRITICAL):
        assert OUR_FAULT in guarded(lambda: (1,), 2)()[0]


def test_a_stream_that_breaks_keeps_what_it_gave() -> None:
    def count(to: int) -> Iterator[tuple[int]]:
        for n in range(to):
            yield (n,)
        raise PlaygroundError("the request took longer than 30 s")

    given = list(guarded(count, 1)(2))
    assert given[:2] == [("", 0), ("", 1)]
    assert "took longer" in given[2][0] and given[2][1] == SKIP


def test_gradio_still_sees_the_handler_s_own_arguments() -> None:
    def click(event: gr.EventData) -> tuple[int]:
        return (1,)

    import inspect

    assert list(inspect.signature(guarded(click, 1)).parameters) == ["event"]
