"""Keys, quotas and rates over HTTP, on a server that needs keys."""

from __future__ import annotations

import time
from typing import Any

import pytest
from tests.service.conftest import make_key
from tests.service.scenes.zips import LAYER
from tests.service.serving import RunningServer

from primray_service import auth
from primray_service.limits import Quotas
from primray_service.store import open_store


@pytest.fixture(scope="module")
def server(start_server: Any) -> RunningServer:
    return start_server(require_keys=True, dispatch=False, warm=False)


def database(server: RunningServer) -> str:
    return f"sqlite:///{server.data / 'primray.sqlite'}"


@pytest.fixture(scope="module")
def admin(server: RunningServer) -> Any:
    return server.client(make_key(database(server), "operator", "admin"))


def slug(response: Any) -> tuple[int, str]:
    return response.status_code, response.json()["type"].removeprefix("/problems/")


def made(admin: Any, **asked: Any) -> dict[str, Any]:
    response = admin.post("/v1/keys", json={"tenant": "studio", **asked})
    assert response.status_code == 201, response.text
    return dict(response.json())


def test_a_key_is_shown_once_and_kept_as_its_hash(server: RunningServer, admin: Any) -> None:
    key = made(admin, name="pipeline", scopes=["read"])
    assert auth.is_whole_key(key["key"])
    assert key["key"].startswith(key["prefix"])
    assert len(key["prefix"]) <= 16
    listed = admin.get("/v1/keys").json()["items"]
    assert key["id"] in [item["id"] for item in listed]
    assert all("key" not in item for item in listed)
    shown = admin.get(f"/v1/keys/{key['id']}")
    assert key["key"] not in shown.text
    for file in server.data.iterdir():
        if file.is_file():
            assert key["key"].encode() not in file.read_bytes(), file
    assert key["key"] not in server.log.read_text()
    who = server.client(key["key"]).get("/v1/whoami").json()
    assert (who["tenant"], who["name"], who["scopes"], who["key"]["id"]) == ("studio", "pipeline", ["read"], key["id"])


def test_scopes_are_kept_to(server: RunningServer, admin: Any) -> None:
    read, submit = (server.client(made(admin, scopes=[scope])["key"]) for scope in ("read", "submit"))
    assert read.get("/v1/scenes").status_code == 200
    assert slug(read.post("/v1/scenes", content=LAYER)) == (403, "forbidden")
    assert submit.post("/v1/scenes", content=LAYER).status_code == 201
    assert slug(submit.get("/v1/scenes")) == (403, "forbidden")
    for client in (read, submit):
        assert slug(client.get("/v1/keys")) == (403, "forbidden")
        assert slug(client.post("/v1/keys", json={"tenant": "other"})) == (403, "forbidden")
        assert slug(client.get("/metrics")) == (403, "forbidden")
    assert admin.get("/metrics").status_code == 200
    assert slug(server.client().get("/metrics")) == (401, "unauthenticated")


def test_a_revoked_key_is_refused_at_once(server: RunningServer, admin: Any) -> None:
    key = made(admin)
    client = server.client(key["key"])
    assert client.get("/v1/whoami").status_code == 200
    assert admin.delete(f"/v1/keys/{key['id']}").status_code == 204
    refused = client.get("/v1/whoami")
    assert slug(refused) == (401, "unauthenticated")
    assert refused.headers["www-authenticate"].startswith("Bearer")
    assert admin.get(f"/v1/keys/{key['id']}").json()["revoked_at"] is not None
    assert slug(admin.delete("/v1/keys/key_nothing")) == (404, "not-found")


def test_an_expired_key_is_refused(server: RunningServer, admin: Any) -> None:
    client = server.client(made(admin, expires_in_s=1.0)["key"])
    assert client.get("/v1/whoami").status_code == 200
    time.sleep(1.1)
    assert slug(client.get("/v1/whoami")) == (401, "unauthenticated")


@pytest.mark.parametrize("key", ["-", "primray_x", "Basic abc", "primray_" + "A" * 43 + "_000000", "\u00e9", "x" * 5000])
def test_what_is_no_key_gets_the_same_refusal(key: str, server: RunningServer) -> None:
    client = server.client()
    response = client.get("/v1/whoami", headers={b"authorization": f"Bearer {key}".encode()})
    assert slug(response) == (401, "unauthenticated")
    assert slug(client.get("/v1/whoami")) == (401, "unauthenticated")


@pytest.mark.parametrize(
    "asked",
    [
        {"tenant": ""},
        {"tenant": "../x"},
        {"tenant": "a" * 65},
        {"tenant": "a", "scopes": []},
        {"tenant": "a", "scopes": ["root"]},
        {"tenant": "a", "expires_in_s": -1},
        {"tenant": "a", "quotas": {"queued_jobs": -1}},
        {"tenant": "a", "quotas": {"burst": 0}},
        {"tenant": "a", "unknown": 1},
        {},
    ],
)
def test_what_no_key_can_be_is_refused(asked: dict[str, Any], admin: Any) -> None:
    assert slug(admin.post("/v1/keys", json=asked)) == (422, "invalid-request")


