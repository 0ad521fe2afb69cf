"""The other colours of lights: focus tint and shadows, in linear Rec.709 where nothing is authored."""

from __future__ import annotations

import pytest

from primray.description import Light

from ..color_text import AP1_HERE, APPLIED, FROM_AP1, IN_AP1, RGB, TO_AP1, close, lamp, quiet


def light_of(line: str, around: str = "", *, in_ap1: bool = False) -> Light:
    text = lamp(line, around, f"{APPLIED}\n{{").replace(
        'def SphereLight "lamp"', 'def SphereLight "lamp" (prepend apiSchemas = ["ShapingAPI", "ShadowAPI"])'
    )
    (light,) = quiet(text, IN_AP1 if in_ap1 else None).lights
    return light


def color_of(light: Light, name: str) -> tuple[float, ...]:
    if name == "shadow:color":
        assert light.shadow is not None
        return light.shadow.color
    assert light.shaping is not None
    return light.shaping.focus_tint


@pytest.mark.conforms("ShapingAPI.inputs:shaping:focusTint", "ShadowAPI.inputs:shadow:color")
@pytest.mark.parametrize(("name", "more"), [("shaping:focusTint", "float inputs:shaping:focus = 2"), ("shadow:color", "")])
def test_tints_and_shadows(name: str, more: str) -> None:
    line = f"color3f inputs:{name} = {RGB} %s\n{more}"
    assert close(color_of(light_of(line % ""), name), RGB)
    assert close(color_of(light_of(line % "", in_ap1=True), name), TO_AP1 @ RGB)
    assert close(color_of(light_of(line % "", AP1_HERE), name), FROM_AP1 @ RGB)
    data = line % '(colorSpace = "data")'
    assert close(color_of(light_of(data, in_ap1=True), name), RGB)
