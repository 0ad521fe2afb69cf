"""Inheritance through the walk: visibility, purpose, bindings across instances, times."""

from __future__ import annotations

import pytest

from primray.description import SceneDescription
from primray.settings import RenderSettings

from ..usd_text import translate_text


def materials(*names: str) -> str:
    return "".join(
        f"""def Material "{name}"
{{
    token outputs:surface.connect = </{name}/s.outputs:surface>
    def Shader "s"
    {{
        uniform token info:id = "UsdPreviewSurface"
        token outputs:surface
    }}
}}
"""
        for name in names
    )


BOUND = '(\n    prepend apiSchemas = ["MaterialBindingAPI"]\nMETA)\n{\n    rel material:binding = </NAME>STRENGTH\n'


def bound(name: str, meta: str = "", *, stronger: bool = False) -> str:
    strength = ' (\n        bindMaterialAs = "strongerThanDescendants"\n    )' if stronger else ""
    return BOUND.replace("NAME", name).replace("META", meta).replace("STRENGTH", strength)


def surfaces(description: SceneDescription) -> list[str]:
    """The material of each prototype's and each static shape, sorted."""
    return sorted(description.surfaces[s.surface].path for s in description.shapes if isinstance(s.surface, int))


LIBRARY = (
    'over "lib"\n{\n    def Xform "x"\n    {\n        def Sphere "bare"\n        {\n        }\n        def Sphere "own" '
    + bound("inner")
    + "        }\n    }\n}\n"
)
REFERENCE = "    instanceable = true\n    references = </lib/x>\n"


def test_bindings_above_instances_make_their_own_prototypes() -> None:
    text = materials("red", "blue", "inner") + LIBRARY
    text += "".join(f'def Xform "i{k}" ' + bound(m, REFERENCE) + "}\n" for k, m in enumerate(("red", "red", "blue", "blue")))
    description, _ = translate_text(text)
    assert len(description.prototypes) == 2
    assert [len(p) for p in description.placements] == [2, 2]
    assert surfaces(description) == ["/blue", "/inner", "/inner", "/red"]
    stronger = text.replace(
        "rel material:binding = </red>",
        'rel material:binding = </red> (\n        bindMaterialAs = "strongerThanDescendants"\n    )',
    )
    assert surfaces(translate_text(stronger)[0]) == ["/blue", "/inner", "/red", "/red"]


def test_prototypes_share_their_arrays() -> None:
    text = materials("red", "blue", "inner") + LIBRARY.replace("def Sphere", "def Cone")
    text += "".join(f'def Xform "i{k}" ' + bound(m, REFERENCE) + "}\n" for k, m in enumerate(("red", "red", "blue", "blue")))
    bare = [s for s in translate_text(text)[0].shapes if s.path.endswith("bare")]
    assert len(bare) == 2
    assert bare[0].points is bare[1].points  # type: ignore[union-attr]


@pytest.mark.conforms("MaterialBindingAPI.material:binding")
def test_full_purpose_wins_over_the_general_binding() -> None:
    text = materials("red", "blue") + 'def Sphere "s" ' + bound("red") + "    rel material:binding:full = </blue>\n}\n"
    assert surfaces(translate_text(text)[0]) == ["/blue"]


PURPOSES = """def Xform "x"
{
    uniform token purpose = "proxy"
    def Sphere "proxy"
    {
    }
    def Sphere "render"
    {
        uniform token purpose = "render"
    }
    def Xform "hidden"
    {
        token visibility = "invisible"
        def Sphere "no"
        {
            uniform token purpose = "render"
        }
    }
}
def Sphere "plain"
{
}
"""


@pytest.mark.conforms("Imageable.visibility", "Imageable.purpose")
def test_purpose_and_visibility() -> None:
    def paths(settings: RenderSettings | None = None, extra: str = "") -> list[str]:
        return [s.path for s in translate_text(PURPOSES + extra, settings)[0].shapes]

    assert paths() == ["/x/render", "/plain"]
    assert paths(RenderSettings(purposes=("default", "proxy"))) == ["/x/proxy", "/plain"]
    only = 'def RenderSettings "s"\n{\n    uniform token[] includedPurposes = ["render"]\n}\n'
    assert paths(extra=only) == ["/x/render"]


MOVING = """def Sphere "ball"
{
    double radius.timeSamples = {
        1: 2,
        3: 4,
    }
    double3 xformOp:translate.timeSamples = {
        1: (0, 0, 0),
        3: (10, 0, 0),
    }
    double3 xformOp:scale = (2, 2, 2)
    double3 xformOp:scale.timeSamples = {
        1: (5, 5, 5),
    }
    token visibility = "VISIBILITY"
    token visibility.timeSamples = {
        1: "invisible",
        2: "inherited",
    }
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
}
"""


@pytest.mark.conforms("Xformable.xformOp:translate", "Xformable.xformOp:scale", "Imageable.visibility")
def test_time_codes() -> None:
    def ball(time: float | None) -> tuple[float, float, float] | None:
        description = translate_text(MOVING.replace("VISIBILITY", "inherited"), RenderSettings(time_code=time))[0]
        if not description.shapes:
            return None
        matrix = description.static[0].matrix
        return description.shapes[0].radius, matrix[0, 3], matrix[0, 0]  # type: ignore[union-attr]

    assert ball(2.0) == (3, 5, 5)  # interpolated
    assert ball(1.0) is None
    assert ball(None) == (2, 0, 2)  # defaults, and the earliest sample where there is none


def test_instances_under_invisible_parents_are_out() -> None:
    text = (
        LIBRARY
        + materials("inner")
        + 'def Xform "a"\n{\n    token visibility = "invisible"\n    def Xform "i" (\n'
        + REFERENCE
        + "    )\n    {\n    }\n}\n"
    )
    assert translate_text(text)[0].shapes == ()


def test_inactive_and_abstract_prims_are_out() -> None:
    text = 'class "c"\n{\n    def Sphere "s"\n    {\n    }\n}\ndef Sphere "off" (\n    active = false\n)\n{\n}\n'
    assert translate_text(text)[0].shapes == ()


def test_prototypes_under_a_class_are_drawn() -> None:
    text = """class "c"
{
    def Xform "x"
    {
        def Sphere "s"
        {
        }
    }
}
def PointInstancer "p"
{
    rel prototypes = </c/x>
    int[] protoIndices = [0]
    point3f[] positions = [(1, 2, 3)]
}
"""
    description, _ = translate_text(text)
    assert description.static[0].matrix[:3, 3].tolist() == [1, 2, 3]


@pytest.mark.parametrize("above", ["Camera", "DistantLight", "Sphere", "Scope", "Unknown"])
def test_what_stands_below_a_prim_of_any_kind_is_drawn(above: str) -> None:
    """A lamp and a hood that a rig hangs on its camera: only what has children of its own meaning keeps them."""
    description, _ = translate_text(
        f"""def {above} "rig"
{{
    double3 xformOp:translate = (0, 0, 10)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Sphere "hood"
    {{
        double radius = 3
        double3 xformOp:translate = (1, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
    def SphereLight "lamp"
    {{
    }}
}}
"""
    )
    hood = next(p for p in description.static if description.shapes[p.shape].path == "/rig/hood")
    # A Scope and a type that is not known have no transform.
    assert tuple(hood.matrix[:3, 3]) == (1, 0, 0 if above in ("Scope", "Unknown") else 10)
    assert "/rig/lamp" in [light.path for light in description.lights]
