"""How costs grow: python -m tests.bench.growth [--most N] [KIND ...].

With a stage: prims, scene instances (referenced), triangles, instances, nested instances, lights, textures, texels, and those
of stages/crowded_stages.py, each in processes of their own (setup/scaling.py); from opening to a built scene, and the seconds
a ray then takes. With a picture: threads, pixels and samples, on one scene that is built once a size. The powers on the page
are fitted to these (fits.py).
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from tests.bench.cores.replay import build
from tests.bench.setup import scaling

from primray import core
from primray.settings import QUICK_LOOK

from .results import write_results
from .scenes import BenchScene, bench_scene

SIZES: dict[str, tuple[int, ...]] = {
    "prims": (10**3, 10**4, 10**5, 10**6),
    "referenced": (10**3, 10**4, 10**5, 10**6),
    "triangles": (10**3, 10**4, 10**5, 10**6, 10**7),
    "instances": (10**3, 10**4, 10**5, 10**6, 10**7),
    "nested": (10**3, 10**4, 10**5, 10**6, 10**7),
    "lights": (1, 10, 10**2, 10**3, 10**4, 10**5),
    "textures": (1, 10, 10**2, 10**3),
    "texels": (10**4, 10**5, 10**6, 10**7),
    "kinds": (10**3, 10**4, 10**5, 3 * 10**5, 10**6),
    "unique": (10**3, 10**4, 3 * 10**4, 10**5),
    "island": (10**4, 10**5, 10**6, 4 * 10**6),
    "materials": (10, 10**2, 10**3, 2 * 10**4),
    "tufts": (46, 460, 1500, 4600),
    "flat-tufts": (46, 460, 1500, 4600),
}
SIDES = (64, 128, 256, 512)
SAMPLES = (QUICK_LOOK, 8, 16, 32)  # fewer are rendered in another way
ROUNDS = 3
PICTURED = ("box", "field", "hills")


def of_stages(kind: str, most: int) -> list[dict[str, Any]]:
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for count in SIZES[kind]:
            if count <= most:
                row = scaling.run(kind, count, Path(folder))
                rows.append(row)
                each = f"{setup_cpu_s(row) / count * 1e6:8.3f} us and {row['bytes_per_item']:9.1f} bytes each"
                seconds = f"{setup_s(row):7.3f} s ({setup_cpu_s(row):7.3f} of CPUs)"
                print(f"{kind:10} {count:>12,}  set-up {seconds}, {each}  {ray_us(row):6.3f} us/ray", flush=True)
    return rows


STEPS = ("open", "translate", "textures", "dice", "build")


def setup_s(row: dict[str, Any]) -> float:
    return float(sum(row[f"{step}_s"] for step in STEPS))


def setup_cpu_s(row: dict[str, Any]) -> float:
    """Of all threads: what a busy machine leaves as it is, mostly."""
    return float(sum(row[f"{step}_cpu_s"] for step in STEPS))


def ray_us(row: dict[str, Any]) -> float:
    return float(row["timed_s"] / row["timed_rays"] * 1e6)


def of_pictures(scene: BenchScene) -> list[dict[str, Any]]:
    """Seconds of whole passes, by turns so that a slow minute falls on all sizes."""
    cores = len(os.sched_getaffinity(0))
    cases: list[tuple[str, int, Any, Any]] = []
    built, settings = build(scene, 8)
    cases += [("threads", n, built, replace(settings, threads=n)) for n in range(1, cores + 1)]
    cases += [("samples", n, built, replace(settings, threads=cores, spp=n)) for n in SAMPLES]
    for side in SIDES:
        other, its = build(replace(scene, resolution=(side, side)), 4)
        cases.append(("pixels", side * side, other, replace(its, threads=cores)))
    splits = core.choose_splits(built, settings)  # for all sizes, though pilots of some would find others
    seconds: dict[tuple[str, int], list[float]] = {}
    cpu_s: dict[tuple[str, int], list[float]] = {}
    for _ in range(ROUNDS):
        for kind, count, made, wanted in cases:
            film = core.Film(made)
            made.guide(wanted, splits)  # learnt before the clocks run
            cpu_start = time.process_time()
            done = core.render_pass(made, film, core.uniform_ends(film, wanted.most_samples), splits, wanted)
            cpu_s.setdefault((kind, count), []).append(round(time.process_time() - cpu_start, 5))
            seconds.setdefault((kind, count), []).append(round(done.seconds, 5))
    for (kind, count), found in seconds.items():
        print(f"{scene.name:10} {kind:8} {count:>9,}  {statistics.median(found):.3f} s", flush=True)
    return [
        {"scene": scene.name, "kind": kind, "count": count, "seconds": s, "cpu_s": cpu_s[kind, count]}
        for (kind, count), s in seconds.items()
    ]


def report(kinds: list[str], most: int) -> None:
    """A file for each kind, so that one can be measured again."""
    for kind in kinds:
        if kind == "pictures":
            rows = [row for name in PICTURED for row in of_pictures(bench_scene(name))]
        else:
            rows = of_stages(kind, most)
        write_results(f"growth-{kind}", rows)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.growth", description=__doc__)
    parser.add_argument("kinds", nargs="*", default=[*SIZES, "pictures"])
    parser.add_argument("--most", type=lambda text: int(float(text)), default=10**7, help="leave out larger stages")
    options = parser.parse_args()
    report(options.kinds, options.most)


if __name__ == "__main__":
    main()
