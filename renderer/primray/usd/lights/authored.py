"""The inputs of a prim with LightAPI: each is read on first use, and once for all placements of the light.

Inputs without an effect, such as the shaping of a light without an area, are not read, so that nothing is said of them.
"""

from __future__ import annotations

import math

import numpy as np
from pxr import Sdf, UsdLux

from ...color.color_space import REC709, converted
from ...description import Shaping, TextureFile
from ...description.lighting import Photometric
from ..materials.texture_files import light_texture
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..stage.read_once import ReadOnce
from ..stage.reads import targets
from ..stage.values import flag, number, read, token
from .light_color import ENABLED, Color, Illuminant, light_color, read_illuminant
from .photometric import read_amount
from .shaping import read_shaping

BRIGHTEST_RADIANCE = 1e30  # radiance is clamped to this, so that single precision does not overflow
# A normalized light of size 0 is the limit of small lights, a point or line of the same power; it gets this size.
SMALLEST = 1e-12
TEXTURE = "inputs:texture:file"
_FORMATS = ("automatic", "latlong", "mirroredBall", "angular", "cubeMapVerticalCross")  # UsdLux, DomeLight
COOLEST_K, HOTTEST_K = 1000.0, 10000.0  # the range of UsdLux.BlackbodyTemperatureAsRgb


