"""Films and pose strips: what comes out can be read again, moves, has its colours, and bad input is one sentence."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from playground.errors import PlaygroundError
from playground.figures.pictures import Actor, Studio, followed, labelled, noted
from playground.figures.video import main, read_job, write_film, write_job, write_strip
from playground.limits import LIMITS
from playground.motion.synthetic import corpus
from tests.conftest import drifting

ROOT = Path(__file__).parents[2]
BLUE, GREY = "#0072b2", "#6b7684"


@pytest.fixture(scope="module")
def walk() -> Actor:
    return Actor("Walk", corpus(1, seed=4)[0].motion.joints[:20:2], BLUE, "MPJPE 21 mm")


def near(picture: np.ndarray, color: str) -> int:
    """How many pixels have about the hue of a colour."""
    wanted = np.array([int(color[i : i + 2], 16) for i in (1, 3, 5)], float)
    pixels = picture.reshape(-1, 3).astype(float)
    spread = np.ptp(pixels, axis=1) > 60
    return int(
        ((pixels @ wanted) / (np.linalg.norm(pixels, axis=1) * np.linalg.norm(wanted) + 1e-9) > 0.985)[spread].sum()
    )


def test_an_mp4_has_every_frame_and_moves(walk: Actor, tmp_path: Path) -> None:
    import av

    told: list[tuple[int, int]] = []
    write_film([walk], tmp_path / "walk.mp4", note="a note", tell=lambda done, total: told.append((done, total)))
    with av.open(str(tmp_path / "walk.mp4")) as film:
        stream = film.streams.video[0]
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(stream)]
        assert stream.average_rate == LIMITS.fps and stream.codec_context.name == "h264"
    assert len(frames) == 10 and told == [(n, 10) for n in range(1, 11)]
    assert np.abs(frames[0].astype(int) - frames[9]).max() > 60  # the legs have moved
    assert near(frames[5], BLUE) > 1_500
    edge = np.concatenate([frames[5][:8].reshape(-1, 3), frames[5][:, :4].reshape(-1, 3)])
    assert np.ptp(edge.astype(int), axis=1).max() < 40  # the floor may go on, the figure is not cut off


def test_a_gif_loops_at_half_the_rate_and_shows_two_figures(walk: Actor, tmp_path: Path) -> None:
    other = Actor("Original", drifting(8), GREY)
    write_film([other, walk], tmp_path / "both.gif", dark=True)
    with Image.open(tmp_path / "both.gif") as film:
        assert film.n_frames == 5 and film.info["duration"] == 100 and film.info["loop"] == 0
        first = np.asarray(film.convert("RGB"))
    assert first[2, 2].max() < 60  # a dark ground
    left, right = np.split(first, 2, axis=1)
    assert near(right, BLUE) > 500 and near(left, BLUE) < 50


def test_a_strip_has_a_row_a_figure_and_gets_darker(walk: Actor, tmp_path: Path) -> None:
    write_strip([walk, walk], tmp_path / "two.png", poses=4)
    write_strip([walk], tmp_path / "one.png", poses=4)
    two, one = (np.asarray(Image.open(tmp_path / name).convert("RGB")) for name in ("two.png", "one.png"))
    assert two.shape == (2 * one.shape[0], *one.shape[1:])
    quarters = list(np.array_split(one[40:-60], 4, axis=1))
    darkest = [part.reshape(-1, 3).sum(axis=1).min() for part in quarters]
    assert darkest == sorted(darkest, reverse=True) and near(quarters[-1], BLUE) > 1_000


@pytest.mark.parametrize(
    "joints", [np.zeros((0, 22, 3)), np.zeros((4, 21, 3)), np.full((4, 22, 3), np.nan), np.full((4, 22, 3), 1e6),
               np.zeros((LIMITS.max_frames + 2, 22, 3))],
)  # fmt: skip
def test_what_is_no_motion_is_refused(joints: np.ndarray) -> None:
    with pytest.raises(PlaygroundError, match=r"^(a picture needs joints|positions in a picture)"):
        Actor("bad", joints, BLUE)


def test_bounds_are_kept(walk: Actor, tmp_path: Path) -> None:
    with pytest.raises(PlaygroundError, match=r"ends in \.mp4 or \.gif"):
        write_film([walk], tmp_path / "walk.avi")
    for actors in ([], [walk] * 7):
        with pytest.raises(PlaygroundError, match="1 to 6 figures"):
            write_film(actors, tmp_path / "walk.mp4")
    with pytest.raises(PlaygroundError, match="2 to 16 poses"):
        write_strip([walk], tmp_path / "walk.png", poses=400)
    with pytest.raises(PlaygroundError, match="sides of 64 to 1920"):
        Studio((4_000, 4_000))


def test_the_camera_follows_a_smooth_way() -> None:
    joints = drifting(60)
    way = followed(joints.astype(float))
    assert way.shape == (60, 2) and np.abs(way[10:-10] - joints[10:-10, 0][:, [0, 2]]).max() < 0.08


def test_words_stay_in_the_picture() -> None:
    blank = np.full((120, 200, 3), 255, np.uint8)
    assert (labelled(blank, [(100.0, "Name", "small", BLUE)], "Title") != blank).any(axis=(0, 2)).sum() > 20
    long = noted(blank, "word " * 100)
    assert (long[-22:, 190:] == 255).all() and (long[-22:, :190] != 255).any()


def test_a_job_comes_back_and_a_broken_one_is_said_so(
    walk: Actor, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    write_job(tmp_path / "job.npz", [walk], True, "no\nte")
    (actor,), dark, note = read_job(tmp_path / "job.npz")
    assert np.allclose(actor.joints, walk.joints) and (actor.name, actor.color, dark) == ("Walk", BLUE, True)
    assert note == "no\nte"
    (tmp_path / "broken.npz").write_bytes(b"PK\x03\x04 nothing")
    assert main([str(tmp_path / "broken.npz"), str(tmp_path / "x.mp4")]) == 2
    assert "is no job for a picture" in capsys.readouterr().err


def test_the_command_tells_how_far_it_is(walk: Actor, tmp_path: Path) -> None:
    write_job(tmp_path / "job.npz", [Actor("Walk", walk.joints[:4], BLUE)], False, "")
    command = [sys.executable, "-m", "playground.figures.video", str(tmp_path / "job.npz"), str(tmp_path / "walk.gif")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split("\n")[:2] == ["1 2", "2 2"] and (tmp_path / "walk.gif").stat().st_size > 2_000
