"""Small moving figures for the points of the maps: a few seconds of every stored clip, flat, a few poses a second.

They are made with the stored first results (opening.py), fetched by the page when a point is first hovered, and played
there by preview.js, which draws between poses; a hover asks nobody. Joints travel as int8 in steps of STEP metres.
"""

import base64
import json
from pathlib import Path
from typing import Any

import gradio as gr
import numpy as np
from numpy.typing import ArrayLike, NDArray

from playground.limits import LIMITS
from playground.motion.representation import canonicalise
from playground.motion.rotation import qrotate, yaw_quaternion
from playground.motion.skeleton import HUMAN22
from playground.ui.services import Services
from playground.ui.tokencard import sentence

RATE, SECONDS = 5, 3.6  # poses a second, and the length of what is played: the middle of a clip
TURN = 0.6  # radians that a figure is turned out of the front view
STEP = 0.0125  # metres of one step of an int8
MIDDLE = 0.9  # metres above the floor that stand at 0
_TEMPLATE = '<figure class="mtp-preview" hidden aria-hidden="true"><canvas></canvas><figcaption></figcaption></figure>'
_ON_LOAD = """
const start = () => window.mtpPreview
  ? mtpPreview(element, props.chart, () => server.previews())
  : requestAnimationFrame(start);
start();
"""


def flat(joints: ArrayLike) -> NDArray[np.int8]:
    """The middle of a motion [F, 22, 3] as seen half from the front: int8 [P, 22, 2], right and up from under the
    pelvis, P = at most RATE * SECONDS + 1 poses."""
    motion = np.asarray(joints, np.float64)
    every = LIMITS.fps // RATE
    span = min(len(motion), round(SECONDS * LIMITS.fps) + 1)
    first = (len(motion) - span) // 2
    turned = qrotate(yaw_quaternion(np.array(TURN)), canonicalise(motion[first : first + span : every]))
    seen = np.stack([turned[..., 0] - turned[:, :1, 0], turned[..., 1] - MIDDLE], axis=-1)
    return np.clip(np.round(seen / STEP), -127, 127).astype(np.int8)


def make_previews(services: Services, system: str) -> dict[str, Any]:
    """The previews of all stored clips of a system, as JSON has them."""
    bundle, engine = services.bundle(system), services.engine()
    poses = [flat(engine.decode(bundle.token_file(row)).motion.joints) for row in range(len(bundle))]
    return {
        "made_from": services.fingerprint(),
        "rate": RATE,
        "step": STEP,
        "middle": MIDDLE,
        "parents": HUMAN22.parents,
        "right": [name.startswith("r_") for name in HUMAN22.joints],
        "ids": list(bundle.ids),
        "words": [sentence(bundle, row) for row in range(len(bundle))],
        "poses": [len(one) for one in poses],
        "joints": base64.b64encode(np.concatenate(poses).tobytes()).decode(),
    }


def previews_path(services: Services) -> Path:
    """Where they lie."""
    return services.opening_path("embedding-map-previews")


def write_previews(services: Services) -> None:
    """Make and store those of the system that the maps open with."""
    made = make_previews(services, services.default_system().name)
    path = previews_path(services)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(made, separators=(",", ":")) + "\n", encoding="utf-8")


def read_previews(services: Services) -> dict[str, Any] | None:
    """The stored ones; None where there are none or they were made from other checkpoints."""
    try:
        found = json.loads(previews_path(services).read_text(encoding="utf-8"))
        return dict(found) if found["made_from"] == services.fingerprint() else None
    except (OSError, ValueError, TypeError, KeyError):
        return None


def preview_card(services: Services, chart: str) -> gr.HTML:
    """What shows them beside the points of a chart, by its element's id; takes no place on the page."""

    def previews(_: Any = None) -> dict[str, Any] | None:
        return read_previews(services)

    return gr.HTML(
        "", html_template=_TEMPLATE, js_on_load=_ON_LOAD, apply_default_css=False, server_functions=[previews],
        chart=chart, elem_classes=["mtp-preview-host"],
    )  # fmt: skip
