#!/usr/bin/env python3
"""Sends a job to OpenCue that renders frames of a USD stage, each frame a task of its own.

    python render_frames.py shot.usda /shots/pictures/beauty.####.exr --frames 1-100 --aov depth -- --target-error 0.001
    python render_frames.py shot.usda /shots/pictures --frames 1-100 --products

Needs `pip install opencue-pyoutline` here, primray on the PATH of the farm's machines, and a file system that all of them see.
"""

from __future__ import annotations

import argparse
import shlex
import sys

from outline import Outline
from outline.modules.shell import Shell
from render_flags import PLACE, flags, layer_arguments, parsed_by, parser_of, require_place, send


def main() -> None:
    asked = parsed(sys.argv[1:])
    send(job_of(asked), asked)


def job_of(asked: argparse.Namespace) -> Outline:
    job = Outline(asked.name, frame_range=asked.frames)
    job.add_layer(Shell("render", command=shlex.join(render_command(asked)), chunk=1, **layer_arguments(asked)))
    return job


def render_command(asked: argparse.Namespace) -> list[str]:
    words = ["primray", "render", str(asked.scene), "--frames", PLACE]
    if asked.products is None:
        words += ["-o", str(asked.output), "--make-output-path"]
    else:
        words += ["--output-dir", str(asked.output)]
        words += [word for product in asked.products for word in ("--product", product)] or ["--all-products"]
    return [*words, *flags(asked), *(["--denoise"] if asked.denoise else []), *asked.extra]


def parsed(arguments: list[str]) -> argparse.Namespace:
    parser = parser_of(
        "Render frames of a USD stage on OpenCue, one task per frame.",
        output="a picture's name, in which #### becomes the frame; with --products a folder",
        frames="such as 1-100 or 1-100x2",
    )
    parser.add_argument(
        "--products", nargs="*", metavar="PRIM", help="render the stage's products with these names; without names, all"
    )
    parser.add_argument("--denoise", action="store_true", help="add a denoised picture (primray[denoise])")
    asked = parsed_by(parser, arguments)
    if asked.products is None:
        require_place(parser, asked)
    return asked


if __name__ == "__main__":
    main()
