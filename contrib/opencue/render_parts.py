#!/usr/bin/env python3
"""Sends a job to OpenCue that renders frames of a USD stage with each frame's samples in parts, and merges them.

    python render_parts.py shot.usda /shots/pictures/beauty.####.exr --frames 1-100 --samples 1024 --parts 8

Needs `pip install opencue-pyoutline` here, primray on the PATH of the farm's machines, and a file system that all of them see.
A layer renders one part of every frame; a frame is merged as soon as its own parts are there. The pictures have the bits of
renders of all samples.
"""

from __future__ import annotations

import argparse
import re
import shlex
import sys
from itertools import pairwise
from pathlib import Path

from outline import Outline
from outline.modules.shell import Shell
from render_flags import PLACE, flags, layer_arguments, parsed_by, parser_of, require_place, send


def main() -> None:
    asked = parsed(sys.argv[1:])
    send(job_of(asked), asked)


def job_of(asked: argparse.Namespace) -> Outline:
    folder = asked.output.parent / "parts"
    folder.mkdir(parents=True, exist_ok=True)
    # Part files are named without the frame placeholder, which primray would fill in.
    stem = folder / re.sub(r"[^\w-]", "_", asked.output.name)
    points = [f"{stem}.{PLACE}.{part + 1}-of-{asked.parts}" for part in range(asked.parts)]
    ranges = sample_ranges(asked.samples, asked.parts)
    job = Outline(asked.name, frame_range=asked.frames)
    merging = Shell("merge", command=merge_command(points, asked.output), cores=1)
    for number, (point, span) in enumerate(zip(points, ranges, strict=True), 1):
        layer = Shell(f"part_{number}", command=render_command(asked, point, span), **layer_arguments(asked))
        job.add_layer(layer)
    job.add_layer(merging)
    for number in range(1, asked.parts + 1):
        merging.depend_on(f"part_{number}")  # frame by frame
    return job


def render_command(asked: argparse.Namespace, point: str, span: tuple[int, int]) -> str:
    """Return a shell command that resumes from the checkpoint if there is one, so that a retried frame loses nothing."""
    words = ["primray", "render", str(asked.scene), "-o", f"{point}.exr", "--frames", PLACE]
    words += ["--sample-range", f"{span[0]}:{span[1]}", *flags(asked, ["--aov", "none"]), *asked.extra]
    file = f"{point}.prc"
    there, begin, go_on = map(shlex.join, (["-e", file], [*words, "--checkpoint", file], [*words, "--resume", file]))
    return f"if [ {there} ]; then {go_on}; else {begin}; fi"


def merge_command(points: list[str], output: Path) -> str:
    parts = [f"{point}.prc" for point in points]
    merge = shlex.join(["primray", "merge", *parts, "-o", str(output)])
    return f"{merge} && {shlex.join(['rm', '-f', '--', *parts, *(f'{point}.exr' for point in points)])}"


def sample_ranges(samples: int, parts: int) -> list[tuple[int, int]]:
    """Split the samples into ranges of nearly equal length; their bounds are even, since the two replicates take turns."""
    if samples % 2 or not 1 <= parts <= samples // 2:
        raise SystemExit(f"--samples has to be even and at least twice --parts: {samples}, {parts}")
    ends = [samples // 2 * part // parts * 2 for part in range(parts + 1)]
    return list(pairwise(ends))


def parsed(arguments: list[str]) -> argparse.Namespace:
    parser = parser_of(
        "Render frames of a USD stage on OpenCue, each frame's samples in parts.",
        output="a picture's name, in which #### becomes the frame",
        frames="such as 1-100",
    )
    parser.add_argument("--samples", type=int, default=256, help="samples per pixel, of all parts together")
    parser.add_argument("--parts", type=int, default=4, help="number of parts that share a frame's samples")
    asked = parsed_by(parser, arguments)
    require_place(parser, asked)
    return asked


if __name__ == "__main__":
    main()
