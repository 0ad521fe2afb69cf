"""Alpha under a sky that is seen: what is not there, or not shown to the camera, is a hole; what light passes is none."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import primray

HEAD = """#usda 1.0
(
    upAxis = "Y"
)
def Camera "cam"
{
    token projection = "orthographic"
    float horizontalAperture = 20
    float verticalAperture = 20
    double3 xformOp:translate = (0, 0, 10)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
SKY = 'def DomeLight "sky"\n{\n}\n'
LOOKS = {
    "absent": 'float inputs:opacity = 0\ntoken inputs:opacityMode = "presence"',
    "half": 'float inputs:opacity = 0.5\ntoken inputs:opacityMode = "presence"',
    "cut": "float inputs:opacity = 0\nfloat inputs:opacityThreshold = 0.5",
    "glass": "float inputs:opacity = 0.25\ncolor3f inputs:diffuseColor = (0, 0, 0)",
    "solid": "",
}
PASS = """def RenderPass "p"
{
    uniform bool collection:cameraVisibility:includeRoot = true
    rel collection:cameraVisibility:excludes = [HIDDEN]
    uniform bool collection:matte:includeRoot = false
    rel collection:matte:includes = [MATTE]
}
"""


def sheet(number: int, look: str) -> str:
    z = -number
    return f"""def Mesh "m{number}" (prepend apiSchemas = ["MaterialBindingAPI"])
{{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-5, -5, {z}), (5, -5, {z}), (5, 5, {z}), (-5, 5, {z})]
    uniform token subdivisionScheme = "none"
    rel material:binding = </{look}>
}}
"""


def material(name: str) -> str:
    return f"""def Material "{name}"
{{
    token outputs:surface.connect = </{name}/s.outputs:surface>
    def Shader "s"
    {{
        uniform token info:id = "UsdPreviewSurface"
        {LOOKS[name]}
        token outputs:surface
    }}
}}
"""


def alpha(folder: Path, looks: list[str], sky: str = SKY, **more: Any) -> tuple[float, primray.Image]:
    """Of sheets one behind the other; "hidden" and "matte" ones are solid, and so in a pass."""
    plain = [look if look in LOOKS else "solid" for look in looks]
    paths = {what: ", ".join(f"</m{k}>" for k, look in enumerate(looks) if look == what) for what in ("hidden", "matte")}
    text = HEAD + sky + "".join(map(material, LOOKS)) + "".join(sheet(k, look) for k, look in enumerate(plain))
    if any(paths.values()):
        text += PASS.replace("HIDDEN", paths["hidden"]).replace("MATTE", paths["matte"])
        more["render_pass"] = "/p"
    (folder / "s.usda").write_text(text)
    settings: dict[str, Any] = {"resolution": (16, 16), "spp": 64, "progress": False, "camera": "/cam"} | more
    image = primray.render(folder / "s.usda", **settings)
    return float(np.mean(image.pixels[..., 3])), image


HOLES = {"absent": 0, "cut": 0, "hidden": 0, "matte": 0, "half": 0.5, "solid": 1, "glass": 1}


@pytest.mark.parametrize(
    ("looks", "expected"),
    [
        *(([look], share) for look, share in HOLES.items()),
        (["absent", "absent"], 0),
        (["absent", "cut", "absent"], 0),
        (["hidden", "absent"], 0),
        (["absent", "hidden"], 0),
        (["hidden", "hidden"], 0),
        (["absent", "solid"], 1),
        (["hidden", "solid"], 1),
        (["solid", "absent"], 1),
        (["absent", "matte"], 0),
        (["half", "half"], 0.75),
        (["half", "hidden"], 0.5),
        (["absent", "glass"], 1),
        (["glass", "absent"], 1),
        (["hidden", "glass", "hidden"], 1),
    ],
    ids=str,
)
def test_gaps_are_holes(looks: list[str], expected: float, tmp_path: Path) -> None:
    found, image = alpha(tmp_path, looks)
    assert found == pytest.approx(expected, abs=0.03 if expected % 1 else 1e-6)
    assert image.pixels[..., :3].min() >= 0


@pytest.mark.parametrize("looks", [["absent"], ["half"], ["absent", "absent"], ["hidden"], ["half", "half"]], ids=str)
def test_the_sky_makes_no_difference(looks: list[str], tmp_path: Path) -> None:
    lamp = 'def DistantLight "sun"\n{\n}\n'
    with_sky, without = (alpha(tmp_path, looks, sky)[1].pixels[..., 3] for sky in (SKY, lamp))
    assert np.array_equal(with_sky, without)


def test_lights_that_are_seen_through_gaps_cover(tmp_path: Path) -> None:
    card = 'def RectLight "card"\n{\nfloat inputs:width = 20\nfloat inputs:height = 20\n'
    card += "double3 xformOp:translate = (0, 0, -5)\ndouble xformOp:rotateY = 180\n"
    card += 'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY"]\n}\n'
    assert alpha(tmp_path, ["absent"], SKY + card)[0] == 1


@pytest.mark.parametrize("looks", [["absent"], ["half"], ["hidden", "half"]], ids=str)
def test_mattes_add_up_to_it(looks: list[str], tmp_path: Path) -> None:
    found, image = alpha(tmp_path, looks, aovs=["crypto_object"])
    aov = image.aovs["crypto_object"]
    assert np.allclose(aov.values[..., 1::2].sum(axis=2), image.pixels[..., 3], atol=1e-6)
    (manifest,) = (value for key, value in aov.metadata.items() if key.endswith("/manifest"))
    assert "lights" not in manifest
    assert ("half" in looks) == (found > 0)
