"""Who is let in, from where, and what every answer carries."""

from __future__ import annotations

import re
import time

import httpx2
import pytest
from tests.service.api_calls import Json, problem, stored, submit
from tests.service.conftest import StartServer, make_key
from tests.service.serving import RunningServer

from primray_service.problems import KINDS


@pytest.fixture(scope="module")
def locked(start_server: StartServer) -> RunningServer:
    """A server that needs keys."""
    return start_server(dispatch=False, warm=False, require_keys=True, allowed_hosts=["render.example"])


@pytest.fixture(scope="module")
def keys(locked: RunningServer) -> dict[str, str]:
    url = f"sqlite:///{locked.data / 'primray.sqlite'}"
    return {
        "both": make_key(url, "a", "submit", "read"),
        "read": make_key(url, "a", "read"),
        "submit": make_key(url, "a", "submit"),
        "admin": make_key(url, "a", "admin"),
        "other": make_key(url, "b", "submit", "read"),
    }


@pytest.fixture(scope="module")
def open_to_all(start_server: StartServer) -> RunningServer:
    return start_server(dispatch=False, warm=False)


def test_keys_are_needed_and_checked(locked, keys):
    refused = locked.client().get("/v1/jobs")
    problem(refused, 401, "unauthenticated")
    assert refused.headers["www-authenticate"].startswith("Bearer")
    for sent in ("Bearer wrong", "Bearer", "Basic YTpi", keys["both"]):
        problem(locked.client().get("/v1/jobs", headers={"authorization": sent}), 401, "unauthenticated")
    assert locked.client(keys["both"]).get("/v1/jobs").status_code == 200
    problem(locked.client().get(f"/v1/jobs?key={keys['both']}"), 401, "unauthenticated")


def test_scopes(locked, keys):
    scene = stored(locked.client(keys["both"]))
    job = submit(locked.client(keys["both"]), scene)
    here = f"/v1/jobs/{job['id']}"
    document = problem(locked.client(keys["read"]).post(f"{here}/cancel"), 403, "forbidden")
    assert document["scope"] == "submit"
    problem(locked.client(keys["submit"]).get(here), 403, "forbidden")
    assert locked.client(keys["read"]).get(here).status_code == 200
    assert locked.client(keys["admin"]).post(f"{here}/cancel").status_code == 202


def test_another_tenants_things_do_not_exist(locked, keys):
    scene = stored(locked.client(keys["both"]))
    here = f"/v1/jobs/{submit(locked.client(keys['both']), scene)['id']}"
    stranger = locked.client(keys["other"])
    missing = problem(stranger.get("/v1/jobs/job_00000000000000000000000000"), 404, "not-found")
    for method, path in (
        ("GET", here),
        ("PATCH", here),
        ("DELETE", here),
        ("POST", f"{here}/cancel"),
        ("POST", f"{here}/continue"),
        ("GET", f"{here}/events"),
        ("GET", f"{here}/frames"),
        ("GET", f"{here}/frames/0"),
        ("GET", f"{here}/convergence"),
    ):
        body: Json | None = {} if method in ("POST", "PATCH") else None
        document = problem(stranger.request(method, path, json=body), 404, "not-found")
        assert {**document, "request_id": ""} == {**missing, "request_id": ""}, path
    problem(stranger.post("/v1/jobs", json={"scene": {"id": scene}}), 404, "not-found")
    assert stranger.get("/v1/jobs").json()["items"] == []
    assert locked.client(keys["both"]).get(here).status_code == 200


def test_a_session_stands_for_its_key(locked, keys):
    browser = locked.client()
    problem(browser.post("/v1/session", json={"key": "wrong"}), 401, "unauthenticated")
    begun = browser.post("/v1/session", json={"key": keys["both"]})
    assert (begun.status_code, begun.json()["tenant"]) == (201, "a")
    cookie = begun.headers["set-cookie"].lower()
    assert all(word in cookie for word in ("httponly", "samesite=strict", "path=/"))
    assert keys["both"] not in begun.headers["set-cookie"]
    assert browser.get("/v1/jobs").status_code == 200
    kept = browser.cookies["primray_session"]
    forged = kept[:-1] + ("0" if kept[-1] != "0" else "1")
    for value in (forged, kept.replace(".", ".x", 1), "x", "a.b.c.d"):
        problem(locked.client().get("/v1/jobs", headers={"cookie": f"primray_session={value}"}), 401, "unauthenticated")
    assert browser.delete("/v1/session").status_code == 204
    problem(locked.client().get("/v1/jobs", headers={"cookie": f"primray_session={kept}"}), 401, "unauthenticated")


def test_no_key_is_needed_on_loopback_but_one_that_is_sent_counts(open_to_all):
    assert open_to_all.client().get("/v1/jobs").status_code == 200
    problem(open_to_all.client("wrong").get("/v1/jobs"), 401, "unauthenticated")


@pytest.mark.parametrize("host", ["evil.example", "localhost.evil.example", "", "render.example"])
def test_other_hosts_are_refused(open_to_all, host):
    answer = open_to_all.client().get("/v1/jobs", headers={"host": host})
    assert "--allow-host " in problem(answer, 421, "host-not-allowed")["detail"], "as `primray serve --help` calls it"


@pytest.mark.parametrize("host", ["localhost:1", "LOCALHOST.", "127.0.0.1", "[::1]:80", "10.1.2.3:8700"])
def test_own_hosts_are_served(open_to_all, host):
    assert open_to_all.client().get("/v1/jobs", headers={"host": host}).status_code == 200


