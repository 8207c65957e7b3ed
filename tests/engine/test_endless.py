"""An endless session on a tiny generator: what it shows, what it keeps, and what its seams measure."""

from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from playground.engine.endless import AROUND, EndlessSession, Trail
from playground.errors import PlaygroundError
from playground.generators.hierarchical import HierarchicalGenerator
from playground.motion.representation import Normaliser, from_features67, to_features67
from playground.systems import SamplingDefaults
from playground.tokenizers.base import Tokens
from tests.analysis.tiny import swaying
from tests.generators.test_hierarchical import tiny
from tests.generators.test_streaming import tiny_conv
from tests.tiny import text_features

HOW = SamplingDefaults(cfg=1.0, top_k=1.0)
STILL = Normaliser(np.zeros(67, np.float32), np.full(67, 0.05, np.float32))


def runtime(**changes):
    generator = HierarchicalGenerator(tiny().network, tiny_conv())
    facts = {"name": "mogo", "checkpoint": "c" * 12, "generator": generator, "normaliser": STILL}
    return SimpleNamespace(
        **facts | {"prompt": lambda line: text_features((len(line) % 5 + 1,), seed=len(line))} | changes
    )


def session(seed: int = 3, **options) -> EndlessSession:
    return EndlessSession(runtime(), "a person walks", seed, HOW, **options)


def shown(one: EndlessSession, *parts: float) -> np.ndarray:
    return np.concatenate([one.advance(part).joints for part in parts])


@settings(max_examples=20, deadline=None)
@given(cuts=st.lists(st.integers(0, 80), max_size=6), seed=st.integers(0, 99))
def test_rows_in_pieces_make_the_motion_that_they_make_at_once(cuts, seed):
    rng = np.random.default_rng(seed)
    rows = to_features67(swaying(81, 2)) + rng.normal(0, 0.02, (80, 67)).astype(np.float32)
    trail = Trail()
    pieces = [trail.push(part) for part in np.split(rows, sorted(cuts))]
    np.testing.assert_allclose(np.concatenate(pieces), from_features67(rows), atol=1e-4)


def test_a_session_shows_the_frames_asked_for_and_goes_on_without_a_jump():
    one = session()
    parts = [one.advance(seconds) for seconds in (0.05, 1.0, 2.13, 0.4)]
    assert [part.frames for part in parts] == [1, 20, 42, 8]
    assert one.frames == 71 and parts[0].caption == "a person walks"
    made = np.concatenate([part.joints for part in parts])
    steps = np.abs(np.diff(made, axis=0)).max(axis=(1, 2))
    borders = np.cumsum([1, 20, 42]) - 1
    assert steps[borders].max() <= np.delete(steps, borders).max()


def test_a_session_decodes_the_tokens_that_its_seed_draws():
    tokenizer, ids = tiny_conv(), None
    made = shown(session(), 1.0, 1.4)
    generator = runtime().generator
    from playground.generators.streaming import Stream
    from playground.nn.sampling import Sampling

    ids = Stream(generator, runtime().prompt("a person walks"), Sampling(seed=3, cfg=1.0, top_k=1.0)).next(24)
    lengths = torch.tensor([96])
    rows = tokenizer.decode(tokenizer.embed(Tokens(ids, (10,) * 3), lengths=lengths), lengths, None)[0].numpy()
    exact = from_features67(STILL.invert(rows))[:48]
    assert np.abs(made - exact).max() < 0.1 * np.abs(exact - exact[:1]).max()


def test_the_next_prompt_changes_nothing_that_was_shown_or_stands_before_its_frame():
    plain, told = session(), session()
    first = [shown(one, 1.0, 0.5) for one in (plain, told)]
    frame = told.say("  now the person   jumps ")
    assert told.prompt == "now the person jumps" and 30 < frame <= 30 + 20
    later = [np.concatenate([start, shown(one, 3.0)]) for start, one in zip(first, (plain, told), strict=True)]
    assert np.array_equal(first[0], first[1])
    sure = frame - 16  # decoded together with what comes later
    assert np.array_equal(later[0][:sure], later[1][:sure])
    assert np.abs(later[0][frame + 4 :] - later[1][frame + 4 :]).max() > 1e-3


def test_same_seed_and_switches_same_motion():
    def run(seed: int) -> np.ndarray:
        one = session(seed)
        start = shown(one, 1.0)
        one.say("a person turns around")
        return np.concatenate([start, shown(one, 2.0)])

    assert np.array_equal(run(5), run(5)) and not np.array_equal(run(5), run(6))


