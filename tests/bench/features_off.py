"""What features cost scenes that do not use them: the core as it is, and with their code left out, on the same scenes.

python -m tests.bench.features_off [--isa v3] [--rounds 15] [--instructions] [--one-by-one] [--keep FOLDER] [SCENE ...]

Builds the core again (minutes each), so CI does not run it. Both ways' pixels must be the same. The figure is the way with all
over the way without: of CPU seconds the median over interleaved passes, or of the core's own instructions, by valgrind's
callgrind. Both trace packets, and never choose by the clock.
"""

from __future__ import annotations

import argparse
import os
import re
import statistics
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from tests.bench.cores.ablation_rows import Edit, Row

from .ablations import compile_core
from .results import write_results
from .scenes import ROOT, BenchScene, available

CLOCKLESS = Row("", "", edits=(Edit("integrator/rays/packet_choice.hpp", "{ return __rdtsc(); }", "{ return 0; }"),))
# As PRIMRAY_WITHOUT of renderer/core/CMakeLists.txt has them, and the scenes here that use one.
FEATURES = [
    "attributes",
    "curves",
    "cutouts",
    "emission",
    "instances",
    "light_images",
    "links",
    "lobe_factors",
    "motion",
    "portals",
    "shaping",
    "special_shadows",
    "spheres",
    "textures",
    "thin",
]
# Those whose cost together is bounded: 2 % of a scene without them.
BOUNDED = ["links", "motion", "shaping", "textures"]
USES = {"box": set[str](), "hills": set[str](), "field": {"instances"}}

# One process for each way: a line asks for a pass, its CPU seconds and the film's hash are the answer.
WORKER = """
import hashlib, pathlib, sys, time
from dataclasses import replace
from tests.bench.cores import other_core, replay
from tests.bench import scenes
other_core.use_core(pathlib.Path(sys.argv[3]))
from primray import core
scene = next(s for s in scenes.available() if s.name == sys.argv[1])
scene = replace(scene, resolution=tuple(pixels // int(sys.argv[4]) for pixels in scene.resolution))
spp = int(sys.argv[2])
built, settings = replay.build(scene, spp)
splits = core.choose_splits(built, settings)
for _ in sys.stdin:
    film = core.Film(built)
    start = time.process_time()
    core.render_pass(built, film, core.uniform_ends(film, spp), splits, settings)
    seconds = time.process_time() - start
    print(seconds, hashlib.sha256(film.pixels.tobytes()).hexdigest(), flush=True)
"""


def build(folder: Path, isa: str, without: list[str]) -> Path:
    """The file of a core that lacks `without`."""
    return compile_core(CLOCKLESS, folder, isa, f"-DPRIMRAY_WITHOUT={';'.join(without)}")


def environment(isa: str) -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(ROOT), "PRIMRAY_ISA": isa}


def times(ways: list[Path], scene: BenchScene, isa: str, rounds: int, spp: int) -> list[list[float]]:
    """CPU seconds of passes, by turns, for each way."""
    workers = [
        subprocess.Popen(
            [sys.executable, "-c", WORKER, scene.name, str(spp), str(way), "1"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment(isa),
        )
        for way in ways
    ]
    seconds: list[list[float]] = [[] for _ in ways]
    hashes = set()
    for turn in range(rounds + 1):
        order = range(len(ways)) if turn % 2 else reversed(range(len(ways)))
        for i in order:
            asked, answered = workers[i].stdin, workers[i].stdout
            assert asked
            assert answered
            asked.write("\n"), asked.flush()
            took, pixels = answered.readline().split()
            hashes.add(pixels)
            if turn > 0:  # the first warms up
                seconds[i].append(float(took))
    for worker in workers:
        assert worker.stdin
        worker.stdin.close()
        worker.wait()
    check_same(scene, hashes)
    return seconds


def check_same(scene: BenchScene, hashes: set[str]) -> None:
    if len(hashes) != 1:
        raise SystemExit(f"{scene.name}: the pixels differ")


def instructions(way: Path, scene: BenchScene, isa: str) -> tuple[int, str]:
    """Of the core's own code, for one pass of a small picture: how a whole render divides its passes depends on the clock.
    And the pixels' hash."""
    with tempfile.TemporaryDirectory() as folder:
        counted = Path(folder) / "callgrind.out"
        command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={counted}"]
        command += [sys.executable, "-c", WORKER, scene.name, "4", str(way), "4"]
        done = subprocess.run(command, check=True, env=environment(isa), input="\n", text=True, capture_output=True)
        return counted_in(f"_core_{isa}", counted.read_text().splitlines()), done.stdout.split()[-1]


def counted_in(name: str, lines: list[str]) -> int:
    """Instructions of the object with `name` in its path, from a file of callgrind's: by their addresses alone, as
    callgrind_annotate has them, functions of several stripped objects can be one."""
    objects: dict[str, str] = {}
    current, total, of_call = "", 0, False
    for line in lines:
        if match := re.match(r"c?ob=(\(\d+\))(?: (.*))?$", line):
            number, path = match.groups()
            if path is not None:
                objects[number] = path
            if line[0] != "c":
                current = objects[number]
        elif line.startswith("calls="):
            of_call = True  # the next line's cost is that of the callee
        elif line and line[0] in "0123456789+-*":
            if not of_call and name in current:
                total += int(line.split()[-1])
            of_call = False
    return total


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.features_off", description=__doc__)
    parser.add_argument("scenes", nargs="*", default=list(USES))
    parser.add_argument("--isa", default="v3")
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--spp", type=int, default=2)
    parser.add_argument("--instructions", action="store_true")
    parser.add_argument("--one-by-one", action="store_true", help="a row for each feature, not only for all")
    parser.add_argument("--keep", type=Path, help="a folder for the builds, which are made anew only where something changed")
    options = parser.parse_args()
    folder = options.keep or Path(tempfile.mkdtemp())
    whole = build(folder / "whole", options.isa, [])
    rows: list[dict[str, Any]] = []
    for scene in available():
        if scene.name not in options.scenes:
            continue
        left = [f for f in FEATURES if f not in USES[scene.name]]
        for without in [left, BOUNDED, *([[f] for f in left] if options.one_by_one else [])]:
            name = "all_but_" + "_".join(sorted(USES[scene.name])) if without is left else "_".join(without)
            way = build(folder / name, options.isa, without)
            row: dict[str, Any] = {"scene": scene.name, "without": without}
            if options.instructions:
                with ThreadPoolExecutor() as both:
                    found = list(both.map(instructions, (whole, way), (scene, scene), (options.isa, options.isa)))
                check_same(scene, {pixels for _, pixels in found})
                counts = [count for count, _ in found]
                row |= {"core_instructions": counts, "ratio": round(counts[0] / counts[1], 4)}
            else:
                seconds = times([whole, way], scene, options.isa, options.rounds, options.spp)
                ratios = [a / b for a, b in zip(*seconds, strict=True)]
                row |= {"cpu_s": [[round(s, 4) for s in way] for way in seconds], "ratio": round(statistics.median(ratios), 4)}
            rows.append(row)
            print(f"{scene.name:10} {row['ratio']:.4f} with all over without {', '.join(without)}", flush=True)
    print(f"written: {write_results('features_off', rows, options.isa)}")


if __name__ == "__main__":
    main()
