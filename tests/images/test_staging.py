"""What is added beside the stage: the pictures are those of a stage that has it, and each addition is reported."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio
import pytest
from pxr import Usd
from tests.unit.usd.volumes.volume_text import grid, volume_text, write

import primray
from primray.cli import run, shots
from primray.diagnostics import Diagnostics
from primray.errors import SettingsError
from primray.images.exposure import View, exposure_that_serves, view_fault
from primray.settings import RenderSettings
from primray.staging import GROUND, GroundShadow, Spent, with_requested_additions
from primray.usd import translate

FFMPEG = shots._program()  # before a test hides it from PATH
CAMERA = {
    "Y": "double3 xformOp:translate = (0, 1, 8)\n    uniform token[] xformOpOrder = ['xformOp:translate']",
    "Z": "double3 xformOp:translate = (0, -8, 1)\n    float xformOp:rotateX = 90\n"
    "    uniform token[] xformOpOrder = ['xformOp:translate', 'xformOp:rotateX']",
}
CUBE = """
def Cube "cube"
{
    double size = 1
    float3 xformOp:rotateXYZ = (30, 40, 0)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
    color3f[] primvars:displayColor = [(0.8, 0.1, 0.1)]
}
"""


def stage_of(text: str, up: str = "Y", camera: str | None = None) -> Usd.Stage:
    stage = Usd.Stage.CreateInMemory()
    looks = CAMERA[up] if camera is None else camera
    whole = f'#usda 1.0\n(\n    upAxis = "{up}"\n)\ndef Camera "c"\n{{\n    {looks}\n}}\n{text}'
    assert stage.GetRootLayer().ImportFromString(whole.replace("'", '"'))
    return stage


def rendered(stage: Usd.Stage, **more: Any) -> primray.Image:
    return primray.render(stage, **{"resolution": (32, 24), "spp": 8, **more})


def says(image: primray.Image) -> str:
    return "\n".join(d["message"] for d in image.report["diagnostics"] if d["code"] == "staging")


@pytest.fixture
def sky(tmp_path: Path) -> str:
    """A lat-long image of no symmetry."""
    pixels = np.random.default_rng(3).uniform(0, 1, (8, 16, 3)).astype(np.float32)
    pixels[2, 5] = 40
    image = oiio.ImageBuf(oiio.ImageSpec(16, 8, 3, oiio.FLOAT))
    image.set_pixels(oiio.ROI(0, 16, 0, 8, 0, 1, 0, 3), pixels)
    path = str(tmp_path / "sky.exr")
    assert image.write(path)
    return path


@pytest.mark.parametrize("up", ["Y", "Z"])
@pytest.mark.parametrize("degrees", [0.0, 70.0])
def test_a_dome_is_the_stages_dome_with_that_image(up: str, degrees: float, sky: str) -> None:
    """DomeLight_1 with the scene's pole, turned about the up axis; a dome of the stage gives way, other lights stay."""
    dome = f"""
def DomeLight_1 "sky"
{{
    asset inputs:texture:file = @{sky}@
    double xformOp:rotate{up} = {degrees}
    uniform token[] xformOpOrder = ["xformOp:rotate{up}"]
}}
"""
    sun = 'def DistantLight "sun"\n{\n}\n'
    wanted = rendered(stage_of(CUBE + sun + dome, up))
    other = 'def DomeLight "other"\n{\n    float inputs:intensity = 9\n}\n'
    found = rendered(stage_of(CUBE + sun + other, up), dome=sky, dome_rotation=degrees)
    np.testing.assert_allclose(found.pixels, wanted.pixels, rtol=2e-4, atol=1e-5)
    assert "in place of /other" in says(found)
    hidden = rendered(stage_of(CUBE, up), dome=sky, dome_visible=False)
    assert (hidden.pixels[0, 0] == 0).all()
    assert (found.pixels[0, 0, :3] > 0).all()


