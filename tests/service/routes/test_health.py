"""Health, readiness, metrics, capabilities and the log of a server, over HTTP."""

from __future__ import annotations

import json
import re
import time
from typing import Any

import pytest
from prometheus_client.parser import text_string_to_metric_families
from tests.service.api_calls import wait_until
from tests.service.scenes.zips import LAYER
from tests.service.serving import RunningServer


@pytest.fixture(scope="module")
def server(start_server: Any) -> RunningServer:
    return start_server()


@pytest.fixture(scope="module")
def client(server: RunningServer) -> Any:
    return server.client()


def test_a_server_in_order_is_alive_and_ready(client: Any) -> None:
    assert client.get("/healthz").json() == {"status": "ok"}
    response = client.get("/readyz")
    assert response.status_code == 200, response.text
    found = response.json()
    assert found["status"] == "ready"
    assert set(found["checks"]) == {"database", "disk", "executor", "sandbox", "dispatcher"}
    assert all(check["ok"] for check in found["checks"].values())
    sandbox = found["checks"]["sandbox"]
    walls = {name for name, state in sandbox["layers"].items() if state.startswith("on")}  # Landlock adds its ABI
    assert walls & {"landlock", "bubblewrap"}
    assert sandbox["attempts"]
    assert all(result != "allowed" for result in sandbox["attempts"].values())


def test_a_full_disk_is_not_ready(start_server: Any) -> None:
    server = start_server(limits={"free_disk_bytes": 2**60}, dispatch=False, warm=False)
    response = server.client().get("/readyz")
    assert response.status_code == 503
    checks = response.json()["checks"]
    assert {name for name, check in checks.items() if not check["ok"]} == {"disk"}
    assert response.json()["status"] == "not ready"


def test_a_lost_database_is_not_ready_and_its_address_is_not_told(tmp_path: Any, start_server: Any) -> None:
    server = start_server(dispatch=False, warm=False)
    client = server.client()
    assert client.get("/readyz").status_code == 200
    for file in server.data.glob("primray.sqlite*"):
        file.write_bytes(b"this is no database any more" * 100)
    response = client.get("/readyz")
    assert response.status_code == 503
    assert not response.json()["checks"]["database"]["ok"]
    assert str(server.data) not in response.text
    assert client.get("/healthz").status_code == 200


def samples(client: Any) -> dict[str, float]:
    response = client.get("/metrics")
    assert response.headers["content-type"].startswith("text/plain; version=0.0.4")
    found = {}
    for family in text_string_to_metric_families(response.text):
        assert family.documentation, family.name
        for sample in family.samples:
            labels = ",".join(f"{name}={value}" for name, value in sorted(sample.labels.items()))
            key = f"{sample.name}{{{labels}}}"
            assert key not in found, key
            found[key] = sample.value
    return found


def test_metrics_can_be_parsed_and_count_what_happened(client: Any) -> None:
    before = samples(client)
    scene = client.post("/v1/scenes", content=LAYER + b"# metrics").json()["id"]
    for _ in range(3):
        client.get(f"/v1/scenes/{scene}")
    client.get("/v1/jobs/job_nothing")
    client.get("/nothing/at/all")
    after = samples(client)

    def grew(name: str) -> float:
        return after.get(name, 0) - before.get(name, 0)

    count = "primray_http_request_seconds_count"
    assert grew(f"{count}{{method=GET,route=/v1/scenes/{{scene_id}},status=200}}") == 3
    assert grew(f"{count}{{method=POST,route=/v1/scenes,status=201}}") == 1
    assert grew(f"{count}{{method=GET,route=/v1/jobs/{{job_id}},status=404}}") == 1
    assert grew("primray_uploaded_bytes_total{}") >= len(LAYER)
    assert not any("job_nothing" in name or "/nothing" in name for name in after)
    assert after["primray_jobs{state=queued}"] == 0
    assert {f"primray_jobs{{state={state}}}" for state in ("queued", "running", "failed", "expired")} <= set(after)
    for name in ("primray_queue_wait_seconds_count{}", "primray_checkpoint_seconds_sum{}", "primray_disk_free_bytes{}"):
        assert name in after
    assert "primray_dispatcher_leader{}" in after


