"""Code that both OpenCue scripts share: their arguments, the flags of primray that these become, and submission of the job."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from pathlib import Path

from outline import Outline, cuerun

PLACE = "#IFRAME#"  # OpenCue replaces this token with the frame's number
PLACE_IN_NAME = re.compile(r"#|%\d*d|%g|\$F|<F[\dF]*>")  # placeholders that primray recognises in a picture's name


def parser_of(description: str, output: str, frames: str) -> argparse.ArgumentParser:
    """Return a parser with the arguments of both scripts; `output` and `frames` are the help texts of these two."""
    parser = argparse.ArgumentParser(description=description, epilog="Flags after -- are passed to primray render.")
    parser.add_argument("scene", type=Path, help="the stage")
    parser.add_argument("output", type=Path, help=output)
    parser.add_argument("--frames", default="1", help=frames)
    add_flags(parser)
    return parser


def parsed_by(parser: argparse.ArgumentParser, arguments: Sequence[str]) -> argparse.Namespace:
    """Return a script's own arguments, and as `extra` what follows `--`: further flags of `primray render`."""
    own = list(arguments)
    at = own.index("--") if "--" in own else len(own)
    asked = parser.parse_args(own[:at])
    asked.extra = own[at + 1 :]
    return asked


def require_place(parser: argparse.ArgumentParser, asked: argparse.Namespace) -> None:
    """Exit with an error if the tasks, of one frame each, would all write the same picture."""
    if not re.fullmatch(r"\s*-?\d+\s*", asked.frames) and not PLACE_IN_NAME.search(asked.output.name):
        parser.error(
            f"{asked.output.name} has no placeholder for the frame's number, such as ####, but --frames is {asked.frames}"
        )


def send(job: Outline, asked: argparse.Namespace) -> None:
    """Send the job to OpenCue, or print it on a dry run."""
    launcher = cuerun.OutlineLauncher(job, range=asked.frames)
    if asked.print:
        launcher.setup()
        print(launcher.serialize(use_pycuerun=False))
    else:
        launcher.launch(use_pycuerun=False)


def add_flags(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--camera", help="a camera's prim path or name (default: the stage's)")
    parser.add_argument("--aov", action="append", default=[], metavar="NAMES", help="further outputs, separated by commas")
    parser.add_argument(
        "--light-group", action="append", default=[], metavar="NAME", help="add the light of this group as an output"
    )
    parser.add_argument(
        "--cryptomatte", action="append", default=[], choices=("object", "material", "asset"), help="as an output"
    )
    parser.add_argument("--variant", action="append", default=[], metavar="PRIM:SET=NAME", help="select a variant")
    parser.add_argument("--threads", type=int, default=8, help="threads of one task, and the cores it reserves")
    parser.add_argument("--memory", help="memory that OpenCue reserves for a task, such as 8g")
    parser.add_argument("--name", default="primray", help="name of the job")
    parser.add_argument("--print", action="store_true", help="print the job instead of sending it")


def flags(asked: argparse.Namespace, no_outputs: Sequence[str] = ()) -> list[str]:
    """Return the flags of `primray render` for these arguments; `no_outputs` are given when no output beside the picture is
    requested."""
    outputs = [*asked.aov, *(f"crypto_{kind}" for kind in asked.cryptomatte)]
    outputs += [f"C.*<L.'{group}'>" for group in asked.light_group]
    words = ["--threads", str(asked.threads)]
    words += ["--camera", asked.camera] if asked.camera else []
    words += [word for output in outputs for word in ("--aov", output)] or list(no_outputs)
    return words + [word for variant in asked.variant for word in ("--variant", variant)]


def layer_arguments(asked: argparse.Namespace) -> dict[str, object]:
    return {"cores": asked.threads} | ({"memory": asked.memory} if asked.memory else {})
