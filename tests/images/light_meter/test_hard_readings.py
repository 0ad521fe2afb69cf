"""Light that samples hardly find, meters that are mirrored, and settings of pictures, which readings do not depend on."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdRender

from primray import Camera, LightMeter, MeterGrid, PrimrayError, RenderSettings, measure, rate_glare
from primray.cli import run
from primray.errors import LimitError, RenderCancelled
from primray.light_meter.luminance import luminance_pictures
from primray.light_meter.meters import MeterKind
from primray.light_meter.pictures import KEPT
from primray.settings import rows

from .test_closed_forms import CYLINDER, LIFT, UP, box, light, new_stage

ROOM_BELOW = 1.0  # metres from the meter to a lid with a hole


def below_a_hole(half: float) -> Usd.Stage:
    """Return a black box under a sky of 100 nits, with a square hole in its lid above the origin."""
    stage, far, lid = new_stage(), 50.0, ROOM_BELOW
    light(stage, UsdLux.DomeLight, (0, 0, 0), intensity=100.0)
    for name, low, high in (
        ("west", (-far, lid, -far), (-half, lid, far)),
        ("east", (half, lid, -far), (far, lid, far)),
        ("north", (-half, lid, -far), (half, lid, -half)),
        ("south", (-half, lid, half), (half, lid, far)),
        ("a", (-far, 0, -far), (-far, lid, far)),
        ("b", (far, 0, -far), (far, lid, far)),
        ("c", (-far, 0, -far), (far, lid, -far)),
        ("d", (-far, 0, far), (far, lid, far)),
    ):
        box(stage, name, low, high, 0.0)
    return stage


@pytest.mark.parametrize(("half", "seeds"), [(0.1, 24), (0.02, 24)])
def test_light_that_few_samples_find_is_in_the_interval(half: float, seeds: int) -> None:
    """Most of the first 512 samples of the small hole find nothing, which is no reading of 0."""
    stage, slant = below_a_hole(half), math.hypot(half, ROOM_BELOW)
    expected = 400 * half / slant * math.atan(half / slant)
    found = [measure(stage, [UP], target=0.05, seed=seed) for seed in range(seeds)]
    held = [one.readings[0].low <= expected <= one.readings[0].high for one in found]
    assert sum(held) >= 0.8 * seeds  # 0.95 within three standard deviations
    assert np.mean([one.readings[0].value for one in found]) == pytest.approx(expected, rel=0.03)


def test_lit_meters_do_not_wait_for_dark_ones() -> None:
    """A grid that crosses a wall: what is inside of it is searched for light alone."""
    stage = lit_stage()
    inside, above = LightMeter("inside", (0.0, -0.05, 0.0)), [LightMeter(f"{k}", (0.1 * k, 0.5, 0.0)) for k in range(8)]
    counted: list[int] = []
    found = measure(stage, [inside, *above], target=0.05, progress=lambda _, samples, rays: counted.append(samples))
    assert (found["inside"].value, found["inside"].met, found.met) == (0, True, True)
    assert found.report["samples"] >= 150_000
    assert max(counted) < 2 * found.report["samples"], "nine meters would take nine times as many"


@pytest.mark.parametrize(("place", "radius"), [((0.0, 1.0, 0.0), 0.02), ((0.3, 1.5, 0.1), 0.1), ((0.7, 1.5, 0.4), 0.3)])
def test_a_lamp_over_a_cylinder(place: tuple[float, float, float], radius: float) -> None:
    """The integral of L sin(e) / pi over the lamp, also straight above, where a cylinder of any width gets another share."""
    stage = new_stage()
    light(stage, UsdLux.SphereLight, place, radius=radius, intensity=100.0)
    expected = cylindrical_of_sphere(np.array(place), radius)
    [reading] = measure(stage, [CYLINDER], target=0.002).readings
    assert reading.value == pytest.approx(expected, rel=0.008)  # 1.25 mm nearer, on average, and the noise


def cylindrical_of_sphere(place: np.ndarray[Any, Any], radius: float) -> float:
    middles = (np.arange(1000) + 0.5) / 1000
    distance = float(np.linalg.norm(place))
    cap = 1 - math.cos(math.asin(radius / distance))
    cosines, turns = np.meshgrid(1 - middles * cap, 2 * math.pi * middles)
    up = place[1] / distance
    heights = cosines * up + np.sqrt((1 - cosines**2) * (1 - up**2)) * np.cos(turns)
    return 100 * 2 * math.pi * cap * float(np.sqrt(1 - heights**2).mean()) / math.pi


@pytest.mark.parametrize("scale", [(1, 1, 1), (-1, 1, 1), (1, 1, -1), (-1, -1, -1), (2, 3, 4), (-2, 3, -4)])
def test_a_mirrored_meter_looks_along_its_own_z(scale: tuple[float, float, float]) -> None:
    stage = new_stage()
    light(stage, UsdLux.DistantLight, (0, 0, 0), -90, intensity=100.0, angle=0.0)
    made = UsdGeom.Xform.Define(stage, "/meter")
    made.AddRotateXOp().Set(90.0)
    made.AddScaleOp().Set(Gf.Vec3f(*scale))
    made.GetPrim().AddAppliedSchema("PrimrayLightMeterAPI")
    looks_up = UsdGeom.XformCache().GetLocalToWorldTransform(made.GetPrim()).TransformDir(Gf.Vec3d(0, 0, -1))[1] > 0
    assert measure(stage, target=0.1, spp=16).readings[0].value == pytest.approx(100.0 if looks_up else 0.0)


def lit_stage() -> Usd.Stage:
    stage = new_stage()
    box(stage, "floor", (-2, -0.1, -2), (2, 0, 2), 0.5)
    light(stage, UsdLux.SphereLight, (0.5, 1.5, -2), radius=0.3, intensity=500.0)
    camera = UsdGeom.Camera.Define(stage, "/cam")
    camera.AddTranslateOp().Set(Gf.Vec3d(0, 1, 2))
    return stage


# Values that no measurement may depend on, of all settings that are not kept.
OTHERS: dict[str, Any] = {
    "camera": Camera.lat_long(),
    "resolution": (17, 5),
    "resolution_scale": 0.5,
    "target_error": 0.5,
    "denoise": True,
    "adaptive": True,
    "clamp_indirect": 0.001,
    "caustics": False,
    "filter_width": 3.0,
    "orbit_deg": 30.0,
    "pixel_size": 50.0,
    "motion_blur": True,
    "region": (0.2, 0.2, 0.7, 0.7),
    "aovs": ("depth",),
    "aov_errors": True,
}


@pytest.mark.parametrize("name", OTHERS)
def test_settings_of_pictures_have_no_effect(name: str) -> None:
    assert name in {row.name for row in rows(RenderSettings)} - set(KEPT)
    stage, settings = lit_stage(), RenderSettings(spp=8)
    plain = [reading.value for reading in measure(stage, [UP, CYLINDER_ASIDE], settings, target=1e-6).readings]
    other = measure(stage, [UP, CYLINDER_ASIDE], RenderSettings(spp=8, **{name: OTHERS[name]}), target=1e-6)
    assert [reading.value for reading in other.readings] == plain


CYLINDER_ASIDE = LightMeter("aside", (1.0, 0.5, 0.0), kind="cylindrical")  # type: ignore[arg-type]


def with_a_product(stage: Usd.Stage) -> Usd.Stage:
    """Ask of pictures what would change readings: a crop, other pixels, another camera's exposure."""
    settings = UsdRender.Settings.Define(stage, "/Render/settings")
    stage.SetMetadata("renderSettingsPrimPath", "/Render/settings")
    settings.GetDataWindowNDCAttr().Set(Gf.Vec4f(0.25, 0.25, 0.75, 0.75))
    settings.GetResolutionAttr().Set(Gf.Vec2i(200, 100))
    settings.GetPixelAspectRatioAttr().Set(2.0)
    product = UsdRender.Product.Define(stage, "/Render/product")
    product.GetDataWindowNDCAttr().Set(Gf.Vec4f(0.1, 0.25, 0.75, 0.75))
    product.GetCameraRel().SetTargets([Sdf.Path("/cam")])
    settings.GetProductsRel().SetTargets([product.GetPath()])
    UsdGeom.Camera(stage.GetPrimAtPath("/cam")).GetExposureAttr().Set(3.0)
    return stage


