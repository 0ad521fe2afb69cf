"""Where light comes from, as translated: textures, formats and portals, and what is reported of the rest."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.unit.usd.lights.light_text import told, translated

from primray.description import Light, LightType, TextureFile
from primray.diagnostics import Diagnostics
from primray.textures.texture import Texture
from primray.textures.texture_set import with_read_textures


@pytest.mark.conforms("RectLight.inputs:texture:file", "DomeLight.inputs:texture:file", "DomeLight_1.inputs:texture:file")
@pytest.mark.parametrize("kind", ["RectLight", "DomeLight", "DomeLight_1"])
def test_textures(kind: str, tmp_path: Path) -> None:
    file = tmp_path / "a.exr"
    file.write_bytes(b"")
    description, found = translated(
        f'def {kind} "l" {{ asset inputs:texture:file = @{file}@ (colorSpace = "raw")\n color3f inputs:color = (1, 2, 3) }}'
    )
    (light,) = description.lights
    assert light.texture is not None
    assert (light.texture.path, light.texture.color_space) == (str(file), "raw")
    assert light.emission == (1, 2, 3)
    assert told(found, "/l") == []
    description, found = translated(f'def {kind} "l" {{ asset inputs:texture:file = @nowhere.exr@ }}')
    assert description.lights[0].texture is None
    assert told(found, "/l") == [("asset-missing", "inputs:texture:file")]


@pytest.mark.conforms("DomeLight.inputs:texture:format", "DomeLight_1.inputs:texture:format")
def test_formats(tmp_path: Path) -> None:
    file = tmp_path / "a.exr"
    file.write_bytes(b"")
    for layout in ("automatic", "latlong", "mirroredBall", "angular", "cubeMapVerticalCross", "fisheye"):
        body = f'asset inputs:texture:file = @{file}@\n token inputs:texture:format = "{layout}"'
        description, found = translated(f'def DomeLight_1 "l" {{ {body} }}')
        known = layout != "fisheye"
        assert description.lights[0].texture_format == (layout if known else "automatic")
        assert told(found, "/l") == ([] if known else [("light-input", "inputs:texture:format")])


FILE = TextureFile("a", "raw")


@pytest.mark.conforms("DomeLight.inputs:texture:format", "DomeLight_1.inputs:texture:format")
@pytest.mark.parametrize(
    ("asked", "size", "says", "becomes", "noted"),
    [
        ("automatic", (8, 4), "", "latlong", False),
        ("automatic", (7, 4), "", "latlong", False),
        ("automatic", (6, 8), "", "cubeMapVerticalCross", False),
        ("automatic", (6, 8), "latlong", "latlong", False),
        ("automatic", (8, 8), "", "latlong", True),
        ("automatic", (1, 1), "", "latlong", False),
        ("automatic", (4, 24), "cube", "latlong", True),
        ("angular", (8, 8), "", "angular", False),
        ("angular", (8, 4), "", "angular", True),
        ("mirroredBall", (8, 8), "latlong", "mirroredBall", False),
        ("cubeMapVerticalCross", (8, 8), "", "cubeMapVerticalCross", True),
        ("latlong", (3, 4), "", "latlong", False),
    ],
)
def test_automatic_formats(asked: str, size: tuple[int, int], says: str, becomes: str, noted: bool) -> None:
    dome = Light("/dome", LightType.DOME, np.eye(4), (1, 1, 1), texture=FILE, texture_format=asked)
    texture = Texture(np.zeros((size[1], size[0], 3), np.float32), environment=says)
    found = Diagnostics()
    (settled,) = with_read_textures([dome], {FILE: [(0, texture)]}, found)
    assert settled.texture_format == becomes
    assert told(list(found), "/dome") == ([("light-input", "inputs:texture:format")] if noted else [])


@pytest.mark.conforms("RectLight.inputs:texture:file")
def test_rectangles_shine_without_a_file_that_cannot_be_read() -> None:
    rect = Light("/rect", LightType.RECT, np.eye(4), (1, 1, 1), texture=FILE)
    dome = Light("/dome", LightType.DOME, np.eye(4), (1, 1, 1), texture=FILE)
    (only,) = with_read_textures([rect, dome], {}, Diagnostics())
    assert (only.path, only.texture) == ("/rect", None)


@pytest.mark.conforms("DomeLight.guideRadius", "DomeLight_1.guideRadius")
def test_the_guide_radius_means_nothing_to_a_picture() -> None:
    for kind in ("DomeLight", "DomeLight_1"):
        small, found = translated(f'def {kind} "l" {{ float guideRadius = 3 }}')
        large, _ = translated(f'def {kind} "l" {{ float guideRadius = 3000 }}')
        np.testing.assert_array_equal(small.lights[0].world_from_light, large.lights[0].world_from_light)
        assert small.lights[0].emission == large.lights[0].emission
        assert told(found, "/l") == []


DOME_WITH_PORTALS = """
def Xform "house" {{
    double3 xformOp:translate = (1, 2, 3)
    double3 xformOp:scale = (2, 2, 2)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
    def PortalLight "window" {{ float inputs:width = 3
        float inputs:height = 0.5
        double xformOp:rotateY = 90
        uniform token[] xformOpOrder = ["xformOp:rotateY"] }}
    def PortalLight "other" {{ {other} }}
}}
def {kind} "sky" {{ rel portals = [{targets}] }}
"""


@pytest.mark.conforms(
    "DomeLight.portals",
    "DomeLight_1.portals",
    "PortalLight.inputs:width",
    "PortalLight.inputs:height",
    "PortalLight.light:shaderId",
)
@pytest.mark.parametrize("kind", ["DomeLight", "DomeLight_1"])
def test_portals(kind: str) -> None:
    text = DOME_WITH_PORTALS.format(kind=kind, targets="</house/window>, </house/other>", other="")
    description, found = translated(text)
    (sky,) = description.lights
    window, other = sky.portals
    assert (window.width, window.height, other.width, other.height) == (3, 0.5, 1, 1)
    # Turned by 90 degrees about y: its x is -z, its z is x; twice as large, moved.
    expected = np.array([[0, 0, 2, 1], [0, 2, 0, 2], [-2, 0, 0, 3], [0, 0, 0, 1]])
    np.testing.assert_allclose(window.world_from_portal, expected, atol=1e-12)
    assert [d for d in found if d.prim_path.startswith(("/house", "/sky"))] == []


@pytest.mark.conforms("DomeLight.portals", "DomeLight_1.portals")
def test_portals_that_guide_nothing() -> None:
    flat = "float inputs:width = 0\n color3f inputs:color = (1, 0, 0)"
    text = DOME_WITH_PORTALS.format(kind="DomeLight", targets="</house/other>, </house>, </nowhere>", other=flat)
    description, found = translated(text)
    assert description.lights[0].portals == ()
    assert told(found, "/house/window") == [("light-input", "portals")]  # nobody names it
    assert told(found, "/sky") == [("light-input", "portals")] * 2  # no portal, nothing at all
    assert told(found, "/house/other") == [("light-input", "inputs:color"), ("light-input", "")]


@pytest.mark.conforms("LightAPI.light:filters", "LightFilter.lightFilter:shaderId", state="diagnosed")
@pytest.mark.conforms("LightFilter.collection:filterLink", "LightFilter.collection:filterLink:includeRoot", state="diagnosed")
@pytest.mark.parametrize("kind", ["LightFilter", "PluginLight", "PluginLightFilter", "GeometryLight"])
def test_other_kinds_are_told(kind: str) -> None:
    _, found = translated(f'def {kind} "x" {{ }}\ndef SphereLight "l" {{ rel light:filters = </x> }}')
    assert [code for code, _ in told(found, "/x")] == ["unsupported-light"]
    assert told(found, "/l") == [("light-input", "light:filters")]
