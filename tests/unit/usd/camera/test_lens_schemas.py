"""Flaws of lenses as cameras have them, and schemas registered with USD or not."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from tests.unit.usd.camera.lens_text import camera_of

SCHEMAS = Path(__file__).resolve().parents[4] / "schemas" / "usd"


FLAWS = """bool primray:lens:vignetting:natural = 1
float primray:lens:vignetting:mechanicalDistance = 2
float primray:lens:vignetting:mechanicalRadius = 0.5
float3 primray:lens:chromatic:lateral = (1.25, 1, 0.75)
float3 primray:lens:chromatic:longitudinal = (-0.5, 0, 0.25)
"""


def test_flaws_are_read_and_asked_for() -> None:
    camera, said = camera_of(FLAWS, "PrimrayLensAPI")
    assert said == []
    assert (camera.natural_vignetting, camera.rim) == (True, (2.0, 0.5))
    assert (camera.channel_magnification, camera.channel_focus_shift) == ((1.25, 1, 0.75), (-0.5, 0, 0.25))
    plain, _ = camera_of("")
    assert (plain.natural_vignetting, plain.rim, plain.channel_magnification) == (False, (0, 0), (1, 1, 1))
    asked = ("natural-vignetting=0", "mechanical-vignetting=3,0.25", "lateral-chromatic=1,1,1", "longitudinal-chromatic=0,0,0")
    over, _ = camera_of(FLAWS, lens_flaws=asked)
    assert (over.natural_vignetting, over.rim, over.channel_magnification) == (False, (3, 0.25), (1, 1, 1))
    alone, _ = camera_of("", lens_flaws=("natural-vignetting=1",))
    assert alone.natural_vignetting


@pytest.mark.parametrize(
    ("body", "attribute"),
    [
        ("float primray:lens:vignetting:mechanicalRadius = -1", "primray:lens:vignetting:mechanicalRadius"),
        ("float3 primray:lens:chromatic:lateral = (1, 0, 1)", "primray:lens:chromatic:lateral"),
        (
            "float fStop = 1\nfloat focusDistance = 2\nfloat3 primray:lens:chromatic:longitudinal = (0, -2, 0)",
            "primray:lens:chromatic:longitudinal",
        ),
    ],
)
def test_flaws_that_cannot_be(body: str, attribute: str) -> None:
    camera, said = camera_of(body)
    assert said == [("out-of-range", attribute)]
    assert (camera.rim, camera.channel_magnification, camera.channel_focus_shift) == ((0, 0), (1, 1, 1), (0, 0, 0))


def test_an_orthographic_camera_has_no_flaws() -> None:
    camera, said = camera_of('token projection = "orthographic"\n' + FLAWS)
    assert said == [("camera-input", "")]
    assert camera.rim == (0, 0)


REGISTERED = """
import primray.usd
from pxr import Usd, UsdGeom
stage = Usd.Stage.CreateInMemory()
prim = UsdGeom.Camera.Define(stage, "/eye").GetPrim()
assert prim.ApplyAPI("PrimrayLensAPI")
assert tuple(prim.GetAttribute("primray:lens:chromatic:lateral").Get()) == (1, 1, 1)
assert prim.GetAttribute("primray:lens:vignetting:mechanicalRadius").Get() == 0
prim.GetAttribute("primray:lens:vignetting:natural").Set(True)
from primray.settings import RenderSettings
description, diagnostics = primray.usd.translate(stage, RenderSettings(camera="/eye"))
assert description.camera.natural_vignetting and not [d for d in diagnostics if d.prim_path == "/eye"]
"""


def test_usd_knows_the_schema_by_its_folder() -> None:
    found = os.environ | {"PXR_PLUGINPATH_NAME": str(SCHEMAS)}
    subprocess.run([sys.executable, "-c", REGISTERED], env=found, check=True, capture_output=True, text=True)
