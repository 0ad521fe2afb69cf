"""One job from upload to download on a server that renders: its preview while it runs, its files, its log, its metrics."""

from __future__ import annotations

import hashlib
import os
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.service.executor.scenes import ROOM
from tests.service.routes.jobs.test_previews import png
from tests.service.routes.test_health import samples

from primray_service.worker.preview import decode_preview


@pytest.fixture(scope="module")
def client(start_server: Any) -> Any:
    return start_server().client()


@pytest.fixture(scope="module")
def job(client: Any) -> str:
    scene = client.post("/v1/scenes", content=ROOM.replace("intensity = 4", "intensity = 80").encode()).json()["id"]
    settings = {"resolution": [160, 90], "stop": {"max_seconds": 6, "max_samples": 4096}}
    return str(client.post("/v1/jobs", json={"scene": {"id": scene}, "settings": settings}).json()["id"])


def test_the_picture_refines_while_it_runs(client: Any, job: str, tmp_path: Path) -> None:
    path = f"/v1/jobs/{job}/preview"
    tags: list[str] = []
    passes: list[int] = []
    until = time.monotonic() + 60
    while client.get(f"/v1/jobs/{job}").json()["state"] in ("queued", "preparing", "running"):
        assert time.monotonic() < until
        response = client.get(path, headers={"if-none-match": tags[-1]} if tags else {})
        if response.status_code == 200:
            tags.append(response.headers["etag"])
            passes.append(int(response.headers["preview-pass"]))
            assert png(response.content).shape[:2] == (90, 160)
        elif response.status_code != 304:
            assert (response.status_code, response.headers["retry-after"]) == (404, "1")
        time.sleep(0.1)
    assert len(set(tags)) >= 2, "it was seen to change"
    assert passes == sorted(passes)
    folder = Path(os.environ.get("PRIMRAY_KEEP", tmp_path))
    for view in ("beauty", "error", "relative-error"):
        (folder / f"room-{view}.png").write_bytes(client.get(path, params={"view": view}).content)


def test_the_last_preview_is_the_picture_that_is_kept(client: Any, job: str) -> None:
    items = {item["name"]: item for item in client.get(f"/v1/jobs/{job}/outputs").json()["items"]}
    assert any(name.endswith(".exr") for name in items)
    for item in items.values():
        response = client.get(item["urls"]["self"])
        assert hashlib.sha256(response.content).hexdigest() == item["sha256"]
        assert response.headers["etag"] == f'"{item["sha256"]}"'
    name = next(name for name in items if name.endswith(".png"))
    kept = png_of_any(client.get(items[name]["urls"]["self"]).content)
    shown = png(client.get(f"/v1/jobs/{job}/preview").content)
    assert np.abs(kept[..., :3].astype(int) - shown[..., :3].astype(int)).mean() < 4
    raw = decode_preview(client.get(f"/v1/jobs/{job}/preview", params={"format": "raw"}).content)
    assert raw.picture == (160, 90)


def png_of_any(data: bytes) -> Any:
    import OpenImageIO as oiio

    path = Path(os.environ.get("TMPDIR", "/tmp"), f"primray-{os.getpid()}.png")
    path.write_bytes(data)
    try:
        return oiio.ImageBuf(str(path)).get_pixels(oiio.UINT8)
    finally:
        path.unlink()


def test_metrics_and_usage_have_it(client: Any, job: str) -> None:
    found = samples(client)
    assert found["primray_jobs{state=succeeded}"] == 1
    assert found["primray_frames_ended_total{reason=succeeded}"] == 1
    assert found["primray_scene_checks_total{result=ready}"] == 1
    assert found["primray_worker_cpu_seconds_total{}"] > 0.2
    assert found["primray_queue_wait_seconds_count{}"] == 1
    assert found["primray_first_sample_seconds_count{}"] == 1
    assert found["primray_dispatcher_leader{}"] == 1
    usage = client.get("/v1/usage").json()
    assert usage["cpu_s_total"] == pytest.approx(client.get(f"/v1/jobs/{job}").json()["usage"]["cpu_s"], rel=0.2)
    assert client.get(f"/v1/jobs/{job}/log").status_code == 200
