"""Readings of light meters against closed forms, the coverage of their intervals, and that nothing else changes them."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux

from primray import LightMeter, MeterGrid, PrimrayError, RenderSettings, measure
from primray.cli import run

UP = LightMeter("up", (0.0, 0.0, 0.0))
CYLINDER = LightMeter("cylinder", (0.0, 0.0, 0.0), kind="cylindrical")  # type: ignore[arg-type]
LIFT = 5e-4  # of a facet above its meter, in metres


def new_stage(up: str = "Y", meters_per_unit: float = 1.0) -> Usd.Stage:
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, up)
    UsdGeom.SetStageMetersPerUnit(stage, meters_per_unit)
    return stage


def light(stage: Usd.Stage, kind: Any, place: tuple[float, float, float], turn: float = 0.0, **inputs: Any) -> Any:
    made = kind.Define(stage, "/light")
    made.AddTranslateOp().Set(Gf.Vec3d(*place))
    if turn:
        made.AddRotateXOp().Set(turn)
    for name, value in inputs.items():
        made.GetPrim().GetAttribute(name if name.startswith("treat") else f"inputs:{name}").Set(value)
    return made


def box(stage: Usd.Stage, name: str, low: Iterable[float], high: Iterable[float], albedo: float) -> None:
    """Define an axis-aligned box, or a rectangle where it has no extent along one axis."""
    made = UsdGeom.Cube.Define(stage, f"/{name}")
    a, b = np.array(list(low)), np.array(list(high))
    made.AddTranslateOp().Set(Gf.Vec3d(*(0.5 * (a + b)).tolist()))
    made.AddScaleOp().Set(Gf.Vec3f(*(0.5 * np.maximum(b - a, 1e-3)).tolist()))
    made.CreateDisplayColorAttr([Gf.Vec3f(albedo)])


def of_rectangle(width: float, height: float, distance: float, radiance: float) -> float:
    """Illuminance at a distance below the middle of a rectangle that is parallel to the plane."""
    a, b = 0.5 * width, 0.5 * height
    u, v = math.hypot(a, distance), math.hypot(b, distance)
    return 2 * radiance * (a / u * math.atan(b / u) + b / v * math.atan(a / v))


def read(stage: Usd.Stage, *meters: LightMeter | MeterGrid, target: float = 0.001, **more: Any) -> list[float]:
    found = measure(stage, meters, target=target, **more)
    assert found.met
    return [reading.value for reading in found.readings]


def test_lights_of_known_illuminance() -> None:
    stage = new_stage()
    light(stage, UsdLux.RectLight, (0, 2, 0), -90, width=2.0, height=2.0, intensity=10.0)
    assert of_rectangle(2, 2, 2, 10) == pytest.approx(7.52275, rel=1e-6)
    assert read(stage, UP) == pytest.approx([of_rectangle(2, 2, 2 - LIFT, 10)], rel=0.001)
    stage = new_stage()
    light(stage, UsdLux.DiskLight, (0, 2, 0), -90, radius=1.0, intensity=10.0)
    assert read(stage, UP) == pytest.approx([10 * math.pi / (1 + (2 - LIFT) ** 2)], rel=0.001)
    stage = new_stage()
    light(stage, UsdLux.SphereLight, (1, 2, 0), radius=0.5, intensity=10.0)
    distance = math.sqrt(1 + (2 - LIFT) ** 2)
    facing = 10 * math.pi * 0.25 / distance**2
    assert read(stage, UP) == pytest.approx([facing * (2 - LIFT) / distance], rel=0.001)
    stage = new_stage()
    light(stage, UsdLux.DomeLight, (0, 0, 0), intensity=10.0)
    both = read(stage, UP, CYLINDER)
    assert both == pytest.approx([10 * math.pi] * 2, rel=0.001)


@pytest.mark.parametrize(("up", "unit"), [("Y", 1.0), ("Z", 0.01)])
def test_a_point_light_over_a_cylinder(up: str, unit: float) -> None:
    """An upright cylinder gets I sin(e) / (pi d^2), e from the vertical: in any direction, axis and unit."""
    stage = new_stage(up, unit)
    for angle in (0.1, 0.7, 2.0):
        height, aside = 1.5 / unit, 2.0 / unit
        flat = (aside * math.cos(angle), aside * math.sin(angle))
        place = (flat[0], height, flat[1]) if up == "Y" else (flat[0], flat[1], height)
        stage.RemovePrim("/light")
        made = light(stage, UsdLux.SphereLight, place, radius=1e-4 / unit, intensity=1e8)
        assert made
        squared = 1.5**2 + 2.0**2
        candelas = 1e8 * math.pi * 1e-8
        expected = candelas * (2.0 / math.sqrt(squared)) / (math.pi * squared)
        assert read(stage, CYLINDER) == pytest.approx([expected], rel=0.003)


def test_light_in_a_white_sphere() -> None:
    """In a sphere all points get as much indirect light: flux x albedo / (area (1 - albedo)), wherever the light is."""
    stage, albedo = new_stage(), 0.5
    ball = UsdGeom.Sphere.Define(stage, "/wall")
    ball.CreateRadiusAttr(2.0)
    ball.CreateDisplayColorAttr([Gf.Vec3f(albedo)])
    light(stage, UsdLux.SphereLight, (0.5, 0.3, 0), radius=0.01, intensity=1e4)
    flux = 4 * math.pi * (1e4 * math.pi * 1e-4)
    indirect = flux * albedo / (16 * math.pi * (1 - albedo))
    for direction in ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.6, 0.0, -0.8)):
        out = np.array(direction)
        place = 1.99 * out
        to_light = np.array([0.5, 0.3, 0]) - place
        distance = float(np.linalg.norm(to_light))
        direct = 1e4 * math.pi * 1e-4 * float(to_light @ -out) / distance**3
        meter = LightMeter("wall", tuple(place.tolist()), tuple((-out).tolist()))
        assert read(stage, meter, target=0.002) == pytest.approx([direct + indirect], rel=0.005)


@pytest.mark.parametrize(("width", "height", "distance", "factor"), [(1, 1, 1, 0.045251), (2, 1.5, 3, 0.011472)])
@pytest.mark.parametrize("up", ["Y", "Z"])
def test_the_daylight_factor_of_a_window(up: str, width: float, height: float, distance: float, factor: float) -> None:
    """Black room; on the floor, opposite a lower corner of the window: Moon and Spencer's sky, Seshadri's formula."""
    stage = new_stage(up)

    def at(x: float, y: float, z: float) -> tuple[float, float, float]:
        return (x, y, z) if up == "Y" else (x, -z, y)

    def wall(name: str, a: tuple[float, float, float], b: tuple[float, float, float]) -> None:
        ends = np.array([at(*a), at(*b)])
        box(stage, name, ends.min(axis=0), ends.max(axis=0), 0.0)

    far = 20.0
    wall("left", (-far, -1, 0), (0, far, 0))
    wall("right", (width, -1, 0), (far, far, 0))
    wall("above", (0, height, 0), (width, far, 0))
    wall("below", (0, -1, 0), (width, 0, 0))
    wall("back", (-far, -1, far), (far, far, far))
    wall("ceiling", (-far, far, 0), (far, far, far))
    wall("west", (-far, -1, 0), (-far, far, far))
    wall("east", (far, -1, 0), (far, far, far))
    light(stage, UsdLux.DomeLight, (0, 0, 0), intensity=1000.0)  # has no effect
    meter = LightMeter("floor", at(0, 0, distance))
    assert read(stage, meter, target=0.002, daylight_factor=True) == pytest.approx([factor], rel=0.006)


def test_the_overcast_sky_on_open_ground() -> None:
    found = read(new_stage(), UP, CYLINDER, LightMeter("wall", (0, 0, 0), (1, 0, 0)), daylight_factor=True)
    assert found == pytest.approx([1.0, 0.39618, 0.39618], rel=0.001)
    halved = measure(new_stage(), [UP], daylight_factor=True, maintenance_factor=0.5)
    assert halved.readings[0].value == pytest.approx(0.5, rel=0.001)


def lit_room() -> Usd.Stage:
    stage = new_stage()
    box(stage, "floor", (-2, -0.1, -2), (2, 0, 2), 0.3)
    box(stage, "ceiling", (-2, 2.5, -2), (2, 2.6, 2), 0.8)
    for name, low, high in (
        ("a", (-2.1, 0, -2), (-2, 2.5, 2)),
        ("b", (2, 0, -2), (2.1, 2.5, 2)),
        ("c", (-2, 0, -2.1), (2, 2.5, -2)),
    ):
        box(stage, name, low, high, 0.5)
    box(stage, "desk", (-0.5, 0.7, -0.5), (0.5, 0.75, 0.5), 0.4)
    light(stage, UsdLux.RectLight, (0.8, 2.4, 0.3), -90, width=0.6, height=0.3, intensity=2000.0)
    return stage


GRID = MeterGrid("floor", (-1.8, 0.0, -1.8), (0, 0, 3.6), (3.6, 0, 0), (6, 6), 0.0)


def test_intervals_hold() -> None:
    stage = lit_room()
    truth = measure(stage, [GRID], target=0.002, seed=1000)
    expected = np.array([reading.value for reading in truth.readings])
    held, total, means = 0, 0, 0
    for seed in range(24):
        found = measure(stage, [GRID], target=1e-6, spp=8, seed=seed)
        low, high = (np.array([getattr(reading, end) for reading in found.readings]) for end in ("low", "high"))
        held += int(((low <= expected) & (expected <= high)).sum())
        total += len(expected)
        mean = found.grids[0].mean
        means += mean[1] <= truth.grids[0].mean[0] <= mean[2]
    assert 0.92 <= held / total <= 0.98
    assert means >= 20


def test_simultaneous_intervals_are_wider() -> None:
    stage = lit_room()
    alone, together = (measure(stage, [GRID], target=1e-6, spp=8, simultaneous=both) for both in (False, True))
    ratios = [b.half_width / a.half_width for a, b in zip(alone.readings, together.readings, strict=True)]
    assert min(ratios) > 1.5
    assert max(ratios) < 2.5


def test_a_mean_is_reached_earlier_than_each_reading() -> None:
    stage = lit_room()
    each, mean = (measure(stage, [GRID], target=0.02, of_mean=of_mean) for of_mean in (False, True))
    assert each.met
    assert mean.met
    assert mean.report["samples"] <= each.report["samples"]
    grid = mean.grids[0]
    assert (grid.mean[2] - grid.mean[1]) / 2 <= 0.02 * grid.mean[0]


def test_the_same_bits_and_the_same_light_far_away() -> None:
    stage = lit_room()
    values = [[reading.value for reading in measure(stage, [GRID], spp=8, target=1e-6, threads=n).readings] for n in (1, 2)]
    assert values[0] == values[1]
    here = read(stage, GRID, target=0.01)
    moved = new_stage()
    root = UsdGeom.Xform.Define(moved, "/moved")
    root.AddTranslateOp().Set(Gf.Vec3d(1e6, -1e6, 1e6))
    layer = stage.GetRootLayer()
    for prim in stage.GetPseudoRoot().GetChildren():
        Sdf.CopySpec(layer, prim.GetPath(), moved.GetRootLayer(), Sdf.Path(f"/moved/{prim.GetName()}"))
    there = MeterGrid("floor", (1e6 - 1.8, -1e6, 1e6 - 1.8), (0, 0, 3.6), (3.6, 0, 0), (6, 6), 0.0)
    assert read(moved, there, target=0.01) == pytest.approx(here, rel=0.03)


def test_meters_of_a_stage_and_what_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stage = lit_room()
    desk = UsdGeom.Xform.Define(stage, "/desk_light")
    desk.AddTranslateOp().Set(Gf.Vec3d(0, 0.75, 0))
    desk.AddRotateXOp().Set(90.0)
    prim = desk.GetPrim()
    prim.CreateAttribute("primray:lightMeter:size", Sdf.ValueTypeNames.Float2).Set(Gf.Vec2f(0.8, 0.6))
    prim.CreateAttribute("primray:lightMeter:counts", Sdf.ValueTypeNames.Int2).Set(Gf.Vec2i(4, 3))
    prim.CreateAttribute("primray:lightMeter:border", Sdf.ValueTypeNames.Float).Set(0.0)
    prim.CreateAttribute("primray:lightMeter:colour", Sdf.ValueTypeNames.Float).Set(0.0)
    single = UsdGeom.Xform.Define(stage, "/under_desk").GetPrim()
    single.AddAppliedSchema("PrimrayLightMeterAPI")
    UsdGeom.Xformable(single).AddRotateXOp().Set(90.0)
    path = tmp_path / "room.usda"
    stage.GetRootLayer().Export(str(path))
    found = measure(str(path), target=0.05)
    assert [reading.meter.name for reading in found.readings][:2] == ["/desk_light[0,0]", "/desk_light[1,0]"]
    assert len(found.readings) == 13
    assert found["/under_desk"].value < 0.5 * found.grids[0].least[0]
    assert any(one["code"] == "unknown-input" for one in found.report["diagnostics"])
    page, table, facts = (str(tmp_path / f"r.{kind}") for kind in ("html", "csv", "json"))
    assert run(["measure", str(path), "--target", "0.05", "-o", page, "-o", table, "-o", facts]) == 0
    printed = capsys.readouterr().out
    assert "/desk_light: mean" in printed
    assert "uniformity" in printed
    assert len(Path(table).read_text().splitlines()) == 14
    written = json.loads(Path(facts).read_text())
    assert written["grids"][0]["mean"]["value"] == found.grids[0].mean[0]
    assert Path(page).read_text().count("<rect") == 12


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["--at", "0,0"], "--at takes X,Y,Z"),
        (["--grid", "0,0,0/1,0,0"], "--grid takes"),
        (["--facing", "0,1,0"], "--facing is of the points"),
        (["--at", "0,0,0", "-o", "a.txt"], "readings are written as"),
        (["--at", "a=0,0,0", "--at", "a=1,0,0"], "two light meters have the name a"),
        (["--at", "0,0,0", "--target", "0"], "a share between 0 and 1"),
        (["--at", "0,0,0", "--maintenance-factor", "2"], "a maintenance factor"),
        (["--grid", "0,0,0/1,0,0/2,0,0"], "must span a plane"),
        ([], "there are no light meters"),
    ],
)
def test_what_is_refused(flags: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "room.usda"
    stage = lit_room()
    stage.GetRootLayer().Export(str(path))
    assert run(["measure", str(path), *flags]) == 2
    assert said in capsys.readouterr().err


def test_no_light_is_told() -> None:
    found = measure(lit_room(), [LightMeter("inside", (0, -0.05, 0)), LightMeter("floor", (0, 0.01, 1.5))], target=0.05)
    assert found["inside"].value == 0
    assert 0 < found["inside"].high < 1e-3 * found["floor"].value, "what no sample found may still be there"
    assert [one["code"] for one in found.report["diagnostics"]].count("dark-light-meter") == 1
    with pytest.raises(PrimrayError, match="three finite numbers"):
        LightMeter("bad", (0.0, float("nan"), 0.0))


def test_the_page_has_luminance_as_cameras_see_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stage = lit_room()
    for name, place in (("near", 0.0), ("far", 1.5)):
        camera = UsdGeom.Camera.Define(stage, f"/{name}")
        camera.AddTranslateOp().Set(Gf.Vec3d(0, 1, place))
    path, page = tmp_path / "room.usda", tmp_path / "room.html"
    stage.GetRootLayer().Export(str(path))
    asked = ["measure", str(path), "--at", "0,0,0", "--target", "0.5", "-o", str(page)]
    assert run([*asked, "--luminance", "all"]) == 0
    text = page.read_text()
    assert text.count("<h2>Luminance from") == 2
    assert text.count("legend in cd/m2") == 2
    assert "/near" in text
    assert "/far" in text
    assert text.count("data:image/png;base64,") == 2
    assert run([*asked, "--luminance", "/nowhere"]) == 2
    assert "the stage has /near, /far" in capsys.readouterr().err
    assert run([*asked[:-2], "--luminance", "all"]) == 2


def test_luminance_is_that_of_the_walls() -> None:
    """A camera in a closed white sphere that glows sees its radiance everywhere, whatever it looks at."""
    from primray.light_meter.luminance import luminance_pictures

    stage = new_stage()
    UsdGeom.Camera.Define(stage, "/cam")
    UsdLux.DomeLight.Define(stage, "/sky").CreateIntensityAttr(250.0)
    [picture] = luminance_pictures(stage, ["all"], RenderSettings(resolution=(32, 18), spp=4))
    assert np.allclose(picture.luminance, 250, rtol=1e-5)
    value, low, high = picture.mean
    assert low <= 250.001
    assert high >= 249.999
    assert value == pytest.approx(250)
    least, most = picture.scale
    assert least <= 250 <= most
