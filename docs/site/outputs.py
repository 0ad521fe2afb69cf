"""Runs the tutorials' examples for the site and keeps what they said: examples/out/*.txt, and the pictures beside them."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

# What a tutorial shows of each: the text of a run, and a picture that it made.
SHOWN = {
    "command-line": ("command_line.txt", "shot.png"),
    "farm": ("farm.txt", "whole.png"),
    "pytest": ("pytest.txt", "difference.png"),
    "service": ("service.txt", "beauty.png"),
}
FIRST = "first-picture"  # the page whose commands are run one by one
# Away from the project's own settings of pytest.
PYTEST = ("pytest", "-q", "-c", os.devnull, "--rootdir", ".", "-p", "no:cacheprovider", "--disable-warnings")
START_S = 90.0  # on a machine that has other work
LAMP = ("intensity = 24", "intensity = 30")


def write_outputs(examples: Path) -> None:
    """In a copy of examples/: its stage is changed on the way, and put back."""
    out = examples / "out"
    out.mkdir()
    _kept(out / "command_line.txt", _said(examples, "bash", "command_line.sh"))
    _kept(out / "farm.txt", _said(examples, "bash", "farm.sh"))
    _kept(out / "service.txt", _of_service(out))
    _kept(out / "pytest.txt", _of_pytest(examples))
    _first_picture(out, examples.parent / f"docs/site/{FIRST}.md")


def _first_picture(out: Path, page: Path) -> None:
    """What each of its commands said, by their number; the picture is that of the first."""
    folder = out / "first"
    folder.mkdir()
    for number, commands in enumerate(
        re.findall(r"^```sh\n(.*?)^```$", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    ):
        _kept(out / f"{FIRST}-{number}.txt", _said(folder, "bash", "-euo", "pipefail", "-c", commands))
        if number == 1:
            (folder / "shot.png").rename(out / f"{FIRST}.png")


def _of_service(out: Path) -> str:
    """What the client said beside a server of its own, whose log goes to a file: a pipe that nobody reads would stop it."""
    with tempfile.TemporaryDirectory() as data:
        log = Path(data, "log")
        with log.open("w") as told:
            command = ["primray", "serve", "--port", "0", "--data", f"{data}/data"]
            server = subprocess.Popen(command, env=_environment(), stdout=told, stderr=subprocess.STDOUT)
        try:
            until = time.monotonic() + START_S
            while (found := re.search(r"http://127\S+:\d+", log.read_text(encoding="utf-8"))) is None:
                if server.poll() is not None or time.monotonic() > until:
                    sys.exit(f"primray serve did not start:\n{log.read_text(encoding='utf-8')}")
                time.sleep(0.05)
            return _said(out, sys.executable, "../service_client.py", PRIMRAY_SERVER=found[0])
        finally:
            server.terminate()
            server.wait(30)


def _of_pytest(examples: Path) -> str:
    """What a comparison says of a lamp that is a quarter brighter."""
    stage, references = examples / "shot.usda", str(examples / "out/references")
    command = (*PYTEST, "--basetemp", "out/pytest", "test_pictures.py")
    _said(examples, *command, "--primray-update", PRIMRAY_REFERENCES=references)
    as_it_was = stage.read_text(encoding="utf-8")
    assert as_it_was.count(LAMP[0]) == 1
    stage.write_text(as_it_was.replace(*LAMP), encoding="utf-8")
    try:
        told = _said(examples, *command, expected=1, PRIMRAY_REFERENCES=references)
    finally:
        stage.write_text(as_it_was, encoding="utf-8")
    (difference,) = (examples / "out/pytest").rglob("difference.png")
    difference.rename(examples / "out/difference.png")
    return told


def _said(folder: Path, *command: str, expected: int = 0, **variables: str) -> str:
    ended = subprocess.run(
        command,
        cwd=folder,
        env=_environment() | variables,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=300,
    )
    if ended.returncode != expected:
        sys.exit(f"{' '.join(command)} ended with {ended.returncode}:\n{ended.stdout}")
    return ended.stdout.replace(f"{folder}/", "")


def _environment() -> dict[str, str]:
    """With this Python's commands before others, and lines as a terminal of 100 columns has them."""
    return os.environ | {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}", "COLUMNS": "100"}


def _kept(file: Path, text: str) -> None:
    file.write_text(text, encoding="utf-8")
