"""How opening, translating and building grow with a stage: python -m tests.bench.setup.scaling [--quick] [KIND:COUNT ...].

Every stage is generated once and measured in a process of its own; bytes per item are that process's peak resident memory
beyond what it had before opening the stage. KIND is meshes (equal cubes), distinct (no two are equal), cages (distinct and
subdivided), prims (of several kinds, nested), referenced (scene instances), triangles, instances, nested (1000 times the rest,
10,000 from 1e9 on), multiplied (never kept in two levels), lights (small spheres of the same power together), textures (as
many images, each on a quad of its own), texels (of one image), kinds (prims that each refer to one of a hundredth as many
meshes), unique (meshes with caps, no two alike), island (instances of 1,000 prototypes), materials (of 20 nodes each), tufts
(instances of 60 strands each), flat-tufts (the same strands as one prim).
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from tests.bench.results import write_results

ROOT = Path(__file__).parents[3]
SIZES = {
    "meshes": (10**3, 10**4, 10**5),
    "distinct": (10**3, 10**4, 10**5),
    "cages": (10**3, 10**4, 10**5),
    "prims": (10**4, 10**5, 10**6),
    "referenced": (10**4, 10**5, 10**6),
    "triangles": (10**5, 10**6, 10**7),
    "instances": (10**4, 10**5, 10**6, 10**7),
    "nested": (10**4, 10**6, 10**7, 10**9),
    "multiplied": (10**6, 10**7),
    "lights": (1, 10, 10**2, 10**3, 10**4, 10**5),
    "textures": (1, 10, 10**2, 10**3),
    "texels": (10**4, 10**5, 10**6, 10**7),
    "kinds": (10**3, 10**4, 10**5, 10**6),
    "unique": (10**3, 10**4, 10**5),
    "island": (10**4, 10**5, 10**6, 4 * 10**6),
    "materials": (10, 10**2, 10**3, 2 * 10**4),
    "tufts": (46, 460, 4600),
    "flat-tufts": (46, 460, 4600),
}
RESOLUTION = (160, 90)
TIMED_SPP = 16


def measure(path: str, kind: str, count: int) -> dict[str, Any]:
    """Seconds of each step and peak bytes; what is not imported yet is loaded before."""
    from primray import core, usd
    from primray.diagnostics import Diagnostics
    from primray.render import load_textures
    from primray.report.report import peak_rss_bytes
    from primray.report.summary import summary
    from primray.settings import RenderSettings
    from primray.usd.instancing import instances

    if kind == "multiplied":
        instances.MAX_FLAT_INSTANCES = count
    settings = RenderSettings(resolution=RESOLUTION, spp=1, threads=len(os.sched_getaffinity(0)))
    core.module()
    before = peak_rss_bytes()
    seconds = {}
    start, cpu_start = time.perf_counter(), time.process_time()

    def lap(name: str) -> None:
        nonlocal start, cpu_start
        seconds[f"{name}_s"] = round(time.perf_counter() - start, 3)
        seconds[f"{name}_cpu_s"] = round(time.process_time() - cpu_start, 3)  # of all threads
        start, cpu_start = time.perf_counter(), time.process_time()

    stage = usd.open_stage(path, Diagnostics())
    lap("open")
    description, _ = usd.translate(stage, settings, core.compiled.triangulate)
    lap("translate")
    after_translation = peak_rss_bytes()
    counted = summary(description)
    start, cpu_start = time.perf_counter(), time.process_time()
    description, textures = load_textures(description, Diagnostics(), usd.read_asset)
    lap("textures")
    start, cpu_start = time.perf_counter(), time.process_time()
    description, _ = core.dice(description, settings)
    lap("dice")
    shapes, description = list(description.shapes), replace(description, shapes=())  # as render() does
    scene = core.build(description, textures, settings, shapes)
    lap("build")
    peak = peak_rss_bytes()
    film = core.render(scene, settings)
    lap("render")
    start = time.perf_counter()
    timed = core.render(scene, replace(settings, spp=TIMED_SPP, max_depth=4))
    timed_s = time.perf_counter() - start
    pixels, stderr = timed.image()
    covered = float((film.pixels[..., 3] > 0).mean())
    return {
        **seconds,
        "peak_bytes": peak,
        "bytes_before": before,
        "translated_bytes_per_item": round((after_translation - before) / count, 1),
        "bytes_per_item": round((peak - before) / count, 1),
        "estimated_bytes": counted.memory_bytes,
        "instances": counted.instances,
        "triangles": counted.triangles_unique,
        "rays": film.rays,
        "covered": round(covered, 4),
        "timed_spp": TIMED_SPP,
        "timed_s": round(timed_s, 4),
        "timed_rays": timed.rays,
        "timed_relmse": float((stderr**2 / (pixels[..., :3] ** 2 + 0.01)).mean()),  # by its two replicates
    }


def _in_process(code: str) -> str:
    """A new process, so that its peak memory is its own."""
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(done.stderr)
    return done.stdout


def run(kind: str, count: int, folder: Path) -> dict[str, Any]:
    path = folder / f"{kind}_{count}.usdc"
    start = time.perf_counter()
    arguments = f"{kind!r}, {count}, Path({str(path)!r})"
    _in_process(f"from pathlib import Path; from tests.bench.stages.scaling_stages import write; write({arguments})")
    generated = time.perf_counter() - start
    text = _in_process(
        "import json; from tests.bench.setup.scaling import measure; "
        f"print(json.dumps(measure({str(path)!r}, {kind!r}, {count})))"
    )
    row = {"kind": kind, "count": count, "file_bytes": path.stat().st_size, "generate_s": round(generated, 1)}
    path.unlink()
    return row | json.loads(text.splitlines()[-1])


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.setup.scaling", description=__doc__)
    parser.add_argument("what", nargs="*", help="KIND:COUNT, all by default")
    parser.add_argument("--quick", action="store_true", help="the two smallest sizes of each kind")
    options = parser.parse_args()
    wanted = [(kind, count) for kind, sizes in SIZES.items() for count in (sizes[:2] if options.quick else sizes)]
    if options.what:
        wanted = [(kind, int(float(count))) for kind, count in (what.split(":") for what in options.what)]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for kind, count in wanted:
            row = run(kind, count, Path(folder))
            rows.append(row)
            steps = ("open", "translate", "dice", "build")
            times = "  ".join(f"{step} {row[step + '_s']:6.2f} s ({row[step + '_cpu_s']:6.2f})" for step in steps)
            memory = f"peak {row['peak_bytes'] / 1e6:8.0f} MB  {row['bytes_per_item']:9.1f} bytes each"
            print(f"{kind:10} {count:>13,}  {times}  {memory}", flush=True)
    print(f"written: {write_results('scaling', rows).relative_to(Path.cwd())}")


if __name__ == "__main__":
    main()
