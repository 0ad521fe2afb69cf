"""A server under strace with hostile scenes sent to it; run as a program, since a tracer must not be traced itself."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx2
from tests.service.serving import RunningServer
from tests.service.threats.fates import ROOM, Canary, fate, package, usda, usdz
from tests.service.threats.test_outside import MATERIAL, PLACES, composed

ROOT = Path(__file__).parents[3]
CALLS = "open,openat,openat2,creat,execve,execveat,link,linkat,symlink,symlinkat,rename,renameat,renameat2,truncate,mmap"


@dataclass
class Report:
    slugs: dict[str, str]
    opened: list[str]  # lines of the trace in which a file of the canary's was opened
    seen_control: bool


def main(folder: Path) -> None:
    data, trace = folder / "data", folder / "trace"
    data.mkdir()
    settings = {"data": str(data), "port": 0, "limits": {"check_cpu_s": 30.0, "load_cpu_s": 30.0}}
    command = ["strace", "-f", "-y", "-s", "300", "-e", f"trace={CALLS}", "-e", "signal=none", "-o", str(trace)]
    log = data.with_name("data.log")
    with log.open("wb") as stderr:
        process = subprocess.Popen(
            [*command, sys.executable, "-m", "tests.service.serving", json.dumps(settings)],
            cwd=ROOT, stdout=subprocess.PIPE, stderr=stderr,
            env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT / "renderer"), str(ROOT / "service"), str(ROOT)])},
        )  # fmt: skip
    assert process.stdout is not None
    try:
        line = process.stdout.readline().decode()
        while "listens at" not in line:
            assert process.poll() is None, log.read_text()[-2000:]
            line = process.stdout.readline().decode()
        url = line.split()[-1]
        server = RunningServer(process, url, data, log)  # type: ignore[arg-type]
        slugs = send(server)
    finally:
        for child in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split():
            os.kill(int(child), 15)
        process.wait(60)
    (folder / "report.json").write_text(json.dumps(slugs))


def send(server: RunningServer) -> dict[str, str]:
    canary = Canary(server.data / "canary-of-the-trace", server)
    client = httpx2.Client(base_url=server.url, timeout=60, trust_env=False)
    path = canary.path("secret.usda")
    scenes: dict[str, Any] = {place: make(path) for place, make in PLACES.items()}
    scenes |= {
        "expressions": composed(path),
        "expressions, beside others": composed(path, ROOM),
        "expressions in a texture": package(
            {
                "root.usda": usda(
                    MATERIAL % '`"${X}.png"`' + ROOM, f'expressionVariables = {{ string X = "{canary.path("secret")}" }}'
                )
            }
        ),
        "tiles": usda(ROOM + MATERIAL % canary.path("secret.<UDIM>.png")),
        "out of a usdz": usdz(
            {"root.usda": usda(ROOM + f'def "R" (references = @../../{canary.folder.name}/secret.usda@</X>) {{}}')}
        ),
        "file URL": usda(ROOM + f'def "R" (references = @file:{path}@</X>) {{}}'),
    }
    slugs = {}
    for name, scene in scenes.items():
        found = fate(client, scene, **({"entry": "root.usda"} if name.startswith("expr") else {}))
        canary.never_sang(found)
        slugs[name] = f"{found.end} {found.slug}"
    control = fate(client, package({"control-layer.usda": usda(ROOM)}))
    assert control.end == "succeeded", control.problem
    client.close()
    time.sleep(0.5)
    return slugs


def read_report(folder: Path) -> Report:
    """A call that succeeded and names the canary; the canary's own making is another process's, and not traced."""
    opened, seen_control = [], False
    for line in (folder / "trace").read_text(errors="replace").splitlines():
        failed = re.search(r"= -1 E\w+", line)
        seen_control = seen_control or ("control-layer.usda" in line and "open" in line and not failed)
        if "canary-of-the-trace" in line and not failed and "unfinished" not in line:
            opened.append(line)
    return Report(json.loads((folder / "report.json").read_text()), opened, seen_control)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
