"""How long small jobs take from POST to the last picture fetched: 32 x 32 pixels, 2 samples, one frame and ten.
`python -m tests.bench.service.quick_jobs [--rounds N] [--pause S]`.

The scene is there already. Between jobs there is a pause, in which the next worker is started; without one, a job waits for
that. Client, server and renderer share the machine; the load of others is in each row.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from typing import Any

import httpx2
from tests.bench.results import write_results
from tests.bench.service.load import serving
from tests.service.api_calls import Json, submit, upload

SETTINGS: Json = {"resolution": [32, 32], "stop": {"max_samples": 2}}
AT_MOST_S = {1: 0.5, 10: 1.5}  # what is aimed at, on two quiet cores


def seconds_of(client: httpx2.Client, scene: str, frames: int) -> float:
    """From the request that makes the job to its last picture."""
    began = time.perf_counter()
    job = submit(client, scene, SETTINGS if frames == 1 else {**SETTINGS, "frames": f"1:{frames}"})
    while job["finished_at"] is None:
        job = client.get(job["urls"]["self"], headers={"prefer": "wait=30"}).json()
    assert job["state"] == "succeeded", job["error"]
    names = [row["name"] for row in client.get(job["urls"]["outputs"]).json()["items"] if row["name"].endswith(".png")]
    for name in names:
        assert client.get(f"{job['urls']['outputs']}/{name}").status_code == 200
    assert len(names) == frames
    return time.perf_counter() - began


def measured(rounds: int, pause_s: float) -> list[dict[str, Any]]:
    rows = []
    with serving() as server:
        client = server.client()
        scene = upload(client)
        for frames, aim_s in AT_MOST_S.items():
            seconds = []
            for _ in range(rounds):
                time.sleep(pause_s)
                seconds.append(round(seconds_of(client, scene, frames), 3))
            rows.append(
                {
                    "frames": frames,
                    "median_s": statistics.median(seconds),
                    "seconds": seconds,
                    "aim_s": aim_s,
                    "pause_s": pause_s,
                    "load": round(os.getloadavg()[0], 2),
                }
            )
            print(f"{frames:3} frames: {rows[-1]['median_s']:.3f} s (aim {aim_s} s), load {rows[-1]['load']}", flush=True)
    return rows


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--pause", type=float, default=3.0, metavar="S")
    arguments = parser.parse_args()
    print(write_results("quick-jobs", measured(arguments.rounds, arguments.pause)))
