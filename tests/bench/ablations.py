"""What each feature and technique is worth: python -m tests.bench.ablations [--build] [--rounds N] [--only TEXT] [SCENE ...].

Each row of cores/ablation_rows.py beside the renderer as it is, by turns, in processes of their own: CPU seconds of the render
and relMSE against our converged picture (references.py). Rows that need a build of the core are measured where `--build` has
made it from the sources as they are now; that takes minutes a row. A run of some rows or scenes leaves what was measured of
the others before, with its day and machine. Scenes are written one by one.
"""

from __future__ import annotations

import argparse
import datetime
import hashlib
import json
import os
import shutil
import statistics
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from tests.bench.cores.ablation_rows import BASE, ROWS, Row
from tests.bench.cores.other_core import use_core
from tests.bench.figures.relmse import relmse, saved

from primray import core

from .peer_runs import kept
from .peers.installed import RENDERERS
from .peers.scenes import SCENES
from .references import path_of, reference
from .results import cpu_model, latest, write_results

ROOT = Path(__file__).parents[2]
SOURCES = ROOT / "renderer/core"
SPP = 16
ROUNDS = 3


def edited(row: Row) -> dict[str, str]:
    """The files that a row changes, as they become."""
    texts: dict[str, str] = {}
    for edit in row.edits:
        text = texts.get(edit.file) or (SOURCES / edit.file).read_text(encoding="utf-8")
        if text.count(edit.text) != 1:
            raise SystemExit(f"{row.name}: {edit.file} does not have, once, {edit.text!r}")
        texts[edit.file] = text.replace(edit.text, edit.other)
    return texts


def module_of(row: Row) -> Path:
    """Where the row's build of the core is kept: a folder for these sources and these changes."""
    found = hashlib.sha256(repr((sorted(edited(row).items()), row.defines)).encode())
    for path in sorted(SOURCES.rglob("*")):
        if path.is_file():
            found.update(path.read_bytes())
    isa = core.isa()
    return kept() / "cores" / found.hexdigest()[:16] / f"_core_{isa}{Path(str(core.module().__file__)).suffixes[0]}.so"


def build(row: Row) -> None:
    """All rows in one tree, in which only what a row changes is compiled anew."""
    target = module_of(row)
    if target.exists():
        return
    flags = " ".join(f"-D{name}" for name in row.defines)
    module = compile_core(row, kept() / "ablated", core.isa(), f"-DCMAKE_CXX_FLAGS={flags}")
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(module, target)


def compile_core(row: Row, folder: Path, isa: str, option: str) -> Path:
    """The file of a core with the row's changes, configured with `option`; its sources and its tree stay in the folder."""
    scripts = Path(sys.executable).parent
    nanobind = subprocess.run([sys.executable, "-m", "nanobind", "--cmake_dir"], capture_output=True, text=True, check=True)
    sources, made = folder / "core", folder / "build"
    put_sources(row, sources)
    configure = [scripts / "cmake", "-G", "Ninja", "-S", sources, "-B", made, option]
    configure += [f"-Dnanobind_DIR={nanobind.stdout.strip()}", f"-DPython_EXECUTABLE={sys.executable}"]
    configure += [f"-DCMAKE_MAKE_PROGRAM={scripts / 'ninja'}"]
    for command in (configure, [scripts / "ninja", "-C", made, f"_core_{isa}"]):
        done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
        if done.returncode:
            raise SystemExit(f"{row.name}, {option}:\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}")
    [module] = made.rglob(f"_core_{isa}*.so")
    return module


def put_sources(row: Row, folder: Path) -> None:
    """The core's sources with the row's changes; files that are so already keep their times."""
    changed = edited(row)
    wanted = {path.relative_to(SOURCES) for path in SOURCES.rglob("*") if path.is_file() and "__pycache__" not in path.parts}
    for path in [path for path in folder.rglob("*") if path.is_file()]:
        if path.relative_to(folder) not in wanted:
            path.unlink()
    for name in wanted:
        there, data = folder / name, (SOURCES / name).read_bytes()
        if text := changed.get(name.as_posix()):
            data = text.encode()
        if not there.exists() or there.read_bytes() != data:
            there.parent.mkdir(parents=True, exist_ok=True)
            there.write_bytes(data)


