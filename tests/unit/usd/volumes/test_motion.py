"""Paths of volumes over the shutter: those of the Volume, of the field prim, of what is above both, and of instances."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom
from tests.unit.usd.volumes.volume_text import field_text, grid, translated, volume_text, write

from primray.description import VolumeMedium
from primray.settings import RenderSettings

OPEN = RenderSettings(time_code=0, shutter=(-0.5, 0.5))
STEPS = "xformOp:translate.timeSamples = { -1: (-10, 0, 0), 1: (10, 0, 0) }"
MOVES = f'double3 {STEPS}\nuniform token[] xformOpOrder = ["xformOp:translate"]\n'
STAYS = 'double3 xformOp:translate = (1, 2, 3)\nuniform token[] xformOpOrder = ["xformOp:translate"]\n'


def path_of(medium: VolumeMedium) -> list[list[float]]:
    """Positions of the first instance's origin at the times of its motion."""
    assert medium.motion is not None
    return medium.motion.matrices[:, 0, :3, 3].tolist()


@pytest.mark.parametrize(
    "text",
    [
        volume_text(extra=MOVES),
        volume_text({"density": MOVES}),
        f'def Xform "Up" {{ {MOVES}\n {volume_text()} }}',
        f'def Xform "Up" {{ {MOVES}\n {volume_text({"density": STAYS}, extra=STAYS)} }}',
    ],
)
def test_the_volume_its_field_or_what_is_above_moves(tmp_path: Path, text: str) -> None:
    write(tmp_path, grid())
    description, told, _ = translated(tmp_path, text, OPEN)
    (medium,) = description.media
    assert medium.motion is not None
    assert not medium.motion.turns
    still = np.array([2, 4, 6]) if "(1, 2, 3)" in text else np.zeros(3)
    np.testing.assert_allclose(path_of(medium), [still + [-5, 0, 0], still + [5, 0, 0]])
    np.testing.assert_allclose(medium.matrices[0, :3, 3], still)
    assert description.exposure is not None
    assert description.exposure.span == (-0.5, 0.5)
    assert [(steps.kind, steps.segments) for steps in description.motion_steps] == [("volumes", 1)]
    assert {code for code, _ in told} == {"volume-convention"}


def test_matrices_are_those_of_usd(tmp_path: Path) -> None:
    write(tmp_path, grid())
    stage = Usd.Stage.CreateNew(str(tmp_path / "made.usda"))
    above, volume = UsdGeom.Xform.Define(stage, "/Up"), stage.DefinePrim("/Up/Smoke", "Volume")
    field = stage.DefinePrim("/Up/Smoke/Between/Field", "OpenVDBAsset")
    turn, move, own = above.AddRotateXYZOp(), UsdGeom.Xformable(volume).AddTranslateOp(), UsdGeom.Xformable(field).AddScaleOp()
    for time in (0.0, 1.0, 2.0):
        turn.Set((10 * time, 40 * time, 0), time)
        move.Set((1, time, time**2), time)
        own.Set((1 + time, 2, 1), time)
    field.GetAttribute("filePath").Set("./smoke.vdb")
    field.GetAttribute("fieldName").Set("density")
    volume.CreateRelationship("field:density").AddTarget(field.GetPath())
    text = stage.ExportToString().removeprefix("#usda 1.0")
    text = text.replace('(\n    doc = """Generated from Composed Stage of root layer', "").split('"""\n)')[-1]
    settings = RenderSettings(time_code=1, shutter=(-0.75, 0.5), motion_error=1e-4)
    (medium,) = translated(tmp_path, text, settings)[0].media
    assert medium.motion is not None
    for time, matrix in zip(medium.motion.times, medium.motion.matrices[:, 0], strict=True):
        cache = UsdGeom.XformCache(1.0 - 0.75 + 1.25 * time)
        expected = np.array(cache.GetLocalToWorldTransform(field)).T
        np.testing.assert_allclose(matrix, expected[:3], atol=1e-9)
    frame = np.array(UsdGeom.XformCache(1.0).GetLocalToWorldTransform(field)).T
    np.testing.assert_allclose(medium.matrices[0], frame, atol=1e-12)


