"""How soon a tenant's next job on a scene starts sampling: python -m tests.bench.service.warm_scenes [PRIMS ...] [--rounds N].

The first job opens, translates and builds the scene; the others find a worker that has it. Seconds are the server's own, of its
events: from the claim of the frame ("preparing") to its first sample ("running"), and from the job's coming to there.
"""

from __future__ import annotations

import argparse
import os
import statistics
from datetime import datetime
from typing import Any

import httpx2
from tests.bench.results import write_results
from tests.bench.service.load import serving
from tests.bench.setup.kept_scenes import make
from tests.service.api_calls import Json, finished, submit, upload

AT_MOST_S = 0.1


def seconds_of(client: httpx2.Client, scene: str, seed: int) -> dict[str, float]:
    settings: Json = {"resolution": [160, 90], "seed": seed, "stop": {"max_samples": 8}}
    job = finished(client, submit(client, scene, settings)["id"], 300)
    assert job["state"] == "succeeded", job["error"]
    events = client.get(f"/v1/jobs/{job['id']}/events").json()["items"]
    at = {e["data"]["state"]: datetime.fromisoformat(e["created_at"]) for e in events if e["type"] == "state"}
    came = datetime.fromisoformat(job["created_at"])
    return {
        "claimed_to_sampling_s": (at["running"] - at["preparing"]).total_seconds(),
        "came_to_sampling_s": (at["running"] - came).total_seconds(),
    }


def measured(prims: int, rounds: int) -> dict[str, Any]:
    with serving(limits={"memory_bytes": 4 * 2**30}) as server:
        client = server.client()
        scene = upload(client, make(prims).ExportToString().encode())
        first, *others = [seconds_of(client, scene, seed) for seed in range(rounds + 1)]
    found = {name: [round(other[name], 3) for other in others] for name in first}
    medians = {f"median_{name}": statistics.median(took) for name, took in found.items()}
    row = {"prims": prims, "first": first, **found, **medians, "load": round(os.getloadavg()[0], 2), "at_most_s": AT_MOST_S}
    print(row, flush=True)
    return row


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("prims", type=int, nargs="*", default=[100, 2000])
    parser.add_argument("--rounds", type=int, default=7)
    arguments = parser.parse_args()
    print(write_results("warm-scenes", [measured(prims, arguments.rounds) for prims in arguments.prims]))