def test_methods_that_nobody_knows_make_no_new_series(client: Any) -> None:
    for method in ("FOO", "BAR"):
        assert client.request(method, "/v1/jobs").status_code == 405
    text = client.get("/metrics").text
    assert 'method="other"' in text
    assert not {"FOO", "BAR"} & set(re.findall(r'method="(\w+)"', text))


def test_event_streams_are_seen_while_they_are_open(server: RunningServer) -> None:
    client = server.client()
    scene = client.post("/v1/scenes", content=LAYER + b"# stream").json()["id"]
    job = client.post("/v1/jobs", json={"scene": {"id": scene}, "settings": {"stop": {"max_seconds": 20}}}).json()["id"]
    name = "primray_http_requests_in_progress{method=GET,route=/v1/jobs/{job_id}/events}"
    with client.stream("GET", f"/v1/jobs/{job}/events", headers={"accept": "text/event-stream"}) as stream:
        assert stream.status_code == 200
        if client.get(f"/v1/jobs/{job}").json()["state"] in ("queued", "preparing", "running"):
            assert samples(server.client())[name] == 1
        client_2 = server.client()
        client_2.post(f"/v1/jobs/{job}/cancel")
    until = time.monotonic() + 5
    while samples(server.client()).get(name, 0) and time.monotonic() < until:
        time.sleep(0.05)
    assert samples(server.client()).get(name, 0) == 0


def test_capabilities_say_what_may_be_sent_and_asked(client: Any) -> None:
    found = client.get("/v1/capabilities").json()
    aovs = {aov["name"]: aov["meaning"] for aov in found["aovs"]}
    assert aovs["depth"] == "distance along the camera's axis; infinite where nothing is"
    assert {"prim", "crypto_object"} < set(aovs)
    assert {one["kind"] for one in found["inputs"]} == {"usda", "usdc", "usdz", "zip"}
    assert found["previews"]["views"] == ["beauty", "error", "relative-error"]
    assert found["limits"]["upload_bytes"] == 2 * 2**30
    assert found["executor"]["slots"] >= 1
    assert re.fullmatch(r"\d+\.\d+.*", found["version"])


def test_usage_is_beside_its_limits(client: Any) -> None:
    client.post("/v1/scenes", content=LAYER + b"# usage").raise_for_status()
    found = client.get("/v1/usage").json()
    assert set(found["queued_jobs"]) == {"used", "limit"}
    assert found["stored_bytes"]["used"] > 0


def test_the_log_is_json_with_ids_and_without_secrets(server: RunningServer) -> None:
    client = server.client()
    key = "primray_" + "s3cr3tS3CR3T" * 4
    client.get("/v1/jobs/job_unknown", headers={"x-request-id": "my-request.1", "authorization": "Bearer " + key})
    client.get("/v1/jobs", params={"label": f"key={key}"}, headers={"x-request-id": "my-request.2"})
    # A line is written when its answer has been sent.
    second = wait_until(lambda: _requests(server).get("my-request.2"))
    assert (second["method"], second["path"], second["status"]) == ("GET", "/v1/jobs", 200)
    assert second["tenant"] == "local"
    assert second["seconds"] >= 0
    assert second["timestamp"].endswith("Z")
    assert key not in server.log.read_text()
    assert "s3cr3t" not in server.log.read_text()


def _requests(server: RunningServer) -> dict[str, Any]:
    """What the log says of requests, by their ids; its last line may be only half written."""
    written, _, _ = server.log.read_text().rpartition("\n")
    lines = [json.loads(line) for line in written.splitlines() if line.startswith("{")]
    return {line.get("request_id"): line for line in lines if line.get("event") == "request"}
