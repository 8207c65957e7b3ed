"""Films and pose strips of motions: MP4 (H.264), GIF and PNG, rendered off-screen, with progress.

    write_film([Actor("Original", motion.joints, "#6b7684")], Path("walk.mp4"), tell=progress)
    write_strip([Actor("LG-Tok lite", motion.joints, "#0072b2")], Path("walk.png"))

`python -m playground.figures.video JOB.npz OUT` does the same in a process of its own, which the app can stop at any
time: JOB holds `joints_0`, `joints_1` ... and `about`, a JSON text {"actors": [{"name", "color", "caption"}], "dark",
"note"}; a line "done total" comes out for every frame. A film follows the first figure, as the stage does.
"""

import argparse
import json
import sys
import zipfile
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from playground.errors import PlaygroundError
from playground.figures.body import Floats
from playground.figures.pictures import (
    Actor,
    Frame,
    Studio,
    dressed,
    followed,
    labelled,
    noted,
    place,
    reach_of,
    skin_of,
    surface,
)
from playground.limits import LIMITS

FILMS = (".mp4", ".gif")
HEIGHT = 480  # pixels of a film
GIF_EVERY = 2  # a GIF shows every second frame: 10 a second
GIF_SHARE = 0.75  # its size against the MP4's
STRIP = (1800, 400)  # pixels of one row of a pose strip
POSES = 8
Tell = Callable[[int, int], None]


def write_film(
    actors: Sequence[Actor], path: Path, *, dark: bool = False, note: str = "", tell: Tell | None = None
) -> None:
    """A film of all figures in sync, .mp4 at 20 frames a second or .gif at 10, looping.

    note: one line at the foot of the picture; tell(done, total) is called after every frame.
    PlaygroundError for another suffix, no figure or too many.
    """
    _check(actors)
    if path.suffix not in FILMS:
        raise PlaygroundError(f"a film ends in {' or '.join(FILMS)}, not {path.suffix or 'without one'}")
    moving = path.suffix == ".gif"
    share = GIF_SHARE if moving else 1.0
    size = (_even(share * min(LIMITS.max_picture_side, 560 + 220 * (len(actors) - 1))), _even(share * HEIGHT))
    every = GIF_EVERY if moving else 1
    frames = _shots(actors, size, every, dark, note, tell or (lambda done, total: None))
    if moving:
        _write_gif(frames, path, every)
    else:
        _write_mp4(frames, path, size)


def write_strip(
    actors: Sequence[Actor], path: Path, *, poses: int = POSES, dark: bool = False, note: str = "",
    tell: Tell | None = None,
) -> None:  # fmt: skip
    """Poses of each motion side by side in a PNG, one row a figure, early ones paler, seconds underneath."""
    _check(actors)
    if not 2 <= poses <= 16:
        raise PlaygroundError(f"a strip shows 2 to 16 poses, got {poses}")
    with Studio(STRIP, dark, larger=2) as studio:
        rows = [_standing(studio, actor, poses) for actor in actors]
        spacing = max(spacing for _, _, spacing in rows)
        slots = studio.right * (np.arange(poses)[:, None] - (poses - 1) / 2) * spacing
        target = np.array([0.0, (max(1.5, max(float(row[:, 15, 1].max()) for row, _, _ in rows)) + 0.1) / 2, 0.0])
        distance = max(studio.fit(*reach_of(row + slots[:, None]), target) for row, _, _ in rows)
        made = []
        for number, (actor, (row, at, _)) in enumerate(zip(actors, rows, strict=True), 1):
            shares = np.linspace(0.4, 1.0, poses)
            bodies = [(skin_of(pose), dressed(actor.color, dark, float(share)))
                      for pose, share in zip(row + slots[:, None], shares, strict=True)]  # fmt: skip
            spots = studio.spot(target + slots, target, distance)
            words = [(float(x), f"{frame / LIMITS.fps:.1f} s", "", "") for (x, _), frame in zip(spots, at, strict=True)]
            name = " · ".join(part for part in (actor.name, actor.caption) if part)
            shot = labelled(studio.shoot(bodies, target, distance), words, "", dark)
            made.append(labelled(_cut(shot, spots[:, 0]), [], name, dark))
            if tell:
                tell(number, len(actors))
    finished = np.concatenate(made)
    Image.fromarray(noted(finished, note, dark) if note else finished).save(path, format="PNG", optimize=True)


def _check(actors: Sequence[Actor]) -> None:
    if not 1 <= len(actors) <= LIMITS.max_figures:
        raise PlaygroundError(f"a picture shows 1 to {LIMITS.max_figures} figures, got {len(actors)}")


def _even(length: float) -> int:
    return 2 * round(length / 2)


def _shots(
    actors: Sequence[Actor], size: tuple[int, int], every: int, dark: bool, note: str, tell: Tell
) -> Iterator[Frame]:
    """The frames of a film, one after the other."""
    count = max(len(actor.joints) for actor in actors)
    way = followed(actors[0].joints)
    centres = [place(actor.joints) for actor in actors]
    tones = [dressed(actor.color, dark) for actor in actors]
    with Studio(size, dark) as studio:
        lanes = _lanes(actors, studio.right)
        target, distance = _fitted(studio, actors, lanes, way)
        words = [(lane, actor) for lane, actor in zip(lanes, actors, strict=True)]
        chosen = range(0, count, every)
        for done, t in enumerate(chosen, 1):
            here = way[min(t, len(way) - 1)]
            target = np.array([here[0], target[1], here[1]])
            bodies = [
                (surface(balls[min(t, len(balls) - 1)] + lane), tone)
                for balls, lane, tone in zip(centres, lanes, tones, strict=True)
            ]
            spots = studio.spot(np.array([target + lane for lane, _ in words]), target, distance)
            places = [
                (float(x), actor.name, actor.caption, actor.color)
                for (x, _), (_, actor) in zip(spots, words, strict=True)
            ]
            shot = labelled(studio.shoot(bodies, target, distance), places, "", dark)
            yield noted(shot, note, dark) if note else shot
            tell(done, len(chosen))


