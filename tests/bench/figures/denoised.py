"""Seconds to a denoised picture of an error, ours beside Cycles', both by Open Image Denoise with albedo and normals.

    python -m tests.bench.figures.denoised [--rounds N] [--limit S] [SCENE ...]

By turns, as curves.py; errors are against each renderer's own converged picture, which nothing has denoised.
"""

from __future__ import annotations

import argparse
import itertools
import math
import statistics
import tempfile
from pathlib import Path
from typing import Any

from ..curves import medians
from ..peer_runs import run
from ..peers.installed import DENOISED, OURS, Renderer
from ..references import reference
from ..results import write_results
from .relmse import load, relmse

SCENES = ("box", "plastics", "shelf")
LADDER = (2, 8, 32, 128)
RENDERERS = (Renderer(f"{OURS}-{DENOISED}", OURS, DENOISED), Renderer(f"cycles-{DENOISED}", "cycles", DENOISED))
LIMIT_S = 60.0  # for a picture; a denoiser alone takes a second or two
PART = 1  # of our files: the denoised picture


def measure(scene: str, rounds: int, limit_s: float) -> list[dict[str, Any]]:
    references = {r.name: reference(Renderer(r.peer, r.peer), scene) for r in RENDERERS}
    measured: dict[str, list[dict[str, Any]]] = {r.name: [] for r in RENDERERS}
    with tempfile.TemporaryDirectory() as folder:
        for k in range(rounds):
            for renderer in RENDERERS if k % 2 == 0 else RENDERERS[::-1]:
                pictures = [(samples, 1000 * k + samples) for samples in LADDER]
                first, *rest = run(renderer, scene, pictures, Path(folder), limit_s)
                for picture in rest:
                    pixels = load(picture.pop("path"), PART if renderer.peer == OURS else 0)
                    picture["relmse"] = relmse(pixels, references[renderer.name])
                measured[renderer.name].append({"first": first, "pictures": rest})
    return [{"renderer": r.name, "scene": scene, "rounds": measured[r.name]} for r in RENDERERS]


def seconds_to(error: float, curve: list[tuple[int, float, float]]) -> float | None:
    """Between the pictures of a curve (samples, seconds, error), by logarithms; None beyond them."""
    for (_, before_s, before), (_, after_s, after) in itertools.pairwise(curve):
        if before >= error >= after > 0:
            along = math.log(before / error) / math.log(before / after) if before > after else 0.0
            return before_s * (after_s / before_s) ** along
    return None


def ratios(ours: list[tuple[int, float, float]], theirs: list[tuple[int, float, float]]) -> list[tuple[float, float]]:
    """Errors of either's pictures that both curves reach, and their seconds over ours."""
    found = []
    for error in sorted({e for _, _, e in ours + theirs}, reverse=True):
        mine, other = seconds_to(error, ours), seconds_to(error, theirs)
        if mine is not None and other is not None:
            found.append((error, other / mine))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.figures.denoised", description=__doc__)
    parser.add_argument("scenes", nargs="*", default=list(SCENES))
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--limit", type=float, default=LIMIT_S, help="seconds for a picture")
    options = parser.parse_args()
    rows = []
    for scene in options.scenes:
        rows += measure(scene, options.rounds, options.limit)
        curves = [medians(row) for row in rows[-2:]]
        for row, curve in zip(rows[-2:], curves, strict=True):
            told = "  ".join(f"{samples}: {seconds:.2f} s {error:.6f}" for samples, seconds, error in curve)
            print(f"{scene:9} {row['renderer']:18} {told}", flush=True)
        faster = ratios(*curves)
        middle = statistics.median(ratio for _, ratio in faster) if faster else math.nan
        print(f"{scene:9} as fast to an error: {middle:.2f}  {[(f'{e:.2g}', round(r, 2)) for e, r in faster]}", flush=True)
    print(f"written: {write_results('denoised-time', rows).name}")


if __name__ == "__main__":
    main()