def test_a_field_elsewhere_does_not_move_with_its_volume(tmp_path: Path) -> None:
    write(tmp_path, grid())

    def medium_of(data: str, own: str) -> VolumeMedium:
        text = f'def Xform "Data" {{ {data}\n {field_text()} }}\n'
        text += f'def Volume "Smoke" {{ rel field:density = </Data/density>\n {own} }}'
        (medium,) = translated(tmp_path, text, OPEN)[0].media
        return medium

    still = medium_of(STAYS, MOVES)
    assert still.motion is None
    np.testing.assert_array_equal(still.matrices[0, :3, 3], [1, 2, 3])
    for own in (STAYS, MOVES):
        np.testing.assert_allclose(path_of(medium_of(MOVES, own)), [[-5, 0, 0], [5, 0, 0]])


def test_moving_and_still_instances(tmp_path: Path) -> None:
    write(tmp_path, grid())
    text = f"""
class "Cloud" {{ {volume_text({"density": STAYS})} }}
def Xform "A" (instanceable = true
    references = </Cloud>) {{ {MOVES} }}
def Xform "B" (instanceable = true
    references = </Cloud>) {{ {STAYS} }}
def PointInstancer "Many" {{
    rel prototypes = </Many/One>
    int[] protoIndices = [0, 0]
    point3f[] positions.timeSamples = {{ -1: [(0, -8, 0), (0, 1, 0)], 1: [(0, 8, 0), (0, 1, 0)] }}
    def Xform "One" (instanceable = true
        references = </Cloud>) {{}}
}}"""
    description, told, _ = translated(tmp_path, text, OPEN)
    ends = sorted(
        (tuple(m.motion.matrices[0, k, :, 3]), tuple(m.motion.matrices[-1, k, :, 3]))
        for m in description.media
        if m.motion is not None
        for k in range(len(m.matrices))
    )
    assert ((1, -2, 3), (1, 6, 3)) in ends
    assert ((-4, 2, 3), (6, 2, 3)) in ends
    assert ((1, 3, 3), (1, 3, 3)) in ends
    assert {code for code, _ in told} == {"volume-convention"}


def test_blur_scale_and_stills(tmp_path: Path) -> None:
    write(tmp_path, grid())
    scaled = '(prepend apiSchemas = ["MotionAPI"])'
    text = volume_text(extra=MOVES + "\nfloat motion:blurScale = 0.5").replace('"Smoke"', f'"Smoke" {scaled}')
    (medium,) = translated(tmp_path, text, OPEN)[0].media
    np.testing.assert_allclose(path_of(medium), [[-2.5, 0, 0], [2.5, 0, 0]])
    for moved in (volume_text(extra=MOVES), volume_text({"density": MOVES})):
        description = translated(tmp_path, moved, RenderSettings(time_code=0, shutter=(0.25, 0.25)))[0]
        (medium,) = description.media
        assert medium.motion is None
        assert description.exposure is None
        np.testing.assert_allclose(medium.matrices[0, :3, 3], [2.5, 0, 0])


@pytest.mark.parametrize("apart", [False, True])
def test_fields_that_are_combined(tmp_path: Path, apart: bool) -> None:
    write(tmp_path, grid(), grid(name="cover"))
    text = f"""
{volume_text({"density": MOVES, "cover": STAYS if apart else MOVES}, bound="/Look")}
def Material "Look" {{
    token outputs:mtlx:volume.connect = </Look/Volume.outputs:out>
    def Shader "Volume" {{
        uniform token info:id = "ND_volume"
        token inputs:vdf.connect = </Look/Absorb.outputs:out>
        token outputs:out
    }}
    def Shader "Absorb" {{
        uniform token info:id = "ND_absorption_vdf"
        color3f inputs:absorption.connect = </Look/Product.outputs:out>
        token outputs:out
    }}
    def Shader "Product" {{
        uniform token info:id = "ND_multiply_color3FA"
        color3f inputs:in1.connect = </Look/Cover.outputs:out>
        float inputs:in2.connect = </Look/Density.outputs:out>
        color3f outputs:out
    }}
    def Shader "Cover" {{
        uniform token info:id = "ND_geompropvalue_color3"
        string inputs:geomprop = "cover"
        color3f outputs:out
    }}
    def Shader "Density" {{
        uniform token info:id = "ND_geompropvalue_float"
        string inputs:geomprop = "density"
        float outputs:out
    }}
}}"""
    description, told, messages = translated(tmp_path, text, OPEN)
    (medium,) = description.media
    np.testing.assert_allclose(path_of(medium), [[-5, 0, 0], [5, 0, 0]])
    assert (("motion", "/Smoke") in told) == apart
    assert any("moves with the field density" in message for message in messages) == apart