def test_a_dome_that_is_not_there_is_refused() -> None:
    with pytest.raises(SettingsError, match="does not exist") as refused:
        rendered(stage_of(CUBE), dome="no.exr")
    assert refused.value.where == "dome"


def test_a_dome_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    """As one that is not there: it is asked for by the user, who would get a black picture."""
    broken = tmp_path / "broken.exr"
    broken.write_text("no picture")
    with pytest.raises(SettingsError, match=r"the dome's image cannot be used: the texture cannot be read") as refused:
        rendered(stage_of(CUBE), dome=str(broken))
    assert (refused.value.where, refused.value.code) == ("dome", "texture-unreadable")


def test_a_dome_beside_the_studio_light_says_what_stays(sky: str) -> None:
    image = rendered(stage_of(CUBE), dome=sky, studio_light="on")
    assert "key light stays" in says(image)
    assert "in place of primray" not in says(image)
    assert "studio" not in says(rendered(stage_of(CUBE), dome=sky))


@pytest.mark.parametrize("up", ["Y", "Z"])
def test_domes_of_the_stage_are_turned_and_hidden(up: str, sky: str) -> None:
    """As their author would have turned them about the up axis, after their own transforms."""
    turned = f"double xformOp:rotate{up} = 110\n    "
    own = 'double xformOp:rotateX:own = 25\n    uniform token[] xformOpOrder = [%s"xformOp:rotateX:own"]\n}\n'
    dome = f'def DomeLight_1 "sky"\n{{\n    asset inputs:texture:file = @{sky}@\n    '
    wanted = rendered(stage_of(CUBE + dome + turned + own % f'"xformOp:rotate{up}", ', up))
    stage = stage_of(CUBE + dome + own % "", up)
    found = rendered(stage, dome_rotation=110.0)
    np.testing.assert_allclose(found.pixels, wanted.pixels, rtol=2e-4, atol=1e-5)
    assert says(found) == "/sky is rotated by 110 degrees, as requested."
    hidden = rendered(stage, dome_visible=False)
    assert (hidden.pixels[0, 0] == 0).all()
    assert "hidden from the camera" in says(hidden)
    assert "no dome" in says(rendered(stage_of(CUBE), dome_rotation=110.0))


@pytest.mark.parametrize("up", ["Y", "Z"])
def test_the_ground_touches_the_lowest_point(up: str) -> None:
    settings = RenderSettings(ground="plane", resolution=(32, 24))
    description, _ = translate(stage_of(CUBE, up), settings)
    axis = "XYZ".index(up)
    (placed,) = description.static
    cube = description.shapes[placed.shape]
    world = cube.points @ placed.matrix[:3, :3].T + placed.matrix[:3, 3]  # type: ignore[union-attr]
    made = with_requested_additions(description, settings, Diagnostics())
    (ground,) = (p for p in made.static if made.shapes[p.shape].path == GROUND)
    below = world[:, axis].min() - ground.matrix[axis, 3]
    assert 0 < below < 1e-4
    mesh = made.shapes[ground.shape]
    a, b, c = mesh.points[mesh.triangles[0]]  # type: ignore[union-attr]
    assert np.cross(b - a, c - a)[axis] > 0
    assert with_requested_additions(description, RenderSettings(), Diagnostics()) is description


def test_smoke_above_a_ground_that_only_its_shadow_shows_is_seen(tmp_path: Path) -> None:
    """All surfaces are hidden from the camera, and yet the picture is not empty and has an error."""
    write(tmp_path, grid(2.0))
    smoke = volume_text(None, "float3 xformOp:scale = (0.1, 0.1, 0.1)\nuniform token[] xformOpOrder = ['xformOp:scale']")
    stage = stage_of(smoke.replace("./smoke.vdb", str(tmp_path / "smoke.vdb")))
    image = rendered(stage, ground="shadow", resolution=(32, 24), spp=4)
    assert image.pixels[..., :3].max() > 0
    assert image.report["error"] is not None
    assert "empty-picture" not in {told["code"] for told in image.report["diagnostics"]}


