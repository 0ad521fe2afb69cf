"""What is said of the library is so: every public name has an example that runs, and so do the pages' own."""

from __future__ import annotations

import dataclasses
import doctest
import inspect
import re
import shutil
import warnings
from pathlib import Path

import numpy as np
import pytest

import primray

ROOT = Path(__file__).resolve().parents[2]
STAGE = ROOT / "scenes/features/camera-lens/scene.usda"
STEREO = """#usda 1.0
(
    subLayers = [@./shot.usda@]
)
def Xform "rig"
{
    def Camera "left"
    {
        uniform token stereoRole = "left"
    }
    def Camera "right"
    {
        uniform token stereoRole = "right"
    }
}
"""
PAGES = ("docs/library.md", "docs/notebooks.md", "README.md")
NAMES = [
    name for name in primray.__all__ if inspect.isroutine(getattr(primray, name)) or inspect.isclass(getattr(primray, name))
]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current one, with the stage that examples render."""
    shutil.copy(STAGE, tmp_path / "shot.usda")
    (tmp_path / "stereo.usda").write_text(STEREO)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", NAMES)
def test_every_public_name_has_an_example_that_runs(name: str, folder: Path) -> None:
    text = inspect.getdoc(getattr(primray, name)) or ""
    names = {"primray": primray, "np": np, "dataclasses": dataclasses, "warnings": warnings}
    test = doctest.DocTestParser().get_doctest(text, names, name, None, None)
    assert test.examples, f"the docstring of primray.{name} has no example"
    said: list[str] = []
    with warnings.catch_warnings():
        doctest.DocTestRunner().run(test, out=said.append)
    assert not said, "".join(said)


def test_the_package_has_one(folder: Path) -> None:
    assert not doctest.testmod(primray).failed
    assert doctest.testmod(primray).attempted


@pytest.mark.parametrize("page", PAGES)
def test_the_examples_of_a_page_run(page: str, folder: Path) -> None:
    blocks = re.findall(r"^```python\n(.*?)^```", (ROOT / page).read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    assert blocks
    if page == "docs/notebooks.md":
        pytest.importorskip("anywidget", reason="skipped: no anywidget")
    names: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, page, "exec"), names)  # its claims are the assertions below


def test_what_the_page_says_a_line_gives(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Shapes and messages in its comments."""
    page = (ROOT / "docs/library.md").read_text(encoding="utf-8")
    names: dict[str, object] = {}
    for block in re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL):
        exec(compile(block, "library.md", "exec"), names)
        for expression, shape in re.findall(r"^((?:image|closer)\S+) +# (\([\d, ]+\))", block, re.MULTILINE):
            assert str(np.shape(eval(expression, names))) == shape, expression
        printed = re.search(r"print\(error\) +# (.*)", block)
        assert printed is None or printed[1] in capsys.readouterr().out
    assert "RGBA" in repr(names["image"])


@pytest.mark.parametrize("name", [name for name in NAMES if inspect.isclass(getattr(primray, name))])
def test_public_classes_say_what_they_are(name: str) -> None:
    """In words of their own: a dataclass's generated docstring is its signature."""
    text = vars(getattr(primray, name))["__doc__"]
    assert text
    assert not text.startswith(f"{name}(")
