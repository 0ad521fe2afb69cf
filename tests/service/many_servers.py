"""Several servers over one database and one data directory: which dispatches, what they say, killing it."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx2
from tests.service.api_calls import wait_until
from tests.service.serving import RunningServer


@dataclass
class Many:
    """`start` makes one more over the same database and data."""

    start: Callable[[], RunningServer]
    servers: list[RunningServer] = field(default_factory=list)
    clients: dict[str, httpx2.Client] = field(default_factory=dict)

    def more(self, number: int = 1) -> None:
        for _ in range(number):
            server = self.start()
            self.servers.append(server)
            self.clients[server.url] = server.client()

    @property
    def data(self) -> Path:
        return self.servers[0].data

    def all(self) -> list[httpx2.Client]:
        return [self.clients[server.url] for server in self.servers]

    def leaders(self) -> list[RunningServer]:
        return [server for server in self.servers if metric(self.clients[server.url], "primray_dispatcher_leader") == 1]

    def leader(self, timeout_s: float = 60.0) -> RunningServer:
        """The one that dispatches, once there is one."""
        found: RunningServer = wait_until(lambda: self.leaders(), timeout_s)[0]
        return found

    def dispatches(self) -> httpx2.Client:
        return self.clients[self.leader().url]

    def only_answers(self) -> list[httpx2.Client]:
        """Those that do not dispatch."""
        leader = self.leader()
        return [self.clients[server.url] for server in self.servers if server is not leader]

    def kill_leader(self) -> tuple[float, list[httpx2.Client]]:
        """As a machine that loses its power; when, and who is left."""
        leader = self.leader()
        leader.process.kill()
        at = time.monotonic()
        leader.process.wait()
        self.servers.remove(leader)
        return at, self.all()


def metric(client: httpx2.Client, name: str) -> float:
    found = re.search(rf"^{name} (\S+)$", client.get("/metrics").text, re.MULTILINE)
    assert found is not None, name
    return float(found[1])


def events(client: httpx2.Client, job_id: str) -> list[dict[str, Any]]:
    items: list[dict[str, Any]] = client.get(f"/v1/jobs/{job_id}/events").json()["items"]
    return items
