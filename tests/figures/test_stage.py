"""Tests of figures/stage.py and figures/colors.py: what the payload holds, what is refused, how colours behave."""

import base64
import itertools
import json
from typing import Any

import hypothesis.extra.numpy as arrays
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from playground.errors import PlaygroundError
from playground.figures import colors, stage
from playground.limits import LIMITS
from playground.motion.skeleton import HUMAN22

RNG = np.random.default_rng(3)
DARK_DIGITS = "#111214"  # what the score writes on its cells


def joints(frames: int) -> np.ndarray:
    return RNG.normal(size=(frames, 22, 3)).astype(np.float32)


def figure(name: str = "a", frames: int = 5, **settings: Any) -> stage.Json:
    return stage.figure(name, name.upper(), joints(frames), **settings)


def decoded(text: str, dtype: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), dtype)


# ---------------------------------------------------------------- payload


def test_a_payload_is_json_and_gives_back_every_number() -> None:
    original, ids, entropy = joints(7), np.array([3, 0, 9, 9]), np.array([0.0, 1.5, 0.25, 2.0])
    palette = stage.code_colors(RNG.normal(size=(10, 6)))
    row = stage.level(ids, 10, palette, entropy, spans=[[0, 2], [1, 4], [4, 6], [5, 7]])
    made = stage.payload(
        [stage.figure("original", "Original", original), figure("b", 4, system="lgtok-lite", ghost_of="original")],
        [stage.track("lgtok-lite", "LG-Tok", 7, [row, stage.level(None, 20, size=8)], note="a note")],
        badge=stage.badge("live", 0.21),
    )
    read = json.loads(json.dumps(made))
    assert read == made
    assert read["frames"] == 7 and read["fps"] == LIMITS.fps and read["version"] == 1
    assert np.array_equal(decoded(read["figures"][0]["joints"], "<f4").reshape(7, 22, 3), original)
    level = read["tracks"][0]["levels"][0]
    assert level["size"] == 4 and level["codes"] == 10
    assert np.array_equal(decoded(level["ids"], "<i2"), ids)
    assert np.array_equal(decoded(level["colors"], "u1").reshape(4, 3), palette[ids])
    assert np.array_equal(decoded(level["entropy"], "<f4"), entropy.astype(np.float32))
    assert decoded(level["spans"], "<i2").tolist() == [0, 2, 1, 4, 4, 6, 5, 7]
    assert read["tracks"][0]["levels"][1]["ids"] is None and read["tracks"][0]["levels"][1]["size"] == 8
    assert read["skeleton"] == {"names": list(HUMAN22.joints), "parents": list(HUMAN22.parents)}
    assert read["badge"] == {"kind": "live", "seconds": 0.21, "text": ""}


def test_features_travel_and_figures_may_follow_them() -> None:
    rows, mean, std = RNG.normal(size=(6, 67)), RNG.normal(size=67), np.ones(67)
    block = stage.features("live", rows, rows + 1, mean, std, 3.0)
    live = stage.figure("live", "Your g", None, "lgtok-lite", g="live", frames=6)
    made = stage.payload([live, stage.figure("g0", "g = 0", None, g=0, frames=6)], features=block)
    assert made["figures"][0]["joints"] is None and made["figures"][1]["g"] == 0
    assert np.array_equal(decoded(made["features"]["unconditional"], "<f4").reshape(6, 67), (rows + 1).astype("<f4"))
    assert made["features"]["guidance"] == 3.0


def test_marks_travel_with_their_meaning() -> None:
    row = stage.level([1, 2, 3], 10, marks=np.array([True, False, True]))
    made = stage.track("lgtok-lite", "LG-Tok", 6, [row, stage.level([4], 10)], marked="differs without the caption")
    assert decoded(made["levels"][0]["marks"], "u1").tolist() == [1, 0, 1]
    assert made["levels"][1]["marks"] is None and made["marked"] == "differs without the caption"


