"""Servers for tests. `server` is shared by a file's tests, on SQLite and without keys; `start_server` makes any other."""

from __future__ import annotations

import contextlib
import hashlib
import os
import secrets
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from tests.service.serving import RunningServer, start

from primray_service.limits import Quotas
from primray_service.store import open_store
from primray_service.store.base import ApiKey

StartServer = Callable[..., RunningServer]


@pytest.fixture(scope="module")
def start_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[StartServer]:
    """A function that starts a server with ServeConfig's members as arguments, and a data directory of its own."""
    servers: list[RunningServer] = []

    def make(data: Path | None = None, **settings: object) -> RunningServer:
        server = start(data or tmp_path_factory.mktemp("server") / "data", **settings)
        servers.append(server)
        return server

    yield make
    for server in servers:
        with contextlib.suppress(ProcessLookupError):
            server.stop()


@pytest.fixture(scope="module")
def server(start_server: StartServer) -> RunningServer:
    return start_server()


def make_key(database_url: str, tenant: str, *scopes: str, quotas: Quotas | None = None) -> str:
    """An API key, put into the database as `primray keys create` would."""
    key = f"primray_{secrets.token_urlsafe(32)}"
    store = open_store(database_url)
    store.create_key(
        ApiKey(
            id=f"key_{os.urandom(8).hex()}",
            tenant=tenant,
            name="test",
            prefix=key[:12],
            sha256=hashlib.sha256(key.encode()).hexdigest(),
            scopes=frozenset(scopes),
            quotas=quotas or Quotas(),
            created_at=time.time(),
        )
    )
    store.close()
    return key
