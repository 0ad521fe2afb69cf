"""What the camera does not see of a render pass, and what is held out of its picture, is there for all other light."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pxr import Usd

import primray
from primray import Image
from primray.errors import UnsupportedError

# From above onto a floor, half of which a card hides, in light that falls straight down; beyond the floor there is nothing.
SCENE = """#usda 1.0
def Camera "camera"
{
    token projection = "orthographic"
    float horizontalAperture = 30
    float verticalAperture = 20
    float2 clippingRange = (0.1, 100)
    double3 xformOp:translate = (0, 0, 10)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Mesh "floor"
{
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]
    FLOOR
}
def Mesh "card" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{
    point3f[] points = [(0, -2, 1), (2, -2, 1), (2, 2, 1), (0, 2, 1)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    rel material:binding = </glowing>
}
def Material "glowing"
{
    token outputs:surface.connect = </glowing/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0, 0, 0)
        color3f inputs:emissiveColor = (0, GLOW, 0)
        float inputs:ior = 1
        token outputs:surface
    }
}
def Material "mirror"
{
    token outputs:surface.connect = </mirror/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (1, 1, 1)
        float inputs:metallic = 1
        float inputs:roughness = 0
        token outputs:surface
    }
}
def DistantLight "sun"
{
    float inputs:intensity = 1
    float inputs:angle = 0
    bool inputs:normalize = 1
}
def RenderPass "pass"
{
    uniform bool collection:cameraVisibility:includeRoot = 1
    PASS
}
"""
HIDDEN = "rel collection:cameraVisibility:excludes = </card>"
MATTE = "rel collection:matte:includes = </card>"
MIRROR = "rel material:binding = </mirror>"


def shot(body: str, *, glow: float = 0, floor: str = "", there: str = "", **settings: Any) -> Image:
    stage = Usd.Stage.CreateInMemory()
    text = (
        SCENE.replace("float inputs:ior = 1", f"float inputs:ior = 1\n{there}")
        .replace("PASS", body)
        .replace("GLOW", str(glow))
        .replace("FLOOR", floor)
    )
    assert stage.GetRootLayer().ImportFromString(text)
    return primray.render(stage, **{"resolution": (12, 8), "spp": 16, "render_pass": "/pass", **settings})


# Of 12 by 8 pixels of a quarter: the floor is columns 2 to 9, the card's half of it columns 6 to 9, and 6 to 11 the card.
LIT, SHADED, CARD, NOTHING = np.s_[:, 2:6], np.s_[:, 6:10], np.s_[:, 6:], np.s_[:, :2]


def test_a_plain_pass_shows_the_card() -> None:
    image = shot("", glow=2)
    assert np.array_equal(image.pixels[CARD][..., 1], np.full((8, 6), 2.0, np.float32))
    assert np.all(image.pixels[CARD][..., 3] == 1)
    assert np.all(image.pixels[NOTHING] == 0)


@pytest.mark.conforms("RenderPass.collection:cameraVisibility", "RenderPass.collection:cameraVisibility:includeRoot")
def test_what_is_hidden_from_the_camera_casts_its_shadow() -> None:
    image = shot(HIDDEN)
    assert np.all(image.pixels[LIT][..., :3] > 0)
    assert np.all(image.pixels[SHADED][..., :3] == 0)
    assert np.all(image.pixels[:, 2:10, 3] == 1)
    assert np.all(image.pixels[NOTHING] == 0)
    assert np.all(image.pixels[:, 10:] == 0)


def test_it_shines_and_is_mirrored() -> None:
    image = shot(HIDDEN, glow=2, floor=MIRROR)
    np.testing.assert_allclose(image.pixels[SHADED][..., 1], 2, rtol=1e-5)
    assert np.all(image.pixels[:, 10:] == 0)
    lit = shot(HIDDEN, glow=2, spp=256)
    shown = shot("", glow=2, spp=256)
    np.testing.assert_allclose(lit.pixels[LIT][..., 1].mean(), shown.pixels[LIT][..., 1].mean(), rtol=0.02)
    assert lit.pixels[LIT][..., 1].mean() > 1.05 * lit.pixels[LIT][..., 0].mean()


@pytest.mark.conforms("RenderPass.collection:matte")
def test_what_is_matte_is_a_hole() -> None:
    image = shot(MATTE, glow=2)
    assert np.all(image.pixels[CARD] == 0)
    assert np.all(image.pixels[:, 2:6, 3] == 1)
    assert np.all(image.pixels[NOTHING] == 0)
    shown = shot("", glow=2, spp=256)
    np.testing.assert_allclose(shot(MATTE, glow=2, spp=256).pixels[LIT].mean((0, 1)), shown.pixels[LIT].mean((0, 1)), rtol=0.02)


PRESENCE = 'token inputs:opacityMode = "presence"'


@pytest.mark.parametrize("how", [PRESENCE, "float inputs:opacityThreshold = 0.5"])
def test_what_is_not_there_holds_nothing_out(how: str) -> None:
    image = shot(MATTE, glow=2, there=f"{how}\nfloat inputs:opacity = 0")
    assert np.all(image.pixels[:, 2:10, 3] == 1)
    assert np.all(image.pixels[NOTHING] == 0)


def test_a_matte_that_is_there_in_part_is_reported() -> None:
    with pytest.raises(UnsupportedError, match="holds out everything behind it"):
        shot(MATTE, strict=True, there=f"{PRESENCE}\nfloat inputs:opacity = 0.5")
    assert np.all(shot(MATTE, strict=True, there=f"{PRESENCE}\nfloat inputs:opacity = 1").pixels[CARD] == 0)


def test_what_the_camera_does_not_see_is_in_no_plane() -> None:
    asked = ["depth", "crypto_object", "albedo"]
    hidden, matte = (shot(body, aovs=asked) for body in (HIDDEN, MATTE))
    np.testing.assert_allclose(hidden.aovs["depth"].values[SHADED], 10, rtol=1e-6)
    assert np.all(np.isinf(matte.aovs["depth"].values[CARD]))
    assert np.all(matte.aovs["albedo"].values[CARD] == 0)
    assert np.all(matte.aovs["albedo"].values[LIT] > 0)
    for image in (hidden, matte):
        planes = image.aovs["crypto_object"].values
        np.testing.assert_allclose(planes[..., 1::2].sum(-1), image.pixels[..., 3], atol=1e-6)
