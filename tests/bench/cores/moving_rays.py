"""The rate of moving rays, ours beside Embree's own.

    python -m tests.bench.cores.moving_rays [--rounds N] [KIND:COUNT:TIMES ...]

KIND: terrain (triangles whose vertices move), instances (straight between times), turning (about the frame: 3 TIMES).
Every ray of a small render of the stage is recorded in order; then all are traced again by one thread: as the render asks and
by calls of Embree alone in a world of its own of the same triangles with time steps, or of its own instances with time steps
(which the renderer does not use: single rays find other bits there than packets). By turns, nearest hits and shadow rays apart,
each way in: packets and single rays as the render chose, all packets, all single. Seconds are the thread's CPU seconds.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

from tests.bench.results import write_results
from tests.bench.stages.moving_stages import CAMERA, write

from primray import core, usd
from primray.diagnostics import Diagnostics
from primray.report.summary import motion_facts
from primray.settings import Filter, RenderSettings

CASES = (
    ("terrain", 500_000, 2),
    ("terrain", 500_000, 5),
    ("instances", 100_000, 2),
    ("instances", 100_000, 5),
    ("turning", 100_000, 3),
)
ENTRIES = ("recorded", "packets", "single")
RESOLUTION = (160, 100)
SETTINGS = RenderSettings(camera=CAMERA, resolution=RESOLUTION, spp=8, max_depth=3, filter=Filter.BOX, threads=1, time_code=0.0)
ROUNDS = 5


def built(
    kind: str, count: int, times: int, folder: Path, resolution: tuple[int, int] = RESOLUTION
) -> tuple[core.CoreScene, dict[str, Any]]:
    """The stage in the core, and what the report says of its motion."""
    path = folder / f"{kind}_{count}_{times}.usdc"
    write(kind, count, times, path)
    settings = replace(SETTINGS, resolution=resolution)
    description, _ = usd.translate(usd.open_stage(str(path), Diagnostics()), settings)
    facts = motion_facts(description)
    assert facts is not None, f"nothing moves in {kind}"
    return core.build(description, {}, settings), facts


def rates(kind: str, count: int, times: int, rounds: int, folder: Path) -> list[dict[str, Any]]:
    """A row for each way in and each sort of rays."""
    scene, facts = built(kind, count, times, folder)
    testing = core.module().testing
    recording = core.Recording(scene, SETTINGS)._recording
    bare = testing.BareWorld(scene._scene)
    rows: list[dict[str, Any]] = []
    for shadow in (False, True):
        rays, apart = testing.replay_agreement(recording, bare, shadow)
        for name in ENTRIES:
            about = {"kind": kind, "count": count, "times": times, "motion": facts, "entry": name}
            rows.append(about | {"shadow": shadow, "rays": rays, "apart": apart, "ours_s": [], "embree_s": []})
    for k in range(rounds):
        for row in rows if k % 2 == 0 else rows[::-1]:
            ours, theirs = testing.replay_interleaved(recording, bare, row["shadow"], ENTRIES.index(row["entry"]))
            row["ours_s"].append(round(ours, 4))
            row["embree_s"].append(round(theirs, 4))
    return [row | _figures(row) for row in rows]


def _figures(row: dict[str, Any]) -> dict[str, Any]:
    ratios = sorted(theirs / ours for ours, theirs in zip(row["ours_s"], row["embree_s"], strict=True))
    return {
        "ours_mrays_per_s": round(row["rays"] / statistics.median(row["ours_s"]) / 1e6, 3),
        "embree_mrays_per_s": round(row["rays"] / statistics.median(row["embree_s"]) / 1e6, 3),
        "rate_median": round(statistics.median(ratios), 4),
        "rate_range": [round(ratios[0], 4), round(ratios[-1], 4)],
    }


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.cores.moving_rays", description=__doc__)
    parser.add_argument("cases", nargs="*", help="KIND:COUNT:TIMES, all by default")
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    options = parser.parse_args()
    asked = [text.split(":") for text in options.cases]
    cases = [(kind, int(float(count)), int(times)) for kind, count, times in asked] or CASES
    report(cases, options.rounds)


def report(cases: Any = CASES, rounds: int = ROUNDS) -> None:
    rows = []
    for kind, count, times in cases:
        with tempfile.TemporaryDirectory() as folder:
            found = rates(kind, count, times, rounds, Path(folder))
        rows += [row | {"lanes": core.lanes()} for row in found]
        for row in found:
            low, high = row["rate_range"]
            rays = f"{'shadow ' if row['shadow'] else 'nearest'} {row['entry']:8}"
            speeds = f"{row['ours_mrays_per_s']:6.3f} of {row['embree_mrays_per_s']:6.3f} Mrays/s"
            share = f"{row['rate_median']:.3f} ({low:.3f} to {high:.3f}), {row['apart']} of {row['rays']} apart"
            print(f"{row['kind']:9} {row['count']:>9,} x {row['times']}  {rays}  {speeds}: {share}", flush=True)
    print(f"written: {write_results('moving-rays', rows).name}")


if __name__ == "__main__":
    main()
