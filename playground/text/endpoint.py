"""A language model of the reader's own that rewrites prompts: any server that speaks OpenAI's chat completions.

It is off unless PLAYGROUND_LLM_URL names one (with PLAYGROUND_LLM_KEY and PLAYGROUND_LLM_MODEL where the server wants
them). What it answers is checked like a visitor's text; where it is late, broken or unusable, the rules' result stands
and a note says why. The client is the package openai, imported when a model is asked.
"""

import json
import os
import queue
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from string import Template
from typing import Any
from urllib.parse import urlsplit

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.text.english import DATA
from playground.text.prompts import normalise
from playground.text.rewriting import PromptStep, Rewritten

URL, KEY, MODEL = "PLAYGROUND_LLM_URL", "PLAYGROUND_LLM_KEY", "PLAYGROUND_LLM_MODEL"
MAX_STEPS = 24
MAX_NOTES = 8
TIMEOUT = 20.0  # seconds, all in all


class _UnusableError(Exception):
    """Why an answer cannot be used: the end of a sentence that begins with "it"."""


@dataclass(frozen=True)
class Endpoint:
    """One server and model; called with a prompt and what the rules make of it, as `rewrite` calls its writer."""

    url: str  # up to and without /chat/completions
    key: str = field(default="", repr=False)
    model: str = "default"
    timeout: float = TIMEOUT

    def __post_init__(self) -> None:
        try:
            parts = urlsplit(self.url)
            known = parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port != 0
        except ValueError:
            known = False
        if not known:
            raise PlaygroundError(f"{URL} is {self.url[:80]!r}; an address such as https://host/v1 is accepted")

    @property
    def name(self) -> str:
        """Model and host, for notes."""
        return f"{self.model} at {urlsplit(self.url).hostname}"

    def __call__(self, line: str, ruled: Rewritten) -> Rewritten:
        """The model's rewriting of a clean prompt, or the rules' own with a note on why."""
        try:
            return _checked(self._ask(line), self.name, ruled)
        except _UnusableError as error:
            why = f"the language model {self.name} was asked, but it {error}: the rules were used"
            return replace(ruled, notes=(why, *ruled.notes))

    def _ask(self, line: str) -> str:
        """The text of the answer. In a thread, because a server that sends byte by byte outlasts every time-out."""
        answers: queue.SimpleQueue[str | _UnusableError] = queue.SimpleQueue()
        threading.Thread(target=lambda: answers.put(self._complete(line)), daemon=True).start()
        try:
            answer = answers.get(timeout=self.timeout)
        except queue.Empty:
            raise _UnusableError(f"gave no answer within {self.timeout:g} s") from None
        if isinstance(answer, _UnusableError):
            raise answer
        return answer

    def _complete(self, line: str) -> str | _UnusableError:
        try:
            import openai
        except ImportError:
            return _UnusableError("needs the package openai (pip install openai)")
        try:
            with openai.OpenAI(
                base_url=self.url, api_key=self.key or "none", timeout=self.timeout, max_retries=0
            ) as client:
                reply = client.chat.completions.create(model=self.model, messages=_messages(line))
            return str(reply.choices[0].message.content or "")
        except openai.APITimeoutError:
            return _UnusableError(f"gave no answer within {self.timeout:g} s")
        except openai.APIStatusError as error:
            return _UnusableError(f"answered with status {error.status_code}")
        except openai.APIConnectionError:
            return _UnusableError("could not be reached")
        except (openai.OpenAIError, ValueError, TypeError, AttributeError, IndexError, KeyError):
            return _UnusableError("did not answer in the form of chat completions")


def from_environment(environment: Mapping[str, str] = os.environ) -> Endpoint | None:
    """The endpoint that the environment names, or None. PlaygroundError if its address is none."""
    url = environment.get(URL, "").strip()
    if not url:
        return None
    return Endpoint(url, environment.get(KEY, "").strip(), environment.get(MODEL, "").strip() or "default")


def _messages(line: str) -> Any:
    system = Template((DATA / "rewrite_system.txt").read_text(encoding="utf-8")).substitute(
        shortest=LIMITS.min_seconds, longest=LIMITS.max_seconds, characters=LIMITS.max_prompt_chars
    )
    user = Template((DATA / "rewrite_user.txt").read_text(encoding="utf-8")).substitute(prompt=line)
    return [{"role": "system", "content": system}, {"role": "user", "content": user}]


def _checked(answer: str, who: str, ruled: Rewritten) -> Rewritten:
    """The JSON object in an answer as a `Rewritten`. _UnusableError where it is another."""
    try:
        found = json.loads(answer[answer.index("{") : answer.rindex("}") + 1])
    except (ValueError, RecursionError):
        raise _UnusableError("answered with something else than JSON") from None
    if not isinstance(found, dict) or not isinstance(found.get("steps"), list):
        raise _UnusableError("left out the steps")
    if not 1 <= len(found["steps"]) <= MAX_STEPS:
        raise _UnusableError(f"gave {len(found['steps'])} steps, where 1 to {MAX_STEPS} are accepted")
    notes = [f"written by the language model {who}"]
    given = found.get("notes")
    for note in (given if isinstance(given, list) else [])[:MAX_NOTES]:
        if isinstance(note, str) and note.strip():
            notes.append(" ".join(note.split())[:200])
    steps = []
    for number, step in enumerate(found["steps"], 1):
        seconds = step.get("seconds") if isinstance(step, dict) else None
        if not isinstance(seconds, int | float) or isinstance(seconds, bool) or not 0 <= seconds < 1e6:
            raise _UnusableError(f"gave no number of seconds for step {number}")
        kept = min(max(float(seconds), LIMITS.min_seconds), LIMITS.max_seconds)
        if kept != seconds:
            notes.append(f"step {number}: {seconds:g} s brought to {kept:g} s")
        steps.append(PromptStep(_text(step.get("text"), f"text of step {number}"), round(kept, 1)))
    normalised, expressive = _text(found.get("normalised"), "normalised"), _text(found.get("expressive"), "expressive")
    return Rewritten(ruled.original, normalised, tuple(steps), expressive, tuple(notes))


def _text(value: object, what: str) -> str:
    if not isinstance(value, str):
        raise _UnusableError(f"left out the {what}")
    try:
        return normalise(value, what=what)
    except PlaygroundError as error:
        raise _UnusableError(f"gave an unusable text ({error})") from None
