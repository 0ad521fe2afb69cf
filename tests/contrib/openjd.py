"""OpenJD's own program, and a template's scripts with a stand-in for primray."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml  # type: ignore[import-untyped]

ROOT = Path(__file__).parents[2]
BESIDE = Path(sys.executable).parent  # where this Python's programs are
ENVIRONMENT = {**os.environ, "PATH": f"{BESIDE}{os.pathsep}{os.environ['PATH']}"}


def openjd(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    program = shutil.which("openjd", path=ENVIRONMENT["PATH"])
    if program is None:
        pytest.skip("skipped: no openjd")
    done = subprocess.run([program, *arguments], env=ENVIRONMENT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    return done


def parameters(*asked: str) -> list[str]:
    return [part for each in asked for part in ("-p", each)]


def document(template: Path) -> Any:
    return yaml.safe_load(template.read_text())


def check_parameters(template: Path) -> None:
    """They are described and used."""
    found = document(template)
    assert found["specificationVersion"] == "jobtemplate-2023-09"
    text = str(found["steps"])
    for parameter in found["parameterDefinitions"]:
        assert parameter["description"].endswith(".")
        assert f"{{{{Param.{parameter['name']}}}}}" in text


def run_script(template: Path, step: int, folder: Path, stand_in: str, **values: str) -> subprocess.Popen[str]:
    """A step's embedded script in `folder`, its places filled in, with `stand_in` as primray. `values`: of parameters, and by
    Task_Param_NAME of the task's."""
    found = document(template)
    places = {f"Param.{each['name']}": str(each.get("default", "")) for each in found["parameterDefinitions"]}
    for name, value in values.items():
        places[name.replace("_", ".") if name.startswith("Task_") else f"Param.{name}"] = value
    places |= {"Task.File.Run": str(folder / "run.sh"), "Session.WorkingDirectory": str(folder)}
    script = found["steps"][step]["script"]

    def filled(text: str) -> str:
        for place, value in places.items():
            text = text.replace(f"{{{{{place}}}}}", value)
        return text

    (folder / "run.sh").write_text(filled(script["embeddedFiles"][0]["data"]))
    assert "{{" not in (folder / "run.sh").read_text()
    fake = folder / "bin/primray"
    fake.parent.mkdir(exist_ok=True)
    fake.write_text(f"#!/usr/bin/env bash\n{stand_in}\n")
    fake.chmod(0o755)
    environment = {**os.environ, "PATH": f"{fake.parent}{os.pathsep}{os.environ['PATH']}"}
    action = script["actions"]["onRun"]
    command = [action["command"], *map(filled, action["args"])]
    return subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True)
