"""What an administrator does for all tenants, over HTTP; and that nobody else does."""

from __future__ import annotations

import json
from typing import Any

import pytest
from tests.service.api_calls import ENDLESS, QUICK, finished, problem, stored, submit, upload, wait_until
from tests.service.conftest import make_key
from tests.service.serving import RunningServer


@pytest.fixture(scope="module")
def server(start_server: Any) -> RunningServer:
    return start_server(require_keys=True, slots=1)


def key(server: RunningServer, tenant: str, *scopes: str) -> str:
    return make_key(f"sqlite:///{server.data / 'primray.sqlite'}", tenant, *scopes)


@pytest.fixture(scope="module")
def admin(server: RunningServer) -> Any:
    return server.client(key(server, "operator", "admin"))


@pytest.fixture(scope="module")
def tenant(server: RunningServer) -> Any:
    return server.client(key(server, "lighting", "submit", "read"))


@pytest.fixture(scope="module")
def other(server: RunningServer) -> Any:
    return server.client(key(server, "layout", "submit", "read"))


def audit(server: RunningServer, action: str) -> list[dict[str, Any]]:
    lines = [json.loads(line) for line in server.log.read_text().splitlines() if line.startswith("{")]
    return [line for line in lines if line.get("event") == "audit" and line["action"] == action]


def state(client: Any, job: str, wanted: str) -> Any:
    return wait_until(lambda: client.get(f"/v1/admin/jobs/{job}").json()["state"] == wanted, 60)


OPERATIONS = [
    ("GET", "/v1/admin/jobs"),
    ("GET", "/v1/admin/jobs/{job}"),
    ("GET", "/v1/admin/jobs/{job}/frames"),
    ("PATCH", "/v1/admin/jobs/{job}"),
    ("POST", "/v1/admin/jobs/{job}/cancel"),
    ("POST", "/v1/admin/jobs/{job}/pause"),
    ("POST", "/v1/admin/jobs/{job}/resume"),
    ("POST", "/v1/admin/jobs/{job}/frames/0/retry"),
    ("GET", "/v1/admin/tenants"),
    ("GET", "/v1/admin/tenants/lighting"),
    ("PATCH", "/v1/admin/tenants/lighting/quotas"),
    ("DELETE", "/v1/admin/tenants/lighting/quotas"),
    ("GET", "/v1/admin/workers"),
]


def test_these_are_all_operations_there_are(admin: Any) -> None:
    paths = admin.get("/openapi.json").json()["paths"]
    found = {(method.upper(), path) for path, methods in paths.items() if "/admin/" in path for method in methods}
    told = {
        (method, path.replace("{job}", "{job_id}").replace("/0/", "/{number}/").replace("lighting", "{tenant}"))
        for method, path in OPERATIONS
    }
    assert {(method, path) for method, path in found if method != "HEAD"} == told


@pytest.mark.parametrize(("method", "path"), OPERATIONS)
def test_a_tenants_key_is_refused(server: RunningServer, tenant: Any, method: str, path: str) -> None:
    """Of a job that is there and of one that is not, in the same words: nothing is learnt of it."""
    scene = stored(tenant)
    job = submit(tenant, scene, ENDLESS)["id"]
    tenant.post(f"/v1/jobs/{job}/cancel")
    said = []
    for each in (job, "job_" + "0" * 26):
        body: dict[str, Any] = {"json": {}} if method == "PATCH" else {}
        answer = tenant.request(method, path.format(job=each), **body)
        said.append({**problem(answer, 403, "forbidden"), "request_id": ""})
    assert said[0] == said[1]
    problem(server.client().request(method, path.format(job=job)), 401, "unauthenticated")


