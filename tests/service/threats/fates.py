"""What becomes of what is sent: uploaded, a job at once, and its end; nothing that is answered may hold the canary's words."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.service.scenes.zips import Entry, zip_of
from tests.service.serving import RunningServer

SETTINGS = {"resolution": [48, 27], "stop": {"max_samples": 2}}
END_S = 90.0
TERMINAL = ("succeeded", "failed", "canceled", "expired")


@dataclass
class Fate:
    """`end`: refused (the upload), rejected (the scene, before a job could be), or the job's last state."""

    end: str
    problem: dict[str, Any] = field(default_factory=dict)
    job: dict[str, Any] = field(default_factory=dict)
    scene: dict[str, Any] = field(default_factory=dict)
    said: str = ""  # every answer, and the log
    seconds: float = 0.0

    @property
    def slug(self) -> str:
        return str(self.problem.get("type", "")).removeprefix("/problems/")

    @property
    def cost_s(self) -> float:
        """CPU seconds, whatever else the machine does meanwhile: those of the limit that ended it, or of the job; wall seconds
        where neither is known."""
        if self.slug == "time-limit":
            return float(self.problem["limit"])
        return float(self.job.get("usage", {}).get("cpu_s", self.seconds))

    @property
    def warnings(self) -> list[str]:
        return [warning["code"] for warning in self.job.get("warnings", []) + self.scene.get("warnings", [])]


def usda(body: str = "", head: str = "") -> str:
    """A layer; a statement has to end with its line, or with a semicolon."""
    body, head = body.replace(" }", "\n}"), head.replace(" }", "\n}")
    return f"#usda 1.0\n(\n{head}\n)\n{body}\n" if head else f"#usda 1.0\n{body}\n"


ROOM = """
def Camera "cam" { double3 xformOp:translate = (0, 0, 6)
    uniform token[] xformOpOrder = ["xformOp:translate"] }
def Sphere "ball" { double radius = 1 }
def DistantLight "sun" { float inputs:intensity = 2 }
"""


def package(files: Mapping[str, str | bytes]) -> bytes:
    return zip_of(*(Entry(name, data.encode() if isinstance(data, str) else data) for name, data in files.items()))


def usdz(files: Mapping[str, str | bytes]) -> bytes:
    entries = [Entry(name, data.encode() if isinstance(data, str) else data, align=True) for name, data in files.items()]
    return zip_of(*entries)


def fate(client: Any, body: str | bytes, *, name: str = "", entry: str | None = None, **job: Any) -> Fate:
    """Upload, submit at once (so that the job waits for the check), wait for the end, read all that can be read."""
    began = time.monotonic()
    data = body.encode() if isinstance(body, str) else body
    uploaded = client.post("/v1/scenes", content=data, params={"name": name} if name else {})
    if uploaded.status_code >= 400:
        return Fate("refused", uploaded.json(), said=uploaded.text, seconds=time.monotonic() - began)
    scene_id = uploaded.json()["id"]
    reference = {"id": scene_id} if entry is None else {"id": scene_id, "entry": entry}
    asked = {"scene": reference, "settings": SETTINGS, **job}
    made = client.post("/v1/jobs", json=asked)
    if made.status_code >= 400:
        scene = client.get(f"/v1/scenes/{scene_id}")
        end = "rejected" if scene.json()["state"] == "rejected" else "refused"
        return Fate(end, made.json(), scene=scene.json(), said=made.text + scene.text, seconds=time.monotonic() - began)
    path = f"/v1/jobs/{made.json()['id']}"
    until = time.monotonic() + END_S
    while (found := client.get(path, headers={"prefer": "wait=10"})).json()["state"] not in TERMINAL:
        assert time.monotonic() < until, found.text
    ended = found.json()
    answers = [uploaded, made, found, client.get(f"/v1/scenes/{scene_id}")]
    answers += [client.get(f"{path}/{rest}") for rest in ("log", "outputs", "frames")]
    answers.append(client.get(f"{path}/events", headers={"accept": "application/json"}))
    said = "\n".join(answer.text for answer in answers)
    return Fate(ended["state"], ended["error"] or {}, ended, answers[3].json(), said=said, seconds=time.monotonic() - began)


class Canary:
    """Files outside that no scene may reach; their words are looked for in everything that is answered."""

    def __init__(self, folder: Path, server: RunningServer) -> None:
        self.folder = folder
        self.server = server
        self.word = f"CANARY{folder.name}SINGS"
        folder.mkdir(parents=True)
        (folder / "secret.usda").write_text(f'#usda 1.0\ndef Sphere "{self.word}" {{ custom string x = "{self.word}" }}\n')
        (folder / "broken.usda").write_text(f'#usda 1.0\nstring {self.word} = "{self.word}\n')
        (folder / "secret.ies").write_text(f"IESNA:LM-63-1995\n[TEST] {self.word}\n")
        (folder / "secret.txt").write_text(self.word)
        for tile in ("secret.png", "secret.1001.png"):
            (folder / tile).write_bytes(b"\x89PNG\r\n\x1a\n" + self.word.encode())

    def path(self, name: str) -> str:
        return str(self.folder / name)

    def never_sang(self, found: Fate) -> None:
        assert self.word not in found.said
        assert self.word not in json.dumps([found.problem, found.job, found.scene])
        for output in (self.server.data / "jobs").rglob("*"):
            if output.is_file():
                assert self.word.encode() not in output.read_bytes(), output


def workers_of(server: RunningServer) -> list[str]:
    """Command lines of the server's living descendants that are not its picture helper."""
    lines = []
    for status in Path("/proc").glob("[0-9]*/status"):
        try:
            parent = int(re.search(r"PPid:\s*(\d+)", status.read_text(errors="replace"))[1])  # type: ignore[index]
            command = (status.parent / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
        except (OSError, TypeError):
            continue
        lines.append((int(status.parent.name), parent, command))
    found, family = [], {server.process.pid}
    for pid, parent, command in sorted(lines):
        if parent in family:
            family.add(pid)
            if "pictures.process" not in command:
                found.append(command)
    return found
