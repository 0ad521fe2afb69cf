"""Channels of PNG and TIFF follow from what is asked for and from the stage, never from samples; JPEG is flattened."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import primray

CAMERA = """
def Camera "camera" { %s
 float2 clippingRange = (0.1, 1000)
 double3 xformOp:translate = (0, 0, 10)
 uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Sphere "ball" { double radius = %g
 color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]
}
"""
AT = 'double3 xformOp:translate = (%g, %g, %g)\n uniform token[] xformOpOrder = ["xformOp:translate"]'
ORTHO = 'token projection = "orthographic"\n float horizontalAperture = 60\n float verticalAperture = 60'
HIDDEN = "bool primvars:arnold:camera = false"


def stage(light: str, radius: float = 1.0, camera: str = "") -> Any:
    from pxr import Usd

    made = Usd.Stage.CreateInMemory("alpha.usda")
    assert made.GetRootLayer().ImportFromString("#usda 1.0\n" + CAMERA % (camera, radius) + light)
    return made


def rendered(light: str, radius: float = 1.0, camera: str = "", seed: int = 0) -> primray.Image:
    return primray.render(stage(light, radius, camera), resolution=(20, 20), spp=2, seed=seed, camera="/camera", progress=False)


def channels(path: Path) -> int:
    import OpenImageIO as oiio

    file = oiio.ImageInput.open(str(path))
    assert file is not None
    count = int(file.spec().nchannels)
    file.close()
    return count


def rect(*at: float) -> str:
    return f'def RectLight "r" {{ float inputs:intensity = 5\n {AT % at}\n}}\n'


NO_LIGHT, DOME = "", 'def DomeLight "sky" { float inputs:intensity = 1\n}\n'


@pytest.mark.parametrize(
    ("light", "radius", "camera", "expected"),
    [
        (NO_LIGHT, 1.0, "", 4),
        (NO_LIGHT, 50.0, "", 4),  # all is covered, which samples alone know
        (DOME, 1.0, "", 3),
        (rect(0, 0, 2), 1.0, "", 3),
        (rect(9, 0, 2), 1.0, "", 4),  # beside the frame
        (rect(0, 0, 30), 1.0, "", 4),  # behind the camera
        (rect(2, 0, 2), 1.0, ORTHO, 3),
        (rect(9, 0, 2), 1.0, ORTHO, 4),
        ('def DistantLight "sun" { float inputs:angle = 1\n}\n', 1.0, "", 4),  # it is behind the camera
        ('def DistantLight "sun" { float inputs:angle = 1\n float3 xformOp:rotateXYZ = (180, 0, 0)\n'
         ' uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]\n}\n', 1.0, "", 3),
        ('def SphereLight "s" { float inputs:radius = 0.1\n float inputs:intensity = 0\n}\n', 1.0, "", 4),
    ],
)  # fmt: skip
def test_alpha_is_there_unless_the_camera_may_see_light_behind(
    light: str, radius: float, camera: str, expected: int, tmp_path: Path
) -> None:
    image = rendered(light, radius, camera)
    for suffix in (".png", ".tif"):
        assert channels(image.save(tmp_path / f"a{suffix}")) == expected
    again = primray.read_image(image.save(tmp_path / "a.exr"))
    assert channels(again.save(tmp_path / "again.png")) == expected
    assert (image.to_uint8()[..., 3] == 255).all() == (expected == 3 or radius > 10)


def test_samples_do_not_decide(tmp_path: Path) -> None:
    """Light in single pixels that nothing covers, and coverage of all pixels, as some seeds have it and others do not."""
    image = rendered(NO_LIGHT)
    speck, whole = np.array(image.pixels), np.array(image.pixels)
    assert speck[0, 0, 3] == 0
    speck[0, 0, :3], whole[..., 3] = 0.01, 1
    for pixels, on_merge in itertools.product((image.pixels, speck, whole), (False, True)):
        from dataclasses import replace

        made = replace(image, pixels=pixels)
        made = primray.read_image(made.save(tmp_path / "m.exr")) if on_merge else made
        assert channels(made.save(tmp_path / "m.png")) == 4
        lit = replace(made, file=replace(made.file, lit_behind=True))
        assert channels(lit.save(tmp_path / "m.png")) == 3


def test_a_jpeg_is_over_a_colour(tmp_path: Path) -> None:
    image = rendered(NO_LIGHT)
    corner, middle = (0, 0), (10, 10)
    plain = read(image.save(tmp_path / "a.jpg"))
    over = read(image.save(tmp_path / "b.jpg", flatten_over=(1.0, 0.5, 0.0)))
    assert (plain[corner] < 8).all()
    assert np.abs(over[corner] - [255, 128, 0]).max() < 12
    assert np.abs(over[middle] - plain[middle]).max() < 12
    assert channels(image.save(tmp_path / "b.png", flatten_over=(1.0, 0.5, 0.0))) == 4
    sky = rendered(DOME)
    assert np.array_equal(read(sky.save(tmp_path / "c.jpg")), read(sky.save(tmp_path / "d.jpg", flatten_over=(1.0, 0.5, 0.0))))


def read(path: Path) -> Any:
    import OpenImageIO as oiio

    file = oiio.ImageInput.open(str(path))
    assert file is not None
    return np.asarray(file.read_image(0, 0, 0, file.spec().nchannels, oiio.UINT8)).astype(int)