def test_the_first_key_is_made_in_the_data_directory(server: RunningServer) -> None:
    store = open_store(database(server))
    row, text = auth.issue_key(store, "first", ["admin"], time.time(), name="bootstrap")
    store.close()
    who = server.client(text).get("/v1/whoami").json()
    assert (who["tenant"], who["key"]["id"]) == ("first", row.id)


def test_a_bucket_of_requests_runs_empty_and_fills_again(server: RunningServer, admin: Any) -> None:
    key = made(admin, tenant="hasty", quotas={"requests_per_s": 2.0, "burst": 5})
    client = server.client(key["key"])
    answers = [client.get("/v1/whoami") for _ in range(8)]
    assert [answer.status_code for answer in answers[:5]] == [200] * 5
    assert 429 in [answer.status_code for answer in answers[5:]]
    assert answers[0].headers["ratelimit"].startswith('"requests";r=4;t=')
    assert answers[0].headers["ratelimit-policy"] == '"requests";q=5;w=3'
    refused = next(answer for answer in answers if answer.status_code == 429)
    assert slug(refused) == (429, "too-many-requests")
    assert refused.json()["retryable"] is True
    assert refused.headers["retry-after"] == "1"
    assert ";r=0;" in refused.headers["ratelimit"]
    time.sleep(int(refused.headers["retry-after"]))
    assert client.get("/v1/whoami").status_code == 200
    assert admin.get("/v1/whoami").status_code == 200


def test_queued_jobs_have_a_quota(server: RunningServer, admin: Any) -> None:
    client = server.client(made(admin, tenant="queuer", quotas={"queued_jobs": 2})["key"])
    scene = client.post("/v1/scenes", content=LAYER + b"#").json()["id"]
    jobs = [client.post("/v1/jobs", json={"scene": {"id": scene}}) for _ in range(3)]
    assert [job.status_code for job in jobs] == [202, 202, 429]
    problem = jobs[2].json()
    assert (problem["type"], problem["quota"], problem["limit"], problem["used"]) == (
        "/problems/quota-exceeded",
        "queued_jobs",
        2,
        2,
    )
    assert int(jobs[2].headers["retry-after"]) > 0
    assert client.get("/v1/usage").json()["queued_jobs"] == {"used": 2, "limit": 2}
    assert client.post(f"/v1/jobs/{jobs[0].json()['id']}/cancel").status_code == 202
    assert client.post("/v1/jobs", json={"scene": {"id": scene}}).status_code == 202


def test_another_tenants_ids_are_as_if_they_did_not_exist(server: RunningServer, admin: Any) -> None:
    mine, theirs = (server.client(made(admin, tenant=tenant)["key"]) for tenant in ("mine", "theirs"))
    scene = mine.post("/v1/scenes", content=LAYER + b"##").json()["id"]
    job = mine.post("/v1/jobs", json={"scene": {"id": scene}}).json()["id"]
    nothing = "job_" + "0" * 26
    for rest in ("", "/outputs", "/outputs/beauty.exr", "/log", "/preview", "/events", "/frames", "/convergence"):
        refused, missing = theirs.get(f"/v1/jobs/{job}{rest}"), theirs.get(f"/v1/jobs/{nothing}{rest}")
        assert refused.status_code == missing.status_code == 404
        texts = [{k: v for k, v in answer.json().items() if k != "request_id"} for answer in (refused, missing)]
        assert texts[0] == texts[1]
    for verb, rest in (("post", "/cancel"), ("post", "/continue"), ("delete", ""), ("patch", "")):
        body: dict[str, Any] = {"json": {}} if verb in ("post", "patch") and rest != "/cancel" else {}
        assert getattr(theirs, verb)(f"/v1/jobs/{job}{rest}", **body).status_code == 404
    assert slug(theirs.post("/v1/jobs", json={"scene": {"id": scene}})) == (404, "not-found")
    assert mine.get(f"/v1/jobs/{job}").json()["state"] == "queued"


def test_quotas_of_a_key_are_the_servers_where_it_names_none(start_server: Any) -> None:
    server = start_server(require_keys=True, dispatch=False, warm=False, quotas={"queued_jobs": 7, "requests_per_s": None})
    admin = server.client(make_key(database(server), "operator", "admin", quotas=Quotas(requests_per_s=None)))
    key = made(admin, quotas={"stored_bytes": 1000, "running_jobs": None})
    assert key["quotas"]["queued_jobs"] == 7
    assert key["quotas"]["stored_bytes"] == 1000
    assert "ratelimit" not in server.client(key["key"]).get("/v1/whoami").headers
