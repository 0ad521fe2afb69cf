"""Numbers that images are asked for with: sizes, sums of many samples, cameras and exposures that no film could have."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from tests.described import look_at
from tests.hard.meshes.mesh_stages import DOME, camera_prim, codes, mesh_prim, picture, place, prim
from tests.unit.usd.usd_text import stage_of

import primray
from primray import RenderSettings
from primray.errors import LimitError, SettingsError
from primray.usd import translate

Measured = Callable[[str], None]

EYE = look_at([0, 0, 10], [0, 0, 0])
BALL = prim("Sphere", "ball")
GREY = 'def DomeLight "sky"\n{\n    color3f inputs:color = (0.1, 0.7, 1.3)\n    float inputs:intensity = 0.3\n}\n'


def seen(camera: str = "", more: str = "", resolution: tuple[int, int] = (16, 12)) -> primray.Image:
    eye = prim("Camera", "eye", place(EYE), camera)
    return picture(eye + DOME + BALL + more, resolution, 4, max_depth=2)


PLAIN = seen().pixels

# Samples.


def ulps(pixels: np.ndarray, value: np.ndarray) -> float:
    return float((np.abs(pixels.astype(np.float64) - value.astype(np.float64)) / np.spacing(value)).max())


def constant_error(spp: int) -> float:
    """In units in the last place: a sky of one colour, and a wall that emits another, both against one sample."""
    wall = prim(
        "Material",
        "glow",
        "token outputs:surface.connect = </glow/s.outputs:surface>",
        prim(
            "Shader",
            "s",
            'uniform token info:id = "UsdPreviewSurface"',
            "color3f inputs:diffuseColor = (0, 0, 0)",
            "color3f inputs:emissiveColor = (0.1, 0.7, 1.3)",
            "token outputs:surface",
        ),
    )
    plane = mesh_prim(
        [[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]], [[0, 1, 2, 3]], "rel material:binding = </glow>"
    ).replace('def Mesh "mesh"', 'def Mesh "mesh" (prepend apiSchemas = ["MaterialBindingAPI"])')
    errors = []
    for scene in (GREY, wall + plane):
        text = camera_prim(EYE, 0.1) + scene
        few = picture(text, (2, 1), 2, max_depth=1).pixels
        many = picture(text, (2, 1), spp, max_depth=1).pixels
        errors.append(ulps(many[..., :3], few[..., :3]))
    return max(errors)


@pytest.mark.hard_case(
    "Numbers",
    "1,000,000 samples a pixel of a constant image",
    expected="constant to 1 unit in the last place",
    plain_float="a float sum of a million times 0.1 is off by 1 %",
)
def test_a_million_samples(measured: Measured) -> None:
    error = constant_error(1_000_000)
    assert error <= 1
    assert abs(np.cumsum(np.full(1_000_000, 0.1, np.float32))[-1] / 1e5 - 1) > 5e-3  # what the table says of a float sum
    measured("1 unit in the last place at most")


# Sizes.


@pytest.mark.parametrize("size", [(1, 100_000), (100_000, 1), (1, 1)], ids=["1 x 100,000", "100,000 x 1", "1 x 1"])
@pytest.mark.hard_case("Images", "%s pixels", expected="every pixel sampled, edges where they are to 0.02 px")
def test_sizes(size: tuple[int, int], measured: Measured) -> None:
    """An edge across the longer side, seen by an orthographic film one unit long."""
    width, height = size
    edge = 0.31234567
    corners = np.array([[-1, -1, 0], [edge, -1, 0], [edge, 1, 0], [-1, 1, 0]])
    if height > width:
        corners = corners[:, [1, 0, 2]] * [1, -1, 1]
    wall = mesh_prim(corners, [[0, 1, 2, 3]])
    film = f"float horizontalAperture = {10 * min(1, width / height)}\nfloat verticalAperture = {10 * min(1, height / width)}"
    eye = prim("Camera", "eye", place(EYE), film, 'token projection = "orthographic"')
    image = picture(eye + DOME + wall, size, 256)
    assert image.pixels.shape == (height, width, 4)
    alpha = image.pixels[..., 3].ravel().astype(np.float64)
    assert np.isfinite(image.pixels).all()
    assert image.pixels[..., :3].min() > 0
    exact = np.clip((0.5 + edge) * alpha.size - np.arange(alpha.size), 0, 1)
    off = abs(float((alpha - exact).sum()))
    assert off < 0.02
    assert np.abs(alpha - exact).max() < 0.05
    measured("the edge to 0.02 px")


@pytest.mark.parametrize("size", [(131_073, 1), (1, 2**31), (65_536, 65_536), (2**40, 2**40)])
def test_sizes_beyond_the_limits(size: tuple[int, int]) -> None:
    with pytest.raises(LimitError, match="pixels"):
        RenderSettings(resolution=size)


def test_a_stage_may_not_ask_for_more() -> None:
    settings = prim("RenderSettings", "r", "uniform int2 resolution = (2147483647, 2147483647)")
    with pytest.raises(LimitError, match="pixels"):
        primray.render(stage_of(DOME + settings), RenderSettings(spp=1))
    with pytest.raises(LimitError, match="pixels"):
        primray.render(stage_of(DOME), RenderSettings(resolution=(100_000, 0), spp=1))


@pytest.mark.parametrize("size", [(0, 0), (-1, 5), (5, -1), (1.5, 2), (float("nan"), 2)], ids=str)
@pytest.mark.hard_case("Images", "a resolution of %s", expected="an error that says what it may be")
def test_impossible_sizes(size: tuple[int, int], measured: Measured) -> None:
    with pytest.raises(SettingsError, match="resolution"):
        RenderSettings(resolution=size)
    measured("settings-error")


@pytest.mark.parametrize("size", ["(0, 0)", "(3, 0)", "(-5, 7)"])
def test_impossible_sizes_on_the_stage(size: str) -> None:
    settings = prim("RenderSettings", "r", f"uniform int2 resolution = {size}")
    description, diagnostics = translate(stage_of(DOME + settings), RenderSettings())
    assert description.resolution == (2048, 1080)  # the schema's
    assert "render-settings-input" in [d.code for d in diagnostics]


# Cameras and exposures: what cannot be is said, and the picture is that of the default.

DEFAULTED = [
    "float exposure:fStop = 0", "float exposure:fStop = -2", "float exposure:fStop = nan", "float exposure:fStop = 1e-38",
    "float exposure:iso = -100", "float exposure:iso = inf", "float exposure:time = -1", "float exposure:time = nan",
    "float exposure = 1e30", "float exposure = nan", "float exposure:responsivity = -1",
    "float horizontalAperture = 0", "float horizontalAperture = -5", "float verticalAperture = nan",
    "float horizontalAperture = 3e38", "float verticalAperture = inf", "float horizontalApertureOffset = 1e30",
    "float focalLength = 0", "float focalLength = -1", "float focalLength = nan", "float focalLength = 1e-38",
    "float fStop = 1e-38\nfloat focusDistance = 10", "float fStop = 1\nfloat focusDistance = 1e-30",
    "float2 clippingRange = (100, 1)", "float2 clippingRange = (0, 0)", "float2 clippingRange = (-5, 10)",
    "float2 clippingRange = (1, inf)", "float2 clippingRange = (nan, 10)",
    "float fStop = -1\nfloat focusDistance = 10", "float fStop = 1\nfloat focusDistance = -10",
    "float4[] clippingPlanes = [(0, 0, nan, 1)]", "double shutter:open = nan", "double shutter:close = inf",
]  # fmt: skip


@pytest.mark.parametrize("attribute", DEFAULTED, ids=lambda text: text.replace("\n", ", ").replace("float ", ""))
@pytest.mark.hard_case("Images", "a camera with %s", expected="a diagnostic, and the picture of the default")
def test_cameras_that_cannot_be(attribute: str, measured: Measured) -> None:
    image = seen(attribute)
    found = codes(image)
    assert found
    assert set(found) <= {"camera-input", "out-of-range", "wrong-type", "motion"}
    np.testing.assert_array_equal(image.pixels, PLAIN)
    measured(f"`{found[0]}`")


@pytest.mark.parametrize("attribute", ["float exposure:time = 0", "float exposure:iso = 0", "float exposure = -1e30"])
@pytest.mark.hard_case("Images", "no light at all: %s", expected="black, with a diagnostic")
def test_nothing_is_exposed(attribute: str, measured: Measured) -> None:
    image = seen(attribute)
    assert codes(image) == ["camera-input"]
    assert not image.pixels[..., :3].any()
    np.testing.assert_array_equal(image.pixels[..., 3], PLAIN[..., 3])
    measured("black, `camera-input`")


@pytest.mark.parametrize("ratio", ["0", "-1", "nan", "inf", "-inf", "1e-38"])
@pytest.mark.hard_case("Images", "pixelAspectRatio = %s", expected="a diagnostic, and square pixels")
def test_pixel_aspects_that_cannot_be(ratio: str, measured: Measured) -> None:
    image = seen(more=prim("RenderSettings", "r", f"uniform float pixelAspectRatio = {ratio}"))
    assert len(codes(image)) == 1
    np.testing.assert_array_equal(image.pixels, PLAIN)
    measured(f"`{codes(image)[0]}`")


def test_a_pixel_aspect_that_can_be() -> None:
    """Pixels twice as wide as high: the ball covers half as many a row."""
    settings = prim(
        "RenderSettings", "r", "uniform float pixelAspectRatio = 2", 'uniform token aspectRatioConformPolicy = "cropAperture"'
    )
    wide = seen(more=settings, resolution=(64, 64)).pixels[..., 3]
    assert codes(seen(more=settings)) == []
    rows, columns = (wide > 0.5).any(axis=1).sum(), (wide > 0.5).any(axis=0).sum()
    assert abs(rows / columns - 2) < 0.2


@pytest.mark.parametrize("window", ["(1, 1, 0, 0)", "(nan, 0, 1, 1)", "(0, 0, inf, 1)", "(0.5, 0, 0.5, 1)"])
@pytest.mark.hard_case("Images", "dataWindowNDC = %s", expected="a diagnostic, and the whole frame")
def test_data_windows_that_cannot_be(window: str, measured: Measured) -> None:
    image = seen(more=prim("RenderSettings", "r", f"uniform float4 dataWindowNDC = {window}"))
    assert codes(image) == ["render-settings-input"]
    np.testing.assert_array_equal(image.pixels, PLAIN)
    measured("`render-settings-input`, the whole frame")


@pytest.mark.parametrize(
    ("window", "size"), [("(-1, -1, 3, 3)", (64, 48)), ("(0.25, 0.25, 0.5, 0.5)", (4, 3)), ("(2, 2, 3, 3)", (16, 12))]
)
@pytest.mark.hard_case("Images", "dataWindowNDC = %s", expected="a part of the frame, or more than it")
def test_data_windows(window: str, size: tuple[int, int], measured: Measured) -> None:
    image = seen(more=prim("RenderSettings", "r", f"uniform float4 dataWindowNDC = {window}"))
    assert (codes(image), image.resolution) == ([], size)
    assert np.isfinite(image.pixels).all()
    measured(f"{size[0]} x {size[1]} pixels")


@pytest.mark.conforms("Camera.shutter:open", "Camera.shutter:close", state="approximated")
@pytest.mark.hard_case("Images", "a shutter that closes before it opens", expected="a black picture, and a diagnostic")
def test_a_shutter_that_never_opens(measured: Measured) -> None:
    image = seen("double shutter:open = 1\ndouble shutter:close = 0")
    assert codes(image) == ["camera-input"]
    assert not image.pixels[..., :3].any()
    measured("`camera-input`, black")


# Frames without anything to see.

NOTHING = {
    "an empty stage": "",
    "a camera alone": prim("Camera", "eye", place(EYE)),
    "a camera that looks away": prim("Camera", "eye", place(look_at([0, 0, 10], [0, 0, 20]))) + BALL,
    "all of it behind the far plane": prim("Camera", "eye", place(EYE), "float2 clippingRange = (0.1, 0.2)") + BALL,
    "a mesh without points": prim("Camera", "eye", place(EYE)) + prim("Mesh", "m"),
    "an invisible world": prim("Camera", "eye", place(EYE)) + prim("Sphere", "s", 'token visibility = "invisible"'),
}


@pytest.mark.parametrize("name", NOTHING)
@pytest.mark.hard_case("Images", "nothing to see: %s", expected="black and transparent; white before a white sky")
def test_nothing_to_see(name: str, measured: Measured) -> None:
    assert not picture(NOTHING[name], (8, 6), 4).pixels.any()
    before_sky = picture(NOTHING[name] + DOME, (8, 6), 4).pixels
    assert (before_sky[..., :3] == 1).all()
    assert not before_sky[..., 3].any()
    measured("so it is")


# Times.

MOVING = """def Mesh "moving"
{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points.timeSamples = {
        1: [(-1, -1, 0), (1, -1, 0), (0, 1, 0)],
        2: [(-1, -1, 0), (1, -1, 0), (0, 1, 0), (5, 5, 5)],
        3: [(-1, -1, 0)],
    }
}
"""


@pytest.mark.parametrize(
    ("time", "like"), [(1.5, 1.0), (2.5, 2.0), (-1e9, 1.0), (1e9, None)], ids=["1.5", "2.5", "-1e9", "1e9"]
)
@pytest.mark.hard_case(
    "Images",
    "points of 3, 4 and 1 at times 1, 2 and 3, at time %s",
    expected="USD holds samples of unequal length; faces whose points are missing are named",
)
def test_samples_of_unequal_length(time: float, like: float | None, measured: Measured) -> None:
    text = prim("Camera", "eye", place(EYE)) + DOME + MOVING
    image = picture(text, (16, 12), 4, time_code=time)
    if like is None:
        assert codes(image) == ["faces-dropped"]
        assert not image.pixels[..., 3].any()
        measured("`faces-dropped`")
        return
    assert codes(image) == []
    assert image.pixels[..., 3].max() == 1
    np.testing.assert_array_equal(image.pixels, picture(text, (16, 12), 4, time_code=like).pixels)
    measured("held")


@pytest.mark.parametrize("time", [float("nan"), float("inf")])
def test_times_that_are_none(time: float) -> None:
    with pytest.raises(SettingsError, match="time"):
        RenderSettings(time_code=time)
