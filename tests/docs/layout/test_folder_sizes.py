"""No folder holds more than a reader takes in at a glance."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

from .folder_sizes import ROOMS, size_faults, units

ROOT = Path(__file__).resolve().parents[3]
MADE = (".pyc", ".so", ".lock")


def files() -> list[PurePosixPath]:
    found = [path for room in ROOMS for path in (ROOT / room).rglob("*") if path.is_file() and path.suffix not in MADE]
    return [PurePosixPath(path.relative_to(ROOT).as_posix()) for path in found if not path.name.startswith(".")]


def test_no_folder_is_too_large():
    assert not list(size_faults(units(files())))


def test_a_header_and_its_source_are_one_unit_and_what_a_folder_says_of_itself_is_none():
    names = ("a.hpp", "a.cpp", "a.py", "b.cpp", "__init__.py", "README.md")
    assert units(PurePosixPath(f"renderer/core/x/{name}") for name in names) == {"renderer/core/x": 3}


def test_one_too_many_is_seen():
    assert list(size_faults({"x": 21, "y": 20})) == ["x: 21 units, 20 are allowed; make folders in it"]
