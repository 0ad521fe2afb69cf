"""contrib/openjd: the template as OpenJD's own program reads and runs it, and its script with a stand-in for primray."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
import yaml  # type: ignore[import-untyped]

ROOT = Path(__file__).parents[2]
TEMPLATE = ROOT / "contrib/openjd/usd-render.yaml"


def openjd() -> str:
    found = shutil.which("openjd") or os.environ.get("OPENJD")
    if not found:
        pytest.skip("skipped: no openjd")
    return found


def template() -> Any:
    return yaml.safe_load(TEMPLATE.read_text())


def test_openjd_accepts_and_runs_it(tmp_path: Path) -> None:
    program = openjd()
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    subprocess.run([program, "check", TEMPLATE], check=True, env=environment)
    scene = ROOT / "scenes/analytic/furnace_half.usda"
    asked = [f"Scene={scene}", "Frames=1-2", f"OutputFolder={tmp_path / 'it is'}", "Width=32", "Height=32", "MaxSamples=16"]
    command = [program, "run", str(TEMPLATE), *[part for each in asked for part in ("-p", each)]]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout
    assert sorted(path.name for path in (tmp_path / "it is").iterdir()) == ["beauty.0001.exr", "beauty.0002.exr"]


def test_its_parameters_are_described_and_used() -> None:
    document = template()
    assert document["specificationVersion"] == "jobtemplate-2023-09"
    text = str(document["steps"])
    for parameter in document["parameterDefinitions"]:
        assert parameter["description"].endswith(".")
        assert f"{{{{Param.{parameter['name']}}}}}" in text
    (task,) = document["steps"][0]["parameterSpace"]["taskParameterDefinitions"]
    assert task == {"name": "Frame", "type": "INT", "range": "{{Param.Frames}}"}


def run_script(tmp_path: Path, stand_in: str, **parameters: str) -> subprocess.Popen[str]:
    """The embedded script, its places filled in, with `stand_in` as primray."""
    document = template()
    values = {each["name"]: str(each.get("default", "")) for each in document["parameterDefinitions"]} | parameters
    action = document["steps"][0]["script"]["actions"]["onRun"]
    script = document["steps"][0]["script"]["embeddedFiles"][0]["data"]

    def filled(text: str) -> str:
        for name, value in values.items():
            text = text.replace(f"{{{{Param.{name}}}}}", value)
        return text.replace("{{Task.Param.Frame}}", "7").replace("{{Task.File.Run}}", str(tmp_path / "run.sh"))

    (tmp_path / "run.sh").write_text(filled(script))
    assert "{{" not in filled(script)
    fake = tmp_path / "bin/primray"
    fake.parent.mkdir()
    fake.write_text(f"#!/usr/bin/env bash\n{stand_in}\n")
    fake.chmod(0o755)
    environment = {**os.environ, "PATH": f"{fake.parent}{os.pathsep}{os.environ['PATH']}"}
    command = [action["command"], *map(filled, action["args"])]
    return subprocess.Popen(command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True)


def test_the_script_passes_what_was_asked_for(tmp_path: Path) -> None:
    shown = """printf '[%s]' "$@"; echo; echo '{"type": "progress", "fraction": 0.425}'; echo 'other'"""
    name = {"Scene": 'it\'s "a" $(scene).usda', "OutputFolder": "out put"}
    process = run_script(tmp_path, shown, **name, Camera="/cam", Width="640", TargetError="0.01", MaxSamples="8", Threads="2")
    out, _ = process.communicate(timeout=20)
    assert process.returncode == 0
    arguments = '[render][it\'s "a" $(scene).usda][-o][out put/beauty.####.exr][--frames][7][--json]'
    options = "[--camera][/cam][--res][640][0][--target-error][0.01][--spp][8][--threads][2]"
    assert sorted(out.splitlines()) == sorted([arguments + options, "openjd_progress: 42", "other"])
    assert (tmp_path / "out put").is_dir()


@pytest.mark.parametrize(
    ("code", "ends", "says"), [(0, 0, ""), (5, 0, "openjd_status: ended above"), (3, 3, "openjd_fail: primray ended with 3")]
)
def test_how_it_ends(tmp_path: Path, code: int, ends: int, says: str) -> None:
    process = run_script(
        tmp_path, f"[[ $* == *--res* || $* == *--target* || $* == *--spp* ]] && exit 9; exit {code}", Scene="a.usda"
    )
    out, _ = process.communicate(timeout=20)
    assert process.returncode == ends
    assert says in out


def test_a_task_that_is_canceled_lets_the_renderer_save(tmp_path: Path) -> None:
    saving = """trap 'sleep 0.3; echo saved; exit 130' TERM; echo started; while :; do sleep 0.05; done"""
    process = run_script(tmp_path, saving, Scene="a.usda")
    assert process.stdout is not None
    assert process.stdout.readline() == "started\n"
    begun = time.monotonic()
    process.send_signal(signal.SIGTERM)
    out, _ = process.communicate(timeout=20)
    assert time.monotonic() - begun < 10
    assert "saved" in out
    assert process.returncode == 130
