"""A real server on this machine that speaks chat completions, well and badly."""

import json
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import pytest

from playground.errors import PlaygroundError
from playground.text import endpoint
from playground.text.endpoint import Endpoint, from_environment
from playground.text.rewriting import rewrite

GOOD = {
    "normalised": "a person walks, then sits",
    "steps": [{"text": "a person walks", "seconds": 3}, {"text": "a person sits", "seconds": 2.04}],
    "expressive": "A person walks with long steps and lets the arms swing. Then the knees bend and the body sits down.",
    "notes": ["two actions", "", 3, "x" * 500],
}


@dataclass
class Server:
    """What the server does with the next request, and the requests that it got."""

    url: str = ""
    act: Callable[[BaseHTTPRequestHandler], None] = lambda handler: None
    requests: list[tuple[str, str, dict[str, Any]]] = field(default_factory=list)
    released: threading.Event = field(default_factory=threading.Event)

    def says(self, content: Any, status: int = 200) -> None:
        """Answer with a completion whose message holds `content`."""
        text = content if isinstance(content, str) else json.dumps(content)
        message = {"role": "assistant", "content": text}
        body = {
            "id": "1", "object": "chat.completion", "created": 1, "model": "m",
            "choices": [{"index": 0, "finish_reason": "stop", "message": message}],
        }  # fmt: skip
        self.sends(json.dumps(body), status)

    def sends(self, body: str | bytes, status: int = 200, kind: str = "application/json") -> None:
        """Answer with these bytes."""
        data = body.encode() if isinstance(body, str) else body

        def act(handler: BaseHTTPRequestHandler) -> None:
            handler.send_response(status)
            handler.send_header("Content-Type", kind)
            handler.send_header("Content-Length", str(len(data)))
            handler.end_headers()
            handler.wfile.write(data)

        self.act = act


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    state = Server()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            state.requests.append((self.path, self.headers["Authorization"], body))
            state.act(self)

        def log_message(self, *message: object) -> None:
            pass

    http = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    http.daemon_threads = True
    state.url = f"http://127.0.0.1:{http.server_port}/v1"
    thread = threading.Thread(target=http.serve_forever, args=(0.01,))
    thread.start()
    yield state
    state.released.set()
    http.shutdown()
    thread.join()
    http.server_close()


def test_an_answer_is_taken_checked_and_told(server):
    server.says(GOOD)
    made = rewrite('walk,\nthen "sit"', Endpoint(server.url, "secret", "small"))
    assert [(step.text, step.seconds) for step in made.steps] == [("a person walks", 3.0), ("a person sits", 2.0)]
    assert made.normalised == GOOD["normalised"] and made.expressive == GOOD["expressive"]
    assert made.notes[:2] == ("written by the language model small at 127.0.0.1", "two actions")
    assert len(made.notes) == 3 and len(made.notes[2]) == 200
    path, authorization, body = server.requests[0]
    assert path == "/v1/chat/completions" and authorization == "Bearer secret" and body["model"] == "small"
    system, user = body["messages"]
    assert system["role"] == "system" and "1.0 to 9.8" in system["content"] and '"steps"' in system["content"]
    assert user == {"role": "user", "content": 'Prompt: "walk, | then "sit""\n'}


@pytest.mark.parametrize("around", ["```json\n{}\n```", "Here you are: {} Enjoy!", "\n\n{}"])
def test_words_around_the_json_do_not_matter(server, around):
    server.says(around.replace("{}", json.dumps(GOOD)))
    assert rewrite("walk", Endpoint(server.url)).steps[0].text == "a person walks"


def test_seconds_are_brought_within_the_limits(server):
    steps = [{"text": "a person walks", "seconds": 500}, {"text": "a person sits", "seconds": 0}]
    server.says(GOOD | {"steps": steps, "notes": "none"})
    made = rewrite("walk", Endpoint(server.url))
    assert [step.seconds for step in made.steps] == [9.8, 1.0]
    assert "step 1: 500 s brought to 9.8 s" in made.notes


STEP = {"text": "a person walks", "seconds": 2}
UNUSABLE = {
    "no JSON": ("I cannot help with that.", "something else than JSON"),
    "nothing": ("", "something else than JSON"),
    "broken JSON": ('{"steps": [', "something else than JSON"),
    "deep JSON": ('{"steps":' + "[" * 100_000 + "]" * 100_000 + "}", "something else than JSON"),
    "a list": ('[{"a": 1}, {"b": 2}]', "something else than JSON"),
    "no steps": ({k: v for k, v in GOOD.items() if k != "steps"}, "left out the steps"),
    "empty steps": (GOOD | {"steps": []}, "gave 0 steps"),
    "too many steps": (GOOD | {"steps": [STEP] * 25}, "gave 25 steps"),
    "steps of words": (GOOD | {"steps": ["walk"]}, "no number of seconds for step 1"),
    "seconds of words": (GOOD | {"steps": [STEP | {"seconds": "three"}]}, "no number of seconds for step 1"),
    "seconds that are true": (GOOD | {"steps": [STEP | {"seconds": True}]}, "no number of seconds"),
    "negative seconds": (GOOD | {"steps": [STEP, STEP | {"seconds": -1}]}, "no number of seconds for step 2"),
    "endless seconds": (GOOD | {"steps": [STEP | {"seconds": float("inf")}]}, "no number of seconds"),
    "seconds that are none": (GOOD | {"steps": [STEP | {"seconds": float("nan")}]}, "no number of seconds"),
    "huge seconds": (GOOD | {"steps": [STEP | {"seconds": 10**400}]}, "no number of seconds"),
    "a step without text": (GOOD | {"steps": [{"seconds": 2}]}, "left out the text of step 1"),
    "an empty step": (GOOD | {"steps": [STEP | {"text": " \u200b"}]}, "unusable text"),
    "no expressive text": (GOOD | {"expressive": None}, "left out the expressive"),
    "a book": (GOOD | {"expressive": "walk " * 1000}, "unusable text"),
}


