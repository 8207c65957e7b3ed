"""Pictures of moving figures without a screen: bodies side by side on one floor, seen as on the stage (pyvista).

The camera, the floor, the colours and the shades of left and right are the stage's. pyvista is imported where a picture
is rendered, and nowhere earlier. A Studio belongs to the thread that made it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from playground.errors import PlaygroundError
from playground.figures.body import RADII, Floats, Surface, mix, place, surface, tones_of
from playground.figures.colors import TOKENS, contrast, hex_to_rgb, rgb_to_hex
from playground.limits import LIMITS
from playground.motion.skeleton import HUMAN22

FIELD = 24.0  # degrees, vertical
YAW, PITCH = 0.62, 0.16  # radians
WORDS = 54  # pixels under the figures that belong to their names
AIR = 14  # pixels above them
OUTLINE = 0.006  # metres by which the dark shell stands out
SHADOW = (0.16, -0.1)  # how far a shadow moves per metre of height
SMOOTH = 10  # frames on either side over which the followed point is averaged
SAMPLES = 8  # colour samples a pixel
Frame = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Actor:
    """One moving figure. joints: [F, 22, 3] metres, Y up; color: "#rrggbb"; caption: the small text under the name."""

    name: str
    joints: Floats
    color: str
    caption: str = ""

    def __post_init__(self) -> None:
        joints = np.asarray(self.joints, np.float64)
        if joints.ndim != 3 or joints.shape[1:] != (HUMAN22.size, 3) or not 1 <= len(joints) <= LIMITS.max_frames + 1:
            raise PlaygroundError(
                f"a picture needs joints [frames, {HUMAN22.size}, 3] of 1 to {LIMITS.max_frames + 1} frames,"
                f" got {list(joints.shape)}"
            )
        if not np.isfinite(joints).all() or np.abs(joints).max() > LIMITS.max_metres:
            raise PlaygroundError(f"positions in a picture must be finite and within {LIMITS.max_metres:g} metres")
        object.__setattr__(self, "joints", joints)


class Studio:
    """Renders poses: `with Studio((640, 480)) as studio: frame = studio.shoot(bodies, target, distance)`."""

    def __init__(self, size: tuple[int, int], dark: bool = False, larger: int = 1) -> None:
        """size: of the finished picture in pixels; it is rendered `larger` times as large and made smaller again."""
        import pyvista

        if min(size) < 64 or max(size) > LIMITS.max_picture_side:
            raise PlaygroundError(f"a picture may have sides of 64 to {LIMITS.max_picture_side} pixels, got {size}")
        self.size, self.dark = size, dark
        self.ground = hex_to_rgb(TOKENS["surface"][dark]).astype(np.float64)
        self.line = hex_to_rgb(TOKENS["line-strong"][dark]).astype(np.float64)
        self._mesh, self._larger = pyvista.PolyData, larger
        width, height = size[0], size[1] - AIR - WORDS
        self.plotter = pyvista.Plotter(off_screen=True, window_size=[larger * width, larger * height], lighting="none")
        if self.plotter.render_window is not None:
            self.plotter.render_window.SetMultiSamples(SAMPLES)
        self.plotter.renderer.set_background(rgb_to_hex(self.ground.astype(np.uint8)))
        self.plotter.renderer.SetTwoSidedLighting(True)
        for position, strength in (((-0.55, 0.75, 1.0), 0.62), ((0.9, 0.1, 0.6), 0.12)):
            self.plotter.add_light(pyvista.Light(position=position, intensity=strength, light_type="camera light"))
        self.right, self.forward, self.up = _view()

    def __enter__(self) -> "Studio":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.plotter.close()

    def shoot(self, bodies: Sequence[tuple[Surface, dict[str, Floats]]], target: Floats, distance: float) -> Frame:
        """The picture [H, W, 3] of skins with their tones, standing where they are, without words."""
        self.plotter.renderer.RemoveAllViewProps()
        self._floor(target, max(4.0, min(12.0, np.ceil(0.75 * distance))))
        for skin, tones in bodies:
            self._shadow(skin)
            self._body(skin, tones)
        camera = self.plotter.camera
        camera.view_angle, camera.focal_point, camera.up = FIELD, tuple(target), (0.0, 1.0, 0.0)
        camera.position = tuple(target - self.forward * distance)
        camera.clipping_range = (0.1, distance + 40.0)
        self.plotter.render()
        shot = self.plotter.screenshot(None, return_img=True)
        picture = Image.new("RGB", self.size, rgb_to_hex(self.ground.astype(np.uint8)))
        small = Image.fromarray(np.asarray(shot)).resize(
            (self.size[0], self.size[1] - AIR - WORDS), Image.Resampling.BOX
        )
        picture.paste(small, (0, AIR))
        return np.asarray(picture)

    def spot(self, points: Floats, target: Floats, distance: float) -> Floats:
        """Where points [n, 3] are in the picture: pixels from the left and from the top [n, 2]."""
        seen = points - (target - self.forward * distance)
        depth = np.maximum(seen @ self.forward, 0.1)
        focal = (self.size[1] - AIR - WORDS) / 2 / np.tan(np.deg2rad(FIELD) / 2)
        middle = np.array([self.size[0] / 2, AIR + (self.size[1] - AIR - WORDS) / 2])
        return middle + np.stack([seen @ self.right, -(seen @ self.up)], axis=-1) * (focal / depth)[:, None]

    def fit(self, points: Floats, radii: Floats, target: Floats) -> float:
        """The distance from which all spheres (points [n, 3], radii [n] metres) are inside the picture."""
        focal = (self.size[1] - AIR - WORDS) / 2 / np.tan(np.deg2rad(FIELD) / 2)
        top, bottom = AIR + 2, self.size[1] - WORDS - 2
        near, far = 1.0, 80.0
        for _ in range(24):
            middle = (near + far) / 2
            depth = np.maximum((points - target) @ self.forward + middle, 0.1)
            pixels = radii * focal / depth
            x, y = self.spot(points, target, middle).T
            inside = (x > 4 + pixels) & (x < self.size[0] - 4 - pixels) & (y > top + pixels) & (y < bottom - pixels)
            near, far = (near, middle) if (inside & (depth > 0.3)).all() else (middle, far)
        return far

    def _add(self, mesh: Any, **look: Any) -> None:
        self.plotter.add_mesh(mesh, copy_mesh=False, render=False, reset_camera=False, **look)

    def _floor(self, target: Floats, reach: float) -> None:
        """A grid of metres that fades out round the target."""
        middle, steps = np.round(target[[0, 2]]), np.arange(-reach, reach + 1)
        x, z = (axis.reshape(-1) for axis in np.meshgrid(middle[0] + steps, middle[1] + steps, indexing="ij"))
        nodes = np.stack([x, np.full(len(x), 0.002), z], axis=-1)
        side = len(steps)
        index = np.arange(side * side).reshape(side, side)
        pairs = np.concatenate([np.stack([index[:-1].ravel(), index[1:].ravel()], -1),
                                np.stack([index[:, :-1].ravel(), index[:, 1:].ravel()], -1)])  # fmt: skip
        away = np.hypot(x - target[0], z - target[2]) / reach
        share = np.clip(1 - away, 0, 1)[:, None] * (0.5 if self.dark else 0.42)
        mesh = self._mesh(nodes, lines=np.insert(pairs, 0, 2, axis=1).ravel())
        mesh["rgb"] = mix(self.ground, self.line, share).astype(np.uint8)
        self._add(mesh, scalars="rgb", rgb=True, lighting=False, line_width=self._larger)

    def _shadow(self, skin: Surface) -> None:
        points = skin.points.copy()
        points[:, 0] += points[:, 1] * SHADOW[0]
        points[:, 2] += points[:, 1] * SHADOW[1]
        points[:, 1] = 0.001
        mesh = self._mesh(points, faces=np.insert(skin.faces, 0, 3, axis=1).ravel())
        shade = mix(self.ground, np.array([10.0, 12.0, 16.0]), 0.35 if self.dark else 0.09)
        self._add(mesh, color=rgb_to_hex(shade.astype(np.uint8)), lighting=False)

    def _body(self, skin: Surface, tones: dict[str, Floats]) -> None:
        faces = np.insert(skin.faces, 0, 3, axis=1).ravel()
        mesh = self._mesh(skin.points, faces=faces)
        mesh.point_data.active_normals = skin.normals
        mesh["rgb"] = np.array([tones[tone] for tone in skin.tones]).astype(np.uint8)
        look: dict[str, Any] = {"ambient": 0.6, "diffuse": 0.7, "specular": 0.0}
        self._add(mesh, scalars="rgb", rgb=True, smooth_shading=True, **look)
        shell = self._mesh(skin.points + skin.normals * OUTLINE, faces=faces)
        edge = rgb_to_hex(tones["outline"].astype(np.uint8))
        self._add(shell, color=edge, lighting=False, culling="front")


def labelled(frame: Frame, places: Sequence[tuple[float, str, str, str]], title: str = "", dark: bool = False) -> Frame:
    """A picture with words under its figures: (pixels from the left, name, small text, colour or "") each.

    title stands in the upper left corner.
    """
    picture = Image.fromarray(frame)
    draw = ImageDraw.Draw(picture)
    ground, text, muted = (TOKENS[name][dark] for name in ("surface", "text", "muted"))
    base = picture.height - WORDS
    for x, name, small, color in places:
        ink = muted if not color else (color if contrast(color, ground) >= 4.5 else text)
        draw.text((x, base + 4), name, fill=ink, font=_font(15), anchor="ma")
        draw.text((x, base + 23), small, fill=muted, font=_font(12), anchor="ma")
    if title:
        draw.text((10, 8), title, fill=text, font=_font(15), anchor="la")
    return np.asarray(picture)


def noted(frame: Frame, note: str, dark: bool = False) -> Frame:
    """A picture with one small line at its foot, cut to its width."""
    picture = Image.fromarray(frame)
    draw, font = ImageDraw.Draw(picture), _font(11)
    while note and draw.textlength(note, font) > picture.width - 20:
        note = note[:-2].rstrip("… ") + "…"
    draw.text((10, picture.height - 6), note, fill=TOKENS["muted"][dark], font=font, anchor="ls")
    return np.asarray(picture)


def followed(joints: Floats) -> Floats:
    """The way of the pelvis over the floor [F, 2], smoothed: what the camera follows."""
    padded = np.pad(joints[:, 0, [0, 2]], ((SMOOTH, SMOOTH), (0, 0)), mode="edge")
    window = np.ones(2 * SMOOTH + 1) / (2 * SMOOTH + 1)
    return np.stack([np.convolve(column, window, mode="valid") for column in padded.T], axis=-1)


def reach_of(joints: Floats) -> tuple[Floats, Floats]:
    """Spheres [F * S, 3] of all poses and their radii: what must fit into a picture."""
    centres = place(joints)
    return centres.reshape(-1, 3), np.tile(RADII, len(centres))


def skin_of(pose: Floats) -> Surface:
    """The skin of one pose [22, 3]."""
    return surface(place(pose[None])[0])


def dressed(color: str, dark: bool = False, strength: float = 1.0) -> dict[str, Floats]:
    """The tones of a figure; strength below 1 makes it paler."""
    ground = hex_to_rgb(TOKENS["surface"][dark]).astype(np.float64)
    return {name: mix(ground, tone, strength) for name, tone in tones_of(color, dark).items()}


def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size)


def _view() -> tuple[Floats, Floats, Floats]:
    """The camera's directions: right, forward, up."""
    sy, cy, sp, cp = np.sin(YAW), np.cos(YAW), np.sin(PITCH), np.cos(PITCH)
    return np.array([cy, 0.0, -sy]), np.array([-sy * cp, -sp, -cy * cp]), np.array([-sy * sp, cp, -cy * sp])