def test_what_a_stage_asks_of_pictures_has_no_effect() -> None:
    plain, asking = lit_stage(), with_a_product(lit_stage())
    values = [[one.value for one in measure(stage, [UP], spp=8, target=1e-6).readings] for stage in (plain, asking)]
    assert values[0] == values[1]
    ratings = [rate_glare(stage, (0, 1, 2), (0, 0, -1), pixels=64, spp=8, target=0.1) for stage in (plain, asking)]
    assert ratings[0].dgp == ratings[1].dgp
    assert ratings[0].ugr == ratings[1].ugr


def test_luminance_is_that_before_the_cameras_exposure() -> None:
    """Nits are nits, whatever the camera's sensitivity, aperture and time."""
    stage = new_stage()
    UsdLux.DomeLight.Define(stage, "/sky").CreateIntensityAttr(250.0)
    camera = UsdGeom.Camera.Define(stage, "/cam").GetPrim()
    for name, value in (("exposure", 3.0), ("exposure:iso", 400.0), ("exposure:time", 0.01), ("exposure:fStop", 8.0)):
        camera.GetAttribute(name).Set(value)
        [picture] = luminance_pictures(stage, ["all"], RenderSettings(resolution=(16, 9), spp=2))
        assert np.allclose(picture.luminance, 250, rtol=1e-5)


