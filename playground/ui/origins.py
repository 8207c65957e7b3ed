"""Where a motion that is compared comes from: the library, a stored clip of the maps, or a generation, by its name."""

from dataclasses import dataclass, replace

from playground.analysis.bundle import Bundle
from playground.errors import PlaygroundError
from playground.motion.motion import Motion
from playground.ui.drawing import MADE, made_again
from playground.ui.services import Services


@dataclass(frozen=True)
class Origin:
    """The motion that goes through, and what it is called. Its caption is the motion's own."""

    motion: Motion
    title: str


def is_origin(services: Services, name: str) -> bool:
    """Whether `origin_of` finds a motion by this name."""
    return name.startswith(MADE) or name in {one.id for one in services.examples()} or is_clip(services, name)


def is_clip(services: Services, name: str) -> bool:
    """Whether it names a stored clip of the maps."""
    return _clip(services, name) is not None


def origin_caption(services: Services, name: str) -> str:
    """The words of its own that a motion has; "" for a generated one, whose prompt is not in its name."""
    bundle, row = _clip(services, name) or (None, 0)
    if bundle is not None:
        return bundle.clips[row].caption
    return "" if name.startswith(MADE) else services.example(name).caption


def origin_of(services: Services, name: str, caption: str | None = None) -> Origin:
    """The motion that a name of an address stands for. caption: other words for it, the prompt of a generated one.
    PlaygroundError where there is none."""
    own = origin_caption(services, name) if caption is None else caption
    if name.startswith(MADE):
        made = made_again(services, name, own)
        return Origin(replace(made.motion, caption=made.prompt), made.prompt or "a generated motion")
    bundle, row = _clip(services, name) or (None, 0)
    if bundle is None:
        found = services.example(name)
        return Origin(replace(found.motion(), caption=own), found.title)
    motion = services.engine().decode(bundle.token_file(row)).motion
    return Origin(replace(motion, caption=own), bundle.clips[row].caption or bundle.clips[row].action)


def _clip(services: Services, name: str) -> tuple[Bundle, int] | None:
    """A stored clip of the maps: where it lies, None where there is none of that name."""
    try:
        bundle = services.bundle(services.default_system().name)
    except PlaygroundError:
        return None
    return (bundle, bundle.position(name)) if name in bundle.ids else None
