"""Small stages in memory for the hard cases of lights and materials, and what a render of one says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio
from pxr import Sdf, Usd

from primray import RenderSettings, render

HEAD = '#usda 1.0\n(\n    metersPerUnit = 1\n    upAxis = "Y"\n)\n'


def prim(kind: str, name: str, *lines: str, apis: Sequence[str] = ()) -> str:
    applied = ", ".join(f'"{api}"' for api in apis)
    head = f" (prepend apiSchemas = [{applied}])" if apis else ""
    return "\n".join([f'def {kind} "{name}"{head}', "{", *lines, "}", ""])


def placed(x: float = 0.0, y: float = 0.0, z: float = 0.0, rotate_x: float = 0.0) -> str:
    ops = 'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]'
    return f"double3 xformOp:translate = ({x!r}, {y!r}, {z!r})\ndouble xformOp:rotateX = {rotate_x!r}\n{ops}"


def stage(*prims: str) -> Usd.Stage:
    layer = Sdf.Layer.CreateAnonymous(".usda")
    assert layer.ImportFromString(HEAD + "".join(prims))
    return Usd.Stage.Open(layer)


@dataclass(frozen=True)
class Shown:
    """A render: its pixels (H, W, 3) in double, its diagnostics above information by code, what was left out."""

    pixels: npt.NDArray[np.float64]
    noted: dict[str, str]
    invalid_samples: int
    image: Any

    @property
    def gray(self) -> npt.NDArray[np.float64]:
        return self.pixels[..., 0]

    @property
    def mean(self) -> float:
        return float(self.gray.mean())

    @property
    def noise(self) -> float:
        """Standard error of the mean, if all pixels estimate one number."""
        return float(self.gray.std() / np.sqrt(self.gray.size))


def show(*prims: str, spp: int = 64, resolution: tuple[int, int] = (8, 8), **settings: Any) -> Shown:
    """Renders; every pixel is finite, whatever the case."""
    image = render(stage(*prims), RenderSettings(spp=spp, resolution=resolution, **settings))
    pixels = np.asarray(image.pixels)
    assert np.isfinite(pixels).all()
    said = [d for d in image.report["diagnostics"] if d["severity"] != "info" and d["code"] != "empty-picture"]
    noted = {d["code"]: d["message"] for d in said}
    return Shown(pixels[..., :3].astype(np.float64), noted, image.report["invalid_samples"], image)


def irradiance(*prims: str, **settings: Any) -> Shown:
    """Of the ground around the origin, under lights."""
    found = show(above(), ground(), *prims, **({"max_depth": 1} | settings))
    return Shown(found.pixels * np.pi, found.noted, found.invalid_samples, found.image)


def above(half: float = 0.05, height: float = 0.01) -> str:
    """An orthographic camera close over the ground, below every light; it sees `half` to each side of the origin."""
    return prim(
        "Camera", "camera", "float2 clippingRange = (0.0001, 1000000)", 'token projection = "orthographic"',
        f"float horizontalAperture = {20 * half!r}", f"float verticalAperture = {20 * half!r}",
        placed(0, height, 0, -90),
    )  # fmt: skip


def ground(size: float = 5.0, name: str = "ground", color: str = "(1, 1, 1)") -> str:
    """White Lambert, facing up."""
    s = size
    return prim(
        "Mesh", name, "int[] faceVertexCounts = [4]", "int[] faceVertexIndices = [0, 1, 2, 3]",
        f"point3f[] points = [({-s}, 0, {s}), ({s}, 0, {s}), ({s}, 0, {-s}), ({-s}, 0, {-s})]",
        'uniform token subdivisionScheme = "none"', f"color3f[] primvars:displayColor = [{color}]",
    )  # fmt: skip


def camera_at(z: float, half_tangent: float = 1 / 6) -> str:
    """Looking along -z."""
    return prim(
        "Camera", "camera", "float2 clippingRange = (0.0001, 1000000)", f"float horizontalAperture = {200 * half_tangent!r}",
        f"float verticalAperture = {200 * half_tangent!r}", "float focalLength = 100", placed(z=z),
    )  # fmt: skip


def light(kind: str, *inputs: str, at: str = "", name: str = "light", apis: Sequence[str] = ()) -> str:
    return prim(kind, name, *inputs, at, apis=apis)


def dome(*inputs: str) -> str:
    return prim("DomeLight", "dome", *inputs)


def material(name: str, *inputs: str) -> str:
    shader = prim(
        "Shader", "surface", 'uniform token info:id = "UsdPreviewSurface"', *(f"{i}" for i in inputs), "token outputs:surface"
    )
    return prim("Material", name, f"token outputs:surface.connect = </{name}/surface.outputs:surface>", shader)


def bound(name: str) -> str:
    return f"rel material:binding = </{name}>"


def sphere(material_name: str, radius: float = 1.0, name: str = "ball", at: str = "") -> str:
    return prim("Sphere", name, f"double radius = {radius!r}", bound(material_name), at, apis=["MaterialBindingAPI"])


def plates(material_name: str, depths: Sequence[float], size: float = 5.0, *lines: str, name: str = "plates") -> str:
    """Squares across the z axis, facing +z, all one mesh."""
    s, n = size, len(depths)
    corners = ", ".join(f"({-s}, {-s}, {z!r}), ({s}, {-s}, {z!r}), ({s}, {s}, {z!r}), ({-s}, {s}, {z!r})" for z in depths)
    return prim(
        "Mesh", name, f"int[] faceVertexCounts = {[4] * n}", f"int[] faceVertexIndices = {list(range(4 * n))}",
        f"point3f[] points = [{corners}]", 'uniform token subdivisionScheme = "none"', bound(material_name), *lines,
        apis=["MaterialBindingAPI"],
    )  # fmt: skip


def write_image(path: Path, pixels: npt.ArrayLike) -> str:
    """As a float EXR; the text that names it in a stage."""
    p = np.ascontiguousarray(pixels, np.float32)
    out = oiio.ImageOutput.create(str(path))
    assert out
    assert out.open(str(path), oiio.ImageSpec(p.shape[1], p.shape[0], p.shape[2], "float"))
    assert out.write_image(p)
    out.close()
    return f"@{path}@"
