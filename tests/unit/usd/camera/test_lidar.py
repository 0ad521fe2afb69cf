"""Lidars on a stage: attributes of primray and of Omniverse, axes of cameras and of other prims, what is no lidar."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom

import primray
from primray import usd
from primray.diagnostics import Diagnostics
from primray.errors import InvalidSceneError, SettingsError
from primray.sensor.lidar_pattern import NAMED
from primray.usd.camera.lidar import OWN, WORDS

SCHEMAS = Path(__file__).parents[4] / "schemas/usd"


def stage_with(name: str, **attributes: tuple[Sdf.ValueTypeName, Any]) -> Usd.Stage:
    stage = Usd.Stage.CreateInMemory()
    prim = UsdGeom.Xform.Define(stage, "/lidar").GetPrim()
    for attribute, (kind, value) in attributes.items():
        prim.CreateAttribute(name + attribute, kind).Set(value)
    return stage


def test_the_schema_has_what_is_read() -> None:
    declared = []
    for name in ("schema.usda", "generatedSchema.usda"):
        layer = Sdf.Layer.FindOrOpen(str(SCHEMAS / name))
        spec = layer.GetPrimAtPath("/PrimrayLidarAPI")
        declared.append([(p.name, p.typeName, p.documentation, p.GetInfo("allowedTokens")) for p in spec.properties])
    assert declared[0] == declared[1]
    assert {name for name, *_ in declared[0]} == {OWN + word for word in WORDS}
    assert list({name: tokens for name, _, _, tokens in declared[0]}[f"{OWN}pattern"]) == list(NAMED)


def test_attributes_of_omniverse_are_a_pattern() -> None:
    floats, core = Sdf.ValueTypeNames.FloatArray, "omni:sensor:Core:"
    stage = stage_with(
        core,
        scanRateBaseHz=(Sdf.ValueTypeNames.Float, 20.0),
        patternFiringRateHz=(Sdf.ValueTypeNames.Float, 36000.0),
        rotationDirection=(Sdf.ValueTypeNames.Token, "CW"),
        nearRangeM=(Sdf.ValueTypeNames.Float, 0.5),
        farRangeM=(Sdf.ValueTypeNames.Float, 120.0),
        numberOfEmitters=(Sdf.ValueTypeNames.UInt, 3),
    )
    prim = stage.GetPrimAtPath("/lidar")
    emitters = {"elevationDeg": [-5.0, 5.0], "azimuthDeg": [1.0, -1.0], "fireTimeNs": [0.0, 500.0]}
    for name, value in emitters.items():
        prim.CreateAttribute(f"{core}emitterState:s001:{name}", floats).Set(value)
    diagnostics = Diagnostics()
    found = usd.lidar_prim(stage, None, None, diagnostics)
    pattern = primray.LidarPattern.of(found.authored)
    assert (pattern.elevations_deg, pattern.azimuths_deg) == ((-5, 5), (1, -1))
    assert pattern.times_s == pytest.approx((0, 5e-7))
    assert (pattern.steps, pattern.rate_hz, pattern.range_m, pattern.clockwise) == (1800, 20, (0.5, 120), True)
    assert ["numberOfEmitters is 3" in one.message for one in diagnostics] == [True]


def test_a_lidar_of_omniverse_is_where_its_transform_says_though_usd_does_not_know_its_type() -> None:
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.Xform.Define(stage, "/car").AddTranslateOp().Set((10, 0, 0))
    prim = stage.DefinePrim("/car/lidar", "OmniLidar")
    prim.CreateAttribute("xformOp:translate", Sdf.ValueTypeNames.Double3).Set((0, 0, 2))
    prim.CreateAttribute("xformOp:rotateZ", Sdf.ValueTypeNames.Double).Set(90)
    order = ["xformOp:translate", "xformOp:rotateZ"]
    prim.CreateAttribute("xformOpOrder", Sdf.ValueTypeNames.TokenArray).Set(order)
    assert usd.lidar_prim(stage, None, None, Diagnostics()).path == "/car/lidar"
    _, (pose,) = usd.lidar_poses(stage, "/car/lidar", None, np.zeros(1))
    assert pose[:3, 3].tolist() == [10, 0, 2]
    assert np.allclose(pose[:3, :3] @ [1, 0, 0], [0, 1, 0])


def test_unknown_words_are_reported() -> None:
    stage = stage_with(OWN, elevation=(Sdf.ValueTypeNames.FloatArray, [1.0]), steps=(Sdf.ValueTypeNames.Int, 9))
    diagnostics = Diagnostics()
    assert dict(usd.lidar_prim(stage, "/lidar", None, diagnostics).authored) == {"steps": 9}
    assert ["did you mean elevations" in one.message for one in diagnostics] == [True]


def test_a_camera_scans_along_its_view_and_an_xform_along_x() -> None:
    stage = Usd.Stage.CreateInMemory()
    turned = UsdGeom.Camera.Define(stage, "/camera")
    turned.AddTranslateOp().Set((1, 2, 3))
    turned.AddScaleOp().Set((2, 2, 2))
    _, (pose,) = usd.lidar_poses(stage, "/camera", None, np.zeros(1))
    assert pose[:3, 3].tolist() == [1, 2, 3]
    assert np.allclose(pose[:3, :3] @ [1, 0, 0], [0, 0, -1])  # forward
    assert np.allclose(pose[:3, :3] @ [0, 1, 0], [-1, 0, 0])  # left
    assert np.allclose(pose[:3, :3] @ [0, 0, 1], [0, 1, 0])  # up
    UsdGeom.Xform.Define(stage, "/xform").AddRotateZOp().Set(90)
    _, (pose,) = usd.lidar_poses(stage, "/xform", None, np.zeros(1))
    assert np.allclose(pose[:3, :3] @ [1, 0, 0], [0, 1, 0])


def test_poses_of_many_times_are_those_of_usd_to_a_few_micrometres() -> None:
    stage = Usd.Stage.CreateInMemory()
    xform = UsdGeom.Xform.Define(stage, "/lidar")
    move, turn = xform.AddTranslateOp(), xform.AddRotateZOp()
    for time, x, angle in ((0, 0, 0), (1.3, 2, 40), (5, 3, 41)):
        move.Set((x, 0, 0), time)
        turn.Set(angle, time)
    stage.SetTimeCodesPerSecond(24)
    seconds = np.linspace(0, 0.2, 30001)
    times, poses = usd.lidar_poses(stage, "/lidar", 0.0, seconds)
    assert len(times) == 4097  # even ones, and the authored sample
    few = usd.lidar_poses(stage, "/lidar", 0.0, seconds[::1000])
    assert len(few[0]) == 31
    positions = np.interp(few[0], times, poses[:, 0, 3])
    assert np.abs(positions - few[1][:, 0, 3]).max() < 1e-9


def test_what_is_no_lidar_is_an_error() -> None:
    stage = Usd.Stage.CreateInMemory()
    with pytest.raises(SettingsError, match="no prim of the stage says that it is one") as caught:
        usd.lidar_prim(stage, None, None, Diagnostics())
    assert caught.value.code == "lidar-sensor"
    for name in ("a", "b"):
        UsdGeom.Xform.Define(stage, f"/{name}").GetPrim().CreateAttribute(f"{OWN}steps", Sdf.ValueTypeNames.Int).Set(3)
    with pytest.raises(SettingsError, match="the stage has 2: /a, /b"):
        usd.lidar_prim(stage, None, None, Diagnostics())
    stage.DefinePrim("/scope", "Scope")
    with pytest.raises(SettingsError, match="a Scope has no place"):
        usd.lidar_prim(stage, "/scope", None, Diagnostics())
    flat = UsdGeom.Xform.Define(stage, "/flat")
    flat.AddScaleOp().Set((1, 0, 1))
    with pytest.raises(InvalidSceneError, match="has no inverse"):
        usd.lidar_poses(stage, "/flat", None, np.zeros(1))
    with pytest.raises(SettingsError, match="rigid"):
        primray.lidar(stage, np.diag([2.0, 1, 1, 1]))
    with pytest.raises(SettingsError, match="rigid"):
        primray.lidar(stage, [[1, 0]])
