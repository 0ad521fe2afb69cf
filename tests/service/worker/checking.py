"""Checks of scenes by real workers in their sandbox, as the executor would start them."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pxr import Sdf

from primray_service.sandbox import Budget, decode_exit, worker_spawn

Files = dict[str, str | bytes]
GiB = 2**30


@dataclass
class Checked:
    """`problem` or `facts`; neither if the process did not end by itself."""

    problem: dict[str, Any] | None = None
    facts: dict[str, Any] | None = None
    warnings: list[dict[str, Any]] = field(default_factory=list)
    exit_code: int | None = None
    signal: int | None = None
    log: str = ""
    seconds: float = 0.0  # from the command to the end

    @property
    def slug(self) -> str:
        return str(self.problem["type"]).removeprefix("/problems/") if self.problem else ""

    def codes(self) -> list[str]:
        return [warning["code"] for warning in self.warnings]

    def everything(self) -> str:
        """All that a client could come to read."""
        return json.dumps([self.problem, self.facts, self.warnings]) + self.log


def usda(body: str = "", head: str = "") -> str:
    return f"#usda 1.0\n({head})\n{body}\n" if head else f"#usda 1.0\n{body}\n"


SPHERE = 'def Sphere "ball" {\n}\n'


def write(folder: Path, files: Files) -> None:
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())


def usdz(path: Path, files: Files) -> bytes:
    """Packed by USD's own writer, the first file first."""
    source = path.with_suffix(".parts")
    write(source, files)
    with Sdf.ZipFileWriter.CreateNew(str(path)) as writer:
        for name in files:
            writer.AddFile(str(source / name), name)
    return path.read_bytes()


def check(
    slot: Path,
    files: Files,
    *,
    entry: str | None = None,
    layers: frozenset[str] | None = None,
    cpu_s: float = 20.0,
    wrapper: tuple[str, ...] = (),
    **limits: float,
) -> Checked:
    """A package of these files, or, of one whose name is `scene.*`, that file."""
    shutil.rmtree(slot, ignore_errors=True)
    (slot / "out").mkdir(parents=True)
    (slot / "job").mkdir()
    single = list(files) if len(files) == 1 and next(iter(files)).startswith("scene.") else None
    write(slot / "job" if single else slot / "job" / "package", files)
    file, kind = (single[0], single[0].rpartition(".")[2]) if single else ("package", "zip")
    limits = {"load_cpu_s": cpu_s, **limits}
    command = {"do": "check", "file": file, "kind": kind, "entry": entry, "limits": limits}
    return run(slot, command, layers, wrapper)


def run(slot: Path, command: dict[str, Any], layers: frozenset[str] | None = None, wrapper: tuple[str, ...] = ()) -> Checked:
    spawn = worker_spawn(slot, Budget(2 * GiB, threads=2), ("-m", "primray_service.worker", "check"), layers)
    process = subprocess.Popen(
        [*wrapper, *spawn.argv],
        env=spawn.env,
        cwd=spawn.cwd,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    assert process.stderr is not None
    ready = process.stdout.readline()
    began = time.monotonic()
    if ready:
        process.stdin.write(json.dumps(command).encode() + b"\n")
        process.stdin.flush()
    checked = Checked()
    for line in process.stdout:
        message = json.loads(line)
        if message["at"] == "warning":
            checked.warnings.append(message)
        elif message["at"] == "facts":
            checked.facts = message
        elif message["at"] == "failed":
            checked.problem = message["problem"]
    process.stdin.close()
    checked.log = process.stderr.read().decode("utf-8", "replace")
    checked.exit_code, checked.signal = decode_exit(process.wait(60), spawn.wrapped)
    checked.seconds = time.monotonic() - began
    return checked


CRASHES = {signal.SIGSEGV, signal.SIGABRT, signal.SIGBUS}


# Enters the sandbox as a worker does, and then checks one scene after the other, each with a folder of its own.
_MANY = """
import json, os, sys
messages = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)
from primray_service.sandbox import enter
entered = enter((messages.fileno(),))
from primray_service.worker.check import check_scene
from primray_service.worker.channel import ClientText
from primray_service.worker.failures import problem_of_error

class Left(BaseException):
    pass

text = ClientText(entered.job, entered.out)

class Channel:
    def send(self, at, **members):
        print(json.dumps(text.in_json({"at": at, **members})), file=messages)
    def leave(self, at, **members):
        self.send(at, **members)
        raise Left

for name, command in json.loads(sys.stdin.read()).items():
    channel = Channel()
    channel.send("case", name=name)
    try:
        check_scene(command, entered.job / name, entered.out, channel)
    except Left:
        pass
    except BaseException as error:
        channel.send("failed", problem=problem_of_error(error, str(entered.job / name)).as_json())
messages.flush()
os._exit(0)
"""


def check_many(
    slot: Path,
    scenes: dict[str, Files],
    layers: frozenset[str] | None = None,
    wrapper: tuple[str, ...] = (),
    entries: dict[str, str] | None = None,
    **limits: float,
) -> dict[str, Checked]:
    """As `check`, of many small scenes in one process, as starting one costs more than looking at a scene."""
    shutil.rmtree(slot, ignore_errors=True)
    (slot / "out").mkdir(parents=True)
    commands = {}
    for name, files in scenes.items():
        single = next(iter(files)) if len(files) == 1 and next(iter(files)).startswith("scene.") else None
        write(slot / "job" / name if single else slot / "job" / name / "package", files)
        kind = single.rpartition(".")[2] if single else "zip"
        commands[name] = {
            "do": "check",
            "file": single or "package",
            "kind": kind,
            "entry": (entries or {}).get(name),
            "limits": limits,
        }
    spawn = worker_spawn(slot, Budget(2 * GiB, threads=2), ("-c", _MANY), layers)
    ended = subprocess.run(
        [*wrapper, *spawn.argv],
        env=spawn.env,
        cwd=spawn.cwd,
        input=json.dumps(commands).encode(),
        capture_output=True,
        timeout=120,
    )
    found: dict[str, Checked] = {}
    for line in ended.stdout.splitlines():
        message = json.loads(line)
        if message["at"] == "case":
            checked = found[message["name"]] = Checked(exit_code=0)
        elif message["at"] == "warning":
            checked.warnings.append(message)
        elif message["at"] == "facts":
            checked.facts = message
        elif message["at"] == "failed":
            checked.problem = message["problem"]
    assert ended.returncode == 0, ended.stderr.decode("utf-8", "replace")
    assert set(found) == set(scenes)
    return found
