"""python -m playground COMMAND: the arguments. What a command does is in commands.py and inputs.py.

Bad input and bad usage end with exit status 2 and one line on stderr. Heavy packages are imported by the command that
needs them, so that a mistyped call is answered at once.
"""

import argparse
import math
import os
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn

from playground import commands, inputs
from playground.data.library import SPLITS
from playground.errors import PlaygroundError
from playground.systems import DEFAULT_SYSTEM

SOURCES = "joints-npz, humanml3d, kit-ml, motion-x, snapmogen, cmp, bvh or deepmimic"
MOTION_FILES = (".npz", ".bvh", ".glb")
BAD_INPUT, STOPPED = 2, 130


class _Parser(argparse.ArgumentParser):
    """argparse that speaks in one line."""

    def error(self, message: str) -> NoReturn:
        raise PlaygroundError(f"{message} (see {self.prog} --help)")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status."""
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
    try:
        options = vars(parser().parse_args(arguments))
        run = options.pop("run")
        run(**options)
    except PlaygroundError as error:
        return _complain(str(error))
    except OSError as error:
        return _complain(": ".join(str(part) for part in (error.filename, error.strerror or error) if part))
    except ModuleNotFoundError as error:
        if (error.name or "playground").startswith("playground"):
            raise
        return _complain(f"the package {error.name} is not installed; pip install -r requirements-dev.txt brings it")
    except KeyboardInterrupt:
        _complain("stopped")
        return STOPPED
    return 0


def _complain(message: str) -> int:
    sys.stderr.write(f"playground: {' '.join(message.split())}\n")
    return BAD_INPUT


def _text(value: str) -> str:
    return value.encode("utf-8", "replace").decode("utf-8")


def _number(value: str) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(value)
    return number


_number.__name__ = "number"


def _port(value: str) -> int:
    port = int(value)
    if not 1 <= port <= 65535:
        raise argparse.ArgumentTypeError(f"{value} is not a port; 1 to 65535 is accepted")
    return port


def _output(*suffixes: str) -> Callable[[str], Path]:
    """A file that can be written, with one of the suffixes; any suffix if none is named."""

    def check(value: str) -> Path:
        path = Path(value)
        if suffixes and path.suffix.lower() not in suffixes:
            raise argparse.ArgumentTypeError(f"{value!r} should end in {', '.join(suffixes)}")
        if not value or path.is_dir():
            raise argparse.ArgumentTypeError(f"{value!r} is not the name of a file")
        _writable(path)
        return path

    return check


def _new_folder(value: str) -> Path:
    if not value or Path(value).is_file():
        raise argparse.ArgumentTypeError(f"{value!r} is not the name of a folder")
    _writable(Path(value))
    return Path(value)


def _writable(path: Path) -> None:
    above = next(folder for folder in path.absolute().parents if folder.exists())
    if not above.is_dir() or not os.access(above, os.W_OK):
        raise argparse.ArgumentTypeError(f"{path} cannot be written: {above} is not a folder that may be written to")


def parser() -> argparse.ArgumentParser:
    """The whole command line."""
    top = _Parser(prog="playground", description="Motions become tokens, tokens become motions.", allow_abbrev=False)
    calls = top.add_subparsers(title="commands", metavar="COMMAND", required=True)

    def command(name: str, run: Callable[..., None], help: str) -> argparse.ArgumentParser:
        sub = calls.add_parser(name, help=help, description=help, allow_abbrev=False)
        sub.set_defaults(run=run)
        return sub

    _for_models(command)
    _for_data(command)
    _for_training(command)
    return top


Command = Callable[[str, Callable[..., None], str], argparse.ArgumentParser]


def _for_models(command: Command) -> None:
    """app, systems, tokenize, decode, generate, rewrite."""
    sub = command("app", commands.app, "start the web app")
    sub.add_argument("--host", default="127.0.0.1", type=_text)
    sub.add_argument("--port", default=7860, type=_port)

    sub = command("systems", commands.systems, "list the systems: tokenizer, generator, text encoder, checkpoint")
    sub.add_argument("--json", dest="as_json", action="store_true", help="as JSON")

    sub = command("tokenize", commands.tokenize, "motion to tokens")
    sub.add_argument("clip", metavar="CLIP", help="a .bvh, .npy or .npz file, or the id of a library clip or example")
    sub.add_argument("--caption", type=_text, help="what the motion shows (default: the clip's own caption)")
    sub.add_argument("--system", default=DEFAULT_SYSTEM)
    sub.add_argument("--start", type=_number, default=0.0, metavar="SECONDS", help="where to begin in a longer clip")
    sub.add_argument("--library", type=Path, metavar="DIR", help="where to look for a clip id")
    sub.add_argument("--json", dest="to", type=_output(), metavar="OUT", help="token file to write (default: stdout)")

    sub = command("decode", commands.decode, "tokens to motion")
    sub.add_argument("tokens", metavar="TOKENS.json", type=Path)
    sub.add_argument("--caption", type=_text, help="text for the decoder (default: the caption in the token file)")
    sub.add_argument("--guidance", type=_number, default=0.0, help="guidance scale g of the decoder (default 0)")
    sub.add_argument("--out", type=_output(*MOTION_FILES), required=True, metavar="FILE", help=".npz, .bvh or .glb")

    sub = command("generate", commands.generate, "text to motion")
    sub.add_argument("prompt", metavar="PROMPT", nargs="?", type=_text)
    sub.add_argument("--no-text", action="store_true", help="free-form: no prompt")
    sub.add_argument("--seconds", type=_number, default=5.0)
    sub.add_argument("--seed", type=int, default=0)
    sub.add_argument("--system", default=DEFAULT_SYSTEM)
    sub.add_argument("--guidance", type=_number, help="guidance scale g of the decoder (default: the system's own)")
    sub.add_argument("--out", type=_output(*MOTION_FILES), required=True, metavar="FILE", help=".npz, .bvh or .glb")
    sub.add_argument("--json", dest="to", type=_output(), metavar="TOKENS.json", help="also write the tokens")

    sub = command("rewrite", inputs.rewrite, "a prompt before it is used: normalised, in timed steps, in many words")
    sub.add_argument("prompt", metavar="PROMPT", type=_text)
    sub.add_argument("--rules", action="store_true", help="do not ask the language model of PLAYGROUND_LLM_URL")
    sub.add_argument("--json", dest="as_json", action="store_true", help="as JSON")


def _for_data(command: Command) -> None:
    """prepare, segment, snapmogen, convert."""
    sub = command("prepare", inputs.prepare, "published motion data to a library")
    sub.add_argument("source", metavar="SOURCE", help=SOURCES)
    sub.add_argument("root", metavar="ROOT", nargs="?", type=Path, help="the folder of the data; none for deepmimic")
    sub.add_argument("--out", type=_new_folder, required=True, metavar="DIR", help="the library to write")
    sub.add_argument("--cut", action="store_true", help="bvh: cut takes longer than 12 s at still moments")
    sub.add_argument("--name", default="", metavar="NAME", help="what results call the data (default: the source)")

    sub = command("segment", inputs.segment, "where a long take is cut, with its speed curve")
    sub.add_argument("take", metavar="TAKE", type=Path, help="a .bvh, .npy or .npz file")
    sub.add_argument("--seed", type=int, default=0, help="of the draw (prepare uses 0)")
    sub.add_argument("--html", type=_output(".html"), metavar="OUT.html", help="the curve with its cuts as a page")

    sub = command("snapmogen", inputs.snapmogen, "SnapMoGen's columns to BVH of its 24 joints, and back")
    sub.add_argument("motion", metavar="MOTION", type=Path, help=".npy or .npz: 148 or 296 columns; .bvh: the rig")
    sub.add_argument("--out", type=_output(".bvh", ".npz"), required=True, metavar="FILE")

    sub = command("convert", inputs.convert, "the files that other authors release to checkpoints")
    sub.add_argument("family", metavar="FAMILY", choices=("lgtok",), help="lgtok: the authors' release of LG-Tok")
    sub.add_argument("--tokenizer", type=Path, required=True, metavar="FILE", help="weights of the tokenizer (.tar)")
    sub.add_argument("--generator", type=Path, required=True, metavar="FILE", help="weights of the generator (.tar)")
    sub.add_argument("--options", type=Path, required=True, metavar="FILE", help="options of the tokenizer (opt.txt)")
    sub.add_argument("--out", type=_new_folder, required=True, metavar="DIR", help="the checkpoints to write")
    sub.add_argument("--statistics", type=Path, metavar="DIR", help="folder with Mean.npy and Std.npy (the data set's)")
    sub.add_argument("--llama", metavar="DIR", help="folder of LLaMA-3.2-1B, to note which weights are meant")
    sub.add_argument("--clip", metavar="DIR", help="folder of CLIP ViT-B/32, likewise")


def _for_training(command: Command) -> None:
    """train, evaluate, bench."""
    sub = command("train", commands.train, "train a tokenizer, a generator, a refit, an evaluator or the root refiner")
    sub.add_argument("config", metavar="CONFIG", help="a named run, such as lgtok-tokenizer or tmr-evaluator")
    sub.add_argument("--library", type=Path, required=True, metavar="DIR")
    sub.add_argument("--out", type=_new_folder, required=True, metavar="DIR", help="checkpoints and logs")
    sub.add_argument("--resume", action="store_true", help="go on from the last checkpoint in --out, if there is one")
    sub.add_argument("--size", choices=("cpu", "gpu"), default="cpu", help="of the LG-Tok family (default cpu)")
    sub.add_argument("--steps", type=int, help="other than the run's own number of steps")
    sub.add_argument("--minutes", type=_number, help="stop after so many minutes, the state saved; --resume goes on")
    sub.add_argument("--accelerator", choices=("auto", "cpu", "gpu"), default="auto")
    sub.add_argument(
        "--devices", type=int, help="GPUs or processes to use (default: all GPUs; torchrun decides itself)"
    )
    sub.add_argument("--precision", choices=("auto", "bf16-mixed", "16-mixed", "32-true"), default="auto")

    sub = command("evaluate", commands.evaluate, "measure a system on one split of a library")
    sub.add_argument("system", metavar="SYSTEM")
    sub.add_argument("--library", type=Path, required=True, metavar="DIR")
    sub.add_argument("--split", choices=SPLITS, default="test")
    sub.add_argument("--repeats", type=int, default=0, help="measure everything so often; 0: reconstruction alone")
    sub.add_argument("--mm-texts", type=int, default=96, help="texts of MultiModality (default 96)")
    sub.add_argument("--mm-samples", type=int, default=30, help="motions a text of MultiModality (default 30)")
    sub.add_argument("--seed", type=int, default=0)
    sub.add_argument("--guidance", type=_number, help="guidance scale g of the decoder (default: the system's own)")
    sub.add_argument("--cfg", type=_number, help="guidance scale of the generator (default: the system's own)")
    sub.add_argument(
        "--refine", action="store_true", help="generated motions go through the root refiner (feet slide less)"
    )
    sub.add_argument(
        "--json", dest="to", type=_output(), metavar="OUT",
        help="file to write (default: stdout); the same call goes on with its finished repeats",
    )  # fmt: skip

    sub = command("bench", commands.bench, "measure speed and memory")
    sub.add_argument("--json", dest="to", type=_output(), metavar="OUT", help="also write the figures to a file")
