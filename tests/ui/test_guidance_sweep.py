"""The sweep in the room Guidance: shown with what it was measured on where it is stored, one sentence where not."""

from playground.analysis.results import write_result
from playground.ui.rooms.guidance import sweep
from playground.ui.services import Services
from tests.figures.test_sweep import swept
from tests.ui.double import FakeEngine


def test_without_a_stored_sweep_one_sentence_says_so() -> None:
    engine = FakeEngine()
    figure, told = sweep(Services(lambda: engine))  # type: ignore[arg-type, return-value]
    assert figure is None and told == "FID and R-Precision against g have not been measured for LG-Tok lite yet."


def test_a_stored_sweep_says_what_it_was_measured_on() -> None:
    engine = FakeEngine()
    write_result(swept(), engine.assets / "results")
    figure, told = sweep(Services(lambda: engine))  # type: ignore[arg-type, return-value]
    assert figure is not None and "40 test clips of made up, 5 repeats, seed 0" in told and "95 % intervals" in told


def test_a_broken_file_is_a_sentence_too() -> None:
    engine = FakeEngine()
    path = engine.assets / "results" / "guidance_sweep-lgtok-lite.json"
    path.parent.mkdir(parents=True)
    path.write_text("{}", encoding="utf-8")
    figure, told = sweep(Services(lambda: engine))  # type: ignore[arg-type, return-value]
    assert figure is None and "is no stored result" in told