def test_jobs_of_all_tenants_are_seen_changed_and_canceled(server: RunningServer, admin: Any, tenant: Any, other: Any) -> None:
    mine, its = (submit(client, upload(client), ENDLESS, labels={"shot": "010"}) for client in (tenant, other))
    listed = {job["id"]: job for job in admin.get("/v1/admin/jobs").json()["items"]}
    assert (listed[mine["id"]]["tenant"], listed[its["id"]]["tenant"]) == ("lighting", "layout")
    one = admin.get("/v1/admin/jobs", params={"tenant": "layout", "label": "shot:010"}).json()["items"]
    assert [job["id"] for job in one] == [its["id"]]
    problem(admin.get("/v1/admin/jobs", params={"label": "shot:010"}), 422, "invalid-request")
    problem(other.get(f"/v1/jobs/{mine['id']}"), 404, "not-found")
    problem(other.post(f"/v1/jobs/{mine['id']}/pause"), 404, "not-found")
    problem(other.post(f"/v1/jobs/{mine['id']}/resume"), 404, "not-found")
    problem(other.post(f"/v1/jobs/{mine['id']}/frames/0/retry"), 404, "not-found")
    problem(admin.get(f"/v1/jobs/{mine['id']}"), 404, "not-found")  # its own tenant has no such job
    waiting = its if admin.get(f"/v1/admin/jobs/{its['id']}").json()["state"] == "queued" else mine
    changed = admin.patch(f"/v1/admin/jobs/{waiting['id']}", json={"priority": 90}).json()
    assert changed["priority"] == 90
    state(admin, waiting["id"], "running")  # it goes before the other now
    workers = admin.get("/v1/admin/workers").json()
    assert (workers["dispatcher"], workers["slots"], workers["nodes"][0]["slots"]) == ("here", 1, 1)
    assert [(frame["job"], frame["frame"]) for frame in workers["running"]] == [(waiting["id"], 0)]
    frames = admin.get(f"/v1/admin/jobs/{waiting['id']}/frames").json()
    assert [frame["state"] for frame in frames["items"]] == ["running"]
    for job in (mine, its):
        assert admin.post(f"/v1/admin/jobs/{job['id']}/cancel").json()["state"] in ("canceling", "canceled")
    assert finished(tenant, mine["id"])["state"] == "canceled"
    assert finished(other, its["id"])["state"] == "canceled"
    [line] = audit(server, "change-job")
    assert (line["of_tenant"], line["changes"], line["by_tenant"]) == (changed["tenant"], {"priority": 90}, "operator")
    assert line["by"].startswith("key_")
    assert {line["job_id"] for line in audit(server, "cancel-job")} == {mine["id"], its["id"]}


def test_a_job_is_paused_by_its_tenant_and_resumed_by_an_administrator(server: RunningServer, admin: Any, tenant: Any) -> None:
    job = submit(tenant, upload(tenant), {**ENDLESS, "stop": {"max_seconds": 600}})["id"]
    wait_until(lambda: (tenant.get(f"/v1/jobs/{job}").json()["progress"]["samples_done"] or 0) > 0, 60)
    assert tenant.post(f"/v1/jobs/{job}/pause").json()["state"] in ("pausing", "paused")
    state(admin, job, "paused")
    assert tenant.get(f"/v1/jobs/{job}/frames/0").json()["checkpoint"] >= 1
    assert admin.get("/v1/admin/workers").json()["running"] == []
    quick = finished(tenant, submit(tenant, upload(tenant))["id"])
    assert quick["state"] == "succeeded"
    assert tenant.get(f"/v1/jobs/{job}").json()["state"] == "paused"
    taken = tenant.get(f"/v1/jobs/{job}").json()["progress"]["samples_done"]
    assert admin.post(f"/v1/admin/jobs/{job}/resume").status_code == 202
    wait_until(lambda: (tenant.get(f"/v1/jobs/{job}").json()["progress"]["samples_done"] or 0) > taken, 60)
    assert admin.post(f"/v1/admin/jobs/{job}/pause").json()["tenant"] == "lighting"
    state(admin, job, "paused")
    tenant.post(f"/v1/jobs/{job}/cancel")
    assert finished(tenant, job)["state"] == "canceled"
    problem(tenant.post(f"/v1/jobs/{job}/pause"), 409, "conflict")
    problem(tenant.post(f"/v1/jobs/{job}/resume"), 409, "conflict")
    assert [line["of_tenant"] for line in audit(server, "resume-job") + audit(server, "pause-job")] == ["lighting"] * 2