def test_seams_measure_the_third_difference_near_switches_and_elsewhere():
    one = session()
    made = [shown(one, 2.0)]
    marks = [one.say("a person jumps")]
    made.append(shown(one, 1.2, 1.8))
    marks.append(one.say("a person sits down"))
    made.append(shown(one, 3.0))
    x = np.concatenate(made).astype(np.float64)
    near, far, own = [], [], [[], []]
    for last in range(3, len(x)):
        third = x[last] - 3 * x[last - 1] + 3 * x[last - 2] - x[last - 3]
        size = float(np.linalg.norm(third, axis=-1).mean()) * 20**3
        hits = [n for n, mark in enumerate(marks) if abs((last - 1.5) - (mark - 0.5)) <= AROUND]
        (near if hits else far).append(size)
        for hit in hits:
            own[hit].append(size)
    seams = one.seams()
    assert (seams.system, seams.seed, seams.frames, seams.count) == ("mogo", 3, 160, 2)
    assert seams.at_switches == pytest.approx(np.mean(near)) and seams.elsewhere == pytest.approx(np.mean(far))
    assert [switch.frame for switch in seams.switches] == marks
    assert [switch.jerk for switch in seams.switches] == pytest.approx([np.mean(part) for part in own])


def test_a_new_session_has_no_seams_and_a_switch_is_counted_once():
    one = session()
    one.say("a person runs")
    assert one.seams().count == 0 and one.seams().at_switches is None and one.seams().elsewhere is None
    one.advance(1.0)
    assert one.say("a person jumps") == one.say("a person sits")
    assert [switch.prompt for switch in one.seams().switches] == ["a person sits"] and one.seams().count == 1
    assert one.seams().switches[0].jerk is None


def test_memory_does_not_grow():
    one, sizes = session(), []
    for turn in range(16):
        one.advance(2.0)
        if turn % 5 == 2:
            one.say(f"a person does number {turn}")
        sizes.append(one.held())
    assert one.frames == 640 and max(sizes) < 4 * min(sizes)  # caches are largest right after a switch


def test_a_deadline_stops_a_call_and_loses_no_frame():
    one, same = session(), session()
    with pytest.raises(PlaygroundError, match="longer than 0 s"):
        one.advance(2.0, deadline=0)
    assert one.frames == 0
    assert np.array_equal(shown(one, 2.0), shown(same, 2.0))


def test_calls_from_threads_wait_in_line():
    one = session()
    with ThreadPoolExecutor(6) as pool:
        parts = list(pool.map(lambda _: one.advance(0.5), range(12)))
    assert one.frames == 120 and all(part.frames == 10 for part in parts)


@pytest.mark.parametrize("seconds", [0.0, -1.0, 0.01, 9.81, float("nan"), float("inf")])
def test_a_length_out_of_range_is_refused(seconds):
    with pytest.raises(PlaygroundError, match="accepted"):
        session().advance(seconds)


def test_another_generator_and_an_empty_prompt_are_refused():
    with pytest.raises(PlaygroundError, match="endless motion needs"):
        EndlessSession(runtime(generator=None), "a person walks", 0, HOW)
    with pytest.raises(PlaygroundError, match="empty"):
        EndlessSession(runtime(), "  ", 0, HOW)
    one = session()
    with pytest.raises(PlaygroundError, match="empty"):
        one.say("")
    assert one.prompt == "a person walks"


def test_the_tokens_of_frames_are_those_that_were_drawn_and_old_ones_are_let_go():
    from playground.engine.endless import REMEMBERED
    from playground.generators.streaming import Stream
    from playground.nn.sampling import Sampling

    one = session()
    shown(one, 1.0, 0.55)
    ids = Stream(runtime().generator, runtime().prompt("a person walks"), Sampling(seed=3, cfg=1.0, top_k=1.0)).next(12)
    levels = one.levels(4, 31)
    assert [level.codes for level in levels] == [10] * 3 and one.drawn >= 31
    for level, row in zip(levels, ids, strict=True):
        assert level.size == 7 and level.ids.tolist() == row[0, 1:8].tolist()
    for start, stop in ((0, 0), (20, 400), (-8, 4)):
        with pytest.raises(PlaygroundError, match="are held"):
            one.levels(start, stop)
    while one.frames < REMEMBERED + 40:
        one.advance(4.0)
    with pytest.raises(PlaygroundError, match="are held"):
        one.levels(0, 8)
    start = one.frames // 4 * 4 - 20
    assert one.levels(start, start + 20)[0].size == 5


def test_the_engine_opens_sessions_of_systems_that_can(monkeypatch):
    from playground.engine import Engine

    engine = Engine()
    monkeypatch.setattr(engine, "runtime", lambda system: runtime())
    one = engine.endless("a person walks", seed=3, cfg=1.0, top_k=1.0)
    assert np.array_equal(one.advance(1.0).joints, session().advance(1.0).joints)
    for wrong, why in (({"seed": -1}, "seed"), ({"cfg": 9.0}, "cfg"), ({"pace": 1}, "accepted")):
        with pytest.raises(PlaygroundError, match=why):
            engine.endless("a person walks", **wrong)
