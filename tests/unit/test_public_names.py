"""The package's names: `dir`, star imports, type checkers and attribute access agree about them."""

from __future__ import annotations

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import primray

SOURCE = Path(primray.__file__)
PROJECT = SOURCE.parents[2]
LAZY = """
import sys, primray
assert dir(primray) == sorted(primray.__all__), set(dir(primray)) ^ set(primray.__all__)
heavy = [name for name in ("numpy", "pxr", "OpenImageIO", "logging", "IPython", "primray.images.image") if name in sys.modules]
assert not heavy, heavy
"""


def test_dir_has_every_public_name_and_costs_nothing() -> None:
    subprocess.run([sys.executable, "-c", LAZY], check=True, capture_output=True, text=True)


def test_every_public_name_is_there() -> None:
    assert not [name for name in primray.__all__ if not hasattr(primray, name)]
    with pytest.raises(AttributeError, match="Nonsense"):
        _ = primray.Nonsense  # type: ignore[attr-defined]


@pytest.mark.parametrize("first", ["primray.compare.comparison", "primray.render.products", "primray.compare.pytest_plugin"])
def test_packages_that_share_a_name_with_a_function_do_not_replace_it(first: str) -> None:
    line = f"import {first}, primray; assert callable(primray.compare) and callable(primray.render)"
    subprocess.run([sys.executable, "-c", line], check=True, capture_output=True, text=True)


def bound_for_type_checkers() -> set[str]:
    """Names that the module binds, those of `if TYPE_CHECKING:` among them, those of `if not TYPE_CHECKING:` not."""
    bound: set[str] = set()
    for node in ast.parse(SOURCE.read_text(encoding="utf-8")).body:
        for inner in node.body if isinstance(node, ast.If) and isinstance(node.test, ast.Name) else [node]:
            if isinstance(inner, ast.ImportFrom):
                bound |= {alias.asname or alias.name for alias in inner.names}
            elif isinstance(inner, ast.FunctionDef):
                bound.add(inner.name)
    return bound


def test_type_checkers_know_the_names_and_that_there_are_no_others() -> None:
    bound = bound_for_type_checkers()
    assert not set(primray.__all__) - bound
    assert "__getattr__" not in bound


@pytest.mark.long
def test_mypy_says_so(tmp_path: Path) -> None:
    good = 'import primray\nimage = primray.render("a.usda", filter="box", resolution=[4, 4])\nx: int = image.to_uint8().ndim\n'
    bad = good + 'primray.Imgae\nprimray.render("a.usda", sppp=4)\nprimray.render("a.usda", filter="gauss")\n'
    (tmp_path / "good.py").write_text(good)
    (tmp_path / "bad.py").write_text(bad)
    line = [sys.executable, "-m", "mypy", "--config-file", str(PROJECT / "pyproject.toml")]
    for name, faults in (("good.py", []), ("bad.py", [4, 5, 6])):
        done = subprocess.run([*line, str(tmp_path / name)], cwd=PROJECT, capture_output=True, text=True)
        lines = [int(text.split(":")[1]) for text in done.stdout.splitlines() if ": error:" in text]
        assert lines == faults, done.stdout


@pytest.mark.parametrize("function", [primray.render, primray.render_products])
def test_completion_and_help_know_every_setting(function: object) -> None:
    assert callable(function)
    settings = set(inspect.signature(primray.RenderSettings).parameters)
    assert settings <= set(inspect.signature(function).parameters)
