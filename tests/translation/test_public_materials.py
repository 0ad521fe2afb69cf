"""Materials, textures and primvars of public stages are what their readmes say; skipped where the shared assets are not."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from primray.description import Interpolation, Mesh, PrimvarInput, SceneDescription, TextureFile, TextureInput, Wrap
from primray.diagnostics import Diagnostics
from primray.render import load_textures
from primray.settings import RenderSettings
from primray.textures.texture import Texture, load_texture
from primray.usd import open_stage, read_asset, translate

from .test_public_stages import ASSETS, STAGES

pytestmark = pytest.mark.skipif(not STAGES, reason="the shared assets are not here")


@cache
def translated(path: str) -> tuple[SceneDescription, tuple[tuple[str, str], ...]]:
    description, found = translate(open_stage(ASSETS / path, Diagnostics()), RenderSettings())
    return description, tuple((d.code, d.prim_path) for d in found)


def diffuse(description: SceneDescription, material: str) -> TextureInput:
    [surface] = [s for s in description.surfaces if s.path.endswith(material)]
    found = dict(surface.inputs)["diffuse_color" if surface.open_pbr is None else "open_pbr_base_color"]
    assert isinstance(found, TextureInput)
    return found


def test_texture_coordinates() -> None:
    """Four meshes with one image, each scaled to another colour, by the primvar st0."""
    description, _ = translated("TextureCoordinateTest/TextureCoordinateTest.usda")
    scales = {"TopLeftMat": (0.8, 0.8, 0), "TopRightMat": (0.8, 0.08, 0), "BottomLeftMat": (0, 0.16, 0.8)}
    for name, scale in scales.items():
        made = diffuse(description, name)
        assert made.scale[:3] == pytest.approx(scale, abs=1e-6)
        assert (made.st, made.file.color_space) == (PrimvarInput("st0", (0, 0)), "sRGB")
        assert (made.wrap_s, made.wrap_t) == (Wrap.REPEAT, Wrap.REPEAT)
        assert made.fallback == (1, 1, 1, 1)
    [lower_right] = [s for s in description.shapes if s.path.endswith("BottomRightMesh/submesh")]
    assert isinstance(lower_right, Mesh)
    [st] = lower_right.primvars
    assert (st.name, st.interpolation) == ("st0", Interpolation.POINT)
    corners = [(0.9999998, 0), (0.6000001, 0.4000001), (0.60000014, 0), (0.9999999, 0.4000001)]
    assert np.allclose(st.values, corners, atol=1e-6)


@cache
def formats() -> dict[str, Texture]:
    description, diagnostics = translate(
        open_stage(ASSETS / "TextureFileFormatTests/all_files.usda", Diagnostics()), RenderSettings()
    )
    _, textures = load_textures(description, diagnostics, read_asset)
    assert "texture-unreadable" not in {d.code for d in diagnostics}
    return {Path(file.path).stem: images[0][1] for file, images in textures.items()}


def test_every_file_format_is_read() -> None:
    channels = {name: t.pixels.shape[2] for name, t in formats().items()}
    assert channels == {
        "jpeg_cmyk_8-bit": 3,
        "jpeg_grayscale_8-bit": 1,
        "jpeg_rgb_8-bit": 3,
        "png_grayscale_8-bit": 2,
        "png_grayscale_16-bit": 2,
        "png_rgb_8-bit": 4,
        "png_rgb_16-bit": 4,
        "png_rgb_32-bit": 4,
    }


def differing(a: Texture, b: Texture, colors: int) -> float:
    """The share of texels that differ visibly: each picture has its format's name written on it."""
    inside = formats()["png_rgb_8-bit"].pixels[:, :, 3] == 1
    return float((np.abs(a.pixels - b.pixels[:, :, : a.pixels.shape[2]])[inside][:, :colors].max(axis=1) > 0.05).mean())


def test_formats_of_the_same_picture_agree() -> None:
    """8 and 16 bits (whose profile says that it is sRGB), PNG and JPEG; grey ones likewise."""
    found = formats()
    assert differing(found["png_rgb_8-bit"], found["png_rgb_16-bit"], 3) < 0.06
    assert differing(found["jpeg_rgb_8-bit"], found["png_rgb_8-bit"], 3) < 0.1
    assert differing(found["png_grayscale_8-bit"], found["png_grayscale_16-bit"], 1) < 0.06
    assert differing(found["jpeg_grayscale_8-bit"], found["png_grayscale_8-bit"], 1) < 0.1
    # As if 16 bits were raw: what the bounds above must not let through.
    raw = load_texture(TextureFile(str(ASSETS / "TextureFileFormatTests/png_rgb_16-bit.png"), "raw"))
    assert differing(found["png_rgb_8-bit"], raw, 3) > 0.2


