"""Attributes in other renderers' namespaces: what is read is not reported as not read."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

import primray.usd
from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.scene.notes import RENDERERS, renderer_of
from primray.usd.scene.schemas import LIGHT_GROUPS

from ..usd_text import stage_of

_NAME = re.compile(rf"(?:(?:primvars|inputs|outputs):)?(?:{'|'.join(sorted(RENDERERS))})(?::[A-Za-z_]\w*)+")


def written_names() -> list[str]:
    """Return the attributes of other renderers that the sources of primray.usd name."""
    folder = Path(primray.usd.__file__).parent
    nodes = (node for path in folder.rglob("*.py") for node in ast.walk(ast.parse(path.read_text())))
    texts = {node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    return sorted(text for text in texts if _NAME.fullmatch(text))


@pytest.mark.parametrize("name", written_names())
def test_what_the_sources_name_is_not_reported_as_not_read(name: str) -> None:
    assert renderer_of(name) == ""


@pytest.mark.parametrize("name", LIGHT_GROUPS)
def test_a_light_group_is_read_and_its_neighbour_is_reported(name: str) -> None:
    light = f"""#usda 1.0
def DistantLight "key"
{{
    string {name} = "rim"
    float karma:light:contribs = 1
}}
"""
    description, diagnostics = translate(stage_of(light), RenderSettings())
    assert [light.group for light in description.lights] == ["rim"]
    assert [(d.attribute, d.message) for d in diagnostics if d.code == "other-renderer"] == [
        ("karma:light:contribs", "An attribute of the namespace karma on this prim: ignored.")
    ]


_MATERIAL = """#usda 1.0
def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"])
{{
    rel material:binding = </look>
}}
def Material "look"
{{
    token outputs:arnold:surface.connect = </look/arnold.outputs:out>
    {universal}
    def Shader "arnold"
    {{
        uniform token info:id = "arnold:standard_surface"
        token outputs:out
    }}
    def Shader "preview"
    {{
        uniform token info:id = "UsdPreviewSurface"
        token outputs:surface
    }}
}}
"""
_PREVIEW = "token outputs:surface.connect = </look/preview.outputs:surface>"


@pytest.mark.parametrize(("universal", "unread"), [("", []), (_PREVIEW, [("/look", "outputs:arnold:surface")])])
def test_a_surface_output_is_reported_where_the_material_is_made_from_another(universal: str, unread: list[str]) -> None:
    _, diagnostics = translate(stage_of(_MATERIAL.format(universal=universal)), RenderSettings())
    assert [(d.prim_path, d.attribute) for d in diagnostics if d.code == "other-renderer"] == unread
    assert ("translated" in {d.code for d in diagnostics}) == (unread == [])
