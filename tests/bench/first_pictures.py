"""Whole processes from their start to a first picture, renderers by turns: python -m tests.bench.first_pictures [--rounds N].

Curves time a first picture too, but once a round, after minutes of another renderer's pictures.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
from pathlib import Path
from typing import Any

from .peer_runs import run
from .peers.installed import installed
from .peers.scenes import SCENES
from .results import write_results

ROUNDS = 5
PICTURES = [(1, 2)]  # a second one is made and not looked at


def measure(scene: str, rounds: int) -> list[dict[str, Any]]:
    renderers = installed(scene)
    firsts: dict[str, list[dict[str, Any]]] = {renderer.name: [] for renderer in renderers}
    with tempfile.TemporaryDirectory() as folder:
        for k in range(rounds):
            for renderer in renderers if k % 2 == 0 else renderers[::-1]:
                first, *_ = run(renderer, scene, PICTURES, Path(folder), limit_s=60)
                stages = {name: round(seconds, 4) for name, seconds in first["stages_s"].items()}
                firsts[renderer.name].append({"process_s": round(first["process_s"], 4), "stages_s": stages})
    return [{"scene": scene, "renderer": name, "firsts": found} for name, found in firsts.items()]


def report(rounds: int) -> None:
    rows = []
    for scene in SCENES:
        for row in measure(scene, rounds):
            rows.append(row)
            seconds = statistics.median(first["process_s"] for first in row["firsts"])
            print(f"{scene:7} {row['renderer']:26} {seconds:.3f} s", flush=True)
    write_results("first-pictures", rows)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.first_pictures", description=__doc__)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    report(parser.parse_args().rounds)


if __name__ == "__main__":
    main()
