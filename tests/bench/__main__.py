"""Runs the benchmarks and keeps their raw figures: python -m tests.bench [--spp N] [--repetitions N]."""

from __future__ import annotations

import argparse
from pathlib import Path

from . import replay
from .results import write_results
from .scenes import available


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description=__doc__)
    parser.add_argument("--spp", type=int, default=8)
    parser.add_argument("--repetitions", type=int, default=7)
    options = parser.parse_args()
    rows = []
    for scene in available():
        row = replay.measure(scene, options.spp, options.repetitions)
        rows.append(row)
        low, high = row["embree_share_range"]
        rate = row["samples"] / min(row["render_s"]) / 1e6
        share = f"{row['embree_share_median']:.3f} ({low:.3f} to {high:.3f})"
        print(f"{row['scene']:10} Embree's share {share}, {rate:.2f} Msamples/s on one thread")
    path = write_results("replay", rows)
    print(f"written: {path.relative_to(Path.cwd())}")


if __name__ == "__main__":
    main()
