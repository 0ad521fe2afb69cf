"""See `__init__`."""

from __future__ import annotations

import argparse
import json
import os
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.bench.results import write_results
from tests.bench.service import simulation
from tests.bench.service.long_queues import database
from tests.bench.service.simulation.fleet import Chances
from tests.bench.service.simulation.simulate import Farm, simulate

MEMORY = Path("/dev/shm")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.service.simulation", description=simulation.__doc__)
    parser.add_argument("--nodes", type=int, default=1000)
    parser.add_argument("--tenants", type=int, default=100)
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--frame-s", type=float, default=30.0, help="mean, of the simulated clock")
    parser.add_argument("--minutes", type=float, default=15.0, help="of real time, at most")
    parser.add_argument("--database", choices=["postgresql", "sqlite"], default="postgresql")
    options = parser.parse_args()
    farm = Farm(options.nodes, options.tenants, options.frames, chances=replace(Chances(), frame_s=options.frame_s))
    with database(options.database) as url, TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as folder:
        row = simulate(url, Path(folder) / "data", farm, most_s=60 * options.minutes)
    row |= {"database": options.database, "load_average": os.getloadavg()}
    print(json.dumps(row, indent=1))
    print(f"written: {write_results('service_simulation', [row]).name}")
    raise SystemExit(bool(row["wrong"]))


if __name__ == "__main__":
    main()
