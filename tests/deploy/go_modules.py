"""Schemas and validators that are Go modules, at versions that are named here; Go checks what it gets."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

KUBERAY = "github.com/ray-project/kuberay/ray-operator@v1.5.0"
KUBERAY_SUM = "h1:KCjCQ7PSsvs9Ke+90CZbbs498nuaIJ/JkXk4vd54EVg="
COMPOSE = "github.com/compose-spec/compose-go/v2/cmd@v2.16.2"  # what Docker Compose itself reads files with
ACTIONLINT = "github.com/rhysd/actionlint/cmd/actionlint@v1.7.7"
NEEDS = (1, 24)


def go(*arguments: str, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    program = shutil.which("go")
    if program is None:
        pytest.skip("skipped: no go")
    version = subprocess.run([program, "version"], capture_output=True, text=True, check=True).stdout
    found = re.search(r"go(\d+)\.(\d+)", version)
    if found is None or (int(found[1]), int(found[2])) < NEEDS:
        pytest.skip(f"skipped: no go {NEEDS[0]}.{NEEDS[1]}")
    environment = {**os.environ, "GOFLAGS": "-mod=mod"}
    return subprocess.run([program, *arguments], cwd=folder, env=environment, capture_output=True, text=True, timeout=300)


def module_folder(module: str, digest: str) -> Path:
    """Its files; skipped where it cannot be fetched, but not in CI."""
    done = go("mod", "download", "-json", module)
    if done.returncode != 0 and not os.environ.get("CI"):
        pytest.skip(f"skipped: no {module}")
    assert done.returncode == 0, done.stdout + done.stderr
    found = json.loads(done.stdout)
    assert found["Sum"] == digest
    return Path(found["Dir"])