DOWN = """double3 xformOp:translate = (3.5, 40, 3.5)
    float xformOp:rotateX = -90
    token projection = 'orthographic'
    float horizontalAperture = 40
    float verticalAperture = 40
    uniform token[] xformOpOrder = ['xformOp:translate', 'xformOp:rotateX']"""
NOON = """
def DistantLight "Sun" {
    float inputs:angle = 0
    float xformOp:rotateX = -90
    uniform token[] xformOpOrder = ["xformOp:rotateX"]
}
"""
FOG = """
def Xform "World" {
    float primray:fog:density = 0.05
    float primray:fog:top = 20
}
"""
FIRE = """
def Material "Look" {
    token outputs:arnold:volume.connect = </Look/v.outputs:out>
    def Shader "v" {
        uniform token info:id = "arnold:standard_volume"
        string inputs:emission_mode = "density"
        float inputs:emission = 1000000
        float inputs:scatter = 1
        color3f inputs:scatter_color = (1, 1, 1)
        token outputs:out
    }
}
"""


def shadow_of(text: str, width: int = 8) -> npt.NDArray[np.float32]:
    """The opacity of the shadow on a ground below 8^3 voxels of one unit, seen from above through them: 4 x 4 units."""
    stage = stage_of(NOON + text, camera=DOWN)
    stage.SetMetadata("metersPerUnit", 1.0)
    if stage.GetPrimAtPath("/World"):
        stage.SetDefaultPrim(stage.GetPrimAtPath("/World"))
    settings = RenderSettings(ground="shadow", resolution=(width, width))
    description, _ = translate(stage, settings)
    description = with_requested_additions(description, settings, Diagnostics())
    return GroundShadow(description, {}, settings).opacity(np.zeros((width, width), np.float32), Spent(64, 10**7))


def test_smoke_casts_a_shadow_on_a_ground_that_only_its_shadow_shows(tmp_path: Path) -> None:
    """The shadow has the opacity of the smoke along the light; what is seen of smoke or fog before the ground has no part."""
    write(tmp_path, grid(0.125))
    smoke = volume_text().replace("./smoke.vdb", str(tmp_path / "smoke.vdb"))
    expected = 1 - np.exp(-0.125 * 8)
    for text in (smoke, smoke + FOG):
        found = shadow_of(text)
        assert found[3:5, 3:5].mean() == pytest.approx(expected, abs=0.02)
    assert shadow_of(FOG + CUBE).mean() < 0.2  # fog alone is no shadow
    # What shines dims the shadow, as shapes that shine do, but is not seen.
    fire = volume_text(bound="/Look").replace("./smoke.vdb", str(tmp_path / "smoke.vdb")) + FIRE
    assert shadow_of(fire).mean() < 0.1


def test_only_the_shadow_on_a_ground_is_seen() -> None:
    """The object's pixels are those over a ground; beside it there is a soft black shadow, and no ground far away."""
    camera = "double3 xformOp:translate = (0, 3, 8)\n    float xformOp:rotateX = -20\n"
    camera += "    uniform token[] xformOpOrder = ['xformOp:translate', 'xformOp:rotateX']"
    light = "def DistantLight 'l'\n{\n    float inputs:angle = 5\n    float xformOp:rotateX = -70\n"
    light += "    uniform token[] xformOpOrder = ['xformOp:rotateX']\n}\n"
    stage = stage_of(CUBE + light, camera=camera)
    plane, shadow = (rendered(stage, ground=kind, resolution=(64, 48)) for kind in ("plane", "shadow"))
    alone = rendered(stage, resolution=(64, 48)).pixels[..., 3]
    alpha, black = shadow.pixels[..., 3], shadow.pixels[..., :3].max(axis=2)
    inside = alone == 1
    np.testing.assert_allclose(shadow.pixels[inside], plane.pixels[inside], rtol=0.2, atol=0.02)
    is_shadow = (alone == 0) & (alpha > 0.5)
    assert 20 < is_shadow.sum() < 600
    assert black[is_shadow].max() == 0
    assert (plane.pixels[is_shadow][:, 1] < 0.6 * np.median(plane.pixels[-4:, :, 1])).all()
    assert alpha[:, :8].max() == 0  # beside it, and at the horizon
    over = rendered(stage, ground="shadow", background="#ffffff", resolution=(64, 48)).to_uint8()
    assert (over[0, 0, :3] == 255).all()
    assert over[is_shadow][:, :3].max() < 200
    with pytest.raises(SettingsError, match="complete picture"):
        RenderSettings(ground="shadow", sample_range=(0, 4))


