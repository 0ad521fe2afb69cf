"""The page about data sets is so: its YAML, its Python and its commands run; and the examples in `primray.dataset`."""

from __future__ import annotations

import doctest
import inspect
import re
import shutil
from pathlib import Path

import pytest

import primray
from primray.cli import run

pytest.importorskip("yaml", reason="no PyYAML")
ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs/datasets.md").read_text(encoding="utf-8")
TINY = (
    (r"samples: \d+", "samples: 2"),
    (r"resolution: \[.*\]", "resolution: [32, 24]"),
    (r"spp: \d+", "spp: 1"),
)


def block(kind: str) -> str:
    found = re.search(rf"^```{kind}\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    assert found
    return found[1]


def test_what_the_page_shows_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pycocotools", reason="no pycocotools")
    pytest.importorskip("h5py", reason="no h5py")
    shutil.copy(ROOT / "tests/unit/dataset/room.usda", tmp_path)
    monkeypatch.chdir(tmp_path)
    text = block("yaml")
    for pattern, small in TINY:
        assert re.search(pattern, text)
        text = re.sub(pattern, small, text)
    Path("set.yaml").write_text(text)
    commands = re.findall(r"^    primray (dataset .*)$", PAGE, re.MULTILINE)
    assert len(commands) == 2
    for command in commands:
        assert run(command.split()) == 0, command
    exec(compile(block("python"), "datasets.md", "exec"), {})
    made = {path.name for path in Path("cell").iterdir()}
    assert made >= {"samples", "coco", "kitti", "bop", "yolo", "hdf5", "dataset.lock.json", "dataset.yaml"}


def test_every_public_name_of_the_package_has_a_docstring_and_its_examples_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copy(ROOT / "scenes/features/camera-lens/scene.usda", tmp_path / "shot.usda")
    monkeypatch.chdir(tmp_path)
    texts = [inspect.getdoc(primray.dataset) or ""]
    for name in primray.dataset.__all__:
        found = inspect.getdoc(getattr(primray.dataset, name))
        assert found, f"primray.dataset.{name} has no docstring"
        texts.append(found)
    said: list[str] = []
    for text in texts:
        test = doctest.DocTestParser().get_doctest(text, {"primray": primray}, "primray.dataset", None, None)
        doctest.DocTestRunner().run(test, out=said.append)
    assert not said, "".join(said)
