"""Copy as Python: the state of a room as a script that anyone can run who has the playground, with the same result.

`python_for(room, state)` wants a complete state, as `complete(services, state)` makes one: what the address leaves to
the page (the opening example, a motion's own caption, the system's own sampling) is filled in, so the script says it.
A new room adds its rows to state.CONTROLS, a function here, an entry in SCRIPTS, and a line in complete.py where it
opens with something of its own. The lines that several rooms need are in codelines.py.
"""

import textwrap
from collections.abc import Callable

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.ui.codelines import TOKENS, changed, drawn, in_words, literal, number, opened, remade, scale_set
from playground.ui.comparing import EDIT, PROMPT, VARIATIONS, Setting
from playground.ui.drawing import MADE, read_changes, read_name
from playground.ui.placing import SECONDS, SEED
from playground.ui.state import OWN_FILE, State, Token
from playground.ui.walking import PIECE, SYSTEM, read_plan

_SLIDES = """
for name, result in results.items():
    print(f"{name}: feet slide {foot_sliding(result.motion.joints):.0f} mm/s")
"""
_LOOKED = """
# Which words each moment looked at while the motion was drawn: weights [frames, words], every row sums to 1.
looked = engine.alignment(made)
print(looked.what)
for word, share in zip(looked.words, looked.weights.T):
    print(f"{word}: most at {share.argmax() / made.motion.fps:.2f} s, {share.max():.0%} of the attention there")
"""
_MADE = "Made by the Motion Token Playground; run it with the Python that the playground is installed in."


def python_for(room: str, state: State) -> str:
    """The script of a room for a complete state. PlaygroundError for a room that has none."""
    if room not in SCRIPTS:
        raise PlaygroundError("there is nothing to copy here; open one of the rooms with a motion or a plot")
    title, body = SCRIPTS[room](state)
    return f'"""{title}\n\n{_MADE}\n"""\n\n{textwrap.dedent(body).strip()}\n'


def _tokenize(state: State) -> tuple[str, str]:
    scales = state["scales"]
    asked, words = ("", "all scales") if scales is None else (f", scales={scale_set(scales)}", in_words(scales))
    return "A motion becomes tokens, and comes back.", (
        opened(state)
        + f"tokens = engine.tokenize(motion, {literal(state['caption'])}, system={literal(state.system)})\n"
        + f"back = engine.reconstruct(tokens{asked})\n"
        + TOKENS.format(name="tokens")
        + f'print(f"MPJPE, {words}: {{back.mpjpe_mm:.1f}} mm")\n'
        + _beside(state)
        + _closer(state)
    )


def _beside(state: State) -> str:
    """The systems that stand beside it, with all their scales."""
    others = tuple(name for name in state["beside"] or () if name != state.system)
    if not others:
        return ""
    return (
        f"\n# The same motion through other systems.\nothers = {{}}\nfor name in {list(others)!r}:\n"
        f"    others[name] = engine.tokenize(motion, {literal(state['caption'])}, system=name)\n"
        "    other = engine.reconstruct(others[name])\n"
        "    count = sum(level.size for level in others[name].levels)\n"
        '    print(f"{name}: {count} tokens, MPJPE {other.mpjpe_mm:.1f} mm")\n'
    )


def _closer(state: State) -> str:
    """What was looked at closely: a token replaced, or other words."""
    chosen, code, text = state["selection"], state["code"], ""
    if isinstance(chosen, Token) and code is not None and chosen.system == state.system:
        text += (
            f"\n# The token microscope: one token replaced, and the frames that the change moves.\n"
            f"swap = engine.swap(tokens, scale={chosen.scale}, position={chosen.position}, code={code})\n"
            'print(f"code {swap.before} became {swap.code}: frames {swap.span[0]} to {swap.span[1]} hold 80 % of the '
            'change, at most {1000 * swap.difference.max():.0f} mm")\n'
        )
    if state["wrong"]:
        text += (
            f"\n# What the words do: the same motion with its caption, without words, with wrong ones.\n"
            f"language = engine.language(tokens, {literal(state['wrong'])})\n"
            'print(f"other tokens: {language.bare_share:.0%} without words, {language.misled_share:.0%} with wrong '
            'ones")\n'
        )
    return text


def _generate(state: State) -> tuple[str, str]:
    seed, takes = int(state["seed"]), int(state["takes"])
    return "Words become a motion, scale by scale.", (
        "from pathlib import Path\n\nfrom playground.engine import default_engine\n"
        "from playground.motion.formats import write_motion\n\n"
        "engine = default_engine()\n"
        + drawn(state, seed, takes)
        + "".join(f"made = engine.regenerate({changed(one)})\n" for one in read_changes(state["changes"]))
        + ("made = engine.refine(made)  # standing feet slide less; the tokens stay\n" if state["plant"] else "")
        + TOKENS.format(name="made")
        + 'write_motion(made.motion, Path("generated.bvh"))\n'
        + (_LOOKED if state["words"] and not state["free"] else "")
    )


