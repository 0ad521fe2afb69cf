"""Names and labels of what lies in native instances: the same whatever stands first, and whatever a mask leaves."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import primray
from primray.images.cryptomatte import hash_of

CARD = """def Mesh "card" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-0.4, -0.4, 0), (0.4, -0.4, 0), (0.4, 0.4, 0), (-0.4, 0.4, 0)]
    uniform token subdivisionScheme = "none"
    token[] semantics:labels:class = ["card"]
    rel material:binding = </leaf/paint>
}
"""
LEAF = f"""#usda 1.0
(
    defaultPrim = "leaf"
)
def Xform "leaf" (
    prepend variantSets = "size"
    variants = {{
        string size = "small"
    }}
)
{{
    {CARD}
    def "twig"
    {{
    }}
    def Material "paint"
    {{
        token outputs:surface.connect = </leaf/paint/s.outputs:surface>
        def Shader "s"
        {{
            uniform token info:id = "UsdPreviewSurface"
            token outputs:surface
        }}
    }}
    variantSet "size" = {{
        "small" {{
        }}
        "wide" {{
            double3 xformOp:scale = (1.1, 1, 1)
            uniform token[] xformOpOrder = ["xformOp:scale"]
        }}
    }}
}}
"""
TREE = """#usda 1.0
(
    defaultPrim = "tree"
)
def Xform "tree"
{
    def "inner" (
        instanceable = true
        references = @parts/leaf.usda@
    )
    {
    }
    def PointInstancer "buds"
    {
        rel prototypes = </tree/buds/bud>
        int[] protoIndices = [0]
        point3f[] positions = [(0, 1, 0)]
        def "bud" (
            references = @parts/leaf.usda@
        )
        {
        }
    }
}
"""
HEAD = """#usda 1.0
(
    upAxis = "Y"
)
def Camera "cam"
{
    token projection = "orthographic"
    float horizontalAperture = 80
    float verticalAperture = 40
    double3 xformOp:translate = (0, 0, 10)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
THINGS = {
    "a": ("leaf.usda", -3.0, ""),
    "b": ("leaf.usda", -2.0, ""),
    "wide": ("leaf.usda", -1.0, 'variants = {\n string size = "wide"\n}\n'),
    "c": ("tree.usda", 0.0, ""),
    "d": ("tree.usda", 1.0, ""),
    "k": ("", 2.0, "inherits = </_kind>\n"),
    "l": ("", 3.0, "inherits = </_kind>\n"),
}
KIND = 'class "_kind"\n{\n' + CARD.replace("rel material:binding = </leaf/paint>", "") + "}\n"
AOVS = ("crypto_object", "crypto_material", "crypto_asset", "prim", "material", "labels:class")


def thing(name: str) -> str:
    file, x, more = THINGS[name]
    arc = f"references = @{'parts/' if file == 'leaf.usda' else ''}{file}@\n" if file else ""
    return f"""def Xform "{name}" (
    instanceable = true
    {arc}{more}
)
{{
    token[] semantics:labels:class = ["of_{name}"]
    double3 xformOp:translate = ({x}, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""


def rendered(folder: Path, names: list[str], mask: tuple[str, ...] | None = None) -> primray.Image:
    (folder / "parts").mkdir(exist_ok=True)
    (folder / "parts/leaf.usda").write_text(LEAF)
    (folder / "tree.usda").write_text(TREE)
    path = folder / f"{'-'.join(names)}.usda"
    path.write_text(HEAD + KIND + "".join(map(thing, names)))
    settings: dict[str, Any] = {"aovs": AOVS, "resolution": (80, 40), "spp": 4, "progress": False, "camera": "/cam"}
    return primray.render(path, mask=mask, **settings)


def manifest_of(aov: Any) -> dict[str, str]:
    (text,) = (value for key, value in aov.metadata.items() if key.endswith("/manifest"))
    return dict(json.loads(text))


def at(image: primray.Image, aov: str, name: str, y: float = 0.0) -> str:
    """What is said to be there, at a thing's centre."""
    row, column = int((2 - y) * 10), int((THINGS[name][1] + 4) * 10)
    found = image.aovs[aov]
    if aov.startswith("crypto"):
        number = int(np.ascontiguousarray(found.values[row, column, :1]).view(np.uint32)[0])
        return next(key for key, value in manifest_of(found).items() if int(value, 16) == number)
    return str((found.ids or {}).get(int(found.values[row, column, 0]), ""))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("names")


@pytest.fixture(scope="module")
def whole(folder: Path) -> primray.Image:
    return rendered(folder, list(THINGS))


NAMES = {
    ("a", 0.0): ("/a", "parts/leaf.usda</leaf/card>{size=small}"),
    ("b", 0.0): ("/b", "parts/leaf.usda</leaf/card>{size=small}"),
    ("wide", 0.0): ("/wide", "parts/leaf.usda</leaf/card>{size=wide}"),
    ("c", 0.0): ("/c/inner", "parts/leaf.usda</leaf/card>{size=small}"),
    ("d", 0.0): ("/d/inner", "parts/leaf.usda</leaf/card>{size=small}"),
    ("d", 1.0): ("/d/buds[0]", "parts/leaf.usda</leaf/card>"),
    ("k", 0.0): ("/k", "/_kind/card"),
    ("l", 0.0): ("/l", "/_kind/card"),
}


@pytest.mark.parametrize(("name", "y"), NAMES)
def test_they_are_called_by_where_they_are_defined(name: str, y: float, whole: primray.Image) -> None:
    instance, prim = NAMES[name, y]
    assert at(whole, "crypto_object", name, y) == f"{instance}|{prim}"
    assert at(whole, "crypto_asset", name, y) == instance
    assert at(whole, "prim", name, y) == prim
    if "leaf" in prim:
        assert at(whole, "material", name, y) == at(whole, "crypto_material", name, y) == prim.replace("card", "paint")


def test_the_order_of_prims_does_not_matter(whole: primray.Image, folder: Path) -> None:
    again = rendered(folder, list(THINGS)[::-1])
    for aov in AOVS:
        assert np.array_equal(whole.aovs[aov].values, again.aovs[aov].values), aov
        assert (whole.aovs[aov].ids or {}) == (again.aovs[aov].ids or {})
        assert whole.aovs[aov].metadata == again.aovs[aov].metadata


@pytest.mark.parametrize("names", [("b",), ("d", "l"), ("wide", "c", "k")], ids="+".join)
def test_what_a_mask_leaves_has_the_same_names(names: tuple[str, ...], whole: primray.Image, folder: Path) -> None:
    masked = rendered(folder, list(THINGS), tuple(f"/{name}" for name in names))
    for aov in AOVS:
        for name in names:
            assert at(masked, aov, name) == at(whole, aov, name), aov
    for aov in AOVS[:3]:
        assert manifest_of(masked.aovs[aov]).items() <= manifest_of(whole.aovs[aov]).items()


@pytest.mark.parametrize("aov", AOVS[:3])
def test_each_id_that_covers_is_in_the_manifest(aov: str, whole: primray.Image) -> None:
    values = whole.aovs[aov].values
    ids = np.ascontiguousarray(values[..., 0::2]).view(np.uint32)[values[..., 1::2] > 0]
    manifest = manifest_of(whole.aovs[aov])
    assert set(np.unique(ids).tolist()) == {int(number, 16) for number in manifest.values()}
    assert all(int(number, 16) == hash_of(name) for name, number in manifest.items())


def test_labels_are_those_of_the_instance_itself(whole: primray.Image) -> None:
    for name in THINGS:
        assert at(whole, "labels:class", name) == f"card,of_{name}"
    assert at(whole, "labels:class", "d", 1.0) == "card,of_d"


PRUNED = """def RenderPass "pass"
{
    rel collection:prune:includes = [</b/twig>, </d/inner/twig>]
}
"""


@pytest.mark.parametrize("names", [("b",), ("d",), ("a", "b", "d")], ids="+".join)
def test_instances_that_a_pass_takes_apart_keep_names_of_materials_and_assets(
    names: tuple[str, ...], whole: primray.Image, folder: Path
) -> None:
    """Where no others are left, too."""
    path = folder / f"pass-{'-'.join(names)}.usda"
    path.write_text(HEAD + KIND + "".join(map(thing, names)) + PRUNED)
    image = primray.render(path, aovs=AOVS, resolution=(80, 40), spp=4, camera="/cam", render_pass="/pass", progress=False)
    for aov in ("crypto_material", "crypto_asset", "material"):
        assert at(image, aov, names[-1]) == at(whole, aov, names[-1])
