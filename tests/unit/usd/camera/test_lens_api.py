"""PrimrayLensAPI's diffusion on a camera: read whether or not the schema is applied; flags win; what cannot be is told."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from pxr import Sdf

from primray.description import Camera
from primray.errors import SettingsError
from primray.lens.diffusion import NO_DIFFUSION, Diffusion
from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.camera import lens
from primray.usd.camera.lens import LENS_PREFIX

from ..usd_text import stage_of

SCHEMA = Path(__file__).resolve().parents[4] / "schemas/usd"
Told = list[tuple[str, str]]


def seen(body: str, settings: RenderSettings = RenderSettings(), applied: str = "") -> tuple[Camera, Told]:  # noqa: B008
    head = f'(\nprepend apiSchemas = ["{applied}"]\n)\n' if applied else ""
    stage = stage_of(f'def Camera "eye" {head}\n{{\n{body}\n}}\n')
    description, diagnostics = translate(stage, settings)
    codes = [(d.code, d.attribute) for d in diagnostics if d.code not in ("camera-chosen", "nothing-to-render")]
    return description.camera, [
        code for code in codes if code[0] in ("camera-input", "out-of-range", "api-schema", "wrong-type")
    ]


ALL = """float primray:lens:diffusion:strength = 0.25
float primray:lens:diffusion:glare = 0.5
float primray:lens:diffusion:bloomWidth = 0.125
float primray:lens:diffusion:starburst = 0.375
float primray:lens:diffusion:starburstWidth = 0.0625
int primray:lens:diffusion:blades = 7
float primray:lens:diffusion:bladeRotation = 15"""


@pytest.mark.parametrize("applied", ["", "PrimrayLensAPI"])
def test_all_of_it(applied: str) -> None:
    camera, told = seen(ALL, applied=applied)
    assert camera.diffusion == Diffusion(0.25, 0.5, 0.125, 0.375, 0.0625, 7, 15.0)
    assert told == []


def test_off_unless_asked() -> None:
    assert seen("")[0].diffusion == NO_DIFFUSION
    assert seen("", applied="PrimrayLensAPI") == (seen("")[0], [])


def test_flags_win() -> None:
    asked = RenderSettings(diffusion=0.0, diffusion_glare=0.125, diffusion_bloom_width=0.5)
    assert seen(ALL, asked)[0].diffusion == Diffusion(0.0, 0.125, 0.5, 0.375, 0.0625, 7, 15.0)
    assert seen("", RenderSettings(diffusion=0.5))[0].diffusion == Diffusion(0.5)
    with pytest.raises(SettingsError, match="together must be at most 1") as refusal:
        seen(ALL, RenderSettings(diffusion_starburst=0.75))
    assert refusal.value.where == "diffusion_starburst"


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("float primray:lens:diffusion:strength = 2", "out-of-range"),
        ("float primray:lens:diffusion:bloomWidth = 0", "out-of-range"),
        ("int primray:lens:diffusion:blades = 2", "out-of-range"),
        ("float primray:lens:diffusion:blades = 6", "out-of-range"),
        ('string primray:lens:diffusion:glare = "much"', "wrong-type"),
        ("float primray:lens:difusion:strength = 1", "camera-input"),
    ],
)
def test_what_cannot_be_is_told(line: str, code: str) -> None:
    camera, told = seen(line)
    assert camera.diffusion == NO_DIFFUSION
    assert told == [(code, line.split()[1])]


def test_more_than_all_is_told() -> None:
    camera, told = seen("float primray:lens:diffusion:glare = 0.75\nfloat primray:lens:diffusion:starburst = 0.75")
    assert camera.diffusion == NO_DIFFUSION
    assert told == [("out-of-range", "primray:lens:diffusion:starburst")]


def test_blades_of_a_pinhole_are_read_for_the_star() -> None:
    blades = "int primvars:arnold:aperture_blades = 5\nfloat primvars:arnold:aperture_rotation = 30"
    pinhole, told = seen(blades)
    assert (pinhole.blades, pinhole.diffusion.blades, pinhole.diffusion.blade_rotation_deg) == (0, 5, 30.0)
    assert told == []
    lens, _ = seen(f"{blades}\nfloat fStop = 2\nfloat focusDistance = 9")
    assert (lens.blades, lens.diffusion.blades) == (5, None)


def test_the_schema_names_what_is_read() -> None:
    layer = Sdf.Layer.FindOrOpen(str(SCHEMA / "generatedSchema.usda"))
    declared = layer.GetPrimAtPath("/PrimrayLensAPI").properties
    assert {p.name for p in declared} == set(lens.LENS_NAMES)
    for name, member in lens.DIFFUSION_ATTRIBUTES.items():
        fallback = declared[f"{LENS_PREFIX}diffusion:{name}"].default
        assert fallback == pytest.approx(getattr(NO_DIFFUSION, member))


REGISTERED = """
from pxr import Usd
from primray.settings import RenderSettings
from primray.usd import translate
stage = Usd.Stage.CreateInMemory()
prim = stage.DefinePrim("/eye", "Camera")
assert prim.ApplyAPI("PrimrayLensAPI") and prim.HasAPI("PrimrayLensAPI")
prim.GetAttribute("primray:lens:diffusion:strength").Set(0.5)
print(*sorted(n for n in prim.GetPropertyNames() if n.startswith("primray:")))
print(translate(stage, RenderSettings())[0].camera.diffusion)
"""


def test_the_schema_can_be_registered() -> None:
    """In a process of its own: schemas stay registered. Fallbacks of what is not authored change nothing."""
    known = {**os.environ, "PXR_PLUGINPATH_NAME": str(SCHEMA)}
    ran = subprocess.run([sys.executable, "-c", REGISTERED], env=known, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    names, diffusion = ran.stdout.strip().splitlines()
    assert names.split() == sorted(lens.LENS_NAMES)
    assert diffusion.startswith("Diffusion(strength=0.5, glare=0.2")
    assert diffusion.endswith("blades=None, blade_rotation_deg=0.0)")