def _lanes(actors: Sequence[Actor], right: Floats) -> list[Floats]:
    """How far each figure is moved [3] so that they stand side by side from the camera's angle."""
    half = 0.45
    for actor in actors:
        around = actor.joints[:, :, [0, 2]] - followed(actor.joints)[:, None]
        half = max(half, float(np.linalg.norm(around, axis=-1).max()))
    spacing = min(2.0, max(0.95, 1.3 * half))
    return [right * (index - (len(actors) - 1) / 2) * spacing for index in range(len(actors))]


def _fitted(studio: Studio, actors: Sequence[Actor], lanes: Sequence[Floats], way: Floats) -> tuple[Floats, float]:
    """Where the camera looks in the first frame, and from how far every frame fits."""
    points, radii = [], []
    for actor, lane in zip(actors, lanes, strict=True):
        own = actor.joints[::3]
        centre = way[np.minimum(np.arange(0, len(actor.joints), 3), len(way) - 1)]
        moved = own + lane - np.stack([centre[:, 0], np.zeros(len(own)), centre[:, 1]], axis=-1)[:, None]
        spheres, sizes = reach_of(moved)
        points.append(spheres)
        radii.append(sizes)
    tall = max(1.6, max(float(actor.joints[:, 15, 1].max()) for actor in actors)) + 0.2
    target = np.array([0.0, tall / 2, 0.0])
    distance = studio.fit(np.concatenate(points), np.concatenate(radii), target)
    return np.array([way[0, 0], tall / 2, way[0, 1]]), distance


def _standing(studio: Studio, actor: Actor, poses: int) -> tuple[Floats, NDArray[np.int64], float]:
    """Poses of a strip over the origin [poses, 22, 3], their frames, and how far apart they must stand in metres."""
    at = np.round(np.linspace(0, len(actor.joints) - 1, poses)).astype(np.int64)
    standing = actor.joints[at] * 1.0
    standing[:, :, [0, 2]] -= actor.joints[at][:, :1, [0, 2]]
    half = float(np.abs(standing @ studio.right).max())
    return standing, at, min(1.4, max(0.7, 1.25 * half))


def _cut(frame: Frame, spots: Floats) -> Frame:
    """A row of a strip without the empty floor at its sides."""
    aside = max(110.0, 1.1 * float(np.diff(spots).mean()))
    first, last = max(0, int(spots[0] - aside)), min(frame.shape[1], int(spots[-1] + aside))
    return np.ascontiguousarray(frame[:, first:last])


def _write_mp4(frames: Iterator[Frame], path: Path, size: tuple[int, int]) -> None:
    import av

    with av.open(str(path), "w", format="mp4", options={"movflags": "faststart"}) as film:
        stream = film.add_stream("libx264", rate=LIMITS.fps, options={"crf": "20", "preset": "veryfast"})
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        stream.time_base = Fraction(1, LIMITS.fps)
        for frame in frames:
            film.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
        film.mux(stream.encode())


def _write_gif(frames: Iterator[Frame], path: Path, every: int) -> None:
    pictures = [Image.fromarray(frame).quantize(128, dither=Image.Dither.NONE) for frame in frames]
    duration = 1000 * every // LIMITS.fps
    pictures[0].save(path, format="GIF", save_all=True, append_images=pictures[1:], duration=duration, loop=0)


def read_job(path: Path) -> tuple[list[Actor], bool, str]:
    """What a job file asks for: figures, whether on dark, the note. PlaygroundError if it is none."""
    try:
        with np.load(path, allow_pickle=False) as file:
            about = json.loads(str(file["about"]))
            actors = [
                Actor(one["name"], file[f"joints_{n}"], one["color"], one["caption"])
                for n, one in enumerate(about["actors"])
            ]
        return actors, bool(about["dark"]), str(about["note"])
    except (OSError, KeyError, TypeError, ValueError, zipfile.BadZipFile) as error:
        if isinstance(error, PlaygroundError):
            raise
        raise PlaygroundError(f"{path.name} is no job for a picture") from error


def write_job(path: Path, actors: Sequence[Actor], dark: bool, note: str) -> None:
    """Inverse of `read_job`."""
    about = [{"name": one.name, "color": one.color, "caption": one.caption} for one in actors]
    arrays = {f"joints_{n}": actor.joints.astype(np.float32) for n, actor in enumerate(actors)}
    text = np.array(json.dumps({"actors": about, "dark": dark, "note": note}))
    np.savez(path, about=text, **arrays)  # type: ignore[arg-type]


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; returns its exit status."""
    parser = argparse.ArgumentParser(prog="python -m playground.figures.video", description=__doc__.splitlines()[0])
    parser.add_argument("job", type=Path)
    parser.add_argument("out", type=Path)
    options = parser.parse_args(arguments)

    def tell(done: int, total: int) -> None:
        sys.stdout.write(f"{done} {total}\n")
        sys.stdout.flush()

    try:
        actors, dark, note = read_job(options.job)
        write = write_strip if options.out.suffix == ".png" else write_film
        write(actors, options.out, dark=dark, note=note, tell=tell)
    except PlaygroundError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
