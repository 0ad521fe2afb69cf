"""Faults on purpose on a Ray cluster: as tests.service.faults, and tasks, raylets and the head are killed too.

    python -m tests.service.executor.ray.faults --kills 100

The server and its jobs are on PostgreSQL; two nodes of one core render, behind their walls. What jobs are to have made is known
from a server that renders itself, each frame in one place, and that nobody disturbs: frames in parts have the
same bits, by samples and by their error.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import signal
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tests.service.executor.ray.cluster import RunningCluster
from tests.service.faults import (
    LIMITS,
    Database,
    Disturbance,
    Findings,
    Service,
    Spec,
    database,
    disturbed,
    lost_connections,
    specs,
    undisturbed,
)
from tests.service.postgres import Server as PostgresServer

from primray_service.limits import GiB

AWAY_S = (0.0, 10.0)  # how long the head stays dead: once a study, a minute
LONG_AWAY_S = 60.0


def ray_specs(weight: float) -> list[Spec]:
    """The usual ones, and frames in parts: by samples and by error."""
    n = max(64, int(256 * weight) // 8 * 8)
    in_parts = {"resolution": [96, 72], "adaptive": False}
    return [
        *specs(weight),
        Spec("parts", "glass", {**in_parts, "seed": 4, "stop": {"max_samples": n}}, parallel=2),
        Spec("parts-error", "glass", {**in_parts, "seed": 5, "stop": {"target_error": 0.01 / weight}}, parallel=2),
    ]


def kill_one(pids: Sequence[int], chance: random.Random) -> bool:
    if not pids:
        return False
    with contextlib.suppress(ProcessLookupError):
        os.kill(chance.choice(pids), signal.SIGKILL)
        return True
    return False


class Heads:
    """Kills the head, and has it come back: one of the times after a minute."""

    def __init__(self, cluster: RunningCluster) -> None:
        self._cluster = cluster
        self._away_long = False

    def kill(self, chance: random.Random) -> bool:
        self._cluster.ask(do="kill-head")
        time.sleep(chance.uniform(*AWAY_S) if self._away_long else LONG_AWAY_S)
        self._away_long = True
        self._cluster.ask(do="restart")
        return True


def on_ray(cluster: RunningCluster, database: Database) -> list[Disturbance]:
    def raylet(_: Service, __: random.Random) -> bool:
        cluster.ask(do="kill-raylet", number=1)
        return True

    heads = Heads(cluster)
    return [
        Disturbance("worker", 4, lambda _, chance: kill_one(cluster.workers(), chance)),
        Disturbance("task", 3, lambda _, chance: kill_one(cluster.tasks(), chance)),
        Disturbance("raylet", 2, raylet),
        Disturbance("head", 1, lambda _, chance: heads.kill(chance)),
        Disturbance("server", 2, lambda service, _: service.kill()),
        *lost_connections(database),
    ]


def study(*, kills: int, seed: int, weight: float, every_s: float, server: PostgresServer | None = None) -> Findings:
    jobs = ray_specs(weight)
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="primray-faults-")))
        new_database = stack.enter_context(database("postgresql", server))
        expected = undisturbed(folder / "undisturbed", new_database, jobs)
        cluster = RunningCluster()
        stack.callback(cluster.stop)
        before = dict(os.environ)
        stack.callback(os.environ.update, before)
        os.environ.update(cluster.environment)
        over: dict[str, Any] = {"executor": "ray", "ray_address": cluster.address, "slots": 2, "allow_unsandboxed": False}
        over["limits"] = {**LIMITS, "memory_bytes": GiB, "load_cpu_s": 20.0}
        used = new_database()
        return disturbed(
            folder / "disturbed",
            used,
            jobs,
            expected,
            kills=kills,
            seed=seed,
            every_s=every_s,
            kinds=on_ray(cluster, used),
            settings=over,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--weight", type=float, default=4.0, help="how long jobs take")
    parser.add_argument("--every", type=float, default=2.0, help="mean seconds between kills")
    asked = parser.parse_args()
    found = study(kills=asked.kills, seed=asked.seed, weight=asked.weight, every_s=asked.every)
    print(json.dumps({"seed": asked.seed} | found.as_json(), indent=1))
    sys.exit(bool(found.wrong))


if __name__ == "__main__":
    main()
