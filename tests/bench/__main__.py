"""Runs the benchmarks and keeps their raw figures: python -m tests.bench [--spp N] [--repetitions N]."""

from __future__ import annotations

import argparse
import datetime
import json
import os
import platform
import sys
from pathlib import Path

from . import replay
from .scenes import available

RESULTS = Path(__file__).parent / "results"


def cpu_model() -> str:
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.processor()


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
    RESULTS.mkdir(exist_ok=True)
    today = datetime.date.today().isoformat()
    path = RESULTS / f"replay_{rows[0]['isa']}_{rows[0]['lanes']}_{today}.json"
    facts = {
        "date": today,
        "command": " ".join(sys.orig_argv),
        "cpu": cpu_model(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
    }
    path.write_text(json.dumps(facts | {"rows": rows}, indent=1) + "\n")
    print(f"written: {path.relative_to(Path.cwd())}")


if __name__ == "__main__":
    main()
