"""Bindings: purposes, strength, targets that are not there; subsets of every family, overlapping and incomplete ones."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import UsdShade

from primray.description import Mesh, SceneDescription
from primray.settings import RenderSettings
from primray.usd import translate

from ..usd_text import stage_of, translate_text


def material(name: str) -> str:
    return f"""
def Material "{name}"
{{
    token outputs:surface.connect = </{name}/s.outputs:surface>
    def Shader "s"
    {{
        uniform token info:id = "UsdPreviewSurface"
        token outputs:surface
    }}
}}
"""


MATERIALS = "".join(map(material, ("red", "green", "blue")))


def subset(name: str, indices: list[int], bound: str = "", family: str = "materialBind", element: str = "face") -> str:
    return f"""
    def GeomSubset "{name}" (prepend apiSchemas = ["MaterialBindingAPI"])
    {{
        uniform token elementType = "{element}"
        {f'uniform token familyName = "{family}"' if family else ""}
        int[] indices = {indices}
        {f"rel material:binding = </{bound}>" if bound else ""}
    }}
"""


def mesh(body: str, bound: str = "red") -> str:
    """Four triangles."""
    return f"""
def Mesh "mesh" (prepend apiSchemas = ["MaterialBindingAPI"])
{{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [3, 3, 3, 3]
    int[] faceVertexIndices = [0, 1, 2, 0, 2, 3, 0, 3, 4, 0, 4, 5]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (-1, 1, 0), (-1, 0, 0)]
    rel material:binding = </{bound}>
    {body}
}}
"""


def surfaces_by_face(description: SceneDescription) -> list[str]:
    [shape] = description.shapes
    assert isinstance(shape, Mesh)
    numbers = np.broadcast_to(np.asarray(shape.surface), len(shape.triangles))
    return [description.surfaces[i].path for i in numbers]


def faces_of(text: str) -> tuple[list[str], list[tuple[str, str]]]:
    description, found = translate_text(MATERIALS + text)
    return surfaces_by_face(description), [d for d in found if d[0] not in ("default-light", "camera-automatic")]


@pytest.mark.parametrize("family", ["materialBind", "look", ""])
@pytest.mark.conforms("GeomSubset.indices", "GeomSubset.familyName")
def test_subsets_of_any_family(family: str) -> None:
    faces, found = faces_of(mesh(subset("a", [1, 2], "green", family)))
    assert (faces, found) == (["/red", "/green", "/green", "/red"], [])


@pytest.mark.conforms("GeomSubset.familyName")
def test_the_family_meant_for_materials_wins() -> None:
    for order in (1, -1):
        subsets = [subset("a", [0, 1], "green"), subset("b", [1, 2], "blue", "look")][::order]
        faces, found = faces_of(mesh("".join(subsets)))
        assert (faces, found) == (["/green", "/green", "/blue", "/red"], [])


def test_subsets_without_a_binding() -> None:
    """One of the family meant for it has its mesh's material; of others nothing is expected."""
    faces, found = faces_of(mesh(subset("a", [0]) + subset("b", [1], family="look")))
    assert (faces, found) == (["/red"] * 4, [])


def test_overlapping_subsets_are_told() -> None:
    faces, found = faces_of(mesh(subset("a", [0, 1], "green") + subset("b", [1, 2], "blue")))
    assert (faces, found) == (["/green", "/blue", "/blue", "/red"], [("subset-overlap", "/mesh/b")])


@pytest.mark.conforms("GeomSubset.subsetFamily:NAME:familyType")
def test_a_partition_that_is_none() -> None:
    partition = 'uniform token subsetFamily:materialBind:familyType = "partition"'
    faces, found = faces_of(mesh(partition + subset("a", [0, 1, 2], "green")))
    assert (faces, found) == (["/green"] * 3 + ["/red"], [("subset-incomplete", "/mesh")])
    assert faces_of(mesh(partition + subset("a", [0, 1, 2, 3], "green")))[1] == []
    assert faces_of(mesh(subset("a", [0], "green")))[1] == []


@pytest.mark.parametrize("element", ["point", "edge", "segment"])
@pytest.mark.conforms("GeomSubset.elementType")
def test_subsets_of_other_elements(element: str) -> None:
    faces, found = faces_of(mesh(subset("a", [0], "green", element=element)))
    assert (faces, found) == (["/red"] * 4, [("subset-ignored", "/mesh/a")])


def test_subsets_of_instances_and_the_instances_own_binding() -> None:
    """A stronger binding of the instance overrides the prototype's subsets; a weaker one does not."""
    inside = mesh(subset("a", [0], "green")).replace("</green>", "</source/green>").replace("</red>", "</source/red>")
    source = f'class Xform "source"\n{{\n{MATERIALS}\n{inside}\n}}\n'.replace("</red/", "</source/red/").replace(
        "</green/", "</source/green/"
    )
    for strength, expected in (("weakerThanDescendants", ["green", "red"]), ("strongerThanDescendants", ["blue", "blue"])):
        instance = f"""
def Xform "i" (
    instanceable = true
    references = </source>
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{{
    rel material:binding = </blue> (bindMaterialAs = "{strength}")
}}
"""
        description, _ = translate_text(source + material("blue") + instance)
        names = [path.rsplit("/", 1)[1] for path in surfaces_by_face(description)]
        assert [names[0], names[3]] == expected


@pytest.mark.parametrize("purpose", ["", ":full", ":preview", ":own"])
def test_bindings_that_lead_nowhere(purpose: str) -> None:
    """Told for every purpose, also those that are not rendered; what remains holds."""
    text = mesh("").replace("rel material:binding = </red>", f"rel material:binding{purpose} = </gone>")
    faces, found = faces_of(text)
    assert (faces, found) == ([""] * 4, [("binding-missing", "/mesh")])


