"""No modules import one another in a circle, no layer imports from a higher one, and each of these rules can fail."""

from __future__ import annotations

from pathlib import PurePosixPath

import pytest

from .architecture import ROOT
from .imports import LAYERS, circles, graph_of, imports_of, layer_faults, sources

SOURCES = sources(ROOT)
IMPORTS = imports_of(SOURCES)
RENDERER = [one for one in IMPORTS if one.importer.startswith("primray.")]


def test_no_modules_import_one_another_in_a_circle():
    assert not [" <-> ".join(circle) for circle in circles(graph_of(IMPORTS))]


def test_no_layer_imports_from_a_higher_one():
    broken = sorted(set(layer_faults(RENDERER, "primray", LAYERS)))
    assert not broken, "\n".join(broken)


def test_what_the_layers_name_is_there_once():
    there = {path.parts[2].removesuffix(".py") for path in SOURCES if path.is_relative_to("renderer/primray")}
    assert sorted(there - {"__init__"}) == sorted(name for names in LAYERS.values() for name in names)


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


@pytest.mark.parametrize(
    ("texts", "why"),
    [
        ({"a__a": "from ..b.b import x", "b__b": ""}, "pkg.a.a imports pkg.b.b, which is in a higher layer"),
        ({"a__a": "def f():\n    from ..b.b import x", "b__b": ""}, "pkg.a.a imports pkg.b.b, which is in a higher layer"),
        ({"b__b": "from ..c import x", "c": ""}, "c is in no layer"),
    ],
)
def test_each_fault_of_the_layers_is_seen(texts, why):
    assert list(layer_faults(tree(**texts), "pkg", {"low": ("a",), "high": ("b",)})) == [why]


def test_imports_within_a_layer_and_downwards_have_no_fault():
    found = tree(b__b="from ..a.a import x\nfrom .c import y\nfrom ..d import z", a__a="", b__c="", d="from .b.c import y")
    assert not list(layer_faults(found, "pkg", {"low": ("a",), "high": ("b", "d")}))