def test_hosts_that_were_allowed_are_served(locked, keys):
    assert locked.client(keys["read"]).get("/v1/jobs", headers={"host": "render.example"}).status_code == 200


def test_changes_from_other_sites_are_refused(open_to_all):
    client = open_to_all.client()
    own = open_to_all.url
    for headers in (
        {"origin": "https://evil.example"},
        {"origin": "null"},
        {"origin": own.replace("127.0.0.1", "localhost")},
        {"origin": f"{own}0"},
        {"sec-fetch-site": "cross-site"},
        {"sec-fetch-site": "same-site"},
    ):
        problem(client.post("/v1/jobs", json={}, headers=headers), 403, "cross-origin")
    for headers in ({"origin": own}, {"sec-fetch-site": "same-origin"}, {"sec-fetch-site": "none"}):
        problem(client.post("/v1/jobs", json={}, headers=headers), 422, "invalid-request")
    https = {"origin": "https://localhost", "host": "localhost:443"}
    problem(client.post("/v1/jobs", json={}, headers=https), 422, "invalid-request")
    assert client.get("/v1/jobs", headers={"origin": "https://evil.example"}).status_code == 200


def test_every_answer_has_an_id_and_the_headers_of_safety(open_to_all):
    client = open_to_all.client()
    for method, path in (("GET", "/v1/jobs"), ("GET", "/nothing"), ("GET", "/docs"), ("POST", "/v1/jobs"), ("TRACE", "/")):
        answer = client.request(method, path)
        assert re.fullmatch(r"[0-9A-Z]{26}", answer.headers["x-request-id"]), path
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["referrer-policy"] == "no-referrer"
        assert "frame-ancestors 'none'" in answer.headers["content-security-policy"]
        assert "server" not in answer.headers
        assert "access-control-allow-origin" not in answer.headers
    assert client.get("/v1/jobs", headers={"x-request-id": "mine-1"}).headers["x-request-id"] == "mine-1"
    assert client.get("/v1/jobs", headers={"x-request-id": "not mine"}).headers["x-request-id"] != "not mine"
    assert '"request_id": "mine-1"' in open_to_all.log.read_text()


def test_errors_of_the_router_are_problems(open_to_all):
    client = open_to_all.client()
    problem(client.get("/v2/jobs"), 404, "not-found")
    problem(client.get("/v1/jobs/"), 404, "not-found")
    problem(client.get("/v1/jobs/%00"), 404, "not-found")
    refused = client.put("/v1/jobs/job_x", json={})
    problem(refused, 405, "method-not-allowed")
    assert refused.headers["allow"] == "DELETE, GET, HEAD, PATCH"


def test_head_is_get_without_its_body(open_to_all):
    client = open_to_all.client()
    job = submit(client, stored(client))
    here = f"/v1/jobs/{job['id']}"
    volatile = ("date", "x-request-id")
    for path in ("/v1/jobs", here, f"{here}/events", f"{here}/frames", f"{here}/convergence", "/openapi.json", "/docs"):
        got, head = client.get(path), client.head(path)
        assert head.content == b""
        assert (head.status_code, [pair for pair in head.headers.items() if pair[0] not in volatile]) == (
            got.status_code,
            [pair for pair in got.headers.items() if pair[0] not in volatile],
        ), path
    began = time.perf_counter()
    stream = client.head(f"{here}/events", headers={"accept": "text/event-stream"})
    assert stream.headers["content-type"].startswith("text/event-stream")
    assert time.perf_counter() - began < 30  # the stream itself goes on until its job ends


def test_what_goes_wrong_inside_is_told_without_its_inside(start_server):
    server = start_server(dispatch=False, warm=False)
    client = server.client()
    client.get("/v1/jobs")
    with httpx2.Client(base_url=server.url, trust_env=False) as other:
        for path in server.data.glob("primray.sqlite*"):
            path.write_bytes(b"not a database " * 1000)
        answer = other.get("/v1/jobs/job_00000000000000000000000000", timeout=120)
    assert answer.status_code in (500, 503)
    document = problem(answer, answer.status_code, "internal" if answer.status_code == 500 else "unavailable")
    assert "sqlite" not in answer.text.lower()
    assert document["retryable"]
    assert bool(server.failures()) == (answer.status_code == 500)


def test_the_documents(open_to_all):
    client = open_to_all.client()
    document = client.get("/openapi.json")
    assert document.json()["openapi"].startswith("3.1")
    assert client.get("/openapi.json", headers={"if-none-match": document.headers["etag"]}).status_code == 304
    for slug in KINDS:
        page = client.get(f"/problems/{slug}")
        assert (page.status_code, page.headers["content-type"]) == (200, "text/html; charset=utf-8")
        assert f"Status {KINDS[slug].status}." in page.text
    problem(client.get("/problems/none"), 404, "not-found")
    docs = client.get("/docs")
    assert "script-src 'self';" in docs.headers["content-security-policy"]
    assert "script" not in client.get("/problems").headers["content-security-policy"]
    assert re.findall("<script[^>]*>", docs.text) == ['<script src="/page/docs/try_it.js" type="module">']
    assert set(re.findall(r"(?:src|href)='?\"?(https?:[^'\" >]*)", docs.text)) == set()
    loaded = re.findall('(?:src|href)="(/page/[^"]+)"', docs.text)
    assert len(loaded) == 5
    assert [path for path in loaded if client.get(path).status_code != 200] == []
    assert all(path in docs.text for path in document.json()["paths"])
