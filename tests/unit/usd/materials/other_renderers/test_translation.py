"""Which of a material's outputs is translated, and what reaches the shaders of one that is."""

from __future__ import annotations

import pytest
from tests.unit.usd.known_surface_text import lobes
from tests.unit.usd.materials.other_renderers.shader_text import node, shader, stage, surface_of
from tests.unit.usd.usd_text import stage_of

from primray.settings import RenderSettings
from primray.usd import translate

LAMBERT = shader("arnold:lambert", "float inputs:Kd = 0.5")
OTHER = node("o", "arnold:lambert", "float inputs:Kd = 0.25")
PREVIEW = node("o", "UsdPreviewSurface", "float inputs:roughness = 0.25")


@pytest.mark.parametrize("context", ["", "mtlx:", "ri:"])
def test_a_surface_that_can_be_read_comes_first(context: str) -> None:
    more = "token outputs:glslfx:surface.connect = </m/o.outputs:out>"
    surface, told = surface_of(stage(LAMBERT, PREVIEW, context=context, more=more))
    assert surface.open_pbr is None
    assert surface.roughness == 0.25
    assert "translated" not in told


def test_a_renderers_own_output_comes_before_the_universal_one() -> None:
    more = "token outputs:arnold:surface.connect = </m/o.outputs:out>"
    surface, _ = surface_of(stage(LAMBERT, OTHER, context="", more=more))
    assert lobes(surface)["base_weight"] == 0.25


def test_the_universal_output_counts_where_there_is_no_other() -> None:
    surface, told = surface_of(stage(LAMBERT, context=""))
    assert lobes(surface)["base_weight"] == 0.5
    assert "translated" in told


def test_untranslated_is_as_before() -> None:
    surface, told = surface_of(stage(LAMBERT), RenderSettings(translated_shaders=False))
    assert surface.lambert
    assert surface.open_pbr is None
    assert told["shader-ignored"] == [
        "The surface shader is not supported (arnold:lambert at outputs:arnold:surface): displayColor is used."
    ]


def test_what_is_translated_is_told_once_with_the_nodes_that_it_uses() -> None:
    data = node("n", "arnold:user_data_rgb", 'string inputs:attribute = "tint"')
    unused = node("u", "arnold:noise")
    fed = shader("arnold:lambert", "color3f inputs:Kd_color.connect = </m/n.outputs:out>")
    _, told = surface_of(stage(fed, data + unused))
    assert told["translated"] == [
        "Arnold's shaders are translated by their documentation, not interpreted: lambert, user_data_rgb."
    ]


@pytest.mark.parametrize(
    ("kind", "inputs"),
    [("arnold:user_data_rgb", 'string inputs:attribute = "tint"'), ("PxrPrimvar", 'string inputs:varname = "tint"')],
)
def test_primvars_are_handed_down_to_shapes(kind: str, inputs: str) -> None:
    context, surface = ("arnold:", "arnold:lambert") if kind.startswith("arnold") else ("ri:", "PxrDiffuse")
    fed = "Kd_color" if context == "arnold:" else "diffuseColor"
    more = 'string inputs:type = "color"' if context == "ri:" else ""
    text = stage(
        shader(surface, f"color3f inputs:{fed}.connect = </m/n.outputs:resultRGB>"),
        node("n", kind, f"{inputs}\n{more}", "color3f outputs:resultRGB"),
        context=context,
    )
    above = 'def Xform "x"\n{\ncolor3f primvars:tint = (1, 0.5, 0)\n'
    text = text.replace('def Sphere "ball"', above + 'def Sphere "ball"') + "}"
    description, diagnostics = translate(stage_of(text), RenderSettings())
    [primvar] = [p for p in description.shapes[0].primvars if p.name == "tint"]
    assert primvar.values.ravel()[:3].tolist() == [1.0, 0.5, 0.0]
    assert "primvar-missing" not in {d.code for d in diagnostics}
