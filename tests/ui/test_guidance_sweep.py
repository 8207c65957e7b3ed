"""The sweep in the room Guidance: shown with what it was measured on where it is stored, one sentence where not."""

from types import SimpleNamespace

from playground.analysis.results import write_result
from playground.ui.rooms.guidance import Handlers, sweep
from playground.ui.services import Services
from tests.figures.test_sweep import swept
from tests.ui.double import FakeEngine


def test_without_a_stored_sweep_one_sentence_says_so() -> None:
    engine = FakeEngine()
    figure, told = sweep(Services(lambda: engine))  # type: ignore[arg-type, return-value]
    assert figure is None and told == "FID and R-Precision against g have not been measured for LG-Tok yet."


def test_a_stored_sweep_says_what_it_was_measured_on() -> None:
    engine = FakeEngine()
    write_result(swept(), engine.assets / "results")
    figure, told = sweep(Services(lambda: engine))  # type: ignore[arg-type, return-value]
    assert figure is not None and "40 test clips of made up, 5 repeats, seed 0" in told and "95 % intervals" in told


def test_a_broken_file_is_a_sentence_too() -> None:
    engine = FakeEngine()
    path = engine.assets / "results" / "guidance_sweep-lgtok.json"
    path.parent.mkdir(parents=True)
    path.write_text("{}", encoding="utf-8")
    figure, told = sweep(Services(lambda: engine))  # type: ignore[arg-type, return-value]
    assert figure is None and "is no stored result" in told


def test_every_system_whose_decoder_reads_words_is_offered() -> None:
    engine = FakeEngine(others=("lgtok-mid", "momask"))
    write_result(swept(), engine.assets / "results")
    do = Handlers(Services(lambda: engine))  # type: ignore[arg-type, return-value]
    assert [one.name for one in do.services.readers()] == ["lgtok", "lgtok-mid"]
    stage, facts, _, curve, told = do.change("m1", "a person bows", 1.5, "lgtok-mid")
    assert '"lgtok-mid"' in stage.value and "system=lgtok-mid" in facts
    assert not curve["visible"] and "not been measured for LG-Tok mid" in told
    assert do.change("m1", "a person bows", 1.5, "lgtok")[3]["visible"]


def test_a_link_to_a_system_without_words_shows_another_one_and_says_so() -> None:
    engine = FakeEngine(others=("lgtok-mid", "momask"))
    do = Handlers(Services(lambda: engine))  # type: ignore[arg-type, return-value]
    for name, words in (("momask", "MoMask has no decoder that reads words"), ("mogo", "MOGO is not shipped with")):
        shown = do.arrive(SimpleNamespace(query=f"?room=guidance&system={name}"))  # type: ignore[arg-type]
        assert shown[2] == "lgtok" and shown[3].text.startswith(words) and "this is LG-Tok" in shown[3].text
    there = do.arrive(SimpleNamespace(query="?room=guidance&system=lgtok-mid"))  # type: ignore[arg-type]
    assert there[2] == "lgtok-mid" and there[3].text == ""