def test_other_things_that_cannot_be_bound() -> None:
    assert faces_of(mesh(subset("a", [0], "gone")))[1] == [("binding-missing", "/mesh/a")]
    assert faces_of(mesh("", bound="red/s"))[1] == [("binding-missing", "/mesh")]
    collection = "rel material:binding:collection:some = [</mesh.collection:some>, </gone>]"
    assert faces_of(mesh(collection))[1] == [("binding-missing", "/mesh")]


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ("", "/green"),
        ('token[] materialBindingPurposes = ["full", ""]', "/green"),
        ('token[] materialBindingPurposes = ["preview", "allPurpose"]', "/blue"),
        ('token[] materialBindingPurposes = ["allPurpose"]', "/red"),
        ('token[] materialBindingPurposes = ["own"]', "/red"),
    ],
)
@pytest.mark.conforms("MaterialBindingAPI.material:binding")
def test_purposes_in_order(settings: str, expected: str) -> None:
    """usdlux-test-suite spells the empty token allPurpose; USD falls back to it for every purpose."""
    bound = "rel material:binding:full = </green>\n rel material:binding:preview = </blue>"
    text = f'#usda 1.0\n(\n renderSettingsPrimPath = "/r"\n)\ndef RenderSettings "r"\n{{\n {settings}\n}}\n' + MATERIALS
    description, _ = translate_text(text + mesh(bound), RenderSettings())
    assert surfaces_by_face(description)[0] == expected


LEAF = """
def Mesh "{}" (prepend apiSchemas = ["MaterialBindingAPI"])
{{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    {}
}}
"""


def world(inside: str, collection: str, bound: str = "rel material:binding = </red>") -> str:
    """/World with two instances of a prototype that has the leaves a and b; `collection` of /World binds green."""
    leaves = "".join(LEAF.format(name, inside if name == "a" else "") for name in "ab")
    instances = "".join(f'def Xform "{name}" (instanceable = true\n references = </P>) {{ }}\n' for name in ("one", "two"))
    schemas = 'prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:c"]'
    return f"""{MATERIALS}
class Xform "P" {{
    {leaves}
}}
def Xform "World" ({schemas}) {{
    {bound}
    {collection}
    rel material:binding:collection:c = [</World.collection:c>, </green>]
    {instances}
}}
"""


INSIDE = "rel material:binding = </blue>"
STRONGER = 'rel material:binding = </red> (bindMaterialAs = "strongerThanDescendants")'
COLLECTIONS = {
    "one inside": "rel collection:c:includes = </World/one/a>",
    "excluded": "rel collection:c:includes = </World>\nrel collection:c:excludes = </World/two/b>",
    "the instance only": 'rel collection:c:includes = </World/one>\nuniform token collection:c:expansionRule = "explicitOnly"',
    "the whole instance": "rel collection:c:includes = </World/one>",
    "an expression": 'uniform pathExpression collection:c:membershipExpression = "//two//a"',
    "nobody": "",
}


@pytest.mark.parametrize("collection", COLLECTIONS.values(), ids=COLLECTIONS)
@pytest.mark.parametrize("bound", ["", "rel material:binding = </red>", "rel material:binding:full = </red>", STRONGER])
@pytest.mark.parametrize("inside", ["", INSIDE, INSIDE.replace("binding", "binding:full")])
@pytest.mark.conforms("MaterialBindingAPI.material:binding:collection", "MaterialBindingAPI.bindMaterialAs")
def test_what_is_inside_instances_is_bound_as_its_proxies_are(inside: str, bound: str, collection: str) -> None:
    stage = stage_of(world(inside, collection, bound))
    paths = [f"/World/{instance}/{leaf}" for instance in ("one", "two") for leaf in "ab"]
    asked = [UsdShade.MaterialBindingAPI(stage.GetPrimAtPath(path)) for path in paths]
    wanted = [str(api.ComputeBoundMaterial("full")[0].GetPath()) for api in asked]
    description, _ = translate(stage, RenderSettings())
    placed = [one for p in description.placements for one in description.prototypes[p.prototype].shapes * len(p)]
    shapes = [description.shapes[one.shape] for one in (*description.static, *placed)]
    found = sorted((shape.path[-1], description.surfaces[int(np.max(shape.surface))].path) for shape in shapes)
    assert found == sorted((path[-1], material) for path, material in zip(paths, wanted, strict=True))


@pytest.mark.parametrize("target", ["</World>", "</World.other:property>", "</World.collection:c>"])
def test_a_collection_that_is_none_is_told(target: str) -> None:
    text = world("", "int collection:c:includes = 3").replace("[</World.collection:c>,", f"[{target},")
    assert ("wrong-type", "/World") in translate_text(text)[1]


@pytest.mark.parametrize("instanced", [False, True])
def test_a_binding_without_its_schema_is_used_and_noted(instanced: bool) -> None:
    """USD binds it with a warning: the picture is as authored, so that --strict has nothing to refuse."""
    sphere = 'Sphere "s"\n{\n rel material:binding = </green>\n}\n'
    text = f'class "p"\n{{\n def {sphere}}}\n' if instanced else f"def {sphere}"
    text += 'def "i" (\n instanceable = true\n references = </p>\n)\n{\n}\n' if instanced else ""
    description, found = translate(stage_of(MATERIALS + text), RenderSettings())
    assert description.surfaces[0].path == "/green"
    told = [d for d in found if d.prim_path == ("/i/s" if instanced else "/s")]
    assert [(d.code, d.severity.value, d.kind.value, d.attribute) for d in told] == [
        ("binding-api", "info", "note", "material:binding")
    ]
    assert "usd-message" not in {d.code for d in found}
