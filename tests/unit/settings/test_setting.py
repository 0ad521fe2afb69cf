"""Settings as people write them: strings, lists, arrays and prims are taken; what cannot be meant is refused by its name."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom

from primray import Filter, Metric, RenderSettings
from primray.description import Camera, Projection
from primray.errors import PrimrayError, SettingsError
from primray.settings import settings_as_json, settings_of_json, with_values

NAMES = [field.name for field in fields(RenderSettings)]
STANDING = [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]
LOOKING = Camera("/cam", np.array(STANDING, float), Projection.PERSPECTIVE, (-0.5, 0.5, -0.25, 0.25), (0.1, 100.0))


def prim() -> Usd.Prim:
    return Usd.Stage.CreateInMemory().DefinePrim("/World/cam", "Camera")


@pytest.mark.parametrize(
    ("name", "written", "kept"),
    [
        ("filter", "gaussian", Filter.GAUSSIAN),
        ("filter", Filter.BOX, Filter.BOX),
        ("error_metric", "display", Metric.DISPLAY),
        ("resolution", [640, 0], (640, 0)),
        ("resolution", np.array([640, 360]), (640, 360)),
        ("sample_range", [0, 4], (0, 4)),
        ("spp", np.int64(4), 4),
        ("seed", np.uint8(3), 3),
        ("target_error", np.float32(0.5), 0.5),
        ("time_code", np.float64(1.0), 1.0),
        ("strict", np.bool_(True), True),
        ("aovs", ["depth"], ("depth",)),
        ("purposes", {"render", "default"}, ("default", "render")),
        ("variants", ["/a:b=c"], ("/a:b=c",)),
        ("load", [], ()),
        ("mask", [Sdf.Path("/World")], ("/World",)),
        ("label_table", Path("labels.json"), "labels.json"),
        ("session_layer", Path("over.usda"), "over.usda"),
        ("camera", Sdf.Path("/cam"), "/cam"),
        ("camera", np.array(STANDING), tuple(tuple(map(float, row)) for row in STANDING)),
    ],
)
def test_what_is_meant_is_kept_in_one_form(name: str, written: Any, kept: object) -> None:
    found = getattr(RenderSettings(**{name: written}), name)
    assert found == kept
    assert type(found) is type(kept)


def test_prims_stand_for_their_paths() -> None:
    assert RenderSettings(camera=prim()).camera == "/World/cam"
    assert RenderSettings(camera=UsdGeom.Camera(prim())).camera == "/World/cam"


# Of every field something that it cannot mean: a new field has no row yet, and fails below.
NONSENSE: dict[str, list[Any]] = {
    "camera": [3, [[1]], np.eye(3), np.diag([2.0, 2, 2, 1]), np.diag([-1.0, 1, 1, 1]), np.full((4, 4), np.nan)],
    "auto_camera": ["front", None, 1],
    "panorama": ["globe", 1],
    "render_settings": [3],
    "render_pass": [3],
    "product": [b"/p"],
    "resolution": [640, "640x360", (1, 2, 3), (0, 0), (1.5, 2), {"width": 3}],
    "resolution_scale": [0, -1.0, "half", None, float("nan")],
    "time_code": ["1", float("inf"), True],
    "spp": ["4", 0, 1.5, True],
    "target_error": ["small", 0, float("nan")],
    "error_metric": ["psnr", 1],
    "time_limit_s": ["1 h", -1],
    "denoise": ["yes", 1],
    "stop_at": ["noisy", None, 1],
    "mixes": ["key=1", ["key"], ["key=-1"], ["key=1,2"], [3], None],
    "adaptive": ["yes", 1],
    "sample_range": ["0:4", (1, 4), (0,)],
    "max_depth": [0, "deep"],
    "clamp_indirect": [0, "bright", float("inf")],
    "caustics": ["off", None],
    "filter": ["gauss", 1],
    "filter_width": ["wide", 0],
    "threads": [0, "all"],
    "seed": [-1, None, "x"],
    "default_light": ["no", None],
    "studio_light": ["dark", None, True],
    "dome": [3, ""],
    "dome_rotation": ["half", None, float("inf")],
    "dome_visible": ["no", None],
    "translated_shaders": ["no", None],
    "ground": ["grass", 1],
    "background": [3, ""],
    "orbit_deg": ["half", None, float("nan")],
    "default_wrap": ["useMetadata", None, 1],
    "render_context": ["arnold", None, ""],
    "rendering_color_space": [709],
    "purposes": ["render", ["final"], []],
    "aovs": ["depth", ["deepth"], 3],
    "aov_errors": ["yes", None],
    "deep_tolerance": ["fine", 0, 0.0001, 2.0, None],
    "deep_samples": [3, 5000, "many", None],
    "strict": ["no", 1],
    "fail_on": ["missing", ["a-code-that-is-not-there"], None],
    "allow": ["missing", ["a-code-that-is-not-there"], None],
    "max_memory_bytes": [0, "8 GB"],
    "texture_memory_bytes": [0, 4 * 2**20 - 1, "8 GB"],
    "texture_cache": [3],
    "texture_cache_bytes": [0, None, "8 GB"],
    "dicing_rate": [0, None, "fine"],
    "dicing_camera": ["/cam", STANDING, 3],
    "surface_textures": ["off", None, 1],
    "pixel_size": [0.5, 0, None, "large", float("nan")],
    "motion_blur": ["no", None],
    "shutter": ["0 1", (0.5,), (0, "1"), (0, float("inf"))],
    "motion_error": [0, "fine"],
    "region": ["all", (0, 0, 1), (0, 0, 0, 1), (0, 0.5, 1, 0.2), (-0.1, 0, 1, 1), (0, 0, 1, float("nan"))],
    "diffusion": ["a bit", -0.1, 1.5, float("nan")],
    "diffusion_glare": ["veil", -0.1, 2],
    "diffusion_bloom_width": [0, "5 px", float("inf")],
    "diffusion_starburst": [-1, 1.1, True],
    "diffusion_starburst_width": [0, 2],
    "eye": ["both", 1],
    "lens_flaws": [
        "mechanical-vignetting=1,2",
        ["mechanical-vignetting=1"],
        ["halo=1"],
        ["rim=-1,2"],
        ["lateral-chromatic=1,0,1"],
        ["mechanical-vignetting=1,inf"],
        None,
    ],
    "variants": ["/a:b=c", ["red"], None],
    "load": ["/World", ["World"], 1],
    "mask": ["/World", ["World"], []],
    "joint_products": ["/Render/p", [3]],
    "label_table": [3],
    "silhouettes": ["yes"],
    "session_layer": [3],
}


@pytest.mark.parametrize("name", NAMES)
def test_what_cannot_be_meant_is_refused_by_name(name: str) -> None:
    for value in NONSENSE[name]:
        with pytest.raises(PrimrayError) as refusal:
            RenderSettings(**{name: value})
        assert refusal.value.where == name, (name, value, refusal.value)


def test_overrides() -> None:
    draft = RenderSettings(spp=4)
    assert with_values(draft, {"filter": "gaussian"}) == RenderSettings(spp=4, filter=Filter.GAUSSIAN)
    assert with_values(draft, {}) is draft
    with pytest.raises(SettingsError, match="did you mean resolution") as refusal:
        with_values(draft, {"resolutoin": (4, 4)})
    assert refusal.value.where == "resolutoin"
    with pytest.raises(SettingsError, match="not dict"):
        with_values({"spp": 4}, {})


def test_matrices_for_row_vectors_are_told_apart() -> None:
    rows = np.array(STANDING).T
    with pytest.raises(SettingsError, match="transpose"):
        RenderSettings(camera=rows)
    assert RenderSettings(camera=Gf.Matrix4d(*map(float, rows.ravel()))).camera == RenderSettings(camera=STANDING).camera


def test_inverses_of_look_at_matrices_are_cameras_but_for_rounding() -> None:
    rng = np.random.default_rng(5)
    rounded = 0
    for size in np.geomspace(0.1, 1e5, 100):
        eye, target = Gf.Vec3d(*rng.normal(size=3) * size), Gf.Vec3d(*rng.normal(size=3))
        matrix = Gf.Matrix4d().SetLookAt(eye, target, Gf.Vec3d(0, 1, 0)).GetInverse()
        rounded += matrix.GetColumn(3) != Gf.Vec4d(0, 0, 0, 1)
        for camera in (matrix, np.array(matrix).T):
            kept = np.array(RenderSettings(camera=camera).camera)
            assert (kept[3] == [0, 0, 0, 1]).all()
            np.testing.assert_allclose(kept[:3, 3], list(eye), rtol=1e-9)
        with pytest.raises(SettingsError, match="transpose"):
            RenderSettings(camera=np.array(matrix))
    assert rounded > 10


@pytest.mark.parametrize("last", [(0, 0, 0, 1.00001), (0, 0, 1e-5, 1), (0, 0, -1, 0), (0, 0, 0, float("nan"))])
def test_a_projection_is_no_camera(last: tuple[float, ...]) -> None:
    matrix = np.array(STANDING, float)
    matrix[3] = last
    with pytest.raises(SettingsError):
        RenderSettings(camera=matrix)


@pytest.mark.parametrize(
    "change",
    [
        {"window": (0.5, -0.5, -0.25, 0.25)},
        {"clipping_range": (2.0, 1.0)},
        {"lens_radius": -1.0},
        {"lens_radius": 1.0},  # without a distance to focus at
        {"exposure_scale": float("nan")},
        {"world_from_camera": np.eye(3)},
        {"projection": Projection.ORTHOGRAPHIC, "lens_radius": 1.0, "focus_distance": 1.0},
    ],
)
def test_cameras_that_cannot_look(change: dict[str, Any]) -> None:
    values = {name: getattr(LOOKING, name) for name in ("path", "world_from_camera", "projection", "window", "clipping_range")}
    with pytest.raises(SettingsError) as refusal:
        RenderSettings(camera=Camera(**{**values, **change}))
    assert refusal.value.where == "camera"


@pytest.mark.parametrize("camera", [None, "/cam", STANDING, LOOKING])
def test_settings_go_through_json_and_can_be_keys(camera: Any) -> None:
    import json

    settings = RenderSettings(camera=camera)
    again = settings_of_json(json.loads(json.dumps(settings_as_json(settings))))
    assert again == settings
    assert hash(again) == hash(settings)
    assert again != RenderSettings(camera="/another")
