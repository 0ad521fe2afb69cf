"""Inputs of lights: each is read once for all placements of its light, and none that has no effect."""

from __future__ import annotations

from collections import Counter
from typing import Any

import pytest

from primray.usd.lights import authored, light_color, photometric

from ..usd_text import translate_text

INPUTS = """
float inputs:radius = 0.3
float inputs:intensity = 7
float inputs:exposure = 1
float inputs:diffuse = 0.5
float radiometric:power = 3
token physical:illuminant = "blackbody"
"""
LAMPS = """
def PointInstancer "lamps"
{{
    int[] protoIndices = [0, 0, 0]
    point3f[] positions = [(0, 0, 0), (4, 0, 0), (0, 5, 0)]
    rel prototypes = </lamps/lamp>
    def SphereLight "lamp"
    {{
        {inputs}
    }}
}}
"""


def test_each_input_is_read_once_for_all_placements(monkeypatch: pytest.MonkeyPatch) -> None:
    reads: Counter[str] = Counter()
    for module in (authored, light_color, photometric):
        for function in ("number", "flag", "token", "vector"):
            if (real := getattr(module, function, None)) is not None:

                def counted(prim: Any, name: str, *others: Any, real: Any = real) -> Any:
                    reads[name] += 1
                    return real(prim, name, *others)

                monkeypatch.setattr(module, function, counted)
    description, _ = translate_text(LAMPS.format(inputs=INPUTS))
    assert len(description.lights) == 3
    assert reads.keys() >= {"inputs:radius", "inputs:intensity", "radiometric:power", "physical:illuminant", "treatAsPoint"}
    assert set(reads.values()) == {1}


def test_nothing_is_said_of_inputs_without_an_effect() -> None:
    bad = "float inputs:diffuse = -1\n float inputs:shaping:cone:softness = 2\n asset inputs:texture:file = @none.exr@"
    text = 'def {kind} "light"\n{{\n float inputs:{size} = {value}\n {bad}\n}}\n'
    _, dark = translate_text(text.format(kind="RectLight", size="width", value=0, bad=bad))
    _, lit = translate_text(text.format(kind="RectLight", size="width", value=1, bad=bad))
    assert [code for code, path in dark if path == "/light"] == ["light-dark"]
    assert sorted(code for code, path in lit if path == "/light") == ["asset-missing", "out-of-range", "out-of-range"]