def test_cmyk_is_not_inverted() -> None:
    """Without its profile CMYK gives other colours than RGB, but the same ones bright and dark, red and green."""
    cmyk, rgb = (formats()[f"jpeg_{kind}_8-bit"].pixels.reshape(-1, 3) for kind in ("cmyk", "rgb"))
    for channel in range(3):
        assert np.corrcoef(cmyk[:, channel], rgb[:, channel])[0, 1] > 0.8


def test_alpha_comes_from_the_file_or_is_whole() -> None:
    description, _ = translated("TextureFileFormatTests/all_files.usda")
    with_opacity = [s for s in description.surfaces if "opacity" in dict(s.inputs)]
    assert len(with_opacity) == 8
    for surface in with_opacity:
        found = dict(surface.inputs)["opacity"]
        assert isinstance(found, TextureInput)
        assert found.channels == "a"
    assert formats()["png_rgb_8-bit"].pixels[:, :, 3].min() == 0


def test_a_package_has_its_textures_inside() -> None:
    """Roughness and opacity from textures; the primvar UVW; 0, a third and two thirds by red, green and blue."""
    description, found = translated("RoughnessTest/RoughnessTest.usdz")
    surfaces = {s.path.rsplit("/", 1)[1]: dict(s.inputs) for s in description.surfaces if s.path}
    for name, channel in (("Tex000", "r"), ("Tex033", "g"), ("Tex066", "b")):
        roughness = surfaces[name]["roughness"]
        assert isinstance(roughness, TextureInput)
        assert (roughness.channels, roughness.st.name) == (channel, "UVW")
        assert roughness.file.path.endswith("RoughnessTest.usdz[0/roughness.tga]")
    assert ("unknown-input", "/Roughness/Materials/Tex000/Principled_BSDF") in found
    diagnostics = Diagnostics()
    _, textures = load_textures(description, diagnostics, read_asset)
    assert len(textures) == len({t.file for s in description.surfaces for _, t in s.inputs if isinstance(t, TextureInput)})
    assert list(diagnostics) == []


def test_opacity_by_a_scaled_alpha() -> None:
    description, found = translated("AlphaBlendSortTest/AlphaBlendSortTest.usda")
    scales = set()
    for surface in description.surfaces:
        opacity = dict(surface.inputs)["opacity"]
        assert isinstance(opacity, TextureInput)
        assert (opacity.channels, opacity.st.name, opacity.st_transform) == ("a", "st", (1, 0, 0, 0, 1, 0))
        assert surface.thin  # the shadows are single squares
        scales.add(round(opacity.scale[3], 4))
    assert scales == {0.5098, 0.298}
    assert {code for code, _ in found} <= {"default-light", "camera-automatic"}


def test_a_teapot_reads_its_display_color() -> None:
    """Lime green ceramic, in a surface inside a NodeGraph."""
    description, _ = translated("Teapot/Teapot.usd")
    [surface] = description.surfaces
    assert dict(surface.inputs) == {"diffuse_color": PrimvarInput("displayColor", (0, 0, 0))}
    [color] = description.shapes[0].primvars
    assert color.interpolation is Interpolation.CONSTANT
    red, green, blue = color.values[0]
    assert green > red > blue


def test_two_networks_and_a_missing_file() -> None:
    """The shader ball's materials have MaterialX networks too; the ground's texture is absent from the public copy."""
    description, found = translated("StandardShaderBall/standard_shader_ball_scene.usda")
    missing = [path for code, path in found if code == "asset-missing" and "materials" in path]
    assert missing == ["/standard_shader_ball_scene/materials/ground/mtlximage1"]  # its MaterialX output comes first
    assert "shader-ignored" not in {code for code, _ in found}
    assert diffuse(description, "materials/left").file.path.endswith("maps/wall_left.ACEScg.exr")
    [ground] = [s for s in description.surfaces if s.path.endswith("materials/ground")]
    assert (ground.inputs, ground.constant("open_pbr_base_color")) == ((), (0, 0, 0))  # the image's default


def test_a_box_of_constants_and_one_of_display_colors() -> None:
    description, found = translated("cornell-box/usdpreviewsurface/cornell-box.usda")
    assert all(s.inputs == () for s in description.surfaces)
    assert any(any(s.emissive_color) for s in description.surfaces)
    assert "shader-ignored" not in {code for code, _ in found}
    description, _ = translated("cornell-box/display-color/cornell-box.usda")
    assert all(s.lambert for s in description.surfaces)