def test_nothing_lights_a_stage_without_lights() -> None:
    stage = new_stage()
    box(stage, "floor", (-2, -0.1, -2), (2, 0, 2), 0.5)
    UsdGeom.Camera.Define(stage, "/cam").AddTranslateOp().Set(Gf.Vec3d(0, 0.5, 2))
    [picture] = luminance_pictures(stage, ["all"], RenderSettings(resolution=(16, 9), spp=2))
    assert picture.luminance.max() == 0
    assert rate_glare(stage, (0, 1, 2), (0, -0.2, -1), pixels=32, spp=2).sources == ()
    assert measure(stage, [UP], spp=8).readings[0].value == 0


def test_too_few_samples_for_an_interval_are_an_error() -> None:
    """Half of a picture has no samples then, and no reading may be made of it."""
    stage = lit_stage()
    for make in (
        lambda: measure(stage, [UP], spp=1),
        lambda: rate_glare(stage, (0, 1, 2), (0, 0, -1), pixels=32, spp=1),
        lambda: luminance_pictures(stage, ["all"], RenderSettings(spp=1)),
    ):
        with pytest.raises(PrimrayError, match="2 or more samples"):
            make()
    many = MeterGrid("many", (0, 0, 0), (50, 0, 0), (0, 0, 50), (100, 100))
    with pytest.raises(LimitError, match="the time limit ended before"):
        measure(stage, [many], target=1e-4, time_limit_s=1e-4)
    with pytest.raises(RenderCancelled):
        measure(stage, [UP], progress=lambda *_: False)


def test_meters_that_are_far_apart_have_facets_of_their_own() -> None:
    """A lamp 5 cm above the second meter, ten thousand kilometres away, is above its facet."""
    stage = new_stage()
    light(stage, UsdLux.RectLight, (1e7, 0.05, 0), -90, width=0.2, height=0.2, intensity=100.0)
    u = math.hypot(0.1, 0.05 - LIFT)
    expected = 400 * 0.1 / u * math.atan(0.1 / u)
    found = measure(stage, [UP, LightMeter("there", (1e7, 0.0, 0.0))], target=0.01, spp=64)
    assert found["there"].value == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize(
    "flags",
    [["--daylight-factor"], ["--cylindrical"], ["--maintenance-factor", "0.8"], ["--of-mean"], ["--simultaneous"]],
)
def test_glare_is_not_measured_with_what_it_does_not_heed(
    flags: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "room.usda"
    stage = lit_stage()
    stage.GetRootLayer().Export(str(path))
    assert run(["measure", str(path), "--glare", "--at", "0,1,2", "--facing=0,0,-1", *flags]) == 2
    assert f"--glare and {flags[0]} are two measurements" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: LightMeter("a", (1e30, 0, 0)), "within 1e\\+12"),
        (lambda: MeterGrid("a", (0, 0, 0), (1, 0, 0), (0, 0, 1), 3), "two numbers above 0"),  # type: ignore[arg-type]
        (lambda: MeterGrid("a", (0, 0, 0), (1, 0, 0), (0, 0, 1), border="x"), "a border is"),  # type: ignore[arg-type]
        (lambda: MeterGrid("a", (0, 0, 0), (1, 0, 0), (0, 0, 1), direction=(0, 0, 0)), "must not be 0"),
        (lambda: LightMeter(3, (0, 0, 0)), "is a text"),  # type: ignore[arg-type]
        (lambda: measure(new_stage(), ["desk"]), "LightMeter or a MeterGrid"),  # type: ignore[list-item]
        (lambda: measure(new_stage(), [UP], target="2%"), "a share between"),  # type: ignore[arg-type]
        (lambda: measure(new_stage(), [UP], maintenance_factor="x"), "a maintenance"),  # type: ignore[arg-type]
    ],
)
def test_values_that_are_no_meters_are_refused(make: Any, said: str) -> None:
    with pytest.raises(PrimrayError, match=said):
        make()


def test_a_direction_has_any_length() -> None:
    for size in (1e-300, 1e300):
        assert LightMeter("a", (0, 0, 0), (0, size, 0)).direction == (0.0, 1.0, 0.0)