def _guidance(state: State) -> tuple[str, str]:
    g = number(state["g"])
    return "The same tokens, read with the caption and without; g exaggerates the difference.", (
        opened(state)
        + f"tokens = engine.tokenize(motion, {literal(state['caption'])}, system={literal(state.system)})\n"
        + f"guided = engine.reconstruct(tokens, guidance={g})\n"
        + f"""
# The same by hand: both decodes, blended. Rows are normalised; the rest of engine.reconstruct turns them into joints.
pair = engine.guidance_pair(tokens)
blended = (1 + {g}) * pair.conditional - {g} * pair.unconditional
"""
        + TOKENS.format(name="tokens")
        + 'print(f"MPJPE: {guided.mpjpe_mm:.1f} mm")\n'
    )


def _embedding_map(state: State) -> tuple[str, str]:
    return "A motion of the embedding map: where it lies, its tokens, the motion that they stand for.", (
        "from playground.analysis.bundle import read_bundle\nfrom playground.engine import ASSETS, default_engine\n\n"
        f'bundle = read_bundle(ASSETS / "analysis", {literal(state.system)})\n'
        f"row = bundle.position({literal(state['motion'])})\n"
        "tokens = bundle.token_file(row)\nmotion = default_engine().decode(tokens).motion\n"
        + TOKENS.format(name="tokens")
        + 'print("t-SNE:", *bundle.tsne[row], " PCA:", *bundle.pca[row])\n'
        'print(f"{motion.frames} frames of: {tokens.caption}")\n' + _placed(state)
    )


def _placed(state: State) -> str:
    """A new point on the maps, where one was placed: an example, the visitor's own file or a generation."""
    system, words, wanted = literal(state.system), state["prompt"], str(state["place"] or "")
    if words:
        made = f"new = engine.generate({literal(words)}, {number(SECONDS)}, system={system}, seed={SEED})\n"
    elif wanted.startswith(OWN_FILE):
        made = (
            "from pathlib import Path\n\nfrom playground.motion.formats import read_motion\n\n"
            f"mine = read_motion(Path({literal(wanted.removeprefix(OWN_FILE))})).motion  # your own file\n"
            f"new = engine.tokenize(mine.slice(0, {LIMITS.max_frames + 1}), mine.caption, system={system})\n"
        )
    elif wanted:
        made = (
            f"(example,) = [one for one in engine.examples() if one.id == {literal(wanted)}]\n"
            f"new = engine.tokenize(example.motion().slice(0, {LIMITS.max_frames + 1}), example.caption, "
            f"system={system})\n"
        )
    else:
        return ""
    return (
        f"\nengine = default_engine()\n{made}placed = engine.place(new)\n"
        'print("placed at t-SNE", *placed.tsne, " PCA", *placed.pca, " nearest:", *placed.nearest[:4])\n'
    )


def _codebooks(state: State) -> tuple[str, str]:
    return "Which codes are used, how evenly, at which scale.", (
        "from playground.analysis.bundle import read_bundle\nfrom playground.engine import ASSETS\n\n"
        f'bundle = read_bundle(ASSETS / "analysis", {literal(state.system)})\nusage = bundle.usage\n'
        f"order = {literal(state['order'])}\n"
        "frequencies = [usage.relative(scale, order) for scale in range(len(bundle.sizes))]\n\n"
        "print(bundle.provenance)\n"
        "for scale, (tokens, codes) in enumerate(zip(bundle.sizes, bundle.codes)):\n"
        "    dead, perplexity = len(usage.dead_[scale]), usage.perplexity_[scale]\n"
        '    print(f"scale {scale + 1}: {tokens} tokens, {codes} codes, {dead} dead, perplexity {perplexity:.1f}")\n'
        + _code_of(state)
    )


def _code_of(state: State) -> str:
    """The code of the card: what is like it, and the motion that it stands for."""
    system, *places = str(state["code"] or "").rsplit(".", 2)
    if len(places) != 2 or not all(number.isascii() and number.isdigit() for number in places):
        return ""
    place = f"{literal(system)}, scale={int(places[0])}, code={int(places[1])}"
    return (
        "\nfrom playground.engine import default_engine\n\n"
        f"like = default_engine().neighbours({place})\nprototype = default_engine().prototype({place})\n"
        'print("codes like it:", *like.codes, " frames of the motion it stands for:", prototype.motion.frames)\n'
    )


def _edit(state: State) -> tuple[str, str]:
    given = {"prompt": literal(state["prompt"]), "seed": str(state["seed"]), "kind": literal(state["kind"])}
    edges = [state["from"], state["to"]]
    known = None not in edges
    span = f"({', '.join(str(round(float(edge) * LIMITS.fps)) for edge in edges)})" if known else "None"
    made, source = str(state["motion"]).startswith(MADE), "motion"
    own = made and read_name(str(state["motion"]), str(state["caption"]))[0].system in ("", state.system)
    if own:
        source = "made"
    else:
        source = "made.motion" if made else source
        given |= {"system": literal(state.system), "caption": literal(state["caption"])}
    given |= {"anchor": literal(state["anchor"]), "measured": str(bool(state["measured"]))}
    given |= {"guidance": number(state["g"]), "cfg": number(state["s"])}
    arguments = "".join(f"    {name}={value},\n" for name, value in given.items())
    return "A span of a motion drawn anew; the frames outside stay as they were.", (
        (remade(state) if made else opened(state))
        + f"edited = engine.edit(\n    {source},\n    {span},\n{arguments})\n"
        + TOKENS.format(name="edited")
        + "assert (edited.motion.joints[edited.kept] == edited.source.joints[edited.kept]).all()\n"
        + "for seam in edited.seams:\n"
        + '    print(f"frame {seam.frame}: {seam.jolt_mm:.1f} mm; {seam.source_mm:.1f} mm before")\n'
    )


