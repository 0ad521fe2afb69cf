"""ARCHITECTURE.md names every folder, and its recipes are true and complete."""

from __future__ import annotations

import pytest

from .architecture import PAGE, ROOT, WITNESSES, folder_faults, folders, omissions, recipe_faults, recipes

TEXT = PAGE.read_text(encoding="utf-8")
ROOMS = ("renderer/primray/", "renderer/core/")


def test_it_names_every_folder():
    assert not list(folder_faults(folders(TEXT), ROOMS))


def test_its_recipes_are_true():
    assert not list(recipe_faults(recipes(TEXT)))


def test_its_recipes_are_complete():
    assert not list(omissions(recipes(TEXT)))


def test_a_file_that_a_recipe_omits_is_seen():
    found = recipes(TEXT)
    without = found | {"A light type": [step for step in found["A light type"] if "photometry" not in step.path]}
    assert [fault for fault in omissions(without) if "photometry/" in fault]
    assert list(omissions(found, {"A route": r"^no_file_has_this$"})) == ["A route: no file has ^no_file_has_this$"]
    assert WITNESSES.keys() <= found.keys()


@pytest.fixture
def tree(tmp_path):
    for name in ("pkg/table.py", "pkg/inner/__init__.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    return tmp_path


def page(*lines: str) -> str:
    return "\n".join(["### A route", "", *lines, "", "## After", "", "1. `not/of/it.py`", ""])


def test_a_good_recipe_has_no_fault(tree):
    found = recipes(page("1. new `pkg/NAME.py`: what it does", "2. `pkg/table.py`: a line"))
    assert [step.path for step in found["A route"]] == ["pkg/NAME.py", "pkg/table.py"]
    assert not list(recipe_faults(found, tree))


@pytest.mark.parametrize(
    ("lines", "why"),
    [
        ((), "names no file"),
        (("1. `pkg/table.py`", "2. `pkg/table.py`"), "names a file twice"),
        (("1. `pkg/gone.py`",), "pkg/gone.py is not there"),
        (("1. `pkg`",), "pkg is not there"),
        (("1. new `pkg/new.py`",), "is not a new NAME"),
        (("1. new `other/NAME.py`",), "is not a new NAME"),
        (("1. new `pkg/NAME.hpp`",), "is not a new NAME"),
    ],
)
def test_each_fault_of_a_recipe_is_seen(tree, lines, why):
    found = list(recipe_faults(recipes(page(*lines)), tree))
    assert any(why in fault for fault in found), found


def test_faults_of_the_table_of_folders_are_seen(tree):
    text = "| `pkg/` | what |\n|---|---|\n| its own files | table |\n| `inner/` | room |\n\nAfter.\n"
    assert folders(text) == ["pkg/inner/"]
    assert not list(folder_faults(folders(text), ("pkg/",), tree))
    assert list(folder_faults(["pkg/outer/"], ("pkg/",), tree)) == ["pkg/outer/ is not there", "pkg/inner/ is not named"]


def test_the_folders_are_there():
    assert all((ROOT / room).is_dir() for room in ROOMS)
