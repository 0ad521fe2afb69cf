"""One server for a file's threats, with limits small enough to be reached in seconds."""

from __future__ import annotations

import os
import secrets
from typing import Any

import pytest
from tests.service.serving import RunningServer
from tests.service.threats.fates import Canary

MiB = 2**20
LIMITS = {"check_cpu_s": 8.0, "load_cpu_s": 8.0, "memory_bytes": 1024 * MiB, "output_bytes": 64 * MiB}


@pytest.fixture(scope="module")
def server(start_server: Any, tmp_path_factory: pytest.TempPathFactory) -> RunningServer:
    """Its environment names a folder of the canary's as USD's search path, and one of plug-ins: neither may be used."""
    outside = tmp_path_factory.mktemp("outside")
    names = {"PXR_AR_DEFAULT_SEARCH_PATH": str(outside / "canary"), "PXR_PLUGINPATH_NAME": str(outside / "plugins")}
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(names)
    try:
        server: RunningServer = start_server(limits=LIMITS)
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
    return server


@pytest.fixture(scope="module")
def canary(server: RunningServer, tmp_path_factory: pytest.TempPathFactory) -> Canary:
    """Beside the data directory's scenes, so that ../ leads to it from a package, and anywhere else for absolute paths."""
    return Canary(server.data / f"canary-{secrets.token_hex(6)}", server)


@pytest.fixture(scope="module")
def client(server: RunningServer) -> Any:
    return server.client()


@pytest.fixture(autouse=True)
def _still_answers(server: RunningServer) -> Any:
    yield
    assert server.process.poll() is None
    assert server.client().get("/healthz").status_code == 200
    assert server.failures() == []  # shown here, since the log goes with its folder
