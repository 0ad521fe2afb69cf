"""Everything in examples/ runs and makes what it says; notebook and service's client are run beside those they are of."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np

import primray

FOLDER = Path(__file__).resolve().parents[2] / "examples"
ELSEWHERE = {"notebook.ipynb", "view.ipynb", "service_client.py", "shot.usda", "README.md"}


def run(*command: object, cwd: Path, **variables: object) -> str:
    """What it says; it must end well."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = os.environ | {"PATH": path} | {name: str(value) for name, value in variables.items()}
    ended = subprocess.run([str(c) for c in command], cwd=cwd, env=environment, capture_output=True, text=True, timeout=120)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout


def test_command_line(tmp_path: Path) -> None:
    said = run(FOLDER / "command_line.sh", cwd=tmp_path, OUT=tmp_path)
    assert "relMSE" in said
    assert "unchanged" in said
    assert {"shot.exr", "shot.png", "shot.json", "good.exr"} <= {path.name for path in tmp_path.iterdir()}


def test_library(tmp_path: Path) -> None:
    assert "error" in run(sys.executable, FOLDER / "library.py", cwd=tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"shot.exr", "shot.png", "closer.png"}


def test_numpy(tmp_path: Path) -> None:
    said = run(sys.executable, FOLDER / "numpy_picture.py", cwd=tmp_path)
    covered = re.search(r"covers ([\d.]+)%", said)
    assert covered is not None
    assert 10 < float(covered[1]) < 40


def test_farm_gives_the_bits_of_one_render(tmp_path: Path) -> None:
    run(FOLDER / "farm.sh", cwd=tmp_path, OUT=tmp_path)
    line = [FOLDER / "shot.usda", "-o", tmp_path / "one.exr", "--res", "160", "0", "--seed", "7", "--sample-range", "0:32"]
    run("primray", "render", *line, cwd=tmp_path)
    whole, one = (primray.read_image(tmp_path / name).pixels for name in ("whole.exr", "one.exr"))
    assert np.array_equal(whole, one)


def test_pytest_comparison(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", FOLDER / "test_pictures.py"]
    run(*command, "--primray-update", cwd=tmp_path, PRIMRAY_REFERENCES=tmp_path)
    assert (tmp_path / "shot.exr").exists()
    assert "[100%]" in run(*command, cwd=tmp_path, PRIMRAY_REFERENCES=tmp_path)


def test_every_example_is_listed_and_run() -> None:
    here = {path.name for path in FOLDER.iterdir() if path.is_file()}
    listed = set(re.findall(r"^\| \[(\S+)\]", (FOLDER / "README.md").read_text(encoding="utf-8"), re.MULTILINE))
    assert listed == here - {"shot.usda", "README.md"}
    assert here - ELSEWHERE <= set(re.findall(r'"([\w.]+)"', Path(__file__).read_text(encoding="utf-8")))
