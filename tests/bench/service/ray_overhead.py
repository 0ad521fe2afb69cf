"""What a Ray cluster adds: one long frame on two nodes of one core against two local cores, and many small frames.

    python -m tests.bench.service.ray_overhead [--rounds N] [--seconds S]

A server that renders itself, on two cores, and one whose renders run on a cluster of two nodes of one core take the same
jobs by turns. Wall seconds go from POST to the job's end. Servers, cluster and database share the machine.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import httpx2
from tests.bench.results import write_results
from tests.bench.service.load import serving
from tests.service.api_calls import Json, finished, submit, upload
from tests.service.executor.ray.cluster import RunningCluster

from primray_service.limits import GiB

SCENE = Path(__file__).parents[3] / "scenes/features/glass/scene.usda"
FRAMES = Path(__file__).parents[3] / "scenes/features/time-code/scene.usda"
SIZE = [320, 240]
TRIAL, MANY = 256, 100
AT_MOST = {"long": 1.08, "small_s": 0.15}


def wall_s(client: httpx2.Client, scene: str, settings: Json, **more: Any) -> tuple[float, str]:
    """And the digests of what it made."""
    began = time.perf_counter()
    job = finished(client, submit(client, scene, settings, **more)["id"], 1200)
    assert job["state"] == "succeeded", job["error"]
    return time.perf_counter() - began, str([one["sha256"] for one in job["result"]["pixels_sha256"]])


def at_rest_bytes(pids: list[int]) -> int:
    """What they have in memory, shared pages shared out."""
    found = 0
    for pid in pids:
        for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines():
            if line.startswith("Pss:"):
                found += 1024 * int(line.split()[1])
    return found


def measured(rounds: int, seconds: float) -> dict[str, Any]:
    with ExitStack() as stack:
        cluster = RunningCluster()
        stack.callback(cluster.stop)
        rest = at_rest_bytes(cluster.ray_processes())
        here = stack.enter_context(serving(slots=1))
        os.environ.update(cluster.environment)
        there = stack.enter_context(serving(executor="ray", ray_address=cluster.address, slots=2, limits={"memory_bytes": GiB}))
        clients = {"local": here.client(), "ray": there.client()}
        more: Mapping[str, Json] = {"local": {}, "ray": {"parallel": 2}}
        scenes = {name: upload(client, SCENE.read_bytes()) for name, client in clients.items()}
        trial, _ = wall_s(clients["local"], scenes["local"], settings_of(TRIAL, 1))
        samples = int(TRIAL * seconds / trial) // 8 * 8
        long = _by_turns(rounds, lambda name, k: wall_s(clients[name], scenes[name], settings_of(samples, k), **more[name]))
        shots = {name: upload(client, FRAMES.read_bytes()) for name, client in clients.items()}
        many: Json = {"resolution": [32, 32], "stop": {"max_samples": 2}, "frames": f"1:{MANY}"}
        small = _by_turns(rounds, lambda name, k: wall_s(clients[name], shots[name], {**many, "seed": k}))
        return {
            "samples": samples,
            "long": long,
            "small": small,
            "long_ratio": round(statistics.median(long["ray"]) / statistics.median(long["local"]), 3),
            "small_s_a_frame": {name: round(statistics.median(took) / MANY, 4) for name, took in small.items()},
            "ray_at_rest_bytes": rest,
            "server_at_rest_bytes": {"local": at_rest_bytes([here.process.pid]), "ray": at_rest_bytes([there.process.pid])},
            "at_most": AT_MOST,
            "load": round(os.getloadavg()[0], 2),
        }


def settings_of(samples: int, seed: int) -> Json:
    return {"resolution": SIZE, "seed": seed, "adaptive": False, "stop": {"max_samples": samples}}


def _by_turns(rounds: int, take: Any) -> dict[str, list[float]]:
    """The same pictures from both, which is checked."""
    found: dict[str, list[float]] = {"local": [], "ray": []}
    for k in range(rounds):
        made = {}
        for name in ("local", "ray") if k % 2 else ("ray", "local"):
            took, made[name] = take(name, k)
            found[name].append(round(took, 2))
            print(f"{name}: {took:.2f} s", flush=True)
        assert made["local"] == made["ray"], made
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=60.0, help="that a long frame takes here")
    arguments = parser.parse_args()
    print(write_results("ray-overhead", [measured(arguments.rounds, arguments.seconds)]))
