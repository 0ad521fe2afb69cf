"""Commands of a user who may not read or write everything, also where the tests run as root."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

OVERRIDES = "-dac_override,-dac_read_search"  # the capabilities by which root reads and writes what is locked


def run_locked(*words: str | Path) -> subprocess.CompletedProcess[str]:
    """Run `primray` with these arguments, so that permissions hold."""
    command = [sys.executable, "-c", "from primray.cli import main; main()", *map(str, words)]
    return subprocess.run([*_prefix(), *command], check=False, capture_output=True, text=True)


def skip_unless_locks_hold(folder: Path) -> None:
    """Skip the test where no file in the folder can be locked."""
    probe = folder / "probe"
    probe.touch(mode=0o000)
    if os.geteuid() == 0 and shutil.which("setpriv") is None:
        pytest.skip("skipped: no setpriv, and root may read everything")
    if subprocess.run([*_prefix(), "cat", str(probe)], check=False, capture_output=True).returncode == 0:
        pytest.skip("skipped: no file can be locked here")
    probe.unlink()


def _prefix() -> list[str]:
    return ["setpriv", f"--bounding-set={OVERRIDES}"] if os.geteuid() == 0 else []
