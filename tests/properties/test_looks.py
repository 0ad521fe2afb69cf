"""Looks made by chance: USD binds on the composed stage what MaterialX's text says, judged by its own matching of paths."""

from __future__ import annotations

import random
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import MaterialX
import pytest
from pxr import Sdf, UsdShade

from primray.diagnostics import Diagnostics
from primray.usd import open_stage

TREE = ["/a", "/a/b", "/a/b/c", "/a/b/c/d", "/a/b1", "/a/x", "/a/x/b", "/a/x/y", "/a/x/y/b"]
TREE += ["/b", "/b/a", "/ab", "/ab/c1", "/ab/c2"]
LITERAL = ["/", "/a", "/a/b", "/a/b/c", "/a/b/c/d", "/a/x", "/b", "/b/a", "/ab", "/gone", "a/b", "/a/"]
WILD = ["/a*", "/*", "/a/b?", "/a/*", "/*/b", "/ab/c[0-1]", "/{a,ab}/{b,c1}"]
DEEP = ["/a//b", "//b", "/a//c", "//*", "/a//*", "//*//", "/a//", "//c*", "/*//b"]
MATERIALS = ["M0", "M1", "M2", "M3", "M4"]


@dataclass
class Made:
    """A document and what it says: names that each collection includes and excludes, and to what each material is assigned."""

    text: str
    collections: dict[str, tuple[list[str], list[str], list[str]]]  # names, other collections, names that are excluded
    assigned: list[tuple[str, list[str], str]]  # material, names, collection; in order


def made(rng: random.Random, names: list[str]) -> Made:
    def some() -> list[str]:
        return [rng.choice(names) for _ in range(rng.randint(1, 3))]

    parts = [
        f'<surface_unlit name="S{m}" type="surfaceshader"/><surfacematerial name="{m}" type="material">'
        f'<input name="surfaceshader" type="surfaceshader" nodename="S{m}"/></surfacematerial>'
        for m in MATERIALS
    ]
    collections = {}
    for i in range(3):
        others = [f"c{i - 1}"] if i and rng.random() < 0.5 else []
        collections[f"c{i}"] = held = (some(), others, some() if rng.random() < 0.5 else [])
        kinds = ("includegeom", "includecollection", "excludegeom")
        listed = " ".join(f'{kind}="{", ".join(values)}"' for kind, values in zip(kinds, held, strict=True))
        parts.append(f'<collection name="c{i}" {listed}/>')
    assigned = []
    for look in ('name="base"', 'name="L" inherit="base"'):
        inside = ""
        for _ in range(rng.randint(1, 4)):
            names_or_none, collection = (some(), "") if rng.random() < 0.6 else ([], f"c{rng.randrange(3)}")
            one = (rng.choice(MATERIALS), names_or_none, collection)
            assigned.append(one)
            to = f'geom="{", ".join(one[1])}"' if one[1] else f'collection="{one[2]}"'
            inside += f'<materialassign name="m{len(assigned)}" material="{one[0]}" {to}/>'
        parts.append(f"<look {look}>{inside}</look>")
    return Made(f'<materialx version="1.39">{"".join(parts)}</materialx>', collections, assigned)


@cache
def pattern(name: str) -> re.Pattern[str]:
    """Return a regular expression for the paths that an expression names."""
    below = "(?:/.*)?" if name.endswith("//") else ""
    tokens = {"//": "/(?:[^/]+/)*", "*": "[^/]*", "?": "[^/]", "{": "(?:", "}": ")", ",": "|"}
    return re.compile(re.sub(r"//|[*?{},]", lambda found: tokens[found[0]], name.removesuffix("//")) + below)


def is_location(name: str, path: str, is_leaf: bool) -> bool:
    if name in LITERAL:  # MaterialX's own function knows no wildcards
        return bool(MaterialX.geomStringsMatch(name, path, True) and MaterialX.geomStringsMatch(path, name, True))
    if path == "/" or (name.endswith("//*") and not is_leaf):
        return False
    return pattern(name).fullmatch(path) is not None


def depth(names: list[str], path: str, is_leaf: bool) -> int:
    """Return how deep the deepest location is that covers a path; -1 for none."""
    parts = path.split("/")[1:]
    return max(
        (
            at
            for at in range(len(parts) + 1)
            for name in names
            if is_location(name, "/" + "/".join(parts[:at]), is_leaf and at == len(parts))
        ),
        default=-1,
    )


def depth_of_collection(name: str, path: str, is_leaf: bool, document: Made) -> int:
    included, others, excluded = document.collections[name]
    if depth(excluded, path, is_leaf) >= 0:
        return -1
    return max([depth(included, path, is_leaf), *(depth_of_collection(other, path, is_leaf, document) for other in others)])


def wanted(document: Made, path: str, is_leaf: bool) -> str:
    """Return the material that holds for a path: of the location closest to the leaf, and of these the last."""
    found, best = "", -1
    for material, names, collection in document.assigned:
        at = depth_of_collection(collection, path, is_leaf, document) if collection else depth(names, path, is_leaf)
        if at >= 0 and at >= best:
            found, best = material, at
    return found


def bound(folder: Path, document: Made) -> dict[str, str]:
    """Return the materials that USD finds on the stage, by the paths below the model."""
    (folder / "looks.mtlx").write_text(document.text)
    root = Sdf.Layer.CreateNew(str(folder / "stage.usda"))
    model = Sdf.PrimSpec(root, "Model", Sdf.SpecifierDef, "Xform")
    model.referenceList.prependedItems.append(Sdf.Reference("looks.mtlx", "/ModelRoot"))
    model.variantSelections["LookVariant"] = "L"
    for path in TREE:
        spec = Sdf.CreatePrimInLayer(root, f"/Model{path}")
        spec.specifier, spec.typeName = Sdf.SpecifierDef, "Mesh" if path in leaves() else "Xform"
    root.Save()
    stage = open_stage(folder / "stage.usda", Diagnostics())
    found = {}
    for path in TREE:
        material, _ = UsdShade.MaterialBindingAPI(stage.GetPrimAtPath(f"/Model{path}")).ComputeBoundMaterial()
        references = material.GetPrim().GetPrimStack() if material else []
        found[path] = next((spec.name for spec in references if str(spec.path.GetParentPath()) == "/MaterialX/Materials"), "")
    return found


def leaves() -> list[str]:
    return [path for path in TREE if not any(other.startswith(path + "/") for other in TREE)]


KINDS = {"paths": LITERAL, "wildcards": LITERAL + WILD, "any depth": LITERAL + WILD + DEEP}


@pytest.mark.parametrize("kind", KINDS)
def test_materials_are_bound_as_the_look_says(kind: str, tmp_path: Path) -> None:
    for seed in range(25):
        document = made(random.Random(seed), KINDS[kind])
        found = bound(tmp_path, document)
        for path in leaves():
            assert found[path] == wanted(document, path, True), (seed, path, document.text)
