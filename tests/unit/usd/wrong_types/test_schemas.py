"""Every attribute of every schema with values of wrong types: a description and diagnostics, never an exception."""

from __future__ import annotations

from pathlib import Path

import pytest

from .schemas import TYPES, applied, of_applied, of_nodes, of_schema, schemas
from .tried import Outcomes, defects, tried

QUICK = ("string", "float")


def written(folder: Path, kind: str) -> None:
    texts: dict[str, str] = {}
    for name, attributes in schemas().items():
        texts |= of_schema(name, attributes, kind)
    texts |= {f"{name} {kind}": of_applied(name, attributes, kind) for name, attributes in applied().items()}
    texts |= of_nodes(kind)
    for name, text in texts.items():
        (folder / f"{name.replace(':', '.')}.usda").write_text(text)


def check(outcomes: Outcomes) -> None:
    assert defects(outcomes) == {}
    assert {name: outcome["error"] for name, outcome in outcomes.items() if "error" in outcome} == {}


def test_the_schemas_are_all_there() -> None:
    found = schemas()
    assert {"Mesh", "SphereLight", "Shader", "SkelAnimation", "RenderProduct", "OpenVDBAsset", "PointInstancer"} <= found.keys()
    assert sum(map(len, found.values())) > 600
    assert {"LightAPI", "SkelBindingAPI", "CollectionAPI:one", "GeomModelAPI", "ShapingAPI"} <= applied().keys()


@pytest.mark.parametrize("kind", QUICK)
def test_all_schemas_with_some_types(kind: str, tmp_path: Path) -> None:
    written(tmp_path, kind)
    outcomes = tried(tmp_path)
    assert len(outcomes) > 180
    check(outcomes)


@pytest.mark.long
@pytest.mark.parametrize("kind", [kind for kind in TYPES if kind not in QUICK])
def test_all_schemas_with_every_type(kind: str, tmp_path: Path) -> None:
    written(tmp_path, kind)
    check(tried(tmp_path))


@pytest.mark.parametrize(
    ("name", "attributes", "code"),
    [
        ("Sphere", ["radius"], "wrong-type"),
        ("Xform", ["xformOp:translate"], "wrong-type"),
        ("Mesh", ["points"], "invalid-mesh"),
        ("SphereLight", ["inputs:intensity"], "wrong-type"),
        ("Camera", ["focalLength"], "wrong-type"),
    ],
)
def test_what_is_wrong_is_told(name: str, attributes: list[str], code: str, tmp_path: Path) -> None:
    for what, text in of_schema(name, attributes, "string"):
        (tmp_path / f"{what.replace(':', '.')}.usda").write_text(text)
    assert all(code in outcome["codes"] for outcome in tried(tmp_path).values())
