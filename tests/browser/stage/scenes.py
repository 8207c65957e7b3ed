"""Payloads for the stage's browser tests, and the page they are shown on."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from playwright.sync_api import Page

from playground.figures import stage as scene
from playground.motion.representation import from_features67, to_features67
from playground.motion.skeleton import HUMAN22

FRAMES = 48
SIZES, CODES = (2, 6, 12, 24), (16, 32, 64, 128)
RNG = np.random.default_rng(11)
IDS = [RNG.integers(0, codes, size) for size, codes in zip(SIZES, CODES, strict=True)]


def walk(frames: int = FRAMES, shake: float = 0.0) -> np.ndarray:
    """A body in T-pose that swings its arms and goes forward one metre a second. [F, 22, 3]"""
    rest = np.zeros((22, 3))
    for joint, parent in enumerate(HUMAN22.parents):
        rest[joint] = np.array(HUMAN22.offsets[joint]) + (rest[parent] if parent >= 0 else [0, 0.95, 0])
    time = np.arange(frames)[:, None]
    moving = np.repeat(rest[None], frames, axis=0)
    moving[:, :, 2] += time / 20
    moving[:, [20, 21], 1] += 0.4 * np.sin(time / 4 + np.array([0, 2]))
    return (moving + shake * np.sin(time / 3)[:, :, None] * RNG.normal(size=(1, 22, 3))).astype(np.float32)


def payload(**settings: Any) -> scene.Json:
    """Two figures and two tracks, the second a third shorter than the first."""
    rows = [scene.level(ids, codes) for ids, codes in zip(IDS, CODES, strict=True)]
    short = [scene.level(np.array([1, 2, 3, 4]), 8), scene.level(None, 8, size=8)]
    figures = [
        scene.figure("original", "Original", walk()),
        scene.figure("rebuilt", "LG-Tok", walk(shake=0.05), "lgtok", "MPJPE 31 mm", ghost_of="original"),
    ]
    tracks = [
        scene.track("lgtok", "LG-Tok", FRAMES, rows, scene.NOT_FRAMES),
        scene.track("momask-lite", "MoMask", 32, short),
    ]
    return scene.payload(figures, tracks, **settings)


MARKED = np.arange(SIZES[2]) % 5 == 1
SPANS = np.array([[0, 30], [4, 26], [10, 30], [20, 40], [30, 46], [36, 48]])  # measured, of the second scale
KEPT = [(0, 12), (30, 48)]
DIFFERENCE = np.abs(np.random.default_rng(5).normal(size=(FRAMES, 22))) * 0.01
DIFFERENCE[20, HUMAN22.index("l_wrist")] = 0.25  # the largest by far
WORDS = ("a", "person", "swings", "both", "arms")
ATTENTION = np.random.default_rng(6).dirichlet(np.ones(len(WORDS)), FRAMES).T


def rich(**settings: Any) -> scene.Json:
    """The same two figures; measured spans, marks and entropy; hatched frames; a heat map of joints, one of words."""
    rows = [scene.level(ids, codes) for ids, codes in zip(IDS, CODES, strict=True)]
    rows[1] = scene.level(IDS[1], CODES[1], spans=SPANS)
    rows[2] = scene.level(IDS[2], CODES[2], marks=MARKED, entropy=np.linspace(0, np.log(CODES[2]), SIZES[2]))
    short = [scene.level(np.array([1, 2, 3, 4]), 8), scene.level(np.arange(8), 8)]
    tracks = [
        scene.track("lgtok", "LG-Tok", FRAMES, rows, scene.NOT_FRAMES, marked="differs without the caption"),
        scene.track("momask-lite", "MoMask", 32, short),
    ]
    strips = [
        scene.joint_strip("difference", "Difference", DIFFERENCE),
        scene.strip("attention", "Attention", "", WORDS, ATTENTION),
    ]
    return scene.payload(payload()["figures"], tracks, strips=strips, hatch=KEPT, **settings)


def guided() -> tuple[scene.Json, dict[str, np.ndarray]]:
    """A stage whose figures are recovered in the browser: one live, one at g = 4."""
    rows = to_features67(walk(FRAMES + 1, 0.03))
    mean, std = rows.mean(axis=0), rows.std(axis=0) + 0.05
    parts = {
        "conditional": (rows - mean) / std,
        "unconditional": (rows - mean) / std + 0.2 * RNG.normal(size=rows.shape),
        "mean": mean,
        "std": std,
    }
    parts = {name: np.asarray(value, np.float32) for name, value in parts.items()}
    parts["conditional"][:, 0] += 2.0  # turns all the way
    figures = [
        scene.figure("live", "Your g", None, "lgtok", g="live", frames=FRAMES),
        scene.figure("fixed", "g = 4", None, "lgtok", g=4, frames=FRAMES),
    ]
    return scene.payload(figures, features=scene.features("live", guidance=2.0, **parts)), parts


def expected(parts: dict[str, np.ndarray], g: float) -> np.ndarray:
    """What Python recovers, [F, 22, 3]."""
    wide = {name: value.astype(np.float64) for name, value in parts.items()}
    blended = (1 + g) * wide["conditional"] - g * wide["unconditional"]
    return from_features67(blended * wide["std"] + wide["mean"])


PIXELS = (
    "const canvas = document.querySelector('.ms-canvas'), w = canvas.width, h = canvas.height;"
    "const data = canvas.getContext('2d').getImageData(0, 0, w, h).data;"
)
NEAR = (
    PIXELS + "const [[r, g, b], within] = argument; let n = 0, box = [w, h, 0, 0];"
    "for (let i = 0; i < w * h; i++) {"
    "  if (Math.hypot(data[4 * i] - r, data[4 * i + 1] - g, data[4 * i + 2] - b) > within) continue;"
    "  const x = i % w, y = Math.floor(i / w); n++;"
    "  box = [Math.min(box[0], x), Math.min(box[1], y), Math.max(box[2], x), Math.max(box[3], y)]; }"
    "return [n, ...box, w, h];"
)


@dataclass
class Box:
    """Pixels near a colour: how many, the box round them, the size of the picture."""

    count: int
    left: int
    top: int
    right: int
    bottom: int
    width: int
    height: int


@dataclass
class Shown:
    """A page with one stage on it, what it asked for and what it complained about."""

    page: Page
    requests: list[str] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)

    def state(self, key: str) -> Any:
        return self.page.evaluate("key => MotionStage.get('page').state[key]", key)

    def call(self, code: str, argument: Any = None) -> Any:
        """Run `code` with `stage` and `argument` in the page."""
        return self.page.evaluate(f"argument => {{ const stage = MotionStage.get('page'); {code} }}", argument)

    def until(self, code: str) -> None:
        """Wait until an expression about `stage` holds."""
        self.page.wait_for_function(f"() => {{ const stage = MotionStage.get('page'); return {code}; }}")

    def drawn(self) -> None:
        """Wait until everything that was asked for is drawn."""
        self.page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def picture(self) -> int:
        """A number that changes when the figures' picture does."""
        self.drawn()
        return int(
            self.call(f"{PIXELS} let sum = 0; for (const byte of data) sum = (31 * sum + byte) | 0; return sum;")
        )

    def corner(self) -> list[int]:
        """The colour of the picture's first pixel."""
        self.drawn()
        return list(self.call(f"{PIXELS} return Array.from(data.slice(0, 3));"))

    def near(self, color: str, within: float = 40) -> Box:
        """How much of the picture is near a colour, and where."""
        self.drawn()
        return Box(*self.call(NEAR, [[int(color[i : i + 2], 16) for i in (1, 3, 5)], within]))

    def cell(self, track: int, level: int, position: int) -> tuple[float, float]:
        """Middle of a cell of the score, in the window."""
        box = self.page.locator(".ms-still").bounding_box()
        assert box is not None
        heights = self.call("return stage.score.laid.rows.map(r => [r.track, r.level, r.y + r.height / 2])")
        y = next(middle for t, n, middle in heights if (t, n) == (track, level))
        width = self.call("return stage.score.width")
        frames, size = ((FRAMES, SIZES[level]), (32, 4))[track]
        return box["x"] + (position + 0.5) * frames / size / FRAMES * width, box["y"] + y

    def value(self, strip: int, row: int, frame: float) -> tuple[float, float]:
        """A place in a heat map, scrolled into the window."""
        self.page.locator(".ms-tracks").evaluate("node => node.scrollIntoView({ block: 'end' })")
        box = self.page.locator(".ms-still").bounding_box()
        assert box is not None
        y, step = self.call("const p = stage.score.laid.strips[argument]; return [p.y, p.step]", strip)
        width = self.call("return stage.score.width")
        return box["x"] + (frame + 0.5) / FRAMES * width, box["y"] + y + (row + 0.5) * step

    def events(self) -> list[Any]:
        found: list[Any] = self.page.evaluate("() => window.heard")
        return found
