"""A server of its own process for tests: started on a free port over a data directory, asked over HTTP, stopped."""

from __future__ import annotations

import dataclasses
import json
import re
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx2
from tests.service import forked

from primray_service.config import ServeConfig
from primray_service.limits import Limits, Quotas
from primray_service.shared_roots import roots_of

START_S = 90.0  # on a machine that has other work


@dataclass
class RunningServer:
    """`log` is what it printed, on both channels."""

    process: forked.Process
    url: str
    data: Path
    log: Path
    clients: list[httpx2.Client] = field(default_factory=list)

    def client(self, key: str | None = None, **options: Any) -> httpx2.Client:
        headers = {} if key is None else {"authorization": f"Bearer {key}"}
        client = httpx2.Client(base_url=self.url, headers=headers, timeout=30, trust_env=False, verify=False, **options)
        self.clients.append(client)
        return client

    def failures(self) -> list[str]:
        """What its log says of exceptions that nobody answers for: in a line of JSON they are a structure, not a traceback."""
        lines = self.log.read_text().splitlines()
        starts = [i for i, line in enumerate(lines) if "Traceback" in line or '"exception": [' in line]
        return ["\n".join(lines[i : i + 40]) if "Traceback" in lines[i] else lines[i] for i in starts]

    def stop(self, number: int = signal.SIGTERM, timeout_s: float = 60.0) -> int:
        """Its exit code."""
        for client in self.clients:
            client.close()
        if self.process.poll() is None:
            self.process.send_signal(number)
        try:
            return self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise


def start(data: Path, **settings: Any) -> RunningServer:
    """`settings` are ServeConfig's, but for `data`; limits and quotas as dictionaries."""
    data.mkdir(parents=True, exist_ok=True)
    log = data.with_name(f"{data.name}.log")
    with log.open("ab") as said:
        begin = said.tell()
        process = forked.start({"data": str(data), "port": 0, **settings}, said.fileno())
    until = time.monotonic() + START_S
    while time.monotonic() < until and process.poll() is None:
        if match := re.search(rb"listens at (http://\S+)\s", log.read_bytes()[begin:]):
            return RunningServer(process, match[1].decode(), data, log)
        time.sleep(0.01)
    process.kill()
    process.wait()
    raise AssertionError(f"the server did not start:\n{log.read_text()[-4000:]}")


def config_of(settings: dict[str, Any]) -> ServeConfig:
    settings = dict(settings)
    settings["shared_roots"] = roots_of(settings.pop("shared_roots", ()), settings.pop("shared_tenants", ()))
    known = {field.name for field in dataclasses.fields(ServeConfig)}
    assert set(settings) <= known, set(settings) - known
    lists = ("allowed_hosts", "allowed_origins", "webhook_networks")
    tuples: dict[str, Any] = {name: tuple(settings[name]) for name in lists if name in settings}
    return ServeConfig(
        **{
            **settings,
            **tuples,
            "data": Path(settings["data"]),
            "limits": Limits(**settings.get("limits", {})),
            "quotas": Quotas(**settings.get("quotas", {})),
        }
    )


if __name__ == "__main__":
    from primray_service.server import serve

    serve(config_of(json.loads(sys.argv[1])))
