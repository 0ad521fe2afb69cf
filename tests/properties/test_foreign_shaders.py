"""Whatever other renderers' shaders say, a surface comes of it or displayColor, and nothing of it is out of its range."""

from __future__ import annotations

import math
import random
from dataclasses import fields

import pytest
from tests.unit.usd.materials.other_renderers.shader_text import node, shader, stage, surface_of

from primray.description import OpenPbr
from primray.usd.materials.other_renderers.translation import VOCABULARIES
from primray.usd.materials.other_renderers.values import RendererInputs

VALUES = (
    *(("float", text) for text in ("nan", "1e38", "-1", "0", "0.5")),
    *(("string", text) for text in ('"x"', '""', '"periodic"')),
    *(("color3f", "(1, 2, 3)"), ("color4f", "(0, 0, 0, 0)"), ("float2", "(0, 0)"), ("int", "99"), ("bool", "1")),
    *(("float[]", "[]"), ("float[]", "[1, 0]"), ("color3f[]", "[(1, 0, 0), (0, 1, 0)]"), ("asset", "@missing.png@")),
)
SOURCES = ("k.outputs:out", "k.outputs:r", "k.outputs:a", "t.outputs:rgb", "p.outputs:out", "n.outputs:out")
CONTEXTS = {"Arnold": ("arnold:", "arnold:"), "RenderMan": ("ri:", ""), "Houdini": ("karma:", "")}
BESIDE = (
    node("k", "arnold:flat", "color3f inputs:color = (0.5, 0.2, 1)", "token outputs:out")
    + node("t", "UsdUVTexture", "asset inputs:file = @missing.png@", "float3 outputs:rgb")
    + node("p", "arnold:state_vector", 'string inputs:variable = "P"')
)
READS = {"Arnold": ("arnold:lambert", "Kd_color", "out"), "RenderMan": ("PxrDiffuse", "diffuseColor", "resultRGB")}


def text_of(renderer: str, kind: str, inputs: str, *, is_surface: bool) -> str:
    context, prefix = CONTEXTS[renderer]
    if is_surface:
        return stage(shader(prefix + kind, inputs), BESIDE, context=context)
    surface, fed, output = READS[renderer]
    reads = f"color3f inputs:{fed}.connect = </m/n.outputs:{output}>"
    return stage(shader(surface, reads), node("n", prefix + kind, inputs) + BESIDE, context=context)


def inputs_of(names: set[str], rng: random.Random) -> str:
    lines = []
    for name in sorted(names):
        kind, value = rng.choice(VALUES)
        if (what := rng.random()) < 0.6:
            lines.append(f"{kind} inputs:{name} = {value}")
        elif what < 0.9:
            lines.append(f"token inputs:{name}.connect = </m/{rng.choice(SOURCES)}>")
    return "\n".join(lines)


@pytest.mark.parametrize("renderer", CONTEXTS)
def test_any_values_make_a_surface(renderer: str, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: dict[str, set[str]] = {}
    own = RendererInputs.left_out

    def left_out(self: RendererInputs) -> object:
        asked.setdefault(self.kind, set()).update(self.asked)
        return own(self)

    monkeypatch.setattr(RendererInputs, "left_out", left_out)
    rng = random.Random(7)
    [vocabulary] = [v for v in VOCABULARIES if v.renderer == renderer]
    kinds = [(kind, True) for kind in vocabulary.surfaces] + [(kind, False) for kind in vocabulary.nodes]
    for kind, is_surface in kinds * 3:
        surface, told = surface_of(text_of(renderer, kind, inputs_of(asked.get(kind, set()), rng), is_surface=is_surface))
        assert "translated" in told or "shader-ignored" in told
        numbers = [surface.opacity, *surface.emissive_color]
        if surface.open_pbr is not None:
            values = [getattr(surface.open_pbr, f.name) for f in fields(OpenPbr)]
            numbers += [x for value in values for x in (value if isinstance(value, tuple) else (value,))]
        assert all(map(math.isfinite, numbers)), (kind, surface)
        assert 0 <= surface.opacity <= 1, (kind, surface)
