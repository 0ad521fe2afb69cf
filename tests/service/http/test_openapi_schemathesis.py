"""The server does what its OpenAPI document says, and nothing else: schemathesis, all checks, against a live server."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from tests.service.conftest import StartServer
from tests.service.serving import RunningServer

FOLDER = Path(__file__).parent
# Waits are short: `Prefer: wait` is among the headers that are tried.
LIMITS = {"wait_s": 0.2}


def run(server: RunningServer, *options: str, timeout_s: float) -> subprocess.CompletedProcess[str]:
    pytest.importorskip("schemathesis", reason="skipped: no schemathesis")
    return subprocess.run(
        [
            *(sys.executable, "-m", "schemathesis.cli", "--config-file", str(FOLDER / "schemathesis.toml")),
            *("run", f"{server.url}/openapi.json", "--checks", "all", "--continue-on-failure", *options),
        ],
        env={**os.environ, "SCHEMATHESIS_HOOKS": str(FOLDER / "usd_bodies.py"), "PYTHONPATH": str(FOLDER), "NO_COLOR": "1"},
        cwd=server.data.parent,
        capture_output=True,
        text=True,
        timeout=timeout_s,
    )


def check(done: subprocess.CompletedProcess[str]) -> None:
    lines = [line[:500] for line in (done.stdout + done.stderr).splitlines() if line.strip()]
    print("\n".join(lines[-12:]))
    assert done.returncode == 0, "\n".join(lines[-150:])


def test_examples_and_edges_of_every_operation(start_server: StartServer):
    server = start_server(dispatch=False, warm=False, limits=LIMITS)
    check(run(server, "--phases", "examples,coverage", "--seed", "1", timeout_s=120))


def test_sequences_of_operations(start_server: StartServer):
    server = start_server(dispatch=False, warm=False, limits=LIMITS)
    check(run(server, "--phases", "stateful", "--max-examples", "8", "--seed", "1", timeout_s=120))


@pytest.mark.long
def test_at_length_while_jobs_are_rendered(start_server: StartServer):
    server = start_server(limits={**LIMITS, "samples": 64, "seconds": 5, "image_pixels": 2**16, "frames": 20})
    check(run(server, "--phases", "examples,coverage,fuzzing,stateful", "--max-examples", "40", timeout_s=1800))
