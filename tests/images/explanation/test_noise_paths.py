"""The paths that make a pixel's noise: found where one kind of path rules it, drawn over the picture and in the scene."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import Usd, UsdGeom
from tests.images.sampling.test_rare_paths import room

import primray
from primray.cli import run
from primray.errors import SettingsError
from primray.explanation.drawing import _projected, overlay

SIZE, PIXEL = (48, 32), (23, 21)  # in the caustic below the ball


@pytest.fixture(autouse=True)
def caustics_by_chance(monkeypatch: pytest.MonkeyPatch) -> None:
    """Photons would find these caustics."""
    monkeypatch.setattr("primray.core.scene.CoreScene.caustics", lambda *_: None)


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    (tmp_path / "room.usda").write_text(room(light="0.4"))
    return tmp_path / "room.usda"


def explained(stage: Path, pixel: tuple[int, int] = PIXEL, spp: int = 256) -> primray.ExplainedPixel:
    return primray.explain(stage, *pixel, resolution=SIZE, spp=spp, max_depth=4, renders=0)


def test_the_noise_of_a_caustic_is_the_caustic(stage: Path) -> None:
    pixel = explained(stage)
    worst = [path for path in pixel.noise if not path.is_random]
    assert sum(path.share for path in pixel.noise) <= 1 + 1e-9
    assert sum(path.share for path in worst if path.expression == "C<.D>+<.S>+L") > 0.5
    first = worst[0]
    assert (first.light, first.prims) == ("/key", ("/floor", "/ball", "/ball"))
    np.testing.assert_allclose(first.points[0], (0, 2.5, 7), atol=1e-5)  # the camera
    assert abs(first.points[1][1]) < 1e-4  # on the floor
    for point in first.points[2:4]:  # on the ball
        assert np.linalg.norm(np.array(point) - (0, 1.2, 0)) == pytest.approx(1, abs=1e-3)
    shares = [path.share for path in worst]
    assert shares == sorted(shares, reverse=True)


def test_random_paths_are_among_the_others_and_the_same_each_time(stage: Path) -> None:
    pixel, again = explained(stage, (8, 28)), explained(stage, (8, 28))
    drawn = [path for path in pixel.noise if path.is_random]
    assert 0 < len(drawn) <= 32
    assert max(path.share for path in drawn) <= min(path.share for path in pixel.noise if not path.is_random)
    assert pixel.noise == again.noise


def test_a_layer_of_the_stage_is_replaced_only_by_its_like(stage: Path, tmp_path: Path) -> None:
    pixel = explained(stage)
    opened = Usd.Stage.Open(str(stage))
    with pytest.raises(SettingsError, match="a layer of the stage"):
        pixel.save_layer(stage, opened)
    top, noise = tmp_path / "top.usda", tmp_path / "noise.usda"
    pixel.save_layer(noise, opened)
    top.write_text(f"#usda 1.0\n(\n    subLayers = [@{noise}@, @{stage}@]\n)\n")
    pixel.save_layer(noise, Usd.Stage.Open(str(top)))  # that of the pixel before


def test_the_layer_is_a_sublayer_of_curves_for_guides(stage: Path, tmp_path: Path) -> None:
    pixel = explained(stage)
    pixel.save_layer(tmp_path / "noise.usda", Usd.Stage.Open(str(stage)))
    made = Usd.Stage.Open(str(tmp_path / "noise.usda"))
    curves = UsdGeom.BasisCurves.Get(made, "/primray_light_paths/by_noise")
    worst = [path for path in pixel.noise if not path.is_random]
    assert list(curves.GetCurveVertexCountsAttr().Get()) == [len(path.points) for path in worst]
    assert curves.GetTypeAttr().Get() == "linear"
    assert UsdGeom.Imageable(curves).ComputePurpose() == "guide"
    opacity = curves.GetDisplayOpacityPrimvar()
    assert opacity.GetInterpolation() == "uniform"
    assert len(opacity.Get()) == len(worst)
    assert max(opacity.Get()) == pytest.approx(1)
    about = made.GetDefaultPrim().GetCustomData()
    assert list(about["by_noise"]["share"]) == [path.share for path in worst]
    assert list(about["pixel"]) == list(PIXEL)
    (tmp_path / "both.usda").write_text("#usda 1.0\n(subLayers = [@noise.usda@, @room.usda@]\n)\n")
    both = primray.render(tmp_path / "both.usda", resolution=SIZE, spp=2, progress=False)
    alone = primray.render(stage, resolution=SIZE, spp=2, progress=False)
    assert (both.pixels == alone.pixels).all()  # guides are not drawn
    shown = primray.render(tmp_path / "both.usda", resolution=SIZE, spp=2, progress=False, purposes=["guide"])
    assert (shown.pixels != alone.pixels).any()


def test_the_command_draws_them_over_the_picture(stage: Path, tmp_path: Path) -> None:
    line = ["explain", str(stage), "--pixel", *map(str, PIXEL), "--res", *map(str, SIZE), "--spp", "256", "--max-depth", "4"]
    files = {name: tmp_path / f"noise.{name}" for name in ("png", "usda")}
    assert run([*line, "--renders", "0", "--overlay", str(files["png"]), "--layer", str(files["usda"])]) == 0
    drawn = np.asarray(oiio.ImageBuf(str(files["png"])).get_pixels(oiio.UINT8))[..., :3]
    x, y = PIXEL
    assert (drawn[y - 3, x - 3] == [26, 255, 77]).all()  # the frame around the pixel
    orange = (drawn[..., 0] > 100) & (drawn[..., 0] > 1.5 * drawn[..., 2])
    assert orange[:y].any()  # paths go up from the floor
    assert UsdGeom.BasisCurves.Get(Usd.Stage.Open(str(files["usda"])), "/primray_light_paths/by_noise")
    assert run([*line, "--overlay", str(tmp_path / "noise.exr")]) == 2


def test_the_way_from_the_lens_is_not_drawn(stage: Path) -> None:
    """Off the middle of a wide lens it would sweep through the whole picture."""
    pixel = explained(stage)
    image = primray.render(stage, resolution=SIZE, spp=2, progress=False)
    x, y, z = pixel.noise[0].points[0]
    on_lens = [replace(path, points=((x + 0.2, y - 0.3, z), *path.points[1:])) for path in pixel.noise]
    assert (overlay(image, replace(pixel, noise=tuple(on_lens))) == overlay(image, pixel)).all()


ALL_AROUND = primray.Camera.lat_long()
FISHEYE = replace(
    primray.Camera.lat_long(),
    window=(-1.6, 1.6, -0.8, 0.8),
    distortion=primray.Distortion(primray.DistortionModel.ANGLE_TO_RADIUS, (1.0, 0.0, 0.0, 0.0, 0.0), 100.0),
)


@pytest.mark.parametrize("camera", [FISHEYE, ALL_AROUND], ids=["fisheye", "all around"])
def test_lines_near_the_camera_are_smooth_to_where_they_leave_the_view(camera: primray.Camera) -> None:
    points = ((0.01, 0.02, 5.0), (0.02, 0.03, -20.0))
    seen = _projected(camera, points, (360, 180))
    steps = np.abs(np.diff(seen, axis=0)).max(axis=1)
    assert np.nanmax(steps) <= 6
    near = seen[np.isfinite(seen).all(axis=1)]
    middle, start = np.array((180, 90)), camera.project([(0.012, 0.022, 0.0)], (360, 180))[0]
    assert np.linalg.norm(near - middle, axis=1).min() < 1
    assert np.linalg.norm(near - start, axis=1).min() < 6  # at 90 degrees


def test_lines_are_cut_at_the_seam_of_a_picture_of_all_directions() -> None:
    seen = _projected(ALL_AROUND, ((-1.0, 0.0, 1.0), (1.0, 0.0, 1.0)), (360, 180))
    assert np.isnan(seen).any()
    assert np.nanmax(np.abs(np.diff(seen, axis=0))) <= 6
    assert np.nanmin(seen[:, 0]) < 1
    assert np.nanmax(seen[:, 0]) > 359


def test_a_picture_of_another_size_is_refused(stage: Path, tmp_path: Path) -> None:
    image = primray.render(stage, resolution=(24, 16), spp=2, progress=False)
    with pytest.raises(SettingsError, match="the picture has 24 x 16 pixels") as refused:
        explained(stage, spp=16).save_overlay(image, tmp_path / "noise.png")
    assert refused.value.code == "explain-picture"
