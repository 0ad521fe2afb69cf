"""Nested instances multiplied out and kept in two levels: python -m tests.bench.setup.two_levels [COUNT ...].

The same stages (1000 instances of the rest) rendered on one thread: memory of the scene, rays a second, and how far the
pictures differ.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from tests.bench.results import write_results
from tests.bench.stages.scaling_stages import write

from primray import core, usd
from primray.description import SceneDescription
from primray.diagnostics import Diagnostics
from primray.settings import RenderSettings
from primray.usd.instancing import instances

SETTINGS = RenderSettings(resolution=(320, 180), spp=8, max_depth=4, threads=1)


def translated(path: Path, most_flat: int) -> SceneDescription:
    stage = usd.open_stage(str(path), Diagnostics())
    usual, instances.MAX_FLAT_INSTANCES = instances.MAX_FLAT_INSTANCES, most_flat
    try:
        return usd.translate(stage, SETTINGS)[0]
    finally:
        instances.MAX_FLAT_INSTANCES = usual


def measure(count: int, description: SceneDescription) -> tuple[dict[str, Any], np.ndarray[Any, Any]]:
    start = time.perf_counter()
    before = int(core.module().embree_memory()[0])
    scene = core.build(description, {}, SETTINGS)
    built = time.perf_counter() - start
    seconds = []
    for _ in range(3):
        start = time.perf_counter()
        film = core.render(scene, SETTINGS)
        seconds.append(time.perf_counter() - start)
    row = {
        "count": count,
        "levels": 2 if any(p.placements for p in description.prototypes) else 1,
        "build_s": round(built, 3),
        "scene_bytes": scene.memory_bytes - before,
        "render_s": [round(s, 3) for s in seconds],
        "mrays_per_s": round(film.rays / min(seconds) / 1e6, 3),
    }
    return row, film.pixels


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.setup.two_levels", description=__doc__)
    parser.add_argument("counts", nargs="*", default=["1e5", "1e6", "1e7"])
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for count in (int(float(text)) for text in parser.parse_args().counts):
            path = Path(folder) / f"{count}.usdc"
            write("nested", count, path)
            pictures = []
            for most_flat in (count, 0):
                row, pixels = measure(count, translated(path, most_flat))
                pictures.append(pixels)
                rows.append(row)
                memory, rate = f"{row['scene_bytes'] / 1e6:8.1f} MB", f"{row['mrays_per_s']:5.2f} Mrays/s"
                print(f"{count:>12,} in {row['levels']}  build {row['build_s']:7.3f} s  {memory}  {rate}")
            difference = np.abs(pictures[0] - pictures[1]).max(axis=2)
            rows[-1]["pixels_that_differ"] = float((difference > 1e-5).mean())
            rows[-1]["mean_difference"] = float(pictures[1].mean() / pictures[0].mean() - 1)
            print(
                f"{'':12} {rows[-1]['pixels_that_differ']:.5f} of the pixels differ, means by {rows[-1]['mean_difference']:.1e}"
            )
    print(f"written: {write_results('two_levels', rows).relative_to(Path.cwd())}")


if __name__ == "__main__":
    main()
