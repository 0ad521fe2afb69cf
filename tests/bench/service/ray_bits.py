"""Pictures of jobs on a Ray cluster of 1, 2 and 3 nodes of one core, as digests: they are to be those of one render.

    python -m tests.bench.service.ray_bits

Of five stages, each stopped by samples and by error, in parts and whole, adaptive and not, and by time: of those the digest is
compared with that of one render of as many samples, which differ from run to run.
"""

from __future__ import annotations

import os
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import httpx2
from tests.bench.results import write_results
from tests.bench.service.load import serving
from tests.service.api_calls import finished, submit, upload
from tests.service.executor.ray.cluster import RunningCluster

import primray
from primray import RenderSettings
from primray_service.limits import GiB

SCENES = Path(__file__).parents[3] / "scenes/features"
STAGES = ("glass", "implicit-shapes", "clearcoat", "point-instancer", "light-rect")
SIZE = (48, 36)
ENDS: dict[str, dict[str, Any]] = {
    "samples": {"adaptive": False, "stop": {"max_samples": 64}},
    "error": {"adaptive": False, "stop": {"target_error": 0.01, "max_samples": 4096}},
    "adaptive, samples": {"adaptive": True, "stop": {"max_samples": 64}},
    "adaptive, error": {"adaptive": True, "stop": {"target_error": 0.01, "max_samples": 4096}},
    "time": {"adaptive": False, "stop": {"max_seconds": 3}},
}
Row = dict[str, Any]


def digest(client: httpx2.Client, scene: str, settings: dict[str, Any], parallel: int | None) -> tuple[str, int]:
    """Of a job's picture, and its samples a pixel, where that has most."""
    more: dict[str, Any] = {} if parallel is None else {"parallel": parallel}
    job = finished(client, submit(client, scene, {"resolution": list(SIZE), "seed": 3, **settings}, **more)["id"], 600)
    assert job["state"] == "succeeded", job["error"]
    (one,) = job["result"]["pixels_sha256"]
    report = client.get(f"/v1/jobs/{job['id']}/outputs/report.json").json()
    return one["sha256"], max(report["samples_per_pixel"])


def rows(workers: int, client: httpx2.Client) -> list[Row]:
    found: list[Row] = []
    for path in (SCENES / name / "scene.usda" for name in STAGES):
        scene = upload(client, path.read_bytes())
        for end, settings in ENDS.items():
            parallel = None if settings["adaptive"] else workers
            made, samples = digest(client, scene, settings, parallel)
            row: Row = {"stage": path.parent.name, "end": end, "workers": workers, "sha256": made[:16], "samples": samples}
            if end == "time":
                again = primray.render(path, RenderSettings(resolution=SIZE, seed=3, adaptive=False, spp=samples))
                row["one_render"] = again.report["pixels_sha256"][:16]
            found.append(row)
            print(row, flush=True)
    return found


def main() -> None:
    found: list[Row] = []
    with ExitStack() as stack:
        cluster = RunningCluster()
        stack.callback(cluster.stop)
        os.environ.update(cluster.environment)
        for workers in (2, 3, 1):
            if workers == 3:
                cluster.ask(do="add", number=2)
            if workers == 1:
                cluster.ask(do="remove", number=1)
                cluster.ask(do="remove", number=2)
            with serving(executor="ray", ray_address=cluster.address, slots=workers, limits={"memory_bytes": GiB}) as server:
                found += rows(workers, server.client())
    alone: dict[tuple[str, str], set[str]] = {}
    for row in found:
        if row["end"] == "time":
            assert row["sha256"] == row["one_render"], row
        else:
            alone.setdefault((row["stage"], row["end"]), set()).add(row["sha256"])
    assert all(len(digests) == 1 for digests in alone.values()), alone
    print(write_results("ray-bits", found))


if __name__ == "__main__":
    main()
