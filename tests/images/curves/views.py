"""Stages of curves, seen by a parallel camera from (0, 0, 10): x to the right, y up, from -2 to 2."""

from __future__ import annotations

import numpy as np
from pxr import Usd

from primray import render
from primray.images.image import Image

SIZE = 64

STAGE = """#usda 1.0
(
    upAxis = "Y"
)
def Camera "camera"
{
    token projection = "orthographic"
    float horizontalAperture = 40
    float verticalAperture = 40
    float2 clippingRange = (0.1, 100)
    double3 xformOp:translate = (FAR, 0, 10)
    CAMERA
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def DomeLight "sky"
{
}
"""


def curves(body: str, name: str = "c", kind: str = "BasisCurves", transform: str = "") -> str:
    return f'def {kind} "{name}"\n{{\n{body}\n{transform}\n}}\n'


def linear(points: str, widths: str, more: str = "", counts: str = "") -> str:
    number = counts or f"[{points.count('(')}]"
    return f'uniform token type = "linear"\nint[] curveVertexCounts = {number}\npoint3f[] points = {points}\n{widths}\n{more}'


def cubic(points: str, widths: str, basis: str = "bezier", wrap: str = "nonperiodic", more: str = "") -> str:
    return (
        f'uniform token basis = "{basis}"\nuniform token wrap = "{wrap}"\n'
        f"int[] curveVertexCounts = [{points.count('(')}]\npoint3f[] points = {points}\n{widths}\n{more}"
    )


def stage_of(text: str, camera: str = "", far: str = "0") -> Usd.Stage:
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString(STAGE.replace("CAMERA", camera).replace("FAR", far) + text)
    return stage


def look(text: str, *aovs: str, size: int = SIZE, spp: int = 2, camera: str = "", far: str = "0", **more: object) -> Image:
    """`camera`: more of it; `far`: where it is along x."""
    return render(stage_of(text, camera, far), resolution=(size, size), spp=spp, seed=1, aovs=aovs, **more)  # type: ignore[arg-type]


def values(image: Image, name: str) -> np.ndarray:
    found = image.aovs[name].values
    return found[..., 0] if found.shape[2] == 1 else found


def centres(size: int = SIZE) -> tuple[np.ndarray, np.ndarray]:
    """x and y (size, size) of the pixels' centres."""
    at = (np.arange(size) + 0.5) / size * 4 - 2
    return np.broadcast_to(at, (size, size)), np.broadcast_to(-at[:, None], (size, size))


def covered(image: Image) -> float:
    """The area that is covered, in square units."""
    alpha = image.pixels[..., 3].astype(np.float64)
    return float(alpha.sum()) * 16 / alpha.size


def mean_alpha_error(image: Image) -> float:
    """A bound on how far `covered` is off by chance, at four standard deviations: edge pixels are a coin each sample."""
    alpha = image.pixels[..., 3].astype(np.float64)
    return 4 * float(np.sqrt((alpha * (1 - alpha)).sum() / 2)) * 16 / alpha.size