def test_one_frame_is_rendered_again_under_its_name(admin: Any, tenant: Any) -> None:
    scene = upload(tenant)
    job = finished(tenant, submit(tenant, scene, {**QUICK, "frames": "1:3"})["id"])
    before = {output["name"]: output for output in tenant.get(f"/v1/jobs/{job['id']}/outputs").json()["items"]}
    again = tenant.post(f"/v1/jobs/{job['id']}/frames/1/retry")
    assert (again.status_code, again.json()["state"], again.json()["attempt"]) == (202, "queued", 1)
    problem(tenant.post(f"/v1/jobs/{job['id']}/frames/9/retry"), 404, "not-found")
    ended = finished(tenant, job["id"])
    assert ended["state"] == "succeeded"
    assert ended["usage"]["cpu_s"] > job["usage"]["cpu_s"]
    outputs = {output["name"]: output for output in tenant.get(f"/v1/jobs/{job['id']}/outputs").json()["items"]}
    assert set(outputs) == set(before)
    assert {name for name in outputs if outputs[name]["created_at"] != before[name]["created_at"]} == {
        "beauty.0002.exr",
        "beauty.0002.png",
        "report.0002.json",
    }
    assert "no-cache" in tenant.get(outputs["beauty.0002.png"]["urls"]["self"]).headers["cache-control"]
    ends = [
        event
        for event in tenant.get(f"/v1/jobs/{job['id']}/events", headers={"accept": "application/json"}).json()["items"]
        if event["type"] == "end"
    ]
    assert len(ends) == 2
    assert ends[-1]["data"]["finished_at"] == ended["finished_at"] != ends[0]["data"]["finished_at"]
    assert admin.post(f"/v1/admin/jobs/{job['id']}/frames/0/retry").status_code == 202
    finished(tenant, job["id"])


def test_quotas_are_set_for_a_tenant_whatever_its_keys_say(server: RunningServer, admin: Any, tenant: Any) -> None:
    before = tenant.get("/v1/usage").json()
    assert before["stored_bytes"]["limit"] is not None
    answer = admin.patch("/v1/admin/tenants/lighting/quotas", json={"queued_jobs": 0, "stored_bytes": None})
    assert answer.json()["quotas_set"] == {"queued_jobs": 0, "stored_bytes": None}
    assert tenant.get("/v1/usage").json()["stored_bytes"]["limit"] is None
    scene = upload(tenant)
    refused = tenant.post("/v1/jobs", json={"scene": {"id": scene}, "settings": QUICK})
    assert problem(refused, 429, "quota-exceeded")["quota"] == "queued_jobs"
    admin.patch("/v1/admin/tenants/lighting/quotas", json={"queued_jobs": 7})
    listed = {one["tenant"]: one for one in admin.get("/v1/admin/tenants").json()["items"]}
    assert listed["lighting"]["quotas"]["queued_jobs"] == 7
    assert listed["lighting"]["quotas_set"] == {"queued_jobs": 7, "stored_bytes": None}
    assert listed["lighting"]["stored_bytes"]["used"] > 0
    page = admin.get("/v1/admin/tenants", params={"limit": 1}).json()
    assert (page["items"][0]["tenant"], page["next_after"]) == ("layout", "layout")
    assert admin.delete("/v1/admin/tenants/lighting/quotas").json()["quotas_set"] == {}
    assert tenant.get("/v1/usage").json()["queued_jobs"]["limit"] == before["queued_jobs"]["limit"]
    problem(admin.patch("/v1/admin/tenants/lighting/quotas", json={"queued_jobs": -1}), 422, "invalid-request")
    problem(admin.patch("/v1/admin/tenants/..%2f/quotas", json={}), 404, "not-found")
    assert [line["quotas"] for line in audit(server, "set-quotas")][-1] == {"queued_jobs": 7, "stored_bytes": None}
    assert len(audit(server, "unset-quotas")) == 1
    assert server.failures() == []
