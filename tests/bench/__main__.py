"""The whole benchmark: python -m tests.bench [--quick] [--fresh] [STEP ...].

Every step writes its own file in tests/bench/results; a run that was stopped goes on after its last finished step (--fresh
begins again). About twenty minutes on two quiet cores with every peer (PRIMRAY_PEERS, peers/installed.py) and with the
references there, which the first run makes (references.py). `make docs` then writes docs/benchmarks.md.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from tests.bench import ablations, curves, efficiency, first_pictures, growth, quick_looks, startup
from tests.bench.cores import moving_rays, replay

from primray import core
from primray.settings import QUICK_LOOK

from .peer_runs import kept
from .peers.scenes import SCENES
from .results import write_results
from .scenes import available

ROOT = Path(__file__).parents[2]


def replays(spp: int, repetitions: int) -> None:
    rows = []
    for scene in available():
        row = replay.measure(scene, spp, repetitions)
        rows.append(row)
        low, high = row["embree_share_range"]
        rate = row["samples"] / min(row["render_s"]) / 1e6
        share = f"{row['embree_share_median']:.3f} ({low:.3f} to {high:.3f})"
        print(f"{row['scene']:10} Embree's share {share}, {rate:.2f} Msamples/s on one thread", flush=True)
    write_results("replay", rows)


def replays_at_8(quick: bool) -> None:
    """Eight lanes are the AVX2 build's: another process, as one takes one build."""
    if core.isa() != "v4" or not ablations.has_core("v3"):
        print("no second build of the core here: left out")
        return
    command = [sys.executable, "-m", "tests.bench", *(["--quick"] if quick else []), "replay"]
    subprocess.run(command, check=True, cwd=ROOT, env=dict(os.environ) | {"PRIMRAY_ISA": "v3"})


def steps(quick: bool) -> dict[str, Callable[[], None]]:
    rounds, limit_s = (1, 4.0) if quick else (curves.ROUNDS, curves.LIMIT_S)
    most = 10**6 if quick else 10**7
    repeated = 3 if quick else 5
    found: dict[str, Callable[[], None]] = {"startup": lambda: startup.report(3 if quick else startup.ROUNDS)}
    found["first-pictures"] = lambda: first_pictures.report(1 if quick else first_pictures.ROUNDS)
    found["quick-looks"] = quick_looks.report
    for scene in SCENES:
        found[f"curve-{scene}"] = lambda scene=scene: curves.report(scene, rounds, limit_s)  # type: ignore[misc]
    found["efficiency"] = lambda: efficiency.report(1 if quick else efficiency.ROUNDS)
    found["replay"] = lambda: replays(QUICK_LOOK, repeated)  # the fewest that are split and guided
    found["replay-8"] = lambda: replays_at_8(quick)
    found["moving-rays"] = lambda: moving_rays.report(rounds=2 if quick else moving_rays.ROUNDS)
    for kind in ("pictures", *growth.SIZES):
        largest = most // 10 if kind in ("prims", "referenced", "kinds") else most  # which take minutes to write
        found[f"growth-{kind}"] = lambda kind=kind, largest=largest: growth.report([kind], largest)  # type: ignore[misc]
    found["ablations"] = lambda: ablations.report(list(SCENES), 1 if quick else 2)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description=__doc__)
    parser.add_argument("steps", nargs="*", help=f"all by default: {', '.join(steps(False))}")
    parser.add_argument("--quick", action="store_true", help="small sizes, few rounds")
    parser.add_argument("--fresh", action="store_true", help="begin again, whatever a stopped run had finished")
    options = parser.parse_args()
    known = steps(options.quick)
    unknown = [name for name in options.steps if name not in known]
    if unknown:
        parser.error(f"no step {', '.join(unknown)}; there are {', '.join(known)}")
    begun = kept() / "begun.json"  # with which core, and which steps are done
    run_id = f"{core.build_digest()} {'quick' if options.quick else 'full'}"
    done: list[str] = []
    if begun.exists() and not options.fresh and not options.steps:
        before = json.loads(begun.read_text())
        done = before["done"] if before["run"] == run_id else []
    started = time.perf_counter()
    for name in options.steps or known:
        if name in done:
            print(f"== {name}: done before")
            continue
        print(f"== {name}, after {time.perf_counter() - started:.0f} s", flush=True)
        known[name]()
        if not options.steps:
            done.append(name)
            begun.parent.mkdir(parents=True, exist_ok=True)
            begun.write_text(json.dumps({"run": run_id, "done": done}))
    if not options.steps:
        begun.unlink(missing_ok=True)
    print(f"done after {time.perf_counter() - started:.0f} s; `make docs` writes docs/benchmarks.md from it")


if __name__ == "__main__":
    main()
