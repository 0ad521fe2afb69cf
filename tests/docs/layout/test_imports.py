"""Modules import one another in no circle, folders only those before them, and each of these rules can fail."""

from __future__ import annotations

from pathlib import PurePosixPath

import pytest

from .architecture import PAGE, ROOT, folders
from .imports import ORDER, circles, graph_of, imports_of, order_faults, rooms, sources

SOURCES = sources(ROOT)
IMPORTS = imports_of(SOURCES)
RENDERER = [one for one in IMPORTS if one.importer.startswith("primray.")]


def test_no_modules_import_one_another_in_a_circle():
    assert not [" <-> ".join(circle) for circle in circles(graph_of(IMPORTS))]


def test_folders_import_only_those_before_them():
    broken = sorted(set(order_faults(RENDERER, "primray", ORDER)))
    assert not broken, "\n".join(broken)


def test_rooms_of_usd_import_one_another_in_no_circle():
    assert not [" <-> ".join(circle) for circle in circles(rooms(IMPORTS, "primray.usd"))]


def test_the_order_is_that_of_the_table():
    base = "renderer/primray/"
    named = [name.removeprefix(base).rstrip("/") for name in folders(PAGE.read_text(encoding="utf-8")) if name.startswith(base)]
    assert [row for row in ORDER if (ROOT / base / row).is_dir()] == named


def test_each_place_in_the_order_is_there():
    there = {path.parts[2].removesuffix(".py") for path in SOURCES if path.is_relative_to("renderer/primray")}
    assert there - {"__init__"} == set(ORDER)


def test_the_modules_are_found():
    assert len(graph_of(IMPORTS)) > 300
    assert any(one.importer == "primray.render.render" and one.imported == "primray.sampling.sampling" for one in IMPORTS)


def tree(**texts: str):
    """Imports of a package whose modules have these texts, "__" in their names being a slash."""
    return imports_of({PurePosixPath(f"renderer/pkg/{name.replace('__', '/')}.py"): text for name, text in texts.items()})


@pytest.mark.parametrize(
    ("texts", "found"),
    [
        ({"a": "from . import b", "b": "from .c import x", "c": "import pkg.a"}, [["pkg.a", "pkg.b", "pkg.c"]]),
        ({"a": "if TYPE_CHECKING:\n    from .b import x", "b": "from .a import y"}, [["pkg.a", "pkg.b"]]),
        ({"a__a": "from ..b.b import x", "b__b": "from ..a import a"}, [["pkg.a.a", "pkg.b.b"]]),
        ({"a": "def f():\n    from .b import x", "b": "from .a import y"}, []),
        ({"a": "from .b import x", "c": "from .b import x\nfrom .a import y", "b": "import os"}, []),
    ],
)
def test_circles_are_found(texts, found):
    assert circles(graph_of(tree(**texts))) == found


def test_a_circle_of_rooms_needs_no_circle_of_modules():
    found = tree(a__a="from ..b.b import x", b__b="x = 1", b__c="from ..a.b import x", a__b="x = 1")
    assert circles(graph_of(found)) == []
    assert circles(rooms(found, "pkg")) == [["a", "b"]]


@pytest.mark.parametrize(
    ("texts", "why"),
    [
        ({"a__a": "from ..b.b import x", "b__b": ""}, "pkg.a.a imports pkg.b.b, which comes later"),
        ({"a__a": "def f():\n    from ..b.b import x", "b__b": ""}, "pkg.a.a imports pkg.b.b, which comes later"),
        ({"b__b": "from ..c import x", "c": ""}, "c has no place in the order"),
    ],
)
def test_each_fault_of_the_order_is_seen(texts, why):
    assert list(order_faults(tree(**texts), "pkg", ("a", "b"))) == [why]


def test_what_is_in_order_has_no_fault():
    found = tree(b__b="from ..a.a import x\nfrom .c import y", a__a="", b__c="")
    assert not list(order_faults(found, "pkg", ("a", "b")))
