"""1 / (relMSE x seconds) where all take as many samples, however long that takes: python -m tests.bench.efficiency [SCENE ...].

Curves end where a picture takes long, which for us is at fewer samples than for others. Of the peers those that come near.
"""

from __future__ import annotations

import argparse
from typing import Any

from .curves import measure, medians
from .peers.installed import OURS, Renderer
from .results import write_results

SCENES = ("box", "field", "hills", "metals", "lamps")
SAMPLES = 64
ROUNDS = 2


def report(rounds: int, scenes: tuple[str, ...] = SCENES) -> None:
    found = []
    for scene in scenes:

        def comes_near(renderer: Renderer, scene: str = scene) -> bool:
            return renderer.peer != "luxcore" and (scene == "field" or not renderer.variant.startswith("scalar"))

        rows = [row for row in measure(scene, rounds, 1e9, (SAMPLES,), comes_near) if "left_out" not in row]
        found += rows
        efficiencies = {}
        for row in rows:
            [(_, seconds, error)] = medians(row)
            efficiencies[row["renderer"]] = 1 / (seconds * error)
            print(f"{scene:7} {row['renderer']:26} {seconds:6.2f} s  {error:.6f}  {1 / (seconds * error):.4g}", flush=True)
        best = max((e for name, e in efficiencies.items() if name != OURS), default=None)
        if best is not None:
            print(f"{scene:7} ours over the best peer's: {efficiencies[OURS] / best:.2f}", flush=True)
    print(f"written: {write_results('efficiency', found).name}")


def ratios(ours: dict[str, Any], theirs: dict[str, Any]) -> list[float]:
    """Ours over theirs, round by round."""
    pairs = zip(ours["rounds"], theirs["rounds"], strict=True)
    return [_efficiency(a["pictures"][0]) / _efficiency(b["pictures"][0]) for a, b in pairs]


def _efficiency(picture: dict[str, Any]) -> float:
    return float(1 / (picture["seconds"] * picture["relmse"]))


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.efficiency", description=__doc__)
    parser.add_argument("scenes", nargs="*", default=list(SCENES))
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    options = parser.parse_args()
    report(options.rounds, tuple(options.scenes))


if __name__ == "__main__":
    main()
