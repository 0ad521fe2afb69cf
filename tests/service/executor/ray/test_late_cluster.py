"""A server that starts while its Ray cluster is away, gets the cluster, loses it and gets it again: no job is lost."""

from __future__ import annotations

import socket
from pathlib import Path

import httpx2
import pytest
from tests.service.api_calls import QUICK, SCENE, finished, wait_until
from tests.service.executor.ray.cluster import RunningCluster
from tests.service.serving import RunningServer, start

WAIT_S = 180.0  # on a machine that others use too


def executor_of(client: httpx2.Client) -> tuple[int, dict[str, object]]:
    """The status of /readyz and what it says of the executor."""
    answer = client.get("/readyz")
    return answer.status_code, answer.json()["checks"]["executor"]


def is_ready(client: httpx2.Client) -> bool:
    return executor_of(client)[0] == 200


def submitted(client: httpx2.Client) -> str:
    """A job with its scene, neither of which waits for the cluster to be taken."""
    scene = client.post("/v1/scenes", content=SCENE).json()["id"]
    answer = client.post("/v1/jobs", json={"scene": {"id": scene}, "settings": QUICK})
    assert answer.status_code == 202, answer.text
    assert answer.json()["state"] == "queued"
    return str(answer.json()["id"])


def says_that_jobs_wait(client: httpx2.Client, job: str) -> None:
    status, executor = executor_of(client)
    assert status == 503
    assert executor["ok"] is False
    assert "jobs stay queued" in str(executor["detail"])
    assert "127.0.0.1" not in str(executor)
    assert client.get("/healthz").status_code == 200
    assert client.get(f"/v1/jobs/{job}").json()["state"] == "queued"
    assert "primray_executor_slots 0" in client.get("/metrics").text


def test_a_server_waits_for_its_cluster_and_outlives_it(cluster: RunningCluster, tmp_path: Path) -> None:
    cluster.ask(do="kill-head")
    server = start(tmp_path / "data", executor="ray", ray_address=cluster.address, limits={"memory_bytes": 2**30})
    try:
        _wait_and_outlive(server, cluster)
        assert server.failures() == []
    finally:
        server.stop()


def _wait_and_outlive(server: RunningServer, cluster: RunningCluster) -> None:
    client = server.client()
    assert "the server starts, and jobs stay queued until the cluster is available" in server.log.read_text()
    early = submitted(client)
    says_that_jobs_wait(client, early)

    cluster.ask(do="restart")
    assert finished(client, early, WAIT_S)["state"] == "succeeded"
    assert is_ready(client)

    cluster.ask(do="kill-head")
    wait_until(lambda: not is_ready(client), WAIT_S)
    between = submitted(client)
    says_that_jobs_wait(client, between)

    cluster.ask(do="restart")
    assert finished(client, between, WAIT_S)["state"] == "succeeded"
    assert "is gone" in server.log.read_text()


def test_what_does_not_heal_is_said_at_once(tmp_path: Path) -> None:
    """An address that is none: waiting would not help."""
    pytest.importorskip("ray", reason="skipped: no ray")
    with pytest.raises(AssertionError, match="HOST:PORT"):
        start(tmp_path / "data", executor="ray", ray_address="ray://head:10001")


def test_the_command_without_a_server_does_not_wait(tmp_path: Path) -> None:
    """`primray render --ray` has somebody before it who waits."""
    pytest.importorskip("ray", reason="skipped: no ray")
    import primray
    from primray.errors import PrimrayError
    from primray_service.farm.ray_parts import RayParts

    with socket.create_server(("127.0.0.1", 0)) as free:
        address = f"127.0.0.1:{free.getsockname()[1]}"
    stage = tmp_path / "shot.usda"
    stage.write_bytes(SCENE)
    with pytest.raises(PrimrayError, match="no Ray cluster at"), RayParts(address) as parts:
        primray.render(str(stage), resolution=(64, 48), spp=4096, executor=parts)
