"""Texels of public assets, found again in pixels: orientation, wrap, channels, colour and file format, from stage to film.

Every textured input of a mesh is shown as emission, seen through one tiny pixel above a point of a face, and compared with the
file's texel there, which this test looks up by itself from USD's points, st and the image. Skipped where the assets are absent.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import Usd, UsdGeom, UsdShade

from primray import core
from primray.description import Camera, Doubles, Floats, Projection, SceneDescription, Surface, TextureInput
from primray.diagnostics import Diagnostics
from primray.render import load_textures
from primray.settings import Filter, RenderSettings
from primray.usd import open_stage, read_asset, translate

ASSETS = Path(os.environ.get("PRIMRAY_ASSETS", Path(__file__).parents[4] / "shared" / "assets"))
pytestmark = pytest.mark.skipif(not ASSETS.exists(), reason="the shared assets are not here")
SETTINGS = RenderSettings(spp=1, filter=Filter.BOX, threads=1)
# Stage, input, channel that the stage connects to it, names of the primvar of texture coordinates.
CASES = {
    "TextureCoordinateTest/TextureCoordinateTest.usda": ("diffuse_color", "rgb", "st0"),
    **{
        f"TextureFileFormatTests/{name}.usda": ("diffuse_color", "rgb", "st")
        for name in (
            "jpeg_rgb_8-bit", "jpeg_grayscale_8-bit", "png_grayscale_8-bit", "png_grayscale_16-bit", "png_rgb_8-bit",
            "png_rgb_16-bit", "png_rgb_32-bit",
        )
    },
    "RoughnessTest/RoughnessTest.usdz": ("roughness", "any", "UVW"),
}  # fmt: skip


@dataclass(frozen=True)
class Spot:
    """A point on a face: where, which way it faces, its st, and the texture that the stage puts there."""

    point: Doubles
    normal: Doubles
    st: Doubles
    reader: UsdShade.Shader
    channel: str


def texture_of(mesh: Usd.Prim, name: str) -> tuple[UsdShade.Shader, str] | None:
    """The UsdUVTexture connected to the bound material's input, and which output."""
    material, _ = UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()
    shader = material.ComputeSurfaceSource()[0] if material else None
    connected = shader.GetInput(name) if shader else None
    sources = UsdShade.Utils.GetValueProducingAttributes(connected) if connected else []
    if not sources or UsdShade.Shader(sources[0].GetPrim()).GetShaderId() != "UsdUVTexture":
        return None
    return UsdShade.Shader(sources[0].GetPrim()), sources[0].GetBaseName()


def spots(stage: Usd.Stage, name: str, st_name: str, per_mesh: int = 6) -> list[Spot]:
    rng = np.random.default_rng(1)
    found = []
    for prim in stage.Traverse():
        texture = texture_of(prim, name) if prim.GetTypeName() == "Mesh" else None
        if texture is None:
            continue
        mesh = UsdGeom.Mesh(prim)
        world = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(prim)).T
        points = np.array(mesh.GetPointsAttr().Get(), np.float64) @ world[:3, :3].T + world[:3, 3]
        st = UsdGeom.PrimvarsAPI(prim).GetPrimvar(st_name)
        values, by_corner = np.array(st.ComputeFlattened(), np.float64), st.GetInterpolation() == "faceVarying"
        counts, indices = np.array(mesh.GetFaceVertexCountsAttr().Get()), np.array(mesh.GetFaceVertexIndicesAttr().Get())
        first = np.concatenate([[0], np.cumsum(counts)])
        for face in rng.choice(len(counts), per_mesh):
            corner = first[face] + np.array([0, 1, 2])
            w = rng.dirichlet([2, 2, 2])
            p = points[indices[corner]]
            normal = np.cross(p[1] - p[0], p[2] - p[0])
            if not np.linalg.norm(normal) > 0:
                continue
            uv = values[corner if by_corner else indices[corner]]
            found.append(Spot(w @ p, normal / np.linalg.norm(normal), w @ uv, *texture))
    return found


def linear(v: Doubles) -> Doubles:
    """IEC 61966-2-1."""
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


