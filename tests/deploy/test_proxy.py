"""deploy/Caddyfile, run by Caddy itself before a real server: TLS on one port, nothing without it, sessions that are Secure."""

from __future__ import annotations

import os
import shutil
import socket
import ssl
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import httpx2
import pytest
from tests.service.conftest import make_key
from tests.service.serving import RunningServer, start

from .manifests import ROOT

FILE = ROOT / "deploy/Caddyfile"
START_S = 30.0


def caddy() -> str:
    program = shutil.which("caddy", path=os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")]))
    if program is None:
        pytest.skip("skipped: no caddy; requirements-site.lock has it")
    return program


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningServer]:
    caddy()
    running = start(tmp_path_factory.mktemp("behind") / "data", require_keys=True)
    yield running
    running.stop()


@pytest.fixture(scope="module")
def outside(server: RunningServer, tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx2.Client]:
    """A client of the proxy, which trusts the proxy's own authority and nobody else."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    folder = tmp_path_factory.mktemp("caddy")
    environment = {
        "HOME": str(folder),
        "XDG_DATA_HOME": str(folder),
        "PRIMRAY_HTTPS_PORT": str(port),
        "PRIMRAY_SERVER": server.url.removeprefix("http://"),
    }
    command = [caddy(), "run", "--adapter", "caddyfile", "--config", str(FILE)]
    with (folder / "log").open("wb") as log:
        process = subprocess.Popen(command, env=environment, stderr=log, stdin=subprocess.DEVNULL)
    authority = folder / "caddy/pki/authorities/local/root.crt"
    try:
        until = time.monotonic() + START_S
        while not answers(port, authority):
            assert process.poll() is None, (folder / "log").read_text()[-4000:]
            assert time.monotonic() < until, (folder / "log").read_text()[-4000:]
            time.sleep(0.05)
        with httpx2.Client(base_url=f"https://localhost:{port}", verify=trusting(authority), trust_env=False) as client:
            yield client
    finally:
        process.terminate()
        process.wait(20)


def trusting(authority: Path) -> ssl.SSLContext:
    return ssl.create_default_context(cafile=str(authority))


def answers(port: int, authority: Path) -> bool:
    try:
        with socket.create_connection(("localhost", port), 1) as plain:
            trusting(authority).wrap_socket(plain, server_hostname="localhost").close()
    except OSError:
        return False
    return True


def test_it_is_as_caddy_formats_it(tmp_path: Path) -> None:
    copy = tmp_path / "Caddyfile"
    copy.write_text(FILE.read_text())
    subprocess.run([caddy(), "fmt", "--overwrite", str(copy)], check=True, capture_output=True)
    assert copy.read_text() == FILE.read_text()


def test_the_server_answers_through_it_with_tls_alone(outside: httpx2.Client) -> None:
    answer = outside.get("/readyz")
    assert answer.status_code == 200
    assert answer.json()["status"] == "ready"
    assert "max-age" in answer.headers["strict-transport-security"]
    assert outside.get("/").text.count("<title>") == 1
    with httpx2.Client(trust_env=False) as plain:
        refused = plain.get(f"http://localhost:{outside.base_url.port}/readyz")
        assert refused.status_code == 400
        assert "ready" not in refused.text


def test_a_browsers_session_is_secure_and_lets_it_in(outside: httpx2.Client, server: RunningServer) -> None:
    """The proxy says that it was https, and the page's origin is the host that the server sees."""
    key = make_key(f"sqlite:///{server.data / 'primray.sqlite'}", "studio", "read", "submit")
    origin = str(outside.base_url).rstrip("/")
    begun = outside.post("/v1/session", json={"key": key}, headers={"origin": origin, "sec-fetch-site": "same-origin"})
    assert begun.status_code == 201, begun.text
    assert "; secure" in begun.headers["set-cookie"].lower()
    assert outside.get("/v1/whoami").json()["tenant"] == "studio"
    elsewhere = outside.post("/v1/session", json={"key": key}, headers={"origin": "https://evil.example"})
    assert elsewhere.json()["type"] == "/problems/cross-origin"
