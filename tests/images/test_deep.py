"""Deep pictures: flattened they are the flat picture, with samples where surfaces and volumes are; order shows nowhere."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio
import pytest
from pxr import Usd
from tests.images.test_see_through import DOME, HEAD, HIDDEN, PANE, SUN, panes
from tests.images.test_volumes import look
from tests.unit.usd.volumes.volume_text import grid, volume_text, write

import primray
from primray.checkpoints.checkpointing import Checkpointing
from primray.errors import SettingsError
from primray.images.deep import FAR, DeepPicture
from primray.images.image import Image

ROOT = Path(__file__).parents[2] / "scenes"
pytestmark = pytest.mark.filterwarnings("ignore")
Array = npt.NDArray[Any]


def deep_of(image: Image) -> DeepPicture:
    assert image.deep is not None
    return image.deep


def shot(text: str, folder: Path | None = None, **settings: Any) -> Image:
    values = {"resolution": (16, 12), "spp": 64, "aovs": ("deep",), **settings}
    if folder is None:
        stage = Usd.Stage.CreateInMemory()
        assert stage.GetRootLayer().ImportFromString(HEAD + text)
        return primray.render(stage, **values)
    path = folder / f"stage{len(list(folder.glob('*.usda')))}.usda"  # USD keeps layers by their names
    path.write_text(HEAD + text)
    return primray.render(str(path), **values)


def opened(path: Path) -> Any:
    file = oiio.ImageInput.open(str(path))
    assert file is not None
    return file


def samples_of(deep: DeepPicture, y: int, x: int) -> Array:
    first = int(deep.counts.ravel()[: y * deep.counts.shape[1] + x].sum())
    return deep.values[first : first + int(deep.counts[y, x])]


def check_flat(image: Image) -> None:
    """The samples are in order without overlaps, and their composite is the picture."""
    deep = deep_of(image)
    scale = np.maximum(np.abs(image.pixels), 1.0)
    assert float((np.abs(deep.flattened() - image.pixels) / scale).max()) < 2e-5
    z, back, alpha = deep.values[:, 0], deep.values[:, 1], deep.values[:, 5]
    assert (back >= z).all()
    assert (alpha >= 0).all()
    assert (alpha <= 1).all()
    assert np.isfinite(deep.values).all()
    is_same_pixel = np.repeat(np.arange(deep.counts.size), deep.counts.ravel())
    follows = is_same_pixel[1:] == is_same_pixel[:-1]
    assert (z[1:] >= back[:-1])[follows].all()


SCENES = [
    "gallery/glass",
    "gallery/wax",
    "gallery/groom",
    "gallery/cornell",
    "gallery/motion",
    "features/display-opacity",
    "features/opacity-texture",
    "features/hair",
    "features/visibility",
    "features/interiors",
    "features/light-sphere",
    "features/light-dome",
    "features/camera-lens",
    "features/lens-flaws",
    "features/lens-fisheye",
    "features/rolling-shutter",
    "features/motion-camera",
    "features/camera-orthographic",
    "features/camera-clipping",
    "features/emission",
]


@pytest.mark.parametrize("scene", SCENES)
def test_flattened_it_is_the_picture(scene: str) -> None:
    image = primray.render(
        str(ROOT / scene / "scene.usda"), primray.RenderSettings(resolution=(40, 0), spp=16, aovs=("deep",), threads=1)
    )
    check_flat(image)
    assert deep_of(image).counts.max() > 0


def test_the_picture_has_the_bits_that_it_has_without_it() -> None:
    for scene in ("gallery/glass", "features/motion-shutter"):
        path = str(ROOT / scene / "scene.usda")
        plain, deep = (primray.render(path, resolution=(40, 0), spp=8, aovs=aovs) for aovs in ((), ("deep",)))
        assert plain.report["pixels_sha256"] == deep.report["pixels_sha256"]


def test_what_is_left_out_of_the_picture_is_left_out() -> None:
    path = str(ROOT / "gallery/glass/scene.usda")
    check_flat(primray.render(path, resolution=(40, 0), spp=16, aovs=("deep",), clamp_indirect=0.2))
    check_flat(primray.render(path, resolution=(40, 0), spp=16, aovs=("deep",), caustics=False))
    check_flat(primray.render(path, resolution=(40, 0), spp=16, aovs=("deep", "lpe:C<RD>[LO]")))


@pytest.mark.parametrize("sky", [DOME, HIDDEN, SUN])
@pytest.mark.parametrize("mode", ["presence", "transparent"])
def test_a_pane_before_a_wall(sky: str, mode: str) -> None:
    wall = PANE.format(name="Wall", z=-4, opacity=1, mode=mode, ior=1.5)
    image = shot(sky + panes(0.25, mode=mode, ior=1.0) + wall, spp=1024)
    check_flat(image)
    deep = deep_of(image)
    assert (deep.counts == 2).all()
    z, back, alpha = deep.values[:, 0], deep.values[:, 1], deep.values[:, 5]
    np.testing.assert_allclose(z[0::2], 10, rtol=2e-5)
    np.testing.assert_allclose(z[1::2], 14, rtol=2e-5)
    np.testing.assert_array_equal(z, back)
    np.testing.assert_array_equal(alpha[1::2], 1)
    assert float(alpha[0::2].mean()) == pytest.approx(0.25, abs=0.01)
    # The wall's own samples are those of a render without the pane, but for its shadow and reflections; none of them is black.
    assert (deep.values[1::2, 2:5] > 0).all()


LENS = """
def Camera "lens"
{
    float fStop = 1
    float focusDistance = 5
    float focalLength = 300
    double3 xformOp:translate = (0, 0, 10)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
DOLLY = """
def Camera "dolly"
{
    double shutter:open = 0
    double shutter:close = 1
    double3 xformOp:translate.timeSamples = { 0: (0, 0, 10), 1: (0, 0, 12) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


def test_depth_is_along_the_axis_through_lens_and_shutter() -> None:
    image = shot(HIDDEN + LENS + panes(1), camera="/lens")
    check_flat(image)
    np.testing.assert_allclose(deep_of(image).values[:, 0], 10, rtol=1e-4)
    assert (deep_of(image).counts == 1).all()
    image = shot(HIDDEN + DOLLY + panes(1), camera="/dolly", time_code=0.0, deep_tolerance=0.1, spp=256)
    check_flat(image)
    z = deep_of(image).values[:, 0]
    assert z.min() > 10
    assert z.max() < 12
    means = [samples_of(deep_of(image), y, x) for y, x in np.ndindex(12, 16)]
    flat = [(row[:, 0] * row[:, 5] * np.concatenate([[1], np.cumprod(1 - row[:-1, 5])])).sum() for row in means]
    np.testing.assert_allclose(flat, 11, atol=0.3)


def test_gaps_and_the_sky_behind_them() -> None:
    """Light from behind everything covers nothing; through a transmissive pane it belongs to the pane, as in the flat alpha."""
    image = shot(DOME + panes(0.25), spp=256)
    check_flat(image)
    values = deep_of(image).values
    np.testing.assert_allclose(values[0::2, 0], 10, rtol=2e-5)
    np.testing.assert_allclose(values[1::2, 0], FAR, rtol=1e-6)
    np.testing.assert_array_equal(values[1::2, 5], 0)
    np.testing.assert_allclose(values[1::2, 2:5], 1, rtol=0.01)  # the sky is white, and 3/4 of it is seen
    image = shot(DOME + panes(0.25, mode="transparent", ior=1.0), spp=256)
    check_flat(image)
    assert (deep_of(image).counts == 1).all()
    assert (deep_of(image).values[:, 5] == 1).all()
    image = shot(HIDDEN + panes(0.25, mode="transparent", ior=1.0), spp=256)
    check_flat(image)
    assert float(deep_of(image).values[:, 5].mean()) == pytest.approx(0.25, abs=0.02)


BALL = """
def Sphere "ball{name}" {{
    double radius = {radius}
    double3 xformOp:translate = (0, 0, {z})
    uniform token[] xformOpOrder = ["xformOp:translate"]
    color3f[] primvars:displayColor = [({color})]
}}
"""
SMOKE = """
def Xform "Cloud" {{
    double3 xformOp:translate = ({x}, -3.5, {z})
    uniform token[] xformOpOrder = ["xformOp:translate"]
    {volume}
}}
"""


def smoke(folder: Path, z: float = -3.5, density: float = 0.05, x: float = -3.5) -> str:
    """A cube of smoke, 8 across, about the depth 10 - z - 3.5, bound to a grey that scatters."""
    write(folder, grid(density))
    shader = 'float inputs:scatter = 1\ncolor3f inputs:scatter_color = (0.8, 0.6, 0.4)\nstring inputs:emission_mode = "none"'
    return SMOKE.format(x=x, z=z, volume=volume_text(bound="/Look")) + look(shader)


def test_smoke_is_divided_in_depth(tmp_path: Path) -> None:
    image = shot(HIDDEN + smoke(tmp_path), tmp_path, spp=1024)
    check_flat(image)
    samples = samples_of(deep_of(image), 6, 8)
    z, back, alpha = samples[:, 0], samples[:, 1], samples[:, 5]
    assert len(samples) > 20
    assert (back > z).all()
    assert 5.5 < z[0] < 6.5
    assert 13.5 < back[-1] < 14.5
    # Beer and Lambert: the optical depth up to the middle is half of that of all.
    passed = np.cumsum(np.log1p(-alpha.astype(np.float64)))
    assert passed[-1] == pytest.approx(-0.4, abs=0.06)
    assert np.interp(10.0, back, passed) == pytest.approx(-0.2, abs=0.04)
    # Neighbouring samples touch.
    assert (z[1:] - back[:-1]).max() < 0.02


def merged(*pictures: DeepPicture) -> Array:
    """Composite of deep pictures, as compositing programs make it: samples are split where others begin or end."""
    height, width = pictures[0].counts.shape
    flat = np.zeros((height, width, 4))
    for y, x in np.ndindex(height, width):
        rows = np.concatenate([samples_of(p, y, x) for p in pictures]).astype(np.float64)
        cuts = np.unique(rows[:, :2])
        parts = []
        for row in rows:
            z, back, color = row[0], row[1], row[2:]
            inner = cuts[(cuts > z) & (cuts < back)]
            ends = [z, *inner, back]
            if back == z:
                parts.append((z, z, color))
                continue
            for a, b in itertools.pairwise(ends):
                share = (b - a) / (back - z)
                alpha = 1 - (1 - color[3]) ** share
                scale = alpha / color[3] if color[3] > 0 else share
                parts.append((a, b, color * scale))
        for _, _, color in sorted(parts, key=lambda part: (part[0] + part[1], part[1])):
            flat[y, x] += (1 - flat[y, x, 3]) * color
    return flat


@pytest.mark.parametrize("z", [-2.5, 3.5, -12.0])  # of a ball in the middle of the smoke, before it, and behind it
def test_compositing_in_depth_equals_rendering_both(tmp_path: Path, z: float) -> None:
    """A ball and smoke that cast no light on each other: black, and lit by nothing but their own emission."""
    settings: dict[str, Any] = {"spp": 4096, "max_depth": 1, "default_light": False}
    write(tmp_path, grid(0.05), grid((0.02, 0.05, 0.01), name="emission", kind="vec3s"))
    shader = 'float inputs:scatter = 0\nstring inputs:emission_mode = "none"'
    fog = SMOKE.format(x=-3.5, z=-3.5, volume=volume_text(bound="/Look")) + look(shader)
    fire = SMOKE.format(x=-3.5, z=-3.5, volume=volume_text({"emission": ""})).replace('"Cloud"', '"Fire"')
    light = SHINE.format(z=z)
    smoke_alone = shot(fog + fire, tmp_path, **settings)
    ball_alone = shot(light, tmp_path, **settings)
    both = shot(fog + fire + light, tmp_path, **settings)
    for image in (smoke_alone, ball_alone, both):
        check_flat(image)
    found = merged(deep_of(smoke_alone), deep_of(ball_alone))
    assert smoke_alone.errors is not None
    assert both.errors is not None
    assert ball_alone.errors is not None
    error = np.sqrt(
        smoke_alone.errors.astype(float) ** 2 + both.errors.astype(float) ** 2 + ball_alone.errors.astype(float) ** 2
    )
    spread = np.sqrt((error**2).mean())
    difference = found - both.pixels
    assert np.abs(difference[..., :3].mean()) < 4 * spread / np.sqrt(found[..., :3].size) + 2e-3
    assert np.sqrt((difference[..., :3] ** 2).mean()) < 2 * spread + 2e-3
    assert np.abs(difference[..., 3]).mean() < 0.01


SHINE = """
def Sphere "shine" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
    double radius = 1.5
    double3 xformOp:translate = (0, 0, {z})
    uniform token[] xformOpOrder = ["xformOp:translate"]
    rel material:binding = </shine/m>
    def Material "m"
    {{
        token outputs:surface.connect = </shine/m/s.outputs:surface>
        def Shader "s"
        {{
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (0, 0, 0)
            color3f inputs:specularColor = (0, 0, 0)
            int inputs:useSpecularWorkflow = 1
            color3f inputs:emissiveColor = (1, 0.5, 0.25)
            token outputs:surface
        }}
    }}
}}
"""


FOGGY = """
def Camera "foggy" (prepend apiSchemas = ["PrimrayFogAPI"])
{{
    float primray:fog:density = 5
    color3f primray:fog:color = ({color})
    color3f primray:fog:emission = ({emission})
    double3 xformOp:translate = (0, 0, 10)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""
FILLED = """
def Sphere "filled" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    double radius = 2
    double3 xformOp:translate = (0, 0, -3)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    rel material:binding = </Look>
}
"""


@pytest.mark.parametrize(
    ("color", "emission"), [("0.8, 0.8, 0.8", "0, 0, 0"), ("0, 0, 0", "2, 4, 1"), ("0.5, 0.5, 0.5", "2, 4, 1")]
)
@pytest.mark.parametrize("wall", [False, True])
def test_fog_is_before_and_behind(color: str, emission: str, wall: bool) -> None:
    text = DOME + FOGGY.format(color=color, emission=emission)
    text += PANE.format(name="Wall", z=-8, opacity=1, mode="presence", ior=1.5) if wall else ""
    image = shot(text, camera="/foggy", spp=256)
    check_flat(image)
    samples = samples_of(deep_of(image), 6, 8)
    if color != "0, 0, 0" or emission != "0, 0, 0":
        assert len(samples) > 10
        assert samples[0, 0] < 5
    if wall:
        assert samples[-1, 0] == pytest.approx(18, rel=1e-4)
        assert samples[-1, 5] == 1


@pytest.mark.parametrize("emission", ["none", "channel"])
def test_a_filled_shape_has_its_samples_within(emission: str) -> None:
    shader = "float inputs:scatter = 1\nfloat inputs:density = 0.3\nfloat inputs:emission = 0.1\n"
    shader += f'string inputs:emission_mode = "{emission}"'
    text = HIDDEN + FILLED + look(shader) + PANE.format(name="Wall", z=-8, opacity=1, mode="presence", ior=1.5)
    image = shot(text, spp=256)
    check_flat(image)
    z = samples_of(deep_of(image), 6, 8)[:, 0]
    assert len(z) > 10
    assert z[0] > 10.9
    assert z[-2] < 15.1
    assert z[-1] == pytest.approx(18, rel=1e-4)


def test_flames_cover_nothing_at_their_depth(tmp_path: Path) -> None:
    write(tmp_path, grid(0.0), grid((0.1, 0.2, 0.3), name="emission", kind="vec3s"))
    fire = SMOKE.format(x=-3.5, z=-3.5, volume=volume_text({"emission": ""}))
    wall = PANE.format(name="Wall", z=-8, opacity=1, mode="presence", ior=1.5)
    image = shot(HIDDEN + fire + wall, tmp_path, spp=256)
    check_flat(image)
    samples = samples_of(deep_of(image), 6, 8)
    is_flame = samples[:, 5] == 0
    assert is_flame.sum() > 10
    assert samples[-1, 5] == 1
    assert samples[-1, 0] == pytest.approx(18, rel=1e-4)
    light = samples[is_flame]
    assert (light[:, 0] > 5.4).all()
    assert (light[:, 1] < 14.6).all()
    middle = (light[:, 3] * (light[:, 0] + light[:, 1]) / 2).sum() / light[:, 3].sum()
    assert middle == pytest.approx(10, abs=0.2)
    np.testing.assert_allclose(light[:, 2:5].sum(axis=0), 8 * np.array([0.1, 0.2, 0.3]), rtol=0.05)


@pytest.mark.parametrize(("lanes", "most"), [("1", 32), ("4", 32), ("4", 6)])
def test_bits_do_not_depend_on_lanes_and_threads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lanes: str, most: int
) -> None:
    from primray.core import native

    text = DOME + smoke(tmp_path) + panes(0.25) + BALL.format(name="", radius=1.5, z=-2.5, color="0.5, 0.4, 0.3")
    one = deep_of(shot(text, tmp_path, threads=1, resolution=(40, 30), deep_samples=most))
    monkeypatch.setenv("PRIMRAY_LANES", lanes)
    native.lanes.cache_clear()
    try:
        other = deep_of(shot(text, tmp_path, threads=3, resolution=(40, 30), deep_samples=most))
    finally:
        monkeypatch.undo()
        native.lanes.cache_clear()
    np.testing.assert_array_equal(one.counts, other.counts)
    np.testing.assert_array_equal(one.values, other.values)


@pytest.mark.parametrize("most", [4, 8, 16])
def test_a_pixel_has_no_more_samples_than_asked_for(tmp_path: Path, most: int) -> None:
    image = shot(HIDDEN + smoke(tmp_path), tmp_path, spp=256, deep_samples=most)
    check_flat(image)
    counts = deep_of(image).counts
    assert most // 2 <= counts.max() <= most
    assert image.report["deep"]["samples_per_pixel"]["limit"] == most


def test_files_and_report(tmp_path: Path) -> None:
    image = shot(HIDDEN + panes(0.25), resolution=(20, 10))
    image.save(tmp_path / "a.0001.exr")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.0001.exr", "a.deep.0001.exr"]
    assert not opened(tmp_path / "a.0001.exr").spec().deep
    file = opened(tmp_path / "a.deep.0001.exr")
    assert file.spec().deep
    assert file.spec().getattribute("primray:camera.path") == "/c"
    data = file.read_native_deep_image()
    deep = deep_of(image)
    assert [data.samples(pixel) for pixel in range(200)] == deep.counts.ravel().tolist()
    flat = oiio.ImageBufAlgo.flatten(oiio.ImageBuf(str(tmp_path / "a.deep.0001.exr")))
    names = list(flat.spec().channelnames)
    order = [names.index(name) for name in "RGBA"]
    np.testing.assert_allclose(np.asarray(flat.get_pixels(oiio.FLOAT))[..., order], image.pixels, atol=1e-5)
    said = image.report["deep"]
    assert said["tolerance"] == 0.01
    assert said["samples"] == int(deep.counts.sum())
    image.save(tmp_path / "b.png")
    assert not list(tmp_path.glob("b.deep*"))


def test_checkpoints_and_stereo_pairs_are_refused(tmp_path: Path) -> None:
    with pytest.raises(SettingsError) as caught:
        shot(HIDDEN + panes(0.25), checkpointing=Checkpointing(tmp_path / "a.prc"))
    assert caught.value.code == "deep-setting"
    with pytest.raises(SettingsError) as caught:
        primray.render_stereo(str(ROOT / "features/stereo/scene.usda"), resolution=(16, 0), spp=2, aovs=["deep"])
    assert caught.value.code == "deep-setting"


PRODUCTS = """
def Scope "Render" {
    def RenderSettings "settings" {
        rel products = [</Render/flat>, </Render/deep>]
        rel camera = </c>
        int2 resolution = (16, 12)
    }
    def RenderProduct "flat" {
        token productName = "flat.exr"
    }
    def RenderProduct "deep" {
        token productName = "deep.exr"
        token productType = "deepRaster"
        rel orderedVars = [</Render/color>, </Render/depth>, </Render/normal>]
    }
    def RenderVar "color" {
        string sourceName = "Ci"
    }
    def RenderVar "depth" {
        string sourceName = "Z"
    }
    def RenderVar "normal" {
        string sourceName = "N"
    }
}
"""


def test_deep_raster_products(tmp_path: Path) -> None:
    (tmp_path / "shot.usda").write_text(HEAD + HIDDEN + panes(0.25) + PRODUCTS)
    made = list(primray.render_products(str(tmp_path / "shot.usda"), spp=16))
    assert [product.path for product, _ in made] == ["/Render/flat", "/Render/deep"]
    assert made[0][1].deep is made[1][1].deep  # one render
    for product, image in made:
        product.save(image, tmp_path / "out")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["deep.exr", "flat.exr"]
    assert opened(tmp_path / "out/deep.exr").spec().deep
    assert not opened(tmp_path / "out/flat.exr").spec().deep
    messages = [row["message"] for row in made[1][1].report["diagnostics"]]
    assert any("normal is left out" in message for message in messages)
    assert not any("depth" in message and "left out" in message for message in messages)
    alone = primray.render(str(tmp_path / "shot.usda"), spp=4, product="/Render/deep").as_product("/Render/deep")
    with pytest.raises(SettingsError) as caught:
        alone.save(tmp_path / "deep.png")
    assert caught.value.code == "deep-output"