def _endless(state: State) -> tuple[str, str]:
    said = read_plan(str(state["then"] or ""))
    rows = "".join(f"    ({one.frame}, {literal(one.prompt)}),\n" for one in said)
    then = f"then = [  # frame from which it holds, instruction\n{rows}]\n" if said else "then = []\n"
    frames = LIMITS.fps * max(20, (said[-1].frame // LIMITS.fps if said else 0) + 8)
    return "A motion without end, told what to do next while it moves.", (
        "from pathlib import Path\n\nimport numpy as np\n\nfrom playground.engine import default_engine\n"
        "from playground.motion.formats import write_motion\nfrom playground.motion.motion import Motion\n\n"
        f"session = default_engine().endless({literal(state['prompt'])}, system={literal(SYSTEM)}, "
        f"seed={int(state['seed'])})\n{then}parts = []\n"
        f"while session.frames < {frames}:  # or for as long as you like\n"
        "    while then and then[0][0] <= session.drawn:\n        session.say(then.pop(0)[1])\n"
        f"    parts.append(session.advance({number(PIECE)}).joints)\n"
        "seams = session.seams()\n"
        'print("jerk, m/s3: at the switches", seams.at_switches, " elsewhere", seams.elsewhere)\n'
        'write_motion(Motion(np.concatenate(parts)), Path("endless.bvh"))\n'
    )


def _compare(state: State) -> tuple[str, str]:
    """`settings` of the state are those of comparing.settings_of, which complete() has filled in."""
    of, settings = VARIATIONS[state["vary"]].of, list(state.values["settings"])
    if of == EDIT:
        return _edits(state, settings)
    if of == PROMPT:
        rows = "".join(
            f"    {literal(one.name)}: dict(system={literal(one.system)}, seed={one.seed}, cfg={number(one.cfg)}, "
            f"temperature={number(one.temperature)}, guidance={number(one.guidance)}),\n"
            for one in settings
        )
        made = f"engine.generate({literal(settings[0].text)}, {number(settings[0].seconds)}, **setting)"
        return "One prompt, several settings.", (
            "from playground.engine import default_engine\nfrom playground.motion.measures import foot_sliding\n\n"
            f"engine = default_engine()\nsettings = {{\n{rows}}}\nresults = {{}}\n"
            f"for name, setting in settings.items():\n    results[name] = {made}\n" + _SLIDES
        )
    rows = "".join(
        f"    {literal(one.name)}: ({literal(one.text)}, {literal(one.system)}, {number(one.guidance)}, "
        f"{one.scales}),\n"
        for one in settings
    )
    return "One motion, several settings.", (
        opened(state)
        + "from playground.motion.measures import foot_sliding\n\n"
        + f"settings = {{  # caption, system, guidance, scales\n{rows}}}\ntokens, results = {{}}, {{}}\n"
        + "for name, (caption, system, guidance, scales) in settings.items():\n"
        + "    tokens[name] = engine.tokenize(motion, caption, system=system)\n"
        + "    results[name] = engine.reconstruct(tokens[name], guidance=guidance, scales=scales)\n"
        + '    print(f"{name}: MPJPE {results[name].mpjpe_mm:.1f} mm")\n'
        + _SLIDES
    )


def _edits(state: State, settings: list[Setting]) -> tuple[str, str]:
    """One edit, several settings."""
    first = settings[0]
    span = None if first.span is None else tuple(round(edge * LIMITS.fps) for edge in first.span)
    rows = "".join(f"    {literal(one.name)}: dict(kind={literal(one.kind)}, seed={one.seed}),\n" for one in settings)
    given = {"system": literal(first.system), "caption": literal(state["caption"])}
    given |= {"guidance": number(first.guidance), "cfg": number(first.cfg)}
    arguments = "".join(f", {name}={value}" for name, value in given.items())
    return "One edit, several settings.", (
        opened(state)
        + "from playground.motion.measures import foot_sliding\n\n"
        + f"settings = {{\n{rows}}}\nresults = {{}}\n"
        + "for name, setting in settings.items():\n"
        + f"    results[name] = engine.edit(motion, {span}, {literal(first.text)}, **setting{arguments})\n"
        + _SLIDES
    )


SCRIPTS: dict[str, Callable[[State], tuple[str, str]]] = {
    "tokenize": _tokenize,
    "embedding-map": _embedding_map,
    "codebooks": _codebooks,
    "generate": _generate,
    "guidance": _guidance,
    "edit": _edit,
    "endless": _endless,
    "compare": _compare,
}
