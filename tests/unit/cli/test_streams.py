"""Standard streams that are closed, full, without a reader or of an encoding that lacks letters: no traceback, the render ends
as it would."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from primray import cli

SCENE = '#usda 1.0\ndef Sphere "s" {}\ndef Camera "kamera" {}\n'
LIMITED = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (8192, 8192)); from primray.cli import main; main()"
PRIMRAY = [sys.executable, "-c", "from primray.cli import main; main()"]
SMALL = ["--spp", "1", "--res", "8", "8"]
FULL = "standard output cannot be written: No space left on device"


@pytest.fixture(autouse=True)
def _a_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("s.usda").write_text(SCENE)


def primray(*arguments: str, redirected: str = "", **environment: str) -> subprocess.CompletedProcess[str]:
    """By a shell, which redirects."""
    command = ["sh", "-c", f'exec "$@" {redirected}', "sh", *PRIMRAY, *arguments]
    return subprocess.run(command, capture_output=True, text=True, errors="replace", env=os.environ | environment)


@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&-", "<&- >&- 2>&-"])
@pytest.mark.parametrize("command", [["render", "s.usda", *SMALL], ["inspect", "s.usda"]], ids=["render", "inspect"])
def test_closed_descriptors(command: list[str], closed: str) -> None:
    done = primray(*command, redirected=closed)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert command[0] == "inspect" or Path("s.exr").stat().st_size > 0


@pytest.mark.parametrize("json_lines", [[], ["--json"]])
def test_a_full_disk_behind_stdout_ends_no_sequence(json_lines: list[str]) -> None:
    done = primray("render", "s.usda", *SMALL, "-f", "1:3", "-o", "x.#.exr", *json_lines, redirected=">/dev/full")
    assert done.returncode == 1
    assert done.stderr.count(FULL) == 1
    assert "Traceback" not in done.stderr
    assert sorted(path.name for path in Path().glob("*.exr")) == ["x.1.exr", "x.2.exr", "x.3.exr"]


@pytest.mark.parametrize("command", [["inspect", "s.usda"], ["--help"], ["--version"]])
def test_a_full_disk_behind_stdout(command: list[str]) -> None:
    done = primray(*command, redirected=">/dev/full")
    assert (done.returncode, done.stderr.count(FULL)) == (1, 1)
    assert "Traceback" not in done.stderr


def test_an_error_keeps_its_exit_code_where_it_cannot_be_told() -> None:
    assert primray("render", "none.usda", "--json", redirected=">/dev/full").returncode == 3
    assert primray("render", "none.usda", redirected="2>/dev/full").returncode == 3


@pytest.mark.parametrize("command", [["render", "s.usda", *SMALL, "--json"], ["inspect", "s.usda"]], ids=["render", "inspect"])
def test_a_reader_that_went_away(command: list[str]) -> None:
    read, write = os.pipe()
    os.close(read)
    try:
        done = subprocess.run([*PRIMRAY, *command], stdout=write, stderr=subprocess.PIPE, text=True)
    finally:
        os.close(write)
    assert done.returncode == 0, done.stderr
    assert "error" not in done.stderr
    assert command[0] == "inspect" or Path("s.exr").exists()


def test_letters_that_the_stream_lacks() -> None:
    Path("s.usda").rename("sé.usda")
    done = primray("render", "sé.usda", *SMALL, PYTHONIOENCODING="ascii")
    assert (done.returncode, done.stdout.split(":")[0]) == (0, "s\\xe9.exr")
    done = primray("render", "sé.usda", *SMALL, "--json", PYTHONIOENCODING="ascii")
    assert json.loads(done.stdout.splitlines()[-1])["outputs"] == ["sé.exr"]


def test_names_that_are_no_text() -> None:
    done = primray("render", "s.usda", *SMALL, "-o", os.fsdecode(b"s\xff.exr"), "--json")
    assert done.returncode == 2
    assert json.loads(done.stdout)["where"] == os.fsdecode(b"s\xff.exr")
    assert done.stderr == "error: not-utf8: an argument is not valid UTF-8 [s\\udcff.exr]\n"


@pytest.mark.parametrize("command", ["render", "inspect", "doctor", "estimate", "thumbnail", "sheet", "view", "compare", "ci"])
def test_arguments_that_are_no_text(command: str) -> None:
    done = primray(command, os.fsdecode(b"s\xff.usda"))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "error: not-utf8: an argument is not valid UTF-8 [s\\udcff.usda]\n"


def test_a_full_disk_is_no_bug_of_primray(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def full(arguments: list[str]) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", "place")

    monkeypatch.setattr(cli, "_call", full)
    assert cli.run(["inspect", "s.usda"]) == 1
    assert capsys.readouterr().err == "error: write-failed: the file cannot be written: No space left on device [place]\n"


def test_a_disk_that_is_full_indeed_ends_no_sequence() -> None:
    """By the limit of a file's size, which the library that writes pictures meets like a full disk."""
    Path("s.usda").write_text('#usda 1.0\ndef Sphere "s" {}\n')  # framed: pixels that compress less
    flags = ["-f", "1:2", "-o", "x.#.exr", "-o", "x.#.png", "--res", "64", "64", "--spp", "4"]
    done = subprocess.run([sys.executable, "-c", LIMITED, "render", "s.usda", *flags], capture_output=True, text=True)
    assert done.returncode == 1, done.stderr
    assert sorted(os.listdir()) == ["s.usda", "x.1.png", "x.2.png"]
    errors = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert [line.split("[")[-1] for line in errors] == ["x.1.exr]", "x.2.exr]"]
    assert all(line.startswith("error: write-failed: ") and "/.x." not in line for line in errors)