@pytest.mark.parametrize("case", UNUSABLE)
def test_unusable_answers_leave_the_rules_with_a_note(server, case):
    content, why = UNUSABLE[case]
    server.says(content)
    made, ruled = rewrite("he walks", Endpoint(server.url, "secret")), rewrite("he walks")
    assert made.steps == ruled.steps and made.expressive == ruled.expressive
    assert made.notes[1:] == ruled.notes and why in made.notes[0] and "the rules were used" in made.notes[0]
    assert "secret" not in repr(made) and len(made.notes[0]) < 300


BROKEN = {
    "an error of the server": ("{}", 500, "application/json", "status 500"),
    "a wrong key": ('{"error": {"message": "bad key secret"}}', 401, "application/json", "status 401"),
    "too many requests": ("slow down", 429, "text/plain", "status 429"),
    "another page": ("<html>hello</html>", 200, "text/html", "form of chat completions"),
    "no JSON at all": ("hello", 200, "application/json", "form of chat completions"),
    "no choices": ('{"id": "1"}', 200, "application/json", "form of chat completions"),
    "empty choices": ('{"choices": []}', 200, "application/json", "form of chat completions"),
    "choices of words": ('{"choices": ["walk"]}', 200, "application/json", "form of chat completions"),
    "bytes": (b"\xff\xfe\x00", 200, "application/json", "form of chat completions"),
    "no message": ('{"choices": [{"message": {"content": null}}]}', 200, "application/json", "else than JSON"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken_servers_leave_the_rules_with_a_note(server, case):
    body, status, kind, why = BROKEN[case]
    server.sends(body, status, kind)
    made = rewrite("he walks", Endpoint(server.url, "secret"))
    assert made.steps == rewrite("he walks").steps and why in made.notes[0] and "secret" not in made.notes[0]
    assert len(server.requests) == 1, "a failing server is not asked again"


def test_a_silent_server_is_given_up(server):
    server.act = lambda handler: server.released.wait(20) and None
    made = rewrite("he walks", Endpoint(server.url, timeout=0.2))
    assert made.steps == rewrite("he walks").steps and "gave no answer within 0.2 s" in made.notes[0]


def test_a_server_that_drips_is_given_up(server):
    def drip(handler: BaseHTTPRequestHandler) -> None:
        handler.send_response(200)
        handler.send_header("Content-Length", "100000")
        handler.end_headers()
        for _ in range(400):
            try:
                handler.wfile.write(b" ")
                handler.wfile.flush()
            except OSError:
                return
            if server.released.wait(0.05):
                return

    server.act = drip
    made = rewrite("he walks", Endpoint(server.url, timeout=0.4))
    assert "gave no answer within 0.4 s" in made.notes[0]


def test_a_closed_line_and_no_server(server):
    server.act = lambda handler: handler.connection.close()
    made = rewrite("he walks", Endpoint(server.url, timeout=60))
    assert "could not be reached" in made.notes[0]
    made = rewrite("he walks", Endpoint("http://127.0.0.1:9/v1", timeout=60))
    assert "could not be reached" in made.notes[0] and made.steps == rewrite("he walks").steps


def test_without_the_client_the_rules_remain(server, monkeypatch):
    monkeypatch.setitem(sys.modules, "openai", None)
    made = rewrite("he walks", Endpoint(server.url))
    assert "pip install openai" in made.notes[0] and made.steps == rewrite("he walks").steps


def test_the_environment_names_the_endpoint():
    assert from_environment({}) is None and from_environment({endpoint.URL: " ", endpoint.KEY: "k"}) is None
    found = from_environment({endpoint.URL: "https://host/v1", endpoint.KEY: "k", endpoint.MODEL: "m"})
    assert found == Endpoint("https://host/v1", "k", "m") and "k'" not in repr(found)
    assert from_environment({endpoint.URL: "http://host"}) == Endpoint("http://host", "", "default")


@pytest.mark.parametrize("url", ["host", "ftp://host", "http://", "file:///etc/passwd", "http://[", "http://host:port"])
def test_addresses_that_are_none_are_refused(url):
    with pytest.raises(PlaygroundError, match=endpoint.URL):
        from_environment({endpoint.URL: url})