@pytest.mark.parametrize(("text", "shown"), [("#335577", (51, 85, 119)), ("0.5,0.2,1", (128, 51, 255)), ("#fff", (255,) * 3)])
def test_a_background_is_shown_as_it_was_given(text: str, shown: tuple[int, int, int], sky: str) -> None:
    image = rendered(stage_of(CUBE), background=text, dome=sky)
    np.testing.assert_allclose(image.to_uint8()[0, 0, :3], shown, atol=1)
    assert (image.pixels[..., 3] == 1).all()
    assert "Hidden from the camera, as another background is requested: primray:dome" in says(image)
    assert image.report["pixels_sha256"] != rendered(stage_of(CUBE), dome=sky, background="transparent").report["pixels_sha256"]


def test_a_background_is_transparent_or_a_file_or_refused(tmp_path: Path, sky: str) -> None:
    bare = rendered(stage_of(CUBE), dome=sky, background="transparent")
    assert (bare.pixels[0, 0] == 0).all()
    assert bare.pixels[..., 3].max() == 1
    picture = oiio.ImageBuf(oiio.ImageSpec(10, 40, 3, oiio.UINT8))
    oiio.ImageBufAlgo.fill(picture, (0.2, 0.4, 0.6))
    file = str(tmp_path / "behind.png")
    assert picture.write(file)
    over = rendered(stage_of(CUBE), background=file)
    np.testing.assert_allclose(over.to_uint8()[0, 0, :3], (51, 102, 153), atol=1)
    lit = rendered(stage_of(CUBE))
    inside = lit.pixels[..., 3] == 1
    np.testing.assert_array_equal(over.pixels[inside], lit.pixels[inside])
    for wrong in ("#12345", "1,2,3", "nowhere.png"):
        with pytest.raises(SettingsError, match="is not a background"):
            rendered(stage_of(CUBE), background=wrong)


def test_an_orbit_is_a_camera_that_is_turned_around() -> None:
    """The studio light turns with it; the picture is that of a camera which was authored there."""
    turned = "double3 xformOp:translate = (8, 1, 0)\n    float xformOp:rotateY = 90\n"
    turned += "    uniform token[] xformOpOrder = ['xformOp:translate', 'xformOp:rotateY']"
    wanted = rendered(stage_of(CUBE, camera=turned), spp=64)
    found = rendered(stage_of(CUBE), orbit_deg=90.0, spp=64)
    np.testing.assert_allclose(found.camera.world_from_camera, wanted.camera.world_from_camera, atol=1e-6)  # type: ignore[union-attr]
    np.testing.assert_allclose(found.pixels, wanted.pixels, rtol=0.1, atol=0.05)
    assert "rotated by 90 degrees" in says(found)
    assert not np.allclose(found.pixels, rendered(stage_of(CUBE), spp=64).pixels, atol=0.05)


