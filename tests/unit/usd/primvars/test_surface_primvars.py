"""A constant primvar has one element: of many the first counts, and that is reported; on the shape and handed down to it."""

from __future__ import annotations

import pytest

from primray.settings import RenderSettings
from primray.usd import translate

from ..usd_text import stage_of, translate_text
from .test_reading import quads, reader


@pytest.mark.parametrize(
    ("primvar", "above", "count"),
    [
        ("float[] primvars:p = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]", "", 6),  # an interpolation that was forgotten
        ('float[] primvars:p = [0.1, 0.2] (interpolation = "constant")', "", 2),
        ('float[] primvars:p = [0.1, 0.2] (interpolation = "constant")\nint[] primvars:p:indices = [1, 0, 1]', "", 3),
        ('float[] primvars:p = [0.1, 0.2] (interpolation = "constant")\nint[] primvars:p:indices = [1]', "", 1),
        ("float[] primvars:p = [0.1]", "", 1),
        ("float primvars:p = 0.1", "", 1),
        ("", "float[] primvars:p = [0.1, 0.2]", 2),  # handed down
        ("float[] primvars:p = [0.1]", "float[] primvars:p = [0.1, 0.2]", 1),  # what is nearer counts
        ("color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)]\nfloat[] primvars:p = [0.1]", "", 1),  # which nothing shows
    ],
)
def test_a_constant_primvar_has_one_element(primvar: str, above: str, count: int) -> None:
    text = reader(1) + f'def Xform "above"\n{{\n{above}\n{quads(primvar)}\n}}\n'
    _, diagnostics = translate(stage_of(text), RenderSettings())
    found = [(d.prim_path, d.message) for d in diagnostics if d.code == "invalid-primvar"]
    message = f"primvars:p (constant) has {count} values where 1 is needed: the first is used."
    assert found == ([("/above/mesh", message)] if count > 1 else [])


@pytest.mark.parametrize("name", ["displayColor", "displayOpacity"])
@pytest.mark.parametrize("shape", ["Sphere", "Mesh", "Points"])
def test_what_shapes_without_a_material_show_has_one_element_too(name: str, shape: str) -> None:
    kind, value = ("color3f", "(1, 0, 0)") if name == "displayColor" else ("float", "0.5")
    points = "point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0)]"
    topology = "int[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0, 1, 2]" if shape == "Mesh" else ""
    for count in (1, 2):
        shown = f"{kind}[] primvars:{name} = [{', '.join([value] * count)}]"
        text = f'def Xform "above"\n{{\n{shown}\ndef {shape} "s"\n{{\n{points}\n{topology}\n}}\n}}\n'
        codes = [code for code, _ in translate_text(text, RenderSettings())[1]]
        assert ("invalid-primvar" in codes) == (count > 1)


def test_widths_of_points_that_are_constant_are_one() -> None:
    def codes(widths: str) -> list[str]:
        points = "point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0)]"
        return [code for code, _ in translate_text(f'def Points "p"\n{{\n{points}\n{widths}\n}}\n', RenderSettings())[1]]

    assert "invalid-primvar" not in codes("float[] widths = [1, 2, 3]")
    assert "invalid-primvar" in codes('float[] widths = [1, 2, 3] (interpolation = "constant")')
    assert "invalid-primvar" in codes("float[] primvars:widths = [1, 2, 3]")
    assert "invalid-primvar" not in codes(
        'float[] primvars:widths = [1, 2] (interpolation = "vertex")\nint[] primvars:widths:indices = [0, 1, 0]'
    )
