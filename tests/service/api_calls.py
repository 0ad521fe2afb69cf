"""What tests of the API share: a scene that is quickly rendered, uploads, jobs, and waiting."""

from __future__ import annotations

import time
from typing import Any

import httpx2

SCENE = b"""#usda 1.0
(
    defaultPrim = "w"
    startTimeCode = 1
    endTimeCode = 4
    upAxis = "Y"
)
def Xform "w"
{
    def Camera "cam"
    {
        double3 xformOp:translate = (0, 0, 8)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Sphere "ball"
    {
        double radius = 1
    }
    def DistantLight "sun"
    {
        float inputs:intensity = 2
    }
}
"""
QUICK = {"resolution": [32, 24], "stop": {"max_samples": 4}}
# Longer than any test waits, unless it is canceled.
ENDLESS = {"resolution": [64, 48], "stop": {"max_samples": 2**20}}

Json = dict[str, Any]


def upload(client: httpx2.Client, body: bytes = SCENE) -> str:
    """The scene's id, once it is checked."""
    scene = client.post("/v1/scenes", content=body).json()
    return wait_until(lambda: checked(client, scene["id"]), 30)


def checked(client: httpx2.Client, scene_id: str) -> str | None:
    scene = client.get(f"/v1/scenes/{scene_id}").json()
    assert scene["state"] != "rejected", scene
    return scene_id if scene["state"] == "ready" else None


def stored(client: httpx2.Client, body: bytes = SCENE) -> str:
    """The scene's id, on a server that checks nothing."""
    answer = client.post("/v1/scenes", content=body)
    assert answer.status_code in (200, 201), answer.text
    found: str = answer.json()["id"]
    return found


def submit(client: httpx2.Client, scene: str, settings: Json | None = None, **more: Any) -> Json:
    answer = client.post("/v1/jobs", json={"scene": {"id": scene}, "settings": settings or QUICK, **more})
    assert answer.status_code == 202, answer.text
    job: Json = answer.json()
    return job


def finished(client: httpx2.Client, job_id: str, timeout_s: float = 180) -> Json:
    def ended() -> Json | None:
        job: Json = client.get(f"/v1/jobs/{job_id}", headers={"prefer": "wait=5"}).json()
        return job if job["finished_at"] is not None else None

    return wait_until(ended, timeout_s)


def wait_until(look: Any, timeout_s: float = 60.0) -> Any:
    """What `look` answers once it is true."""
    until = time.monotonic() + timeout_s
    while not (found := look()):
        assert time.monotonic() < until, "it did not happen in time"
        time.sleep(0.02)
    return found


def problem(answer: httpx2.Response, status: int, slug: str) -> Json:
    """The problem document, which is as it is to be."""
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    document: Json = answer.json()
    assert document["type"] == f"/problems/{slug}"
    assert document["status"] == status
    assert document["request_id"] == answer.headers["x-request-id"]
    assert "Traceback" not in answer.text
    return document
