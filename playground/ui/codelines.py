"""Lines of the scripts that code.py writes: a motion opened or drawn again, tokens printed, texts as Python literals.

Texts enter a script as literals, never as they are.
"""

import json

from playground.limits import LIMITS
from playground.ui.drawing import MADE, Change, Wish, read_name
from playground.ui.state import OWN_FILE, Scales, State, controls_of

TOKENS = """
for number, level in enumerate({name}.levels, 1):
    print(f"scale {{number}}:", *level.ids)
"""


def drawn(state: State, seed: int, takes: int) -> str:
    """The lines that give `made`: one motion, or one of several that are drawn together."""
    prompt = "None" if state["free"] else literal(state["prompt"])
    seeds = Wish.seeds_of(seed, takes)
    given = {"seconds": number(state["seconds"]), "system": literal(state.system)}
    given |= {"seed": str(seed)} if takes == 1 else {"seeds": str(seeds)}
    names = {"guidance": "g", "cfg": "s", "temperature": "temperature", "top_k": "topk", "top_p": "topp"}
    given |= {name: number(state[key]) for name, key in names.items()}
    arguments = f"    {prompt},\n" + "".join(f"    {name}={value},\n" for name, value in given.items())
    if takes == 1:
        return f"made = engine.generate(\n{arguments})\n"
    return f"takes = engine.generate_many(\n{arguments})\nmade = takes[{min(int(state['take']), takes - 1)}]\n"


def changed(one: Change) -> str:
    """The arguments that draw a motion anew from a scale on."""
    if one.code is None:
        return f"made, scale={one.scale}, seed={one.seed}"
    return f"made, scale={one.scale}, position={one.position}, code={one.code}"


def remade(state: State) -> str:
    """The lines that open the engine and give `made`, the motion that a name of the address stands for."""
    wish, changes = read_name(str(state["motion"]), str(state["caption"]))
    own = {"prompt": wish.prompt or "", "free": wish.prompt is None, "seconds": wish.seconds, "g": wish.guidance,
           "s": wish.cfg, "temperature": wish.temperature, "topk": wish.top_k, "topp": wish.top_p,
           "system": (wish.system or state.system,)}  # fmt: skip
    return (
        "from playground.engine import default_engine\n\nengine = default_engine()\n"
        + drawn(State("generate", own), wish.seed, 1)
        + "".join(f"made = engine.regenerate({changed(one)})\n" for one in changes)
    )


def opened(state: State) -> str:
    """The lines that open the engine and give `motion`."""
    wanted = str(state["motion"])
    start = float(state["start"]) if any(row.key == "start" for row in controls_of(state.room)) else 0.0
    poses = LIMITS.max_frames + 1
    if state.room == "compare" and wanted.startswith(MADE):
        return remade(state) + "motion = made.motion\n"
    if state.values.get("clip"):
        return (
            "from playground.analysis.bundle import read_bundle\n"
            "from playground.engine import ASSETS, default_engine\n\nengine = default_engine()\n"
            f'bundle = read_bundle(ASSETS / "analysis", {literal(state.system)})\n'
            f"motion = engine.decode(bundle.token_file(bundle.position({literal(wanted)}))).motion\n"
        )
    if not wanted.startswith(OWN_FILE):
        return (
            "from playground.engine import default_engine\n\nengine = default_engine()\n"
            f"(example,) = [one for one in engine.examples() if one.id == {literal(wanted)}]\n"
            f"motion = example.motion().slice(0, {poses})\n"
        )
    first, part = round(start * LIMITS.fps), int(state["part"]) if state.room == "tokenize" else 0
    window, more = f"motion = motion.slice({first}, {first + poses})\n", ""
    if part:
        more = "from playground.data.segment import segment\n"
        window = (
            f"cuts = segment(motion.joints, motion.fps, longest={poses / LIMITS.fps})  # at still moments\n"
            f"motion = motion.slice(*cuts.spans[{part - 1}])  # part {part}\n"
        )
    return (
        f"from pathlib import Path\n\n{more}from playground.engine import default_engine\n"
        "from playground.motion.formats import read_motion\n\nengine = default_engine()\n"
        f"motion = read_motion(Path({literal(wanted.removeprefix(OWN_FILE))})).motion  # your own file\n{window}"
    )


def scale_set(scales: Scales) -> str:
    """The scales of a decode as an argument."""
    return str(scales.n) if scales.kind == "upto" else literal(f"{scales.kind}:{scales.n}")


def in_words(scales: Scales) -> str:
    """The same for people."""
    words = {"upto": "scales 1 to {}", "only": "scale {} alone", "without": "all but scale {}"}
    return words[scales.kind].format(scales.n)


def literal(text: object) -> str:
    """A text as a Python literal in double quotes: a JSON string is one."""
    return json.dumps(str(text), ensure_ascii=False)


def number(value: float) -> str:
    """A number as short as it can be written."""
    return repr(float(value)).removesuffix(".0")
