# SPDX-License-Identifier: GPL-3.0-or-later
"""The two processes beside Blender: a background Blender that exports, and primray's Python that renders. Knows no scene."""

from __future__ import annotations

import json
import os
import queue
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
MARK = "primray: "  # before what the exporter answers, among what Blender prints
EXPORT = "import sys; sys.path.insert(0, {folder!r}); from usd_export.process import main; main()"
POLL_S = 0.05


class ProcessError(Exception):
    """A process beside Blender failed; the message is for the user."""


class Lines:
    """A process that is sent lines of JSON and answers by such lines; its last words are kept for error messages.

    Answers wait for `answer`, or are given to `on_answer`, by the thread that reads them: None is the process's end.
    """

    def __init__(
        self,
        command: Sequence[str],
        environment: dict[str, str] | None = None,
        mark: str = "",
        on_answer: Callable[[dict[str, Any] | None], None] | None = None,
    ) -> None:
        self._mark = mark
        self._answers: queue.Queue[dict[str, Any] | None] = queue.Queue()
        self._said: list[str] = []
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, encoding="utf-8",
            errors="replace", env=environment,
        )  # fmt: skip
        self._take = on_answer or self._answers.put
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        for line in self._process.stdout or ():
            if line.startswith(self._mark or "{"):
                try:
                    answer = json.loads(line[len(self._mark) :])
                except ValueError:
                    pass
                else:
                    self._take(answer)
                    continue
            self._said = [*self._said[-20:], line.rstrip()]
        self._process.wait()
        self._take(None)

    @property
    def is_alive(self) -> bool:
        return self._process.poll() is None

    def send(self, **request: Any) -> None:
        try:
            assert self._process.stdin is not None
            self._process.stdin.write(json.dumps(request) + "\n")
            self._process.stdin.flush()
        except OSError as error:
            raise ProcessError(self.last_words()) from error

    def answer(self, is_cancelled: Callable[[], bool]) -> dict[str, Any] | None:
        """Return the next answer; None where it is cancelled meanwhile. Raises ProcessError if the process ends."""
        while True:
            try:
                found = self._answers.get(timeout=POLL_S)
            except queue.Empty:
                if is_cancelled():
                    return None
                continue
            if found is None:
                raise ProcessError(self.last_words())
            return found

    def last_words(self) -> str:
        """Return how the process ended and what it said last."""
        words = " ".join(line for line in self._said if line)[-600:]
        return f"the process ended with code {self._process.poll()}: {words}"

    def end(self) -> None:
        if self.is_alive:
            self._process.terminate()
            try:
                self._process.wait(timeout=2)
            except subprocess.TimeoutExpired:
                self._process.kill()


Take = Callable[[dict[str, Any] | None], None]


def exporter(binary: str, on_answer: Take | None = None) -> Lines:
    """Start a background Blender; `binary` is Blender's own, and "" where Blender is a module of this Python."""
    code = EXPORT.format(folder=str(HERE))
    environment = dict(os.environ)
    if binary:
        return Lines([binary, "--background", "--factory-startup", "--python-expr", code], environment, MARK, on_answer)
    return Lines([sys.executable, "-c", code], environment, MARK, on_answer)


def renderer(python: str, script: str = "renderer.py", on_answer: Take | None = None) -> Lines:
    """Start one of this folder's scripts in a Python that has primray."""
    # Blender's own modules must not be found before primray's.
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PYTHONHOME")}
    return Lines([python, str(HERE / script)], environment, on_answer=on_answer)


def find_python(preferred: str, own_folder: str) -> str:
    """Return a Python that has primray: of the preference, of the add-on's own environment, of the command `primray` on the
    PATH or among uv's tools. Raises ProcessError if there is none."""
    candidates = [preferred, str(Path(own_folder, "bin", "python")), str(Path(own_folder, "Scripts", "python.exe"))]
    if command := shutil.which("primray"):
        candidates.append(str(Path(command).resolve().parent / "python"))
    tools = Path(os.environ.get("UV_TOOL_DIR", Path.home() / ".local/share/uv/tools"))
    candidates.append(str(tools / "primray/bin/python"))
    for python in candidates:
        if not python:
            continue
        if Path(python).is_dir():  # an environment's folder
            python = str(Path(python, "bin", "python"))
        if Path(python).is_file():
            return python
        if python == preferred:
            raise ProcessError(f"{python}, which the add-on's preferences name, is no Python")
    raise ProcessError("primray is not installed: press Install in the add-on's preferences, or name its Python there")


def install(own_folder: str) -> None:
    """Make the add-on's own environment and install primray into it. Takes a minute; raises ProcessError."""
    python = shutil.which("python3") or sys.executable
    steps = [
        [python, "-m", "venv", own_folder],
        [str(Path(own_folder, "Scripts" if os.name == "nt" else "bin", "python")), "-m", "pip", "install", "primray[denoise]"],
    ]
    for step in steps:
        done = subprocess.run(step, capture_output=True, text=True)
        if done.returncode != 0:
            raise ProcessError(f"{' '.join(step[1:])}: {done.stderr[-600:]}")