def texel(spot: Spot, images: dict[str, tuple[Floats, bool]]) -> Doubles:
    """What UsdUVTexture's text says: bilinear, (0, 0) at the lower left, texture * scale + bias."""

    def given(name: str, default: object) -> object:
        found = spot.reader.GetInput(name)
        value = found.Get() if found else None
        return default if value is None else value

    path = spot.reader.GetInput("file").Get().resolvedPath
    if path not in images:
        images[path] = decoded(path)
    pixels, is_srgb = images[path]
    h, w, channels = pixels.shape
    s, t = (
        x % 1 if given(wrap, "useMetadata") == "repeat" else min(max(x, 0), 1)
        for x, wrap in zip(spot.st, ("wrapS", "wrapT"), strict=True)
    )
    x, y = s * w - 0.5, (1 - t) * h - 0.5
    x0, y0 = int(np.floor(x)), int(np.floor(y))
    color = np.zeros(channels)
    # In the colour space that is stored: the same texels decide, decoding comes before filtering.
    space = given("sourceColorSpace", "auto")
    decode = linear if space == "sRGB" or (space == "auto" and is_srgb) else (lambda v: v)
    for dx, fx in ((0, 1 - (x - x0)), (1, x - x0)):
        for dy, fy in ((0, 1 - (y - y0)), (1, y - y0)):
            stored = pixels[min(max(y0 + dy, 0), h - 1), min(max(x0 + dx, 0), w - 1)].astype(np.float64)
            color += fx * fy * np.concatenate([decode(stored[:3]), stored[3:]])
    rgba = color if channels == 4 else np.append(color if channels == 3 else np.repeat(color[:1], 3), 1.0)
    rgba = rgba * np.array(given("scale", (1, 1, 1, 1))) + np.array(given("bias", (0, 0, 0, 0)))
    return rgba[:3] if spot.channel == "rgb" else np.repeat(rgba["rgba".index(spot.channel)], 3)


def decoded(path: str) -> tuple[Floats, bool]:
    """Pixels as stored, 0 to 1, straight alpha; whether "auto" is sRGB: by the file's profile, else if 8 bits of colour."""
    if path.endswith("]"):
        name = "/tmp/" + path[path.rindex("[") + 1 : -1].replace("/", "_")
        Path(name).write_bytes(read_asset(path))
        path = name
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    image = oiio.ImageInput.open(path, config)
    assert image is not None
    spec, pixels = image.spec(), image.read_image(oiio.FLOAT)
    assert pixels is not None
    profile = spec.get_string_attribute("ICCProfile:profile_description")
    is_srgb = "sRGB" in profile if profile else spec.format.basetype == oiio.UINT8 and spec.nchannels >= 3
    return pixels.reshape(spec.height, spec.width, spec.nchannels), is_srgb


def as_emission(surface: Surface, field: str) -> Surface:
    shown = tuple(("emissive_color", x) for name, x in surface.inputs if name == field and isinstance(x, TextureInput))
    return Surface(surface.path, lambert=True, diffuse_color=(0, 0, 0), inputs=shown)


def above(spot: Spot, size: float) -> Camera:
    """Looks straight down on the spot."""
    z = spot.normal
    x = np.cross([0, 1, 0] if abs(z[1]) < 0.9 else [1, 0, 0], z)
    x /= np.linalg.norm(x)
    m = np.eye(4)
    m[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    m[:3, 3] = spot.point + z * size * 1e-3
    half = size * 1e-6
    return Camera("/spot", m, Projection.ORTHOGRAPHIC, (-half, half, -half, half), (0.0, size * 2e-3))


def seen(description: SceneDescription, field: str, found: list[Spot]) -> Doubles:
    # Diced for the stage's own view: a pixel as small as those here would ask for millions of triangles.
    diced, _ = core.dice(description, SETTINGS)
    surfaces = tuple(as_emission(s, field) for s in diced.surfaces)
    shown, textures = load_textures(replace(diced, surfaces=surfaces, lights=()), Diagnostics(), read_asset)
    size = float(np.ptp([s.point for s in found], axis=0).max())
    pixels = []
    for spot in found:
        scene = core.build(replace(shown, camera=above(spot, size), resolution=(1, 1)), dict(textures), SETTINGS)
        pixels.append(core.render(scene, SETTINGS).pixels[0, 0, :3])
    return np.array(pixels, np.float64)


@pytest.mark.parametrize("name", CASES)
def test_texels(name: str) -> None:
    field, channel, st_name = CASES[name]
    stage = open_stage(ASSETS / name, Diagnostics())
    found = spots(stage, {"diffuse_color": "diffuseColor"}.get(field, field), st_name)
    assert len(found) >= 6
    assert channel == "any" or all(s.channel == channel for s in found)
    description, _ = translate(stage, RenderSettings())
    images: dict[str, tuple[Floats, bool]] = {}
    expected = np.array([texel(s, images) for s in found])
    # Half floats, and st that float rounds: neighbouring texels may differ by much, hence not all spots but nearly all.
    close = np.abs(seen(description, field, found) - expected).max(axis=1) < 2e-3 + 2e-3 * expected.max(axis=1)
    assert close.mean() > 0.95


def test_cmyk_is_the_same_picture() -> None:
    """The readme's table shows one picture in every format; inks have no one conversion, hence roughly."""
    means = []
    for name in ("jpeg_cmyk_8-bit", "jpeg_rgb_8-bit"):
        stage = open_stage(ASSETS / f"TextureFileFormatTests/{name}.usda", Diagnostics())
        found = spots(stage, "diffuseColor", "st", 20)
        means.append(seen(translate(stage, RenderSettings())[0], "diffuse_color", found))
    a, b = means
    assert np.abs(a - b).mean() < 0.2
    assert np.corrcoef(a.ravel(), b.ravel())[0, 1] > 0.8
