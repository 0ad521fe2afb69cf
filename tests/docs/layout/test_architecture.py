"""ARCHITECTURE.md names every room, and its lists of files to touch are true."""

from __future__ import annotations

import pytest

from .architecture import BUDGETS, PAGE, ROOT, folder_faults, folders, recipe_faults, recipes

TEXT = PAGE.read_text(encoding="utf-8")
ROOMS = ("renderer/primray/", "renderer/core/")


def test_it_names_every_room():
    assert not list(folder_faults(folders(TEXT), ROOMS))


def test_its_lists_are_true():
    assert not list(recipe_faults(recipes(TEXT)))


GOOD = {title: [f"### {title}", "", "1. new `pkg/NAME.py`: what it does", "2. `pkg/table.py`: a line", ""] for title in BUDGETS}


@pytest.fixture
def tree(tmp_path):
    for name in ("pkg/table.py", "pkg/inner/__init__.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    return tmp_path


def page(**changed: list[str]) -> str:
    return "\n".join(line for lines in (GOOD | changed).values() for line in lines) + "\n## After\n\n1. `not/of/it.py`\n"


def test_good_lists_have_no_fault(tree):
    found = recipes(page())
    assert [step.path for step in found["A route"]] == ["pkg/NAME.py", "pkg/table.py"]
    assert not list(recipe_faults(found, tree))


@pytest.mark.parametrize(
    ("lines", "why"),
    [
        ([], "A route: has no list"),
        (["### A route"], "0 files, 3 are allowed"),
        (["### A route", *(f"{i}. new `pkg/NAME{i}.py`" for i in range(4))], "4 files, 3 are allowed"),
        (["### A route", "1. `pkg/table.py`", "2. `pkg/table.py`"], "names a file twice"),
        (["### A route", "1. `pkg/gone.py`"], "pkg/gone.py is not there"),
        (["### A route", "1. `pkg`"], "pkg is not there"),
        (["### A route", "1. new `pkg/new.py`"], "is not a new NAME"),
        (["### A route", "1. new `other/NAME.py`"], "is not a new NAME"),
        (["### A route", "1. new `pkg/NAME.hpp`"], "is not a new NAME"),
        (["### A kitchen", "1. `pkg/table.py`"], "is no list that is asked for"),
    ],
)
def test_each_fault_of_a_list_is_seen(tree, lines, why):
    found = list(recipe_faults(recipes(page(**{"A route": lines})), tree))
    assert any(why in fault for fault in found), found


def test_faults_of_the_table_of_rooms_are_seen(tree):
    text = "| `pkg/` | what |\n|---|---|\n| its own files | table |\n| `inner/` | room |\n\nAfter.\n"
    assert folders(text) == ["pkg/inner/"]
    assert not list(folder_faults(folders(text), ("pkg/",), tree))
    assert list(folder_faults(["pkg/outer/"], ("pkg/",), tree)) == ["pkg/outer/ is not there", "pkg/inner/ is not named"]


def test_the_rooms_are_there():
    assert all((ROOT / room).is_dir() for room in ROOMS)
