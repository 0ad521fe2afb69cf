"""Pages of other origins: nothing without an allow-list, and with one what a browser needs, for the origins on it alone."""

from __future__ import annotations

import re
from pathlib import Path

import httpx2
import pytest
from tests.service.api_calls import problem
from tests.service.conftest import StartServer, make_key
from tests.service.serving import RunningServer

from primray.errors import SettingsError
from primray_service.config import ServeConfig
from primray_service.http.guard import READ, SENT

PORTAL, STRANGER = "https://portal.example", "https://portal.example.evil.example"
PREFLIGHT = {"access-control-request-method": "POST", "access-control-request-headers": "authorization, content-type, prefer"}
SERVICE = Path(__file__).parents[3] / "service/primray_service"


@pytest.fixture(scope="module")
def open_to_portal(start_server: StartServer) -> RunningServer:
    return start_server(dispatch=False, warm=False, require_keys=True, allowed_origins=[PORTAL, "http://localhost:3000"])


def preflight(client: httpx2.Client, origin: str, **headers: str) -> httpx2.Response:
    return client.request("OPTIONS", "/v1/jobs", headers={"origin": origin, **PREFLIGHT, **headers})


def test_a_browser_is_told_what_a_listed_page_may_send_without_a_key(open_to_portal: RunningServer) -> None:
    answer = preflight(open_to_portal.client(), PORTAL)
    assert answer.status_code == 200
    assert answer.headers["access-control-allow-origin"] == PORTAL
    allowed = answer.headers["access-control-allow-headers"].lower()
    assert all(name in allowed for name in ("authorization", "content-type", "prefer", "idempotency-key", "if-none-match"))
    methods = answer.headers["access-control-allow-methods"]
    assert all(name in methods for name in ("POST", "PATCH", "DELETE"))
    assert "origin" in answer.headers["vary"].lower()
    assert "access-control-allow-credentials" not in answer.headers
    assert answer.headers["x-content-type-options"] == "nosniff"


def test_others_are_refused(open_to_portal: RunningServer) -> None:
    client = open_to_portal.client()
    for origin in (STRANGER, "http://portal.example", "null"):
        assert "access-control-allow-origin" not in preflight(client, origin).headers
        assert "access-control-allow-origin" not in client.get("/v1/jobs", headers={"origin": origin}).headers
        problem(client.post("/v1/jobs", headers={"origin": origin}, json={}), 403, "cross-origin")
    assert preflight(client, PORTAL, **{"access-control-request-headers": "x-strange"}).status_code == 400


def test_a_listed_page_reads_answers_and_refusals_and_changes_what_its_key_may(open_to_portal: RunningServer) -> None:
    key = make_key(f"sqlite:///{open_to_portal.data / 'primray.sqlite'}", "a", "read", "submit")
    refused = open_to_portal.client().get("/v1/jobs", headers={"origin": PORTAL})
    problem(refused, 401, "unauthenticated")
    assert refused.headers["access-control-allow-origin"] == PORTAL
    client = open_to_portal.client(key)
    answer = client.get("/v1/jobs", headers={"origin": PORTAL})
    assert answer.status_code == 200
    assert answer.headers["access-control-allow-origin"] == PORTAL
    assert {"etag", "location", "retry-after"} <= set(answer.headers["access-control-expose-headers"].lower().split(", "))
    sent = client.post("/v1/jobs", headers={"origin": PORTAL, "sec-fetch-site": "cross-site"}, json={})
    problem(sent, 422, "invalid-request")  # it is read, and no other site's


def test_without_a_list_there_is_no_cors(server: RunningServer) -> None:
    client = server.client()
    assert preflight(client, PORTAL).status_code == 405
    answer = client.get("/v1/jobs", headers={"origin": PORTAL})
    assert answer.status_code == 200
    assert not [name for name in answer.headers if name.startswith("access-control-")]


@pytest.mark.parametrize(
    "origin", ["*", "portal.example", "https://portal.example/", "https://Portal.example", "null", "file://"]
)
def test_an_origin_that_is_none(origin: str) -> None:
    with pytest.raises(SettingsError, match="is not an origin") as raised:
        ServeConfig(Path("data"), allowed_origins=(origin,))
    assert raised.value.code == "allow-origin"


def test_every_header_that_the_service_reads_or_documents_is_listed() -> None:
    sources = "".join(path.read_text() for path in SERVICE.rglob("*.py") if path.name != "cors.py")
    documented = {
        name.lower() for found in re.findall(r"headers=\(([^)]*)\)", sources) for name in re.findall(r'"([A-Z][\w-]+)"', found)
    }
    assert documented - set(SENT) - set(READ) <= {"set-cookie"}
    read = set(re.findall(r'headers\.get(?:list)?\("([a-z-]+)"', sources))
    of_browsers = {"accept", "accept-encoding", "content-length", "content-encoding", "transfer-encoding", "host", "origin"}
    assert read - set(SENT) - set(READ) - of_browsers - {"sec-fetch-site", "sec-fetch-mode"} == set()