def test_frames_of_one_command_are_those_of_their_own(tmp_path: Path, sky: str) -> None:
    """What earlier frames left behind serves a turntable; each picture is the one that is rendered alone."""
    stage = stage_of(CUBE)
    turns = [RenderSettings(resolution=(16, 12), spp=4, orbit_deg=k * 90.0, ground="plane", dome=sky) for k in range(3)]
    for settings, image in zip(turns, primray.render_frames(stage, turns), strict=True):
        np.testing.assert_array_equal(image.pixels, primray.render(stage, settings).pixels)


@pytest.fixture
def shot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    stage = stage_of(CUBE)
    stage.GetRootLayer().Export(str(tmp_path / "shot.usda"))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", str(tmp_path))
    return tmp_path


SMALL = ("render", "shot.usda", "--res", "16", "12", "--spp", "2")


def test_a_turntable_writes_pictures_and_a_movie(shot: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fake = shot / "ffmpeg"
    fake.write_text(
        '#!/bin/sh\nfor word; do test "$last" = -i && /bin/cat "$word" > asked.txt; last=$word; done\necho "$@" > "$last"\n'
    )
    fake.chmod(0o755)
    assert run([*SMALL, "--turntable", "2", "-o", "it's.##.png", "--fps", "12"]) == 0
    assert "it's.mp4: 2 pictures at 12 per second" in capsys.readouterr().out
    assert sorted(path.name for path in shot.glob("it's.*.png")) == ["it's.01.png", "it's.02.png"]
    listed = (shot / "asked.txt").read_text()
    assert listed.count("duration 0.0833333333") == 2
    assert f"file '{os.path.realpath(shot)}/it'\\''s.02.png'" in listed or "it'\\''s.02.png'" in listed
    assert "-r 12" in (shot / "it's.mp4").read_text()


def test_a_turntable_says_once_that_the_camera_is_turned(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without a camera of the stage's, whose path would tell the rows of two frames to be alike."""
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString("#usda 1.0\n" + CUBE)
    stage.GetRootLayer().Export(str(tmp_path / "cube.usda"))
    flags = ["--res", "8", "6", "--spp", "2", "--turntable", "4", "-o", str(tmp_path / "a.png")]
    assert run(["render", str(tmp_path / "cube.usda"), *flags]) == 0
    assert capsys.readouterr().err.count("The camera is rotated") == 1


def test_a_movie_is_refused_before_the_first_picture_where_nothing_makes_it(
    shot: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shots, "find_spec", lambda name: None)
    assert run([*SMALL, "--turntable", "3", "-o", "turn.png", "--fps", "12"]) == 2
    said = capsys.readouterr().err
    for sentence in ("movie-program", "pip install imageio-ffmpeg", "remove --fps"):
        assert sentence in said
    assert not list(shot.glob("turn*"))


def test_ffmpeg_makes_the_movie(shot: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The program itself reads what it is given: a fake one would not notice a protocol that it refuses."""
    if FFMPEG is None:
        pytest.skip("no ffmpeg")
    monkeypatch.setattr(shots, "_program", lambda: FFMPEG)
    assert run([*SMALL, "--turntable", "2", "-o", "turn.png", "--fps", "12"]) == 0
    made = (shot / "turn.mp4").read_bytes()
    assert made[4:8] == b"ftyp"
    assert b"moov" in made


@pytest.mark.parametrize(
    ("flags", "sentence"),
    [
        (["--fps", "12"], "--turntable"),
        (["--turntable", "0"], "has 1 to"),
        (["--turntable", "2", "--fps", "12", "-o", "a.exr"], "PNG or JPEG"),
        (["--turntable", "2", "-f", "1:2", "-o", "a.####.exr"], "one frame"),
    ],
)
def test_turntables_that_cannot_be(shot: Path, capsys: pytest.CaptureFixture[str], flags: list[str], sentence: str) -> None:
    assert run([*SMALL, *flags]) == 2
    assert sentence in capsys.readouterr().err


def test_a_preview_is_denoised(shot: Path) -> None:
    pytest.importorskip("pyoidn")
    assert run(["render", "shot.usda", "--res", "16", "12", "--preview", "-o", "a.exr"]) == 0
    image = primray.read_image(shot / "a.exr")
    assert image.denoised is not None
    assert image.metadata["settings.spp"] == 16
    assert run(["render", "shot.usda", "--res", "16", "12", "--preview", "--no-denoise", "-o", "a.exr"]) == 0
    image = primray.read_image(shot / "a.exr")
    assert image.denoised is None
    assert image.metadata["settings.spp"] == 16


@pytest.mark.parametrize("background", ["#ffffff", "#000000", "linear"])
def test_an_exposure_is_judged_by_what_is_seen_of_the_stage(background: str, sky: str) -> None:
    """A background that fills most of the picture changes neither the exposure that serves nor what is warned of."""
    stage = stage_of(CUBE)
    alone = rendered(stage, background="transparent")
    image = rendered(stage, background=sky if background == "linear" else background)
    np.testing.assert_array_equal(image.seen, alone.pixels)
    auto, plain = image.to_uint8(exposure="auto"), alone.to_uint8(exposure="auto")
    inside = alone.pixels[..., 3] == 1
    np.testing.assert_allclose(auto[inside].astype(int), plain[inside], atol=1)
    assert view_fault(image.seen, View()) is None
    shadow = rendered(stage, ground="shadow", background="transparent")
    assert (shadow.pixels[..., 3] > alone.pixels[..., 3]).any()
    np.testing.assert_array_equal(shadow.seen[..., 3], alone.pixels[..., 3])


@pytest.mark.parametrize("stops", [-3.0, 2.0, "auto"])
def test_a_background_as_displayed_stays_so_at_any_exposure(stops: Any, sky: str) -> None:
    image = rendered(stage_of(CUBE), background="#335577")
    np.testing.assert_allclose(image.to_uint8(exposure=stops)[0, 0, :3], (51, 85, 119), atol=1)
    assert np.abs(image.to_uint8(exposure=2.0).astype(int) - image.to_uint8()).max() > 10
    # Scene-linear files are light like the stage's: they are brightened with it.
    linear = rendered(stage_of(CUBE), background=sky)
    brighter = replace(linear, pixels=linear.pixels * np.array([4, 4, 4, 1], np.float32), foreground=None)
    corner = np.s_[0, 0]
    np.testing.assert_allclose(linear.to_uint8(exposure=2.0)[corner], brighter.to_uint8()[corner], atol=1)


def test_a_denoised_picture_without_light_asks_for_no_exposure() -> None:
    pytest.importorskip("pyoidn")
    stage = stage_of(CUBE)
    dark = rendered(stage, studio_light="off", denoise=True, resolution=(64, 48), spp=4)
    assert dark.denoised is not None
    assert view_fault(dark.seen, View()) is None
    assert exposure_that_serves(dark.seen, View()) == 0
    lit = rendered(stage, denoise=True, resolution=(64, 48), spp=4)
    assert lit.denoised is not None
    np.testing.assert_array_equal(lit.seen[lit.pixels[..., 3] == 1], lit.denoised.pixels[lit.pixels[..., 3] == 1])


SHADE = "double3 xformOp:translate = (0, 3, 8)\n    float xformOp:rotateX = -20\n"
SHADE += "    uniform token[] xformOpOrder = ['xformOp:translate', 'xformOp:rotateX']"


def test_a_shadow_costs_no_more_than_its_picture() -> None:
    """By the clock where there is a time limit, else by rays, so that the same render has the same shadow."""
    stage = stage_of(CUBE, camera=SHADE)
    limited = RenderSettings(time_limit_s=0.6, ground="shadow", resolution=(320, 240))
    assert limited.sampling_time_s is not None
    assert limited.shadow_time_s is not None
    assert limited.sampling_time_s + limited.shadow_time_s == pytest.approx(0.6)
    image = primray.render(stage, limited)
    assert image.report["sampling_s"] < 0.6
    assert image.report["stages_s"]["ground_shadow"] < 6  # 256 samples, as without a limit, take ten times as long
    assert RenderSettings(time_limit_s=0.6, ground="plane").sampling_time_s == 0.6
    pictures = [rendered(stage, ground="shadow", spp=32, threads=threads) for threads in (1, 2)]
    np.testing.assert_array_equal(pictures[0].pixels, pictures[1].pixels)


def test_the_shadow_below_a_denoised_picture_is_denoised() -> None:
    pytest.importorskip("pyoidn")
    stage = stage_of(CUBE, camera=SHADE)
    image = rendered(stage, ground="shadow", denoise=True, resolution=(160, 120), spp=2)
    clean = rendered(stage, ground="shadow", resolution=(160, 120), spp=2048).pixels[..., 3]
    assert image.denoised is not None
    beside = image.seen[..., 3] == 0
    noisy, denoised = (np.abs(made[..., 3] - clean)[beside].mean() for made in (image.pixels, image.denoised.pixels))
    assert denoised < 0.7 * noisy


def stored_in(path: Path) -> npt.NDArray[np.uint8]:
    return np.asarray(oiio.ImageBuf(str(path)).get_pixels(oiio.UINT8))


def test_a_jpeg_shows_the_shadow_over_white(tmp_path: Path) -> None:
    image = rendered(stage_of(CUBE, camera=SHADE), ground="shadow", resolution=(64, 48))
    beside = (image.seen[..., 3] == 0) & (image.pixels[..., 3] > 0.3)
    assert beside.any()
    shown = stored_in(image.save(tmp_path / "a.jpg"))
    assert shown[0, 0].min() > 250
    assert shown[beside].max() < 215
    over = stored_in(image.save(tmp_path / "b.jpg", flatten_over=(0, 0, 1)))
    assert over[0, 0, 2] > 250
    assert over[0, 0, 0] < 5
    plain = stored_in(rendered(stage_of(CUBE)).save(tmp_path / "c.jpg"))
    assert plain[0, 0].max() < 5


def test_the_shadow_darkens_a_dome_that_the_camera_sees(sky: str) -> None:
    stage = stage_of(CUBE, camera=SHADE)
    asked: dict[str, Any] = {"dome": sky, "resolution": (64, 48)}
    image, plain = rendered(stage, ground="shadow", **asked), rendered(stage, **asked)
    beside = plain.pixels[..., 3] == 0
    opacity = image.pixels[beside][:, 3:]
    assert opacity.max() > 0.3
    np.testing.assert_allclose(image.pixels[beside][:, :3], plain.pixels[beside][:, :3] * (1 - opacity), rtol=1e-5)


LAMP = """
def SphereLight "lamp"
{
    float inputs:intensity = %s
    double3 xformOp:translate = (3, 4, 3)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


@pytest.mark.parametrize(("intensity", "code"), [("0.001", "view-exposure"), ("0", "empty-picture")])
def test_a_picture_that_is_dark_by_weak_lights_names_the_studio_light(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], intensity: str, code: str
) -> None:
    """The stage has a light, so that none is added unasked; the warning and `doctor` say what adds one, and it serves."""
    monkeypatch.chdir(tmp_path)
    stage = stage_of(CUBE + LAMP % intensity)
    stage.GetRootLayer().Export("dark.usda")
    assert run(["render", "dark.usda", "--res", "16", "12", "--spp", "4", "-o", "a.png"]) == 0
    said = capsys.readouterr().err
    assert code in said
    assert "--studio-light on adds" in said
    assert run(["doctor", "dark.usda", "--res", "16", "12", "--pilot", "0.1"]) == 0
    assert "--studio-light on" in capsys.readouterr().out
    assert run(["render", "dark.usda", "--res", "16", "12", "--spp", "4", "--studio-light", "on", "-o", "b.png"]) == 0
    assert code not in capsys.readouterr().err