def once(scene: str, row: Row, seed: int) -> dict[str, Any]:
    """One render in a process of its own."""
    job = {
        "scene": scene, "settings": dict(row.settings), "splits": dict(row.splits), "seed": seed, "spp": SPP,
        "core": str(module_of(row)) if row.needs_build else None, "reference": str(path_of(scene, "primray")),
    }  # fmt: skip
    code = (
        "import json, sys; from tests.bench.ablations import in_process; print(json.dumps(in_process(json.loads(sys.argv[1]))))"
    )
    environment = dict(os.environ) | dict(row.environment)
    done = subprocess.run(
        [sys.executable, "-c", code, json.dumps(job)], cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise SystemExit(f"{row.name} on {scene}:\n{done.stderr}")
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def in_process(job: dict[str, Any]) -> dict[str, Any]:
    if job["core"]:
        use_core(Path(job["core"]))
    from tests.bench.cores.replay import build as built

    from .scenes import bench_scene

    scene, settings = built(bench_scene(job["scene"]), job["spp"])
    settings = replace(settings, threads=None, seed=job["seed"], **job["settings"])
    film = core.Film(scene)
    splits = core.choose_splits(scene, settings)._replace(**job["splits"])
    scene.guide(settings, splits)  # learnt before the clock runs
    start = time.process_time()
    core.render_pass(scene, film, core.uniform_ends(film, job["spp"]), splits, settings)
    seconds = time.process_time() - start
    error = relmse(film.pixels[..., :3].astype(float), saved(Path(job["reference"])))
    return {"seconds": round(seconds, 4), "relmse": float(f"{error:.5g}"), "rays": film.rays, "samples": film.samples}


def measure(scene: str, rows: list[Row], rounds: int) -> list[dict[str, Any]]:
    runs: dict[str, list[dict[str, Any]]] = {row.name: [] for row in (BASE, *rows)}
    for k in range(rounds):
        for row in (BASE, *rows) if k % 2 == 0 else (*rows[::-1], BASE):
            runs[row.name].append(once(scene, row, seed=100 + k))
    base = runs[BASE.name]
    return [
        {
            "scene": scene,
            "name": row.name,
            "instead": row.instead,
            "spp": SPP,
            "runs": runs[row.name],
            **_worth(base, runs[row.name]),
        }
        for row in rows
    ]


def _worth(base: list[dict[str, Any]], without: list[dict[str, Any]]) -> dict[str, Any]:
    """Without it over with it: of errors' means, since a few bright pixels may have most of one; of seconds the median of the
    rounds' ratios; their product, and the range of the rounds' products."""
    error = sum(run["relmse"] for run in without) / sum(run["relmse"] for run in base)
    pairs = list(zip(base, without, strict=True))
    seconds = statistics.median(b["seconds"] / a["seconds"] for a, b in pairs)
    products = sorted(b["relmse"] * b["seconds"] / (a["relmse"] * a["seconds"]) for a, b in pairs)
    low, high = (round(value, 4) for value in (products[0], products[-1]))
    return {
        "error": round(error, 4),
        "seconds": round(seconds, 4),
        "error_seconds": round(error * seconds, 4),
        "range": [low, high],
    }


def has_core(isa: str) -> bool:
    """Whether the core was built for that class as well."""
    return any(Path(str(core.module().__file__)).parent.glob(f"_core_{isa}.*"))


def possible(row: Row) -> bool:
    """Where this machine and this build can leave it out."""
    isa = row.environment.get("PRIMRAY_ISA")
    if isa is not None and (isa == core.isa() or not has_core(isa)):
        return False
    lanes = row.environment.get("PRIMRAY_LANES")
    if lanes is not None and int(lanes) >= core.lanes():
        return False
    return not row.needs_build or module_of(row).exists()


def report(scenes: list[str], rounds: int, only: str = "") -> None:
    wanted = [row for row in ROWS if only in row.name]
    for scene in scenes:
        rows = [row for row in wanted if scene in row.scenes and possible(row)]
        if not rows:
            continue
        reference(RENDERERS[0], scene)
        when = {"date": datetime.date.today().isoformat(), "cpu": cpu_model(), "isa": core.isa()}
        found = [row | when for row in measure(scene, rows, rounds)]
        for row in found:
            low, high = row["range"]
            print(
                f"{scene:7} {row['name']:44} {row['instead']:36} error x {row['error']:.3f}  seconds x {row['seconds']:.3f}  "
                f"both x {row['error_seconds']:.3f} ({low:.3f} to {high:.3f})",
                flush=True,
            )
        _write(found)


def _write(rows: list[dict[str, Any]]) -> None:
    found = with_earlier(rows, latest("ablations"))
    measured = {(row["name"], row["instead"]) for row in found}
    left_out = [
        {"name": row.name, "instead": row.instead, "left_out": "not built"}
        for row in ROWS
        if (row.name, row.instead) not in measured and not possible(row)
    ]
    write_results("ablations", found + left_out)


def with_earlier(found: list[dict[str, Any]], earlier: dict[str, Any] | None) -> list[dict[str, Any]]:
    """What was measured now, and before that of other rows that there still are."""
    if earlier is None:
        return found
    now = {_which(row) for row in found}
    there_are = {(row.name, row.instead, scene) for row in ROWS for scene in row.scenes}
    when = {"date": earlier["date"], "cpu": earlier["cpu"], "isa": earlier["isa"]}
    left = [when | row for row in earlier["rows"] if "left_out" not in row]
    return found + [row for row in left if _which(row) in there_are - now]


def _which(row: dict[str, Any]) -> tuple[str, str, str]:
    return row["name"], row["instead"], row["scene"]


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.ablations", description=__doc__)
    parser.add_argument("scenes", nargs="*", default=list(SCENES))
    parser.add_argument("--build", action="store_true", help="make the builds that are missing, and measure nothing")
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--only", default="", help="rows with this in their name")
    options = parser.parse_args()
    if options.build:
        for row in ROWS:
            if row.needs_build and options.only in row.name:
                build(row)
                print(f"built: {row.name}, {row.instead}", flush=True)
        return
    report(options.scenes, options.rounds, options.only)


if __name__ == "__main__":
    main()
