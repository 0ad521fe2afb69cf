"""An address that needs a key, opened by a person in a browser: a page in words; for programs the problem document."""

from __future__ import annotations

import pytest
from tests.service.api_calls import problem
from tests.service.conftest import StartServer, make_key
from tests.service.serving import RunningServer

OPENED = {"accept": "text/html,application/xhtml+xml,*/*;q=0.8", "sec-fetch-mode": "navigate"}


@pytest.fixture(scope="module")
def locked(start_server: StartServer) -> RunningServer:
    return start_server(dispatch=False, warm=False, require_keys=True)


@pytest.mark.parametrize("path", ["/v1/jobs", "/v1/jobs/job_0/outputs/beauty.png", "/metrics"])
def test_a_person_is_told_what_to_do(locked: RunningServer, path: str) -> None:
    answer = locked.client().get(path, headers=OPENED)
    assert answer.status_code == 401
    assert answer.headers["content-type"].startswith("text/html")
    assert "Log in with the API key" in answer.text
    assert "script-src" not in answer.headers["content-security-policy"]
    assert "default-src 'self'" in answer.headers["content-security-policy"]
    assert answer.headers["cache-control"] == "no-store"
    assert locked.client().get("/page/login.js").status_code == 200


def test_programs_get_the_problem(locked: RunningServer) -> None:
    client = locked.client()
    for headers in ({}, {"accept": "application/json"}, {**OPENED, "sec-fetch-mode": "cors"}, {"accept": "*/*"}):
        problem(client.get("/v1/jobs", headers=headers), 401, "unauthenticated")
    problem(client.post("/v1/jobs", headers=OPENED, json={}), 401, "unauthenticated")


def test_with_a_key_the_address_is_what_it_was(locked: RunningServer) -> None:
    key = make_key(f"sqlite:///{locked.data / 'primray.sqlite'}", "a", "read")
    answer = locked.client(key).get("/v1/jobs", headers=OPENED)
    assert answer.status_code == 200
    assert answer.headers["content-type"] == "application/json"
