"""What a scene that has taken over its worker on a node can reach of Ray, of other jobs, and of the server: nothing.

A node of its own runs a hostile program in place of ours, as a chunk's worker, behind the walls that any has there. What it
tries is really there: this process, which has no walls, reaches all of it.
"""

from __future__ import annotations

import asyncio
import os
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.service.executor.ray import reaching
from tests.service.executor.ray.cluster import RunningCluster
from tests.service.postgres import Server, postgres_server

from primray_service.executor.base import Chunk, Ended
from primray_service.executor.ray.executor import RayExecutor
from primray_service.files import DataDirectory
from primray_service.limits import GiB, Limits

__all__ = ["postgres_server"]

NUMBER, POOL = 3, "hostile"
PROGRAM = (
    "import json, sys\nfrom primray_service.sandbox import enter\nenter()\n"
    "say = lambda **message: print(json.dumps(message), flush=True)\nsay(at='ready')\n"
    "command = json.loads(sys.stdin.readline())\n"
    + Path(reaching.__file__).read_text()
    + "\nsay(at='done', outputs=[], report={**tried(command['targets']), **held()})\n"
)
# What Python runs first in each process of the node.
INSTEAD = f"""
import primray_service.executor.local as local
from primray_service.executor.local_worker import SandboxLayers
defaults = local.LocalExecutor.__init__.__kwdefaults__
assert "sandbox_layers" in defaults
defaults["sandbox_layers"] = SandboxLayers(None, ("-c", {PROGRAM!r}))
"""


@pytest.fixture
def node(cluster: RunningCluster, tmp_path: Path) -> Iterator[Path]:
    """What it keeps scenes in."""
    (tmp_path / "sitecustomize.py").write_text(INSTEAD)
    path = os.pathsep.join([str(tmp_path), cluster.environment["PYTHONPATH"]])
    cluster.ask(do="add", number=NUMBER, labels={"pool": POOL}, environment={"PYTHONPATH": path})
    yield cluster.folder / f"node-{NUMBER}"
    cluster.ask(do="remove", number=NUMBER)


def targets_of(cluster: RunningCluster, node: Path, database: Server, server: socket.socket) -> dict[str, list[Any]]:
    """Ray's ports, sockets, objects, processes and token; another job's scene on the node; the database; the server."""
    pids = cluster.ray_processes()
    other = node / "cache" / "another-jobs-scene"
    other.parent.mkdir(parents=True, exist_ok=True)
    other.write_text("#usda 1.0")
    assert database.folder is not None
    return {
        "port": [*reaching.listening(pids), server.getsockname()[1]],
        "socket": [
            *map(str, cluster.folder.glob("ray/session_latest/sockets/*")),
            *map(str, database.folder.glob(".s.PGSQL.*[0-9]")),
        ],
        "file": [str(other), *map(str, sorted(cluster.folder.rglob("logs/raylet.out"))[:1])],
        "environment": pids,
        "memory": pids,
        "signal": pids,
        "folder": [str(cluster.folder), str(node), "/dev/shm"],
    }


async def asked_on_the_node(root: Path, cluster: RunningCluster, targets: dict[str, list[Any]]) -> dict[str, str]:
    executor = RayExecutor(DataDirectory(root), Limits(memory_bytes=GiB), address=cluster.address, labels={"pool": POOL})
    await executor.start()
    try:
        heard: list[dict[str, Any]] = []
        chunk = Chunk("hostile", "render", {"do": "render", "targets": targets})
        handle = executor.submit(chunk, lambda message: heard.append(dict(message)))
        ended: Ended = await asyncio.wait_for(handle.result(), 120)
        handle.release()
    finally:
        await executor.close()
    reports = [message["report"] for message in heard if message["at"] == "done"]
    assert len(reports) == 1, (ended, heard)
    found: dict[str, str] = reports[0]
    return found


def test_a_worker_on_a_node_reaches_nothing(
    cluster: RunningCluster, node: Path, tmp_path: Path, postgres_server: Server
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        targets = targets_of(cluster, node, postgres_server, server)
        here = reaching.tried(targets)
        assert {name: result for name, result in here.items() if result != "allowed"} == {}
        there = asyncio.run(asked_on_the_node(tmp_path / "data", cluster, targets))
    assert set(there) == set(here) | {"variables of Ray", "open files"}
    assert {name: result for name, result in there.items() if not result.startswith("refused")} == {}
    assert len(targets["environment"]) > 4
    assert len(targets["port"]) > 4
    assert len(targets["socket"]) > 2
