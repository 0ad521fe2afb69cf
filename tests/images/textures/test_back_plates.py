"""Back plates fill the frame with their image, pixel for pixel, graded and cut out as they say, wherever the camera stands."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

import primray
from primray.errors import UnsupportedError

WIDTH, HEIGHT = 32, 24
STAGE = """#usda 1.0
(
    upAxis = "Y"
)
def Camera "c" (prepend apiSchemas = ["BackPlateAPI:b"])
{
    float focalLength = 40
    float horizontalAperture = 32
    float verticalAperture = 24
    float focusDistance = 20
    float horizontalApertureOffset = 3
    asset backPlate:b:image = @plate.exr@
    MORE
    double3 xformOp:translate = (1, 2, 3)
    float3 xformOp:rotateXYZ = (10, 20, 30)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}
def Camera "other"
{
    double3 xformOp:translate = (1, 2, 3)
    float3 xformOp:rotateXYZ = (10, 20, 30)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}
"""
GREY = np.full((HEIGHT, WIDTH, 3), (0.25, 0.5, 0.75), np.float32)


def save(path: Path, values: Any) -> None:
    pixels = np.ascontiguousarray(values, np.float32)
    file = oiio.ImageOutput.create(str(path))
    assert file is not None
    file.open(str(path), oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], "float"))
    file.write_image(pixels)
    file.close()


@pytest.fixture
def seen(tmp_path: Path) -> Any:
    def picture(image: Any, more: str = "", camera: str = "/c", size: tuple[int, int] = (WIDTH, HEIGHT), api: str = "") -> Any:
        save(tmp_path / "plate.exr", image)
        stage = STAGE.replace("MORE", more).replace('"BackPlateAPI:b"', f'"BackPlateAPI:b"{api}')
        if "@plate.png@" in more:
            stage = stage.replace("asset backPlate:b:image = @plate.exr@", "")
        (tmp_path / "shot.usda").write_text(stage)
        settings = primray.RenderSettings(camera=camera, resolution=size, spp=16, filter="box", default_light=False)
        return np.asarray(primray.render(str(tmp_path / "shot.usda"), settings).pixels)

    return picture


@pytest.mark.conforms("BackPlateAPI.image")
def test_it_fills_the_frame_pixel_for_pixel(seen: Any) -> None:
    image = np.random.default_rng(1).uniform(0.1, 0.9, (HEIGHT, WIDTH, 3)).astype(np.float32)
    assert np.abs(seen(image)[..., :3] - image).max() < 5e-4  # textures are kept in halves
    wide = seen(GREY, size=(2 * WIDTH, HEIGHT))
    assert wide[..., 3].min() == 1
    assert np.allclose(wide[..., :3], (0.25, 0.5, 0.75), atol=1e-3)


@pytest.mark.conforms(*(f"BackPlateAPI.luma:{name}" for name in ("slope", "offset", "power")))
def test_it_is_graded(seen: Any) -> None:
    """(in * slope + offset) ^ power."""
    luma = {"slope": (2, 1, 1), "offset": (0.1, 0, -0.5), "power": (2, 0.5, 1)}
    more = "".join(f"float3 backPlate:b:luma:{name} = {value}\n    " for name, value in luma.items())
    assert np.allclose(seen(GREY, more)[..., :3], ((0.25 * 2 + 0.1) ** 2, 0.5**0.5, 0.25), atol=1e-3)


@pytest.mark.conforms("BackPlateAPI.alpha:image")
@pytest.mark.parametrize(("channels", "counts"), [(1, 0), (2, 1), (3, None), (4, 3)])
def test_its_opacity_is_a_channel_by_their_number(seen: Any, tmp_path: Path, channels: int, counts: int | None) -> None:
    alpha = np.zeros((HEIGHT, WIDTH, channels), np.float32)
    if counts is not None:
        alpha[:, WIDTH // 2 :, counts] = 1
    save(tmp_path / "alpha.exr", alpha)
    found = seen(GREY, "asset backPlate:b:alpha:image = @alpha.exr@")[..., 3]
    assert found[:, WIDTH // 2 :].min() == 1
    assert found[:, : WIDTH // 2].max() == (0 if counts is not None else 1)


@pytest.mark.conforms("BackPlateAPI.plateVisibility")
def test_who_sees_it(seen: Any) -> None:
    def visible(how: str, camera: str) -> bool:
        return bool(seen(GREY, f'token backPlate:b:plateVisibility = "{how}"', camera)[..., 3].max() > 0)

    assert [visible(how, "/c") for how in ("all", "solo", "mute")] == [True, True, False]
    assert [visible(how, "/other") for how in ("all", "solo", "mute")] == [True, False, False]


@pytest.mark.conforms(*(f"BackPlateAPI.{name}:tweak" for name in ("scale", "translate", "rotateXYZ")))
def test_tweaks_are_about_its_centre(seen: Any) -> None:
    half = seen(GREY, "float2 backPlate:b:scale:tweak = (0.5, 1)")[HEIGHT // 2, :, 3]
    assert half.tolist() == [0] * 8 + [1] * 16 + [0] * 8
    # At 20 + 40 / 10 units the frame is 24 * 32 / 40 wide.
    moved = seen(GREY, f"float3 backPlate:b:translate:tweak = ({24 * 0.8 / 2}, 0, 0)")[HEIGHT // 2, :, 3]
    assert moved.tolist() == [0] * 16 + [1] * 16
    turned = seen(GREY, "float3 backPlate:b:rotateXYZ:tweak = (0, 0, 90)")[..., 3]
    assert turned[HEIGHT // 2].tolist() == [0] * 4 + [1] * 24 + [0] * 4
    assert turned[0].tolist() == [0] * 4 + [1] * 24 + [0] * 4


DEPTH = ("minOffset", "normalizingFactor", "cameraSpaceOffset")


@pytest.mark.conforms("BackPlateAPI.depth:image", *(f"BackPlateAPI.depth:{name}" for name in DEPTH))
def test_texels_stand_at_their_depths(tmp_path: Path) -> None:
    """(texel - minOffset) * normalizingFactor + cameraSpaceOffset, on the camera's own rays: the picture stays as it is."""
    image = np.random.default_rng(2).uniform(0.1, 0.9, (HEIGHT, WIDTH, 3)).astype(np.float32)
    texels = np.repeat(np.repeat(np.array([[0.2, 0.4], [0.6, 0.8]]), HEIGHT // 2, axis=0), WIDTH // 2, axis=1)[:, :, None]
    save(tmp_path / "plate.exr", image)
    save(tmp_path / "depth.exr", texels)
    more = "asset backPlate:b:depth:image = @depth.exr@\n"
    more += "".join(f"    float backPlate:b:depth:{name} = {v}\n" for name, v in zip(DEPTH, (0.1, 10, 3), strict=True))
    (tmp_path / "shot.usda").write_text(STAGE.replace("MORE", more))
    settings = primray.RenderSettings(
        camera="/c", resolution=(WIDTH, HEIGHT), spp=16, filter="box", default_light=False, aovs=("depth",)
    )
    found = primray.render(str(tmp_path / "shot.usda"), settings)
    depth = np.asarray(found.aovs["depth"]).reshape(HEIGHT, WIDTH)
    expected = (texels[:, :, 0] - 0.1) * 10 + 3
    inner = np.ones((HEIGHT, WIDTH), bool)  # between the quarters it goes from one to the other
    inner[HEIGHT // 2 - 1 : HEIGHT // 2 + 1] = inner[:, WIDTH // 2 - 1 : WIDTH // 2 + 1] = False
    assert np.allclose(depth[inner], expected[inner], rtol=1e-4)
    assert np.abs(np.asarray(found.pixels)[..., :3] - image)[inner].max() < 5e-4


def test_nothing_stands_where_there_is_no_depth(seen: Any, tmp_path: Path) -> None:
    save(tmp_path / "depth.exr", np.concatenate([np.zeros((HEIGHT, 8, 1)), np.full((HEIGHT, WIDTH - 8, 1), 5.0)], axis=1))
    found = seen(GREY, "asset backPlate:b:depth:image = @depth.exr@")[..., 3]
    assert found[:, :8].max() == 0
    assert found[:, 9:].min() == 1


def test_without_an_image_it_is_black(tmp_path: Path) -> None:
    (tmp_path / "shot.usda").write_text(STAGE.replace("MORE", "").replace("plate.exr", "none.exr"))
    settings = primray.RenderSettings(camera="/c", resolution=(8, 6), spp=4, filter="box", default_light=False)
    found = np.asarray(primray.render(str(tmp_path / "shot.usda"), settings).pixels)
    assert found[..., 3].min() == 1
    assert found[..., :3].max() == 0


ENCODED = 188 / 255  # of 0.5 by sRGB's curve, nearly
DECODED = {
    "raw": ENCODED,
    "data": ENCODED,
    "lin_rec709_scene": ENCODED,
    "srgb_rec709_scene": ((ENCODED + 0.055) / 1.055) ** 2.4,
}
DECODED |= {"g22_rec709_scene": ENCODED**2.2}


def save_bytes(path: Path, value: float, channels: int) -> None:
    file = oiio.ImageOutput.create(str(path))
    assert file is not None
    file.open(str(path), oiio.ImageSpec(WIDTH, HEIGHT, channels, "uint8"))
    file.write_image(np.full((HEIGHT, WIDTH, channels), round(255 * value), np.uint8))
    file.close()


@pytest.mark.parametrize("space", [*DECODED, ""])
def test_its_image_is_in_the_colour_space_that_its_attribute_says(seen: Any, tmp_path: Path, space: str) -> None:
    save_bytes(tmp_path / "plate.png", ENCODED, 3)
    said = f'(colorSpace = "{space}")' if space else ""
    found = seen(GREY, f"asset backPlate:b:image = @plate.png@ {said}")
    assert np.allclose(found[..., :3], DECODED[space or "srgb_rec709_scene"], atol=2e-3)


@pytest.mark.parametrize("space", DECODED)
def test_spaces_of_the_camera_and_above_count_too(seen: Any, tmp_path: Path, space: str) -> None:
    save_bytes(tmp_path / "plate.png", ENCODED, 3)
    text = f'token colorSpace:name = "{space}"\nasset backPlate:b:image = @plate.png@'
    found = seen(GREY, text, api=', "ColorSpaceAPI"')
    assert np.allclose(found[..., :3], DECODED[space], atol=2e-3)


def test_a_space_that_the_stage_defines(seen: Any, tmp_path: Path) -> None:
    save_bytes(tmp_path / "plate.png", ENCODED, 3)
    own = 'colorSpaceDefinition:mine:name = "mine"\n'
    defined = f"token {own}" + "".join(
        f"{kind} colorSpaceDefinition:mine:{name} = {value}\n"
        for kind, name, value in (
            ("float2", "redChroma", "(0.64, 0.33)"), ("float2", "greenChroma", "(0.3, 0.6)"),
            ("float2", "blueChroma", "(0.15, 0.06)"), ("float2", "whitePoint", "(0.3127, 0.329)"), ("float", "gamma", "3"),
        )
    )  # fmt: skip
    text = defined + 'asset backPlate:b:image = @plate.png@ (colorSpace = "mine")'
    found = seen(GREY, text, api=', "ColorSpaceDefinitionAPI:mine"')
    assert np.allclose(found[..., :3], ENCODED**3, atol=2e-3)


@pytest.mark.parametrize("space", ["", *DECODED])
def test_opacities_are_numbers_unless_their_attribute_says_otherwise(seen: Any, tmp_path: Path, space: str) -> None:
    save_bytes(tmp_path / "alpha.png", ENCODED, 1)
    said = f'(colorSpace = "{space}")' if space else ""
    found = seen(GREY, f"asset backPlate:b:alpha:image = @alpha.png@ {said}")[..., 3]
    assert found.mean() == pytest.approx(DECODED[space or "raw"], abs=0.02)


@pytest.mark.parametrize("space", ["", *DECODED, "nobody's"])
def test_depths_are_numbers_unless_their_attribute_says_otherwise(tmp_path: Path, space: str) -> None:
    save(tmp_path / "plate.exr", GREY)
    save_bytes(tmp_path / "depth.png", ENCODED, 1)
    said = f'(colorSpace = "{space}")' if space else ""
    more = f"asset backPlate:b:depth:image = @depth.png@ {said}\nfloat backPlate:b:depth:normalizingFactor = 10"
    (tmp_path / "shot.usda").write_text(STAGE.replace("MORE", more))
    settings = primray.RenderSettings(camera="/c", resolution=(WIDTH, HEIGHT), spp=4, default_light=False, aovs=("depth",))
    found = primray.render(str(tmp_path / "shot.usda"), settings)
    depth = np.asarray(found.aovs["depth"])
    assert np.allclose(depth, 10 * DECODED.get(space, ENCODED), rtol=2e-3)
    assert ("color-space" in {d["code"] for d in found.report["diagnostics"]}) == (space == "nobody's")


RED = """def Material "red" {
    token outputs:surface.connect = </red/s.outputs:surface>
    def Shader "s" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:emissiveColor = (1, 0, 0)
        token outputs:surface
    }
}
"""
BINDS = 'rel material:binding%s = </red> (bindMaterialAs = "strongerThanDescendants")'


COLLECTED = """rel collection:all:includes = </rig>
rel material:binding:collection:all = [</rig.collection:all>, </red>] (bindMaterialAs = "strongerThanDescendants")"""


def in_a_rig(stage: str, rig: str, header: str = "") -> str:
    """The camera of a stage, below a prim that says more."""
    head, camera = stage.split('def Camera "c"')
    camera, other = camera.split('def Camera "other"')
    return f'{head}{RED}def Xform "rig" ({header}) {{\n{rig}\ndef Camera "c"{camera}}}\ndef Camera "other"{other}'


@pytest.mark.parametrize(
    ("rig", "header"),
    [
        (BINDS % "", ""),
        (BINDS % ":full", ""),
        (COLLECTED, "api"),
        ('uniform token purpose = "guide"', ""),
        ("", "instanceable = true\nreferences = </hidden>"),
    ],
    ids=["stronger", "full", "collection", "guide", "instance"],
)
def test_what_holds_the_camera_changes_nothing(rig: str, header: str, tmp_path: Path) -> None:
    save(tmp_path / "plate.exr", GREY)
    api = 'prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:all"]' if header == "api" else header
    stage = in_a_rig(STAGE.replace("MORE", ""), rig, api)
    if "hidden" in header:
        stage = in_a_rig(STAGE.replace("MORE", ""), "").replace('def Xform "rig" ()', 'class Xform "hidden"')
        stage += f'def Xform "rig" (\n{header}\n)\n{{\n}}\n'
    (tmp_path / "shot.usda").write_text(stage)
    image = primray.render(tmp_path / "shot.usda", camera="/rig/c", resolution=(WIDTH, HEIGHT), spp=4, default_light=False)
    assert np.allclose(image.pixels[..., :3], (0.25, 0.5, 0.75), atol=1e-3)


def test_the_plate_of_an_invisible_camera_is_reported(tmp_path: Path) -> None:
    save(tmp_path / "plate.exr", GREY)
    (tmp_path / "shot.usda").write_text(in_a_rig(STAGE.replace("MORE", ""), 'token visibility = "invisible"'))
    with pytest.raises(UnsupportedError, match="its camera is invisible"):
        primray.render(tmp_path / "shot.usda", camera="/rig/c", resolution=(8, 8), spp=1, strict=True)


@pytest.mark.parametrize(
    ("attribute", "file", "reason"),
    [
        ("image", "@gone.png@", "is black: its image .*gone.png cannot be read"),
        ("image", "@text.png@", "is black: its image .*text.png cannot be read"),
        ("alpha:image", "@gone.png@", "is opaque: its alpha:image .* cannot be read"),
        ("alpha:image", "@plate.exr@", "is opaque: its alpha:image .* has 3 channels"),
    ],
)
def test_an_image_that_cannot_be_used_is_reported(attribute: str, file: str, reason: str, tmp_path: Path) -> None:
    save(tmp_path / "plate.exr", GREY)
    (tmp_path / "text.png").write_text("no picture")
    stage = STAGE.replace("asset backPlate:b:image = @plate.exr@", "") if attribute == "image" else STAGE
    (tmp_path / "shot.usda").write_text(stage.replace("MORE", f"asset backPlate:b:{attribute} = {file}"))
    with pytest.raises(UnsupportedError, match=reason):
        primray.render(tmp_path / "shot.usda", camera="/c", resolution=(8, 8), spp=1, strict=True)