def test_a_strip_gives_back_its_values_and_its_largest() -> None:
    values = RNG.uniform(size=(3, 7)).astype(np.float32)
    made = stage.strip("attention", "Attention", "", ["a", "person", "waves"], values)
    assert np.array_equal(decoded(made["values"], "<f4").reshape(3, 7), values)
    assert made["max"] == pytest.approx(values.max()) and made["rows"] == ["a", "person", "waves"]
    assert stage.strip("a", "A", "mm", ["x"], np.zeros((1, 4)))["max"] == 1.0
    assert stage.strip("a", "A", "mm", ["x"], np.zeros((1, 4)), max=30)["max"] == 30.0


def test_a_joint_strip_orders_every_joint_by_its_part_of_the_body_in_millimetres() -> None:
    difference = RNG.uniform(size=(5, 22))
    made = stage.joint_strip("swap", "Difference", difference)
    rows = decoded(made["values"], "<f4").reshape(22, 5)
    assert sorted(made["joints"]) == list(range(22)) and sum(count for _, count in made["groups"]) == 22
    for row, joint, name in zip(rows, made["joints"], made["rows"], strict=True):
        assert np.allclose(row, 1000 * difference[:, joint])
        assert name.replace("left ", "l_").replace("right ", "r_") == HUMAN22.joints[joint]
    at = 0
    for group, count in made["groups"]:
        sides = {name.split()[0] for name in made["rows"][at : at + count]} & {"left", "right"}
        assert sides == {group.split()[0]} & {"left", "right"}
        at += count


@settings(deadline=None, max_examples=60)
@given(st.lists(st.booleans(), max_size=30))
def test_spans_of_kept_frames_give_back_the_same_frames(kept: list[bool]) -> None:
    spans = stage.spans_of(np.array(kept, bool))
    back = np.zeros(len(kept), bool)
    for start, stop in spans:
        assert start < stop and not back[max(start - 1, 0) : stop].any()
        back[start:stop] = True
    assert back.tolist() == kept
    if kept:
        made = stage.payload([figure("a", len(kept))], hatch=spans, strips=[stage.strip("s", "S", "", ["x"], [[1.0]])])
        assert made["hatch"] == [list(span) for span in spans] and made["strips"][0]["id"] == "s"


def test_the_largest_stage_stays_small() -> None:
    figures = [figure(str(n), LIMITS.max_frames + 1) for n in range(LIMITS.max_figures)]
    assert len(json.dumps(stage.payload(figures))) < 600_000


