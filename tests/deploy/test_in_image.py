"""What runs in the image decides: what buildah does to itself afterwards is told and does not count, anything else does."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
# As buildah 1.28 says it.
PANIC = """
panic: runtime error: invalid memory address or nil pointer dereference
[signal SIGSEGV: segmentation violation code=0x1 addr=0x2c pc=0x73ed42]
goroutine 1 [running]:
github.com/sirupsen/logrus.(*Logger).Errorf(...)
github.com/containers/buildah.(*Builder).Run.func3()
"""
ELSEWHERE = PANIC.replace("buildah.(*Builder).Run.func3", "buildah/imagebuildah.(*Executor).Build")
RUNS = 'while [ "$1" != -- ]; do shift; done; shift; "$@"; ended=$?\n'


def in_image(folder: Path, buildah: str, *command: str) -> subprocess.CompletedProcess[str]:
    """With a `buildah` of ours, which runs the command itself."""
    tool = folder / "buildah"
    tool.write_text(f"#!/bin/sh\n{buildah}\n")
    tool.chmod(0o755)
    environment = {**os.environ, "PATH": f"{folder}:{os.environ['PATH']}", "BUILDAH": "--root here"}
    return subprocess.run([ROOT / "deploy/in-image", "box", *command], env=environment, capture_output=True, text=True)


def panics(text: str) -> str:
    return f"cat >&2 <<'END'\n{text}END\nexit 2"


@pytest.mark.parametrize("code", [0, 3])
def test_it_ends_as_the_command_ended(code: int, tmp_path: Path):
    done = in_image(tmp_path, RUNS + "exit $ended", "sh", "-c", f"echo out; echo err >&2; exit {code}")
    assert (done.returncode, done.stdout) == (code, "out\n")
    assert "err\n" in done.stderr


@pytest.mark.parametrize("code", [0, 3])
def test_a_panic_while_buildah_cleans_up_is_told_and_does_not_count(code: int, tmp_path: Path):
    done = in_image(tmp_path, RUNS + panics(PANIC), "sh", "-c", f"exit {code}")
    assert done.returncode == code
    assert (
        f"buildah panicked while it cleaned up, which is this machine's fault; the command had ended with {code}" in done.stderr
    )


@pytest.mark.parametrize(
    "buildah",
    [
        panics(PANIC),  # before the command could end
        RUNS + panics(ELSEWHERE),
        RUNS + "echo 'error unmounting container' >&2; exit 125",
    ],
)
def test_whatever_else_buildah_ends_with_counts(buildah: str, tmp_path: Path):
    done = in_image(tmp_path, buildah, "true")
    assert done.returncode in (2, 125)
    assert "machine's fault" not in done.stderr
