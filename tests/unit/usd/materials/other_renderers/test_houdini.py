"""Houdini's principled shader, as Solaris writes it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from tests.unit.usd.known_surface_text import lobes
from tests.unit.usd.materials.other_renderers.shader_text import shader, stage, surface_of

from primray.description import PrimvarInput, TextureInput
from primray.description.shading import Surface

ASSET = """
uniform token info:implementationSource = "sourceAsset"
uniform asset info:sourceAsset = @opdef:/Vop/principledshader::2.0?SurfaceVexCode@
"""
PLAIN = "int inputs:basecolor_usePointColor = 0\n"


def made(inputs: str) -> tuple[Surface, dict[str, list[str]]]:
    return surface_of(stage(ASSET + inputs, context="karma:"))


def test_its_values() -> None:
    surface, told = made(
        PLAIN + "vector3f inputs:basecolor = (1, 0.5, 0)\n float inputs:albedomult = 0.5\n float inputs:rough = 0.4\n"
        "float inputs:metallic = 1\n vector3f inputs:emitcolor = (1, 0, 0)\n float inputs:emitint = 2\n float inputs:opac = 0.5"
    )
    assert lobes(surface)["base_color"] == pytest.approx((0.5, 0.25, 0.0))
    assert lobes(surface)["specular_roughness"] == pytest.approx(0.4)
    assert lobes(surface)["base_metalness"] == 1.0
    assert surface.emissive_color == pytest.approx((2.0, 0.0, 0.0))
    assert surface.presence
    assert surface.opacity == pytest.approx(0.5)
    assert told["translated"] == ["Houdini's shaders are translated by their documentation, not interpreted: principledshader."]


def test_its_defaults() -> None:
    found = lobes(made(PLAIN)[0])
    assert found["base_color"] == pytest.approx((0.2, 0.2, 0.2))
    assert found["specular_ior"] == pytest.approx(1.5)


def test_its_colour_is_multiplied_by_the_points() -> None:
    surface, _ = made("vector3f inputs:basecolor = (1, 1, 1)")
    assert dict(surface.inputs)["open_pbr_base_color"] == PrimvarInput("displayColor", (1.0, 1.0, 1.0))


def test_it_is_known_by_its_id_and_by_older_operators() -> None:
    by_id, _ = surface_of(stage(shader("principledshader::2.0", PLAIN), context="vex:"))
    older = ASSET.replace("::2.0?SurfaceVexCode", "?SurfaceVexCode")
    assert by_id == made(PLAIN)[0] == surface_of(stage(older + PLAIN, context="karma:"))[0]


def test_other_operators_are_not_it() -> None:
    other = ASSET.replace("principledshader::2.0", "classicshader")
    surface, told = surface_of(stage(other, context="karma:"))
    assert surface.lambert
    assert "translated" not in told


TEXTURES: dict[str, tuple[str, str, dict[str, Any]]] = {
    "colour": ("basecolor", "open_pbr_base_color", {"channels": "rgb", "space": "sRGB"}),
    "number": ("rough", "open_pbr_specular_roughness", {"channels": "r", "space": "raw"}),
}


@pytest.mark.parametrize(("name", "field", "expected"), TEXTURES.values(), ids=TEXTURES)
def test_its_textures(name: str, field: str, expected: dict[str, Any], tmp_path: Path) -> None:
    for tile in (1001, 1002):
        (tmp_path / f"t_{tile}.png").write_bytes(b"")
    path = tmp_path / "t_%(UDIM)d.png"
    surface, _ = made(PLAIN + f"int inputs:{name}_useTexture = 1\n asset inputs:{name}_texture = @{path}@")
    found = dict(surface.inputs)[field]
    assert isinstance(found, TextureInput)
    assert (found.channels, found.file.color_space) == (expected["channels"], expected["space"])
    assert [number for number, _ in found.file.tiles] == [1001, 1002]


def test_a_texture_that_is_off_is_not_read(tmp_path: Path) -> None:
    surface, told = made(PLAIN + f"asset inputs:basecolor_texture = @{tmp_path}/t.png@")
    assert "open_pbr_base_color" not in dict(surface.inputs)
    assert "asset-missing" not in told


def test_its_normal_map(tmp_path: Path) -> None:
    (tmp_path / "n.png").write_bytes(b"")
    surface, _ = made(
        f"int inputs:baseBumpAndNormal_enable = 1\n asset inputs:baseNormal_texture = @{tmp_path}/n.png@\n"
        "float inputs:baseNormal_scale = 0.5\n int inputs:baseNormal_flipY = 1"
    )
    found = dict(surface.inputs)["normal"]
    assert isinstance(found, TextureInput)
    assert found.scale[:3] == (1.0, -1.0, 2.0)