DARK: dict[str, tuple[str, str]] = {
    "no light": ("", "the stage has neither lights nor emissive materials"),
    "invisible": ('def SphereLight "lamp"\n{\n    token visibility = "invisible"\n}\n', "/lamp is invisible at this frame"),
    "inactive": ('def SphereLight "lamp" (\n    active = false\n)\n{\n}\n', "/lamp is inactive"),
    "not rendered": ('def SphereLight "lamp"\n{\n    uniform token purpose = "guide"\n}\n', "/lamp is of purpose guide"),
    "without intensity": ('def SphereLight "lamp"\n{\n    float inputs:intensity = 0\n}\n', "/lamp is without emission"),
    "black": ('def DomeLight "lamp"\n{\n    color3f inputs:color = (0, 0, 0)\n}\n', "/lamp is without emission"),
}
HEAD = '#usda 1.0\n(\n    upAxis = "Y"\n    metersPerUnit = 1\n)\n'
SLAB = 'def Cube "floor"\n{\n}\n'
BOUND = 'def Cube "floor" (\n    prepend apiSchemas = ["MaterialBindingAPI"]\n)\n{\n    rel material:binding = </M>\n}\n'
GLOWING = """def Material "M"
{
    token outputs:surface.connect = </M/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:emissiveColor = (0, 0, 5)
        token outputs:surface
    }
}
"""


@pytest.mark.parametrize("case", DARK)
def test_a_stage_that_emits_nothing_is_told_at_once(case: str, tmp_path: Path) -> None:
    lamp, why = DARK[case]
    stage = tmp_path / "dark.usda"
    stage.write_text(HEAD + SLAB + lamp)
    found = measure(stage, [LightMeter("a", (0.0, 3.0, 0.0)), LightMeter("b", (400.0, 3.0, 0.0))])
    assert [(row.value, row.low, row.high, row.met) for row in found.readings] == [(0, 0, 0, True)] * 2
    assert found.report["samples"] <= 256
    told = [(row["code"], row["message"]) for row in found.report["diagnostics"]]
    assert [code for code, _ in told] == ["no-light"]
    assert why in told[0][1]
    with pytest.raises(PrimrayError, match="Nothing emits light"):
        measure(stage, [LightMeter("a", (0.0, 3.0, 0.0))], fail_on=("no-light",))
    assert measure(stage, [LightMeter("a", (0.0, 3.0, 0.0))], daylight_factor=True, target=0.1).readings[0].value > 0.9
    masked = measure(stage, [LightMeter("a", (0.0, 3.0, 0.0))], mask=["/floor"])
    assert "no-light" in [row["code"] for row in masked.report["diagnostics"]]


def test_materials_that_emit_are_light(tmp_path: Path) -> None:
    stage = tmp_path / "glowing.usda"
    stage.write_text(HEAD + BOUND + GLOWING)
    found = measure(stage, [LightMeter("a", (0.0, 3.0, 0.0), (0.0, -1.0, 0.0))], target=0.1)
    assert found.readings[0].value > 0
    assert all(row["code"] != "no-light" for row in found.report["diagnostics"])


@pytest.mark.filterwarnings("default")
def test_the_command_tells_diagnostics_of_ratings_without_a_line_of_python(tmp_path: Path, capsys: Any) -> None:
    stage = tmp_path / "dark.usda"
    stage.write_text(HEAD + SLAB)
    assert run(["measure", str(stage), "--glare", "--at", "0,3,0", "--facing", "1,0,0"]) == 0
    said = capsys.readouterr()
    assert said.err.startswith("warning: no-light")
    assert "RenderWarning" not in said.err


@pytest.mark.parametrize(("extent", "unit"), [(2.0, 1.0), (2.0, 0.01), (9.0, 1.0), (600.0, 1.0)])
@pytest.mark.parametrize("axes", [(1, 1, 1), (0, 1, 0), (1, 0, 1)])
def test_cylinders_at_any_places_read_a_uniform_sky(extent: float, unit: float, axes: tuple[int, int, int]) -> None:
    """No side is black: not by facets of others, nor by hits of rays that lie in a facet's plane."""
    stage = new_stage()
    UsdGeom.SetStageMetersPerUnit(stage, unit)
    light(stage, UsdLux.DomeLight, (0, 0, 0), intensity=100.0)
    places = np.random.default_rng(3).uniform(0, extent / unit, (12, 3)) * axes
    meters = [LightMeter(f"{k}", tuple(place), kind=MeterKind.CYLINDRICAL) for k, place in enumerate(places.tolist())]
    values = [row.value for row in measure(stage, meters, target=0.1, spp=8).readings]
    assert values == pytest.approx([100 * math.pi] * 12, rel=0.005)
