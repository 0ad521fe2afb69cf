"""Explained pixels over HTTP: the picture's own light in parts, and requests that are refused."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.service.api_calls import ENDLESS, finished, submit, upload
from tests.service.conftest import make_key
from tests.service.executor.scenes import ROOM
from tests.service.routes.jobs.finished import finished_job
from tests.service.scenes.zips import Entry, zip_of

from primray.images.reading import read_image
from primray_service.limits import Quotas

BRIGHT = ROOM.replace("intensity = 4", "intensity = 400")
SETTINGS = {"resolution": [32, 18], "stop": {"max_samples": 8}, "half": ["none"]}


@pytest.fixture(scope="module")
def client(server: Any) -> Any:
    return server.client()


@pytest.fixture(scope="module")
def job(client: Any) -> str:
    made = submit(client, upload(client, BRIGHT.encode()), SETTINGS)
    assert finished(client, made["id"])["state"] == "succeeded"
    return str(made["id"])


def explain(client: Any, job: str, x: int, y: int, frame: int = 0) -> Any:
    return client.post(f"/v1/jobs/{job}/frames/{frame}/explain", json={"x": x, "y": y}, timeout=120)


def slug(response: Any) -> tuple[int, str]:
    return response.status_code, response.json()["type"].removeprefix("/problems/")


def picture(client: Any, job: str, folder: Path) -> Any:
    path = folder / "beauty.exr"
    path.write_bytes(client.get(f"/v1/jobs/{job}/outputs/beauty.exr").content)
    return read_image(path).pixels


def test_the_parts_add_up_to_the_pictures_own_pixel(client: Any, job: str, tmp_path: Path) -> None:
    used = client.get("/v1/usage").json()["cpu_s_total"]
    answer = explain(client, job, 12, 14)
    assert answer.status_code == 200, answer.text
    pixel = answer.json()
    assert (pixel["pixel"], pixel["samples"], pixel["renders"]) == ([12, 14], 8, 15)
    assert pixel["shown"]["prim"] == "/World/ball"
    assert pixel["scene"] == "scene.usda", "no path of the server"
    assert pixel["splits"]["light"][0]["name"] == "/World/lamp"
    assert np.array_equal(np.float32(pixel["value"]), picture(client, job, tmp_path)[14, 12, :3])
    for parts in pixel["splits"].values():
        sums = [np.float32(math.fsum(part["value"][c] for part in parts)) for c in range(3)]
        assert sums == [np.float32(value) for value in pixel["value"]]
    assert pixel["noise"][0]["words"]
    assert client.get("/v1/usage").json()["cpu_s_total"] > used


def test_a_region_is_explained_from_its_corner(client: Any, tmp_path: Path) -> None:
    scene = upload(client, BRIGHT.encode())
    job = submit(client, scene, {**SETTINGS, "region": [0.25, 0.0, 0.75, 0.5]})["id"]
    assert finished(client, job)["state"] == "succeeded"
    found = explain(client, job, 4, 5)
    assert found.status_code == 200, found.text
    assert found.json()["pixel"] == [12, 14]
    assert np.array_equal(np.float32(found.json()["value"]), picture(client, job, tmp_path)[5, 4, :3])
    refused = explain(client, job, 16, 5)
    assert slug(refused) == (422, "invalid-request")
    assert refused.json()["member"] == "x"
    assert refused.json()["detail"] == "The picture has 16 x 9 pixels, and none at 16 5."


def test_frames_of_a_package_are_explained_at_their_time(client: Any) -> None:
    moving = BRIGHT.replace("double radius = 1", "double radius.timeSamples = {1: 1, 2: 0.01}")
    scene = client.post("/v1/scenes", content=zip_of(Entry("room.usda", moving.encode()))).json()["id"]
    job = submit(client, scene, {**SETTINGS, "frames": "1:2", "resolution": [16, 9]})["id"]
    assert finished(client, job)["state"] == "succeeded"
    shown = [explain(client, job, 8, 4, frame).json()["shown"] for frame in (0, 1)]
    assert shown[0]["prim"] == "/World/ball"
    assert shown[1] is None or shown[1]["prim"] != "/World/ball"


def test_what_cannot_be_explained_is_refused(client: Any, job: str) -> None:
    assert slug(explain(client, job, 0, 0, frame=1)) == (404, "not-found")
    assert slug(explain(client, "job_00000000000000000000000000", 0, 0)) == (404, "not-found")
    assert slug(explain(client, job, -1, 0)) == (422, "invalid-request")
    scene = upload(client, BRIGHT.encode())
    endless = submit(client, scene, ENDLESS)["id"]
    assert slug(explain(client, endless, 0, 0)) == (409, "conflict")
    client.post(f"/v1/jobs/{endless}/cancel")
    assert finished(client, endless)["state"] == "canceled"


def test_a_deleted_scene_is_not_explained(client: Any) -> None:
    scene = upload(client, BRIGHT.replace("400", "401").encode())
    job = submit(client, scene, SETTINGS)["id"]
    finished(client, job)
    assert client.delete(f"/v1/scenes/{scene}").status_code == 204
    assert slug(explain(client, job, 0, 0)) == (409, "conflict")


def test_a_pixel_that_takes_too_long_is_given_up(start_server: Any) -> None:
    client = start_server(limits={"explain_cpu_s": 0.05}).client()
    job = submit(client, upload(client, BRIGHT.encode()), SETTINGS)["id"]
    assert finished(client, job)["state"] == "succeeded"
    refused = explain(client, job, 0, 0)
    assert slug(refused) == (422, "time-limit")
    assert refused.json()["limit"] == 0.05


def test_a_server_without_workers_says_so(start_server: Any) -> None:
    server = start_server(dispatch=False)
    refused = explain(server.client(), finished_job(server, {}), 0, 0)
    assert slug(refused) == (503, "unavailable")


def test_rights_and_quotas_hold(start_server: Any) -> None:
    server = start_server(require_keys=True)
    database = f"sqlite:///{server.data / 'primray.sqlite'}"
    own = server.client(make_key(database, "own", "submit", "read", quotas=Quotas(cpu_s_per_day=0.01)))
    job = submit(own, upload(own, BRIGHT.encode()), SETTINGS)["id"]
    assert finished(own, job)["state"] == "succeeded"
    reader = server.client(make_key(database, "own", "read"))
    assert slug(explain(reader, job, 0, 0)) == (403, "forbidden")
    other = server.client(make_key(database, "other", "submit", "read"))
    assert slug(explain(other, job, 0, 0)) == (404, "not-found")
    exhausted = explain(own, job, 0, 0)
    assert slug(exhausted) == (429, "quota-exceeded")
    assert exhausted.json()["quota"] == "cpu_s_per_day"
