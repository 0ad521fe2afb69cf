"""Which space a texture file is in: sourceColorSpace, metadata, ColorSpaceAPI, the file; and for colours or numbers."""

from __future__ import annotations

import pytest

from primray.color.color_space import ACESCG, REC709, ColorSpace, named
from primray.description import TextureFile
from primray.settings import RenderSettings

from ..color_text import AP1_HERE, APPLIED, IN_AP1
from ..material_text import IMAGE, READER, material
from ..usd_text import translate_text

P3 = named("srgb_p3d65_scene")
COLOR = "color3f inputs:diffuseColor.connect = </m/image.outputs:rgb>"
METADATA = '(colorSpace = "srgb_p3d65_scene")'
API = 'uniform token colorSpace:name = "srgb_p3d65_scene"'


def file_of(
    image: str,
    source: str | None = None,
    metadata: str = "",
    api: str = "",
    inputs: str = COLOR,
    settings: RenderSettings | None = None,
) -> TextureFile:
    nodes = (IMAGE % image).replace(f"@{image}@", f"@{image}@ {metadata}")
    if source is not None:
        nodes = nodes.replace("float2 inputs:st", f'token inputs:sourceColorSpace = "{source}"\n        float2 inputs:st')
    if api:
        nodes = nodes.replace('Shader "image"', f'Shader "image" {APPLIED}').replace(
            "asset inputs:file", f"{api}\nasset inputs:file"
        )
    text = material(inputs, READER + nodes)
    description, found = translate_text(text, settings)
    assert [code for code, _ in found if code in ("color-space", "shader-parameter")] == []
    return next(i for surface in description.surfaces for _, i in surface.inputs).file  # type: ignore[union-attr]


@pytest.mark.conforms("UsdUVTexture.inputs:sourceColorSpace", "ColorSpaceAPI.colorSpace:name")
@pytest.mark.parametrize(
    ("source", "metadata", "api", "expected"),
    [
        (None, "", "", "auto"),
        ("auto", "", "", "auto"),
        ("raw", "", "", "raw"),
        ("sRGB", "", "", "sRGB"),
        ("lin_ap1_scene", "", "", ACESCG),  # beyond the text's three, but it says what it says
        ("raw", METADATA, API, "raw"),  # the node's own input first
        ("sRGB", METADATA, API, "sRGB"),
        (None, METADATA, "", P3),
        ("auto", METADATA, "", P3),
        (None, METADATA, AP1_HERE, P3),
        (None, "", API, P3),  # the Color User's Guide's own example
        ("auto", "", API, "auto"),  # said on the node, nearer than what is inherited
        (None, '(colorSpace = "data")', API, "raw"),
    ],
)
def test_who_says_it(source: str | None, metadata: str, api: str, expected: str | ColorSpace, image: str) -> None:
    assert file_of(image, source, metadata, api).color_space == expected


def test_numbers_do_not_inherit_a_colors_space(image: str) -> None:
    rough = "float inputs:roughness.connect = </m/image.outputs:a>"
    assert file_of(image, None, "", API, rough).color_space == "auto"
    assert file_of(image, None, METADATA, "", rough).color_space == P3


def test_numbers_are_told_apart_only_where_it_matters(image: str) -> None:
    """Else a file that feeds a colour and a number would be loaded twice."""
    normal = "normal3f inputs:normal.connect = </m/image.outputs:rgb>"
    assert file_of(image, inputs=normal) == file_of(image) == TextureFile(image, "auto")
    assert file_of(image, inputs=normal, settings=IN_AP1) == TextureFile(image, "auto", (), ACESCG, is_color=False)
    assert file_of(image, settings=IN_AP1) == TextureFile(image, "auto", (), ACESCG)
    assert file_of(image, "raw", inputs=normal, settings=IN_AP1) == file_of(image, "raw", settings=IN_AP1)


def test_the_rendering_space_itself_is_raw(image: str) -> None:
    assert file_of(image, "lin_ap1_scene", settings=IN_AP1).color_space == "raw"
    assert file_of(image, "lin_rec709_scene").color_space == "raw"
    assert file_of(image, "lin_rec709_scene", settings=IN_AP1).color_space == REC709


@pytest.mark.conforms("DomeLight.inputs:texture:file", "ColorSpaceAPI.colorSpace:name")
@pytest.mark.parametrize(
    ("metadata", "around", "expected"),
    [("", "", "auto"), (METADATA, "", P3), ("", AP1_HERE, ACESCG), ('(colorSpace = "raw")', AP1_HERE, "raw")],
)
def test_light_textures(metadata: str, around: str, expected: str | ColorSpace, image: str) -> None:
    dome = f'def DomeLight "d"\n{{\nasset inputs:texture:file = @{image}@ {metadata}\n}}'
    text = f'def Xform "top" {APPLIED}\n{{\n{around}\n{dome}\n}}\n'
    description, found = translate_text(text)
    assert description.lights[0].texture == TextureFile(image, expected)
    assert [code for code, _ in found if code == "color-space"] == []


def test_card_textures_are_colors(image: str) -> None:
    text = f"""
def Xform "model" (kind = "component"
    prepend apiSchemas = ["GeomModelAPI"])
{{
    uniform token model:drawMode = "cards"
    uniform bool model:applyDrawMode = 1
    asset model:cardTextureXPos = @{image}@
    def Sphere "ball" {{
    }}
}}"""
    description, _ = translate_text(text, IN_AP1)
    files = {i.file for surface in description.surfaces for _, i in surface.inputs}  # type: ignore[union-attr]
    assert files == {TextureFile(image, "auto", (), ACESCG)}