class AuthoredLight:
    """The inputs of one light, in the rendering space and within their ranges; what is wrong with them is reported."""

    def __init__(self, prim: ResolvedPrim, ctx: Context) -> None:
        self.prim, self.ctx = prim, ctx
        _report_ignored_inputs(prim, ctx)

    def warn(self, code: str, message: str, attribute: str = "") -> None:
        self.ctx.warn(code, self.prim.path, message, attribute)

    @ReadOnce
    def amount(self) -> Photometric | None:
        """Lumens or lux that the light is to give; None if its radiance counts."""
        return read_amount(self.prim, lambda: self.illuminant, self.ctx)

    @ReadOnce
    def normalizes(self) -> bool:
        """Whether emission is divided by the area: normalize is on, or a photometric amount is given."""
        return self.amount is not None or self._flag("inputs:normalize")

    @ReadOnce
    def illuminant(self) -> Illuminant | None:
        return read_illuminant(self.prim, self.ctx)

    @ReadOnce
    def radiance(self) -> Color:
        """Radiance before division by the light's size."""
        r, g, b = light_color(self.prim, "inputs:color", (1.0, 1.0, 1.0), self.ctx)
        scale = self._number("inputs:intensity", 1.0) * math.pow(2.0, min(self._number("inputs:exposure", 0.0), 1000.0))
        if self.illuminant is not None:
            x, y, z = self.illuminant.color
            r, g, b = r * x, g * y, b * z
        elif self._flag(ENABLED):
            kelvin = self._clamped("inputs:colorTemperature", 6500.0, COOLEST_K, HOTTEST_K)
            rec709 = np.array(UsdLux.BlackbodyTemperatureAsRgb(kelvin))  # "then transformed to the rendering color space"
            x, y, z = converted(rec709, REC709, self.ctx.rendering_space).tolist()
            r, g, b = r * x, g * y, b * z
        return (r * scale, g * scale, b * scale)

    @ReadOnce
    def width(self) -> float:
        return self._size("inputs:width", 1.0)

    @ReadOnce
    def height(self) -> float:
        return self._size("inputs:height", 1.0)

    @ReadOnce
    def radius(self) -> float:
        return self._size("inputs:radius", 0.5)

    @ReadOnce
    def length(self) -> float:
        return self._size("inputs:length", 1.0)

    @ReadOnce
    def angle_deg(self) -> float:
        """Full angle of a distant light."""
        return self._clamped("inputs:angle", 0.53, 0.0, 360.0)

    @ReadOnce
    def is_point(self) -> bool:
        """Whether a sphere is treated as a point."""
        return flag(self.prim.prim, "treatAsPoint", self.ctx.when, False)

    @ReadOnce
    def is_line(self) -> bool:
        """Whether a cylinder is treated as a line."""
        return flag(self.prim.prim, "treatAsLine", self.ctx.when, False)

    @ReadOnce
    def diffuse(self) -> float:
        return self._clamped("inputs:diffuse", 1.0, 0.0, BRIGHTEST_RADIANCE)

    @ReadOnce
    def specular(self) -> float:
        return self._clamped("inputs:specular", 1.0, 0.0, BRIGHTEST_RADIANCE)

    @ReadOnce
    def shaping(self) -> Shaping | None:
        return read_shaping(self.prim, self.ctx)

    @ReadOnce
    def pole_axis(self) -> str:
        """DomeLight_1's token."""
        return token(self.prim.prim, "poleAxis", self.ctx.when, "scene")

    @ReadOnce
    def texture(self) -> TextureFile | None:
        """Texture of a dome or rectangle; None, with a diagnostic, if its file is missing."""
        if TEXTURE not in self.prim.names:
            return None
        asset = read(self.prim.prim, TEXTURE, self.ctx.when)
        if not isinstance(asset, Sdf.AssetPath) or not asset.path:
            return None
        if not asset.resolvedPath:
            self.warn("asset-missing", missing_texture_text(asset.path, self.prim.type_name), TEXTURE)
            return None
        return light_texture(asset.resolvedPath, self.prim.prim.GetAttribute(TEXTURE), self.prim, self.ctx)

    @ReadOnce
    def texture_format(self) -> str:
        """Layout of a dome's texture."""
        layout = token(self.prim.prim, "inputs:texture:format", self.ctx.when, "automatic")
        if layout in _FORMATS:
            return layout
        message = f"inputs:texture:format = {layout!r} is not one of {', '.join(_FORMATS)}: automatic is used."
        self.warn("light-input", message, "inputs:texture:format")
        return "automatic"

    def _flag(self, name: str) -> bool:
        return name in self.prim.names and flag(self.prim.prim, name, self.ctx.when, False)

    def _number(self, name: str, default: float) -> float:
        # USD queries dominate for 100,000 lights, so unauthored names skip them. Only intensity's default varies by type.
        if name not in self.prim.names and name != "inputs:intensity":
            return default
        return number(self.prim.prim, name, self.ctx.when, default, self.ctx.diagnostics)

    def _clamped(self, name: str, default: float, low: float, high: float) -> float:
        """Return a number clamped to [low, high], with a diagnostic if that changes it."""
        found = self._number(name, default)
        inside = min(max(found, low), high)
        if inside != found:
            self.warn("out-of-range", f"{name} = {found:g} is outside [{low:g}, {high:g}]: {inside:g} is used.", name)
        return inside

    def _size(self, name: str, default: float) -> float:
        size = self._number(name, default)
        if size < 0:
            self.warn("out-of-range", f"{name} = {size:g} is negative: {-size:g} is used.", name)
        return max(abs(size), SMALLEST) if self.normalizes else abs(size)


def missing_texture_text(path: str, type_name: str) -> str:
    """Return the message for a light's texture that does not exist."""
    kind = "dome" if type_name.startswith("Dome") else "light"
    return f"{path} cannot be found: the {kind} is rendered without its texture."


def _report_ignored_inputs(prim: ResolvedPrim, ctx: Context) -> None:
    """Report light filters, and a light:shaderId other than the schema's own."""
    if "light:filters" in prim.names and targets(prim.prim, "light:filters"):
        ctx.warn("light-input", prim.path, "Light filters are ignored.", "light:filters")
    if "light:shaderId" not in prim.names:
        return
    shader = read(prim.prim, "light:shaderId", ctx.when)
    own = {prim.type_name, prim.type_name.removesuffix("_1"), "MeshLight", ""} | (
        {"VolumeLight"} if prim.type_name == "Volume" else set()
    )
    if shader not in own:
        message = f"light:shaderId = {shader!r} is ignored: the light is rendered as a {prim.type_name}."
        ctx.warn("light-input", prim.path, message, "light:shaderId")
