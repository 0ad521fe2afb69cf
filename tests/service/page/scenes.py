"""Scenes that are checked and rendered in a moment, and the API calls that tests of the page need beside it."""

from __future__ import annotations

import time
from typing import Any

import httpx2

# A ball under a light: little light arrives by chance, so that a small picture of it takes some seconds to become clean.
SMALL = """#usda 1.0
(
    upAxis = "Y"
    startTimeCode = 1
    endTimeCode = 3
)

def Camera "camera"
{
    float focalLength = 40
    float horizontalAperture = 36
    float verticalAperture = 24
    float2 clippingRange = (0.1, 1000)
    double3 xformOp:translate = (0, 1, 6)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}

def Camera "side"
{
    float focalLength = 40
    float horizontalAperture = 20
    float verticalAperture = 20
    double3 xformOp:translate = (0.5, 1, 5)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}

def Sphere "ball"
{
    double radius = 1
    color3f[] primvars:displayColor = [(0.8, 0.3, 0.1)]
    double3 xformOp:translate = (0, 1, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}

def Cylinder "post"
{
    double3 xformOp:translate = (1.5, 1, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}

def Mesh "floor"
{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-8, 0, 6), (8, 0, 6), (8, 0, -6), (-8, 0, -6)]
}

def RectLight "key"
{
    float inputs:width = 2
    float inputs:height = 2
    float inputs:intensity = 20
    double3 xformOp:translate = (2, 5, 3)
    float3 xformOp:rotateXYZ = (-55, 20, 0)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}

def DomeLight "sky"
{
    float inputs:intensity = 0.4
}
"""

ENDED = ("succeeded", "failed", "canceled", "expired")
PATIENCE = 4  # times as long on a machine that has other work
FOREVER: dict[str, Any] = {"max_seconds": 600}


def upload(client: httpx2.Client, content: str = SMALL, name: str = "small.usda") -> str:
    """A scene's id, once it has been checked."""
    answer = client.post("/v1/scenes", params={"name": name}, content=content.encode())
    assert answer.status_code in (200, 201), answer.text
    scene: dict[str, Any] = answer.json()
    until = time.monotonic() + 60
    while scene["state"] == "checking":
        assert time.monotonic() < until
        time.sleep(0.05)
        scene = client.get(f"/v1/scenes/{scene['id']}").json()
    assert scene["state"] == "ready", scene["problem"]
    return str(scene["id"])


def submit(
    client: httpx2.Client,
    scene: str,
    *,
    stop: dict[str, Any] | None = None,
    labels: dict[str, str] | None = None,
    wait_s: int = 0,
    **settings: Any,
) -> str:
    """A job's id; with `wait_s`, once it has succeeded."""
    request = {
        "scene": {"id": scene},
        "settings": {"resolution": [48, 32], "stop": stop or {"max_samples": 8}, **settings},
        "labels": labels or {},
    }
    answer = client.post("/v1/jobs", json=request)
    assert answer.status_code == 202, answer.text
    job: dict[str, Any] = answer.json()
    until = time.monotonic() + PATIENCE * wait_s
    while wait_s and job["state"] not in ENDED and time.monotonic() < until:
        job = client.get(f"/v1/jobs/{job['id']}", headers={"prefer": "wait=15"}).json()
    assert not wait_s or job["state"] == "succeeded", job
    return str(job["id"])