BAD: dict[str, Any] = {
    "wrong joints": lambda: stage.figure("a", "A", np.zeros((4, 21, 3))),
    "no frames": lambda: stage.figure("a", "A", np.zeros((0, 22, 3))),
    "not finite": lambda: stage.figure("a", "A", np.full((2, 22, 3), np.nan)),
    "neither joints nor guidance": lambda: stage.figure("a", "A", None, frames=4),
    "guidance without frames": lambda: stage.figure("a", "A", None, g=1.0),
    "id too large": lambda: stage.level([0, 10], 10),
    "id negative": lambda: stage.level([-1], 10),
    "ids not whole": lambda: stage.level([0.5], 10),
    "ids empty": lambda: stage.level(np.zeros(0, int), 10),
    "ids as a matrix": lambda: stage.level(np.zeros((2, 2), int), 10),
    "too many codes": lambda: stage.level([0], 40_000),
    "wrong palette": lambda: stage.level([0], 10, np.zeros((9, 3), np.uint8)),
    "entropy too short": lambda: stage.level([0, 1], 10, entropy=[1.0]),
    "spans not pairs": lambda: stage.level([0, 1], 10, spans=[0, 1]),
    "a pending row without size": lambda: stage.level(None, 10),
    "a track without levels": lambda: stage.track("mosa", "MoSa", 4, []),
    "features too narrow": lambda: stage.features("a", np.zeros((3, 66)), np.zeros((3, 66)), np.zeros(66), np.ones(66)),
    "features of two lengths": lambda: stage.features(
        "a", np.zeros((3, 67)), np.zeros((4, 67)), np.zeros(67), np.ones(67)
    ),
    "marks too short": lambda: stage.level([0, 1], 10, marks=[True]),
    "strip below zero": lambda: stage.strip("s", "S", "mm", ["x"], [[-1.0]]),
    "strip not finite": lambda: stage.strip("s", "S", "mm", ["x"], [[np.nan]]),
    "strip without frames": lambda: stage.strip("s", "S", "mm", ["x"], np.zeros((1, 0))),
    "strip without rows": lambda: stage.strip("s", "S", "mm", [], np.zeros((0, 4))),
    "strip with other names": lambda: stage.strip("s", "S", "mm", ["x"], np.zeros((2, 4))),
    "strip with no end of its ramp": lambda: stage.strip("s", "S", "mm", ["x"], [[1.0]], max=0),
    "strip with groups of other rows": lambda: stage.strip("s", "S", "mm", ["x"], [[1.0]], groups=[("a", 2)]),
    "strip with a joint that is not there": lambda: stage.strip("s", "S", "mm", ["x"], [[1.0]], joints=[22]),
    "difference of other joints": lambda: stage.joint_strip("s", "S", np.zeros((4, 21))),
    "two strips of one id": lambda: stage.payload([figure()], strips=[stage.strip("s", "S", "", ["x"], [[1.0]])] * 2),
    "hatch past the end": lambda: stage.payload([figure()], hatch=[(2, 6)]),
    "hatch of no length": lambda: stage.payload([figure()], hatch=[(2, 2)]),
    "hatch out of order": lambda: stage.payload([figure()], hatch=[(3, 4), (0, 1)]),
    "kept frames that are numbers": lambda: stage.spans_of([0, 1]),
    "badge": lambda: stage.badge("new"),
    "message": lambda: stage.message("ready", ""),
    "no figure": lambda: stage.payload([]),
    "too many figures": lambda: stage.payload([figure(str(n)) for n in range(LIMITS.max_figures + 1)]),
    "same id twice": lambda: stage.payload([figure("a"), figure("a")]),
    "ghost of nobody": lambda: stage.payload([figure("a", ghost_of="b")]),
    "guidance without features": lambda: stage.payload([stage.figure("a", "A", None, g="live", frames=4)]),
    "codebook of one dimension": lambda: stage.code_colors(np.zeros(4)),
    "codebook not finite": lambda: stage.code_colors([[np.inf, 0.0]]),
}


@pytest.mark.parametrize("make", BAD.values(), ids=BAD.keys())
def test_what_the_browser_could_not_show_is_refused_in_one_sentence(make: Any) -> None:
    with pytest.raises(PlaygroundError) as caught:
        make()
    text = str(caught.value)
    assert "\n" not in text and 20 < len(text) < 200


def test_features_of_a_figure_that_is_not_there_are_refused() -> None:
    block = stage.features("b", np.zeros((3, 67)), np.zeros((3, 67)), np.zeros(67), np.ones(67))
    with pytest.raises(PlaygroundError, match='"b"'):
        stage.payload([figure("a")], features=block)


# ---------------------------------------------------------------- code colours

CODEBOOKS = arrays.arrays(
    np.float64,
    st.tuples(st.integers(1, 40), st.integers(1, 6)),
    elements=st.floats(-1e3, 1e3, allow_nan=False).map(lambda value: round(value, 3)),
)


@settings(deadline=None, max_examples=40)
@given(CODEBOOKS)
def test_any_codebook_gets_colours_that_carry_dark_digits(codebook: np.ndarray) -> None:
    palette = stage.code_colors(codebook)
    assert palette.shape == (len(codebook), 3) and palette.dtype == np.uint8
    for color in np.unique(palette, axis=0):
        assert colors.contrast(colors.rgb_to_hex(color), DARK_DIGITS) >= 4.5


@settings(deadline=None, max_examples=40)
@given(CODEBOOKS)
def test_equal_codes_have_equal_colours(codebook: np.ndarray) -> None:
    twice = np.concatenate([codebook, codebook])
    palette = stage.code_colors(twice)
    assert np.array_equal(palette[: len(codebook)], palette[len(codebook) :])


def test_near_codes_look_nearer_than_far_ones() -> None:
    places = np.sort(RNG.uniform(size=(200, 2)), axis=0)
    codebook = places @ RNG.normal(size=(2, 32)) + 1e-4 * RNG.normal(size=(200, 32))
    lab = colors.rgb_to_oklab(stage.code_colors(codebook))
    steps = np.linalg.norm(np.diff(lab, axis=0), axis=-1)
    apart = np.linalg.norm(lab[:100] - lab[100:], axis=-1)
    assert steps.mean() < 0.25 * apart.mean()


def test_colours_do_not_depend_on_the_order_of_the_codes() -> None:
    codebook, order = RNG.normal(size=(50, 8)), RNG.permutation(50)
    assert np.array_equal(stage.code_colors(codebook)[order], stage.code_colors(codebook[order]))


def test_a_codebook_spreads_over_the_circle_of_hues() -> None:
    lab = colors.rgb_to_oklab(stage.code_colors(RNG.normal(size=(256, 16))))
    hues = np.rad2deg(np.arctan2(lab[:, 2], lab[:, 1])) % 360
    assert np.histogram(hues, bins=8, range=(0, 360))[0].min() >= 8
    assert 0.6 < lab[:, 0].min() < 0.66 and 0.82 < lab[:, 0].max() < 0.88


# ---------------------------------------------------------------- table of colours


def test_oklch_gives_known_colours() -> None:
    """Reference values of the OKLCH definition: white, mid grey, pure red (L 0.628, C 0.2577, h 29.23 degrees)."""
    made = colors.oklch_to_rgb(
        np.array([1.0, 0.5999, 0.62796]), np.array([0.0, 0.0, 0.25768]), np.deg2rad([0.0, 0.0, 29.234])
    )
    assert np.abs(made.astype(int) - [[255, 255, 255], [128, 128, 128], [255, 0, 0]]).max() <= 1


@settings(deadline=None, max_examples=80)
@given(st.floats(0, 1), st.floats(0, 0.4), st.floats(0, 6.3))
def test_a_colour_that_does_not_exist_keeps_its_lightness(lightness: float, chroma: float, hue: float) -> None:
    made = colors.oklch_to_rgb(np.array(lightness), np.array(chroma), np.array(hue))
    assert abs(colors.rgb_to_oklab(made)[0] - lightness) < 0.03


def test_a_family_has_a_hue_and_a_variant_a_step_and_a_dash() -> None:
    assert colors.system_color("lgtok-lite") == colors.FAMILIES["lgtok"]
    assert colors.system_color("momask++-lite") == colors.FAMILIES["momask++"] == colors.system_color("momaskpp-lite")
    assert colors.system_color("momask-lite") == colors.FAMILIES["momask"]
    assert colors.system_color("T2M-GPT") == colors.FAMILIES["t2mgpt"]
    assert colors.system_color(None) == colors.ORIGINAL == colors.system_color("something new")
    for variant in ("lgtok-lite-no-text", "lgtok-mini", "t2mgpt-casim", "mdm-casim"):
        family = colors.FAMILIES[colors.family_of(variant) or ""]
        made = colors.system_color(variant)
        assert made.dash != "solid" and made.light != family.light and made.dark != family.dark
        hues = [np.arctan2(*colors.rgb_to_oklab(colors.hex_to_rgb(c))[:0:-1]) for c in (made.light, family.light)]
        assert abs(hues[0] - hues[1]) < 0.12


@pytest.mark.parametrize("mode", ["light", "dark"])
def test_systems_can_be_told_apart(mode: str) -> None:
    shown = [colors.ORIGINAL, *colors.FAMILIES.values()]
    labs = [colors.rgb_to_oklab(colors.hex_to_rgb(getattr(color, mode))) for color in shown]
    assert min(np.linalg.norm(a - b) for a, b in itertools.combinations(labs, 2)) > 0.07


@pytest.mark.parametrize("mode", [0, 1])
@pytest.mark.parametrize("ground", ["bg", "surface", "sunken"])
@pytest.mark.parametrize("text", ["text", "muted", "error", "live", "stored", "focus"])
def test_text_reads_on_every_ground(text: str, ground: str, mode: int) -> None:
    assert colors.contrast(colors.TOKENS[text][mode], colors.TOKENS[ground][mode]) >= 4.5


def test_css_variables_hold_both_modes() -> None:
    css = colors.css_variables()
    for name, (light, dark) in colors.TOKENS.items():
        assert f"--mtp-{name}:{light};" in css and f"--mtp-{name}:{dark};" in css
