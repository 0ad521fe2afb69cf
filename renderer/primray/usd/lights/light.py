"""UsdLux lights: L = color * temperature * intensity * 2^exposure / sizeFactor (UsdLux LightAPI).

Lights given in lumens or lux are scaled to that amount here or, if they have a texture, once it is read.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np
from pxr import Sdf, UsdLux

from ...arrays import Doubles
from ...color.color_space import REC709, converted
from ...description import Light, LightType, TextureFile
from ...description.lighting import Photometric
from ...photometry.amounts import BRIGHTEST_EMISSION, DARK_TEXT, TOO_BRIGHT_TEXT, amount_of_unit_emission, clamped, scaled_to
from ...photometry.light_shape import cylinder_area, disk_area, rect_area, sphere_area
from ..materials.texture_files import light_texture
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..stage.metadata import up_axis
from ..stage.reads import targets
from ..stage.values import flag, number, read, token
from .light_color import illuminant_of, light_color
from .photometric import photometric_of
from .portals import read_portals
from .shaping import peak_factor, read_shaping, report_ignored_shaping

Color = tuple[float, float, float]

# Radiance is clamped to these, so that single precision does not overflow; the tint is multiplied by an image's texels.
BRIGHTEST_RADIANCE, BRIGHTEST_TINT = 1e30, 1e15
# A normalized light of size 0 is the limit of small lights, a point or line of the same power; it gets this size.
SMALLEST = 1e-12
_FORMATS = ("automatic", "latlong", "mirroredBall", "angular", "cubeMapVerticalCross")  # UsdLux, DomeLight
TEXTURE = "inputs:texture:file"
COOLEST_K, HOTTEST_K = 1000.0, 10000.0  # the range of UsdLux.BlackbodyTemperatureAsRgb


def read_light(prim: ResolvedPrim, world_from_light: Doubles, ctx: Context) -> Light | None:
    """Return the light at this matrix; None, with a diagnostic, if it emits nothing."""
    report_ignored_inputs(prim, ctx)
    made = _BY_TYPE[prim.type_name](prim, world_from_light, ctx)
    wanted = photometric_of(prim, ctx)
    return made if made is None or wanted is None else scaled_to_amount(prim, made, wanted, ctx)


def _radiance(prim: ResolvedPrim, ctx: Context) -> Color:
    """Return the radiance before division by the light's size."""
    r, g, b = light_color(prim, "inputs:color", (1.0, 1.0, 1.0), ctx)
    scale = _number(prim, "inputs:intensity", 1.0, ctx) * _exp2(_number(prim, "inputs:exposure", 0.0, ctx))
    illuminant = illuminant_of(prim, ctx)
    if illuminant is not None:
        tint = illuminant.color
        r, g, b = r * tint[0], g * tint[1], b * tint[2]
    elif "inputs:enableColorTemperature" in prim.names and flag(prim.prim, "inputs:enableColorTemperature", ctx.when, False):
        kelvin = _clamped_number(prim, "inputs:colorTemperature", 6500.0, COOLEST_K, HOTTEST_K, ctx)
        rec709 = np.array(UsdLux.BlackbodyTemperatureAsRgb(kelvin))  # "then transformed to the rendering color space"
        x, y, z = converted(rec709, REC709, ctx.rendering_space).tolist()
        r, g, b = r * x, g * y, b * z
    return (r * scale, g * scale, b * scale)


def _emission(prim: ResolvedPrim, emission: Color, brightest: float, ctx: Context) -> Color:
    """Return the emission clamped to [0, brightest], with a diagnostic if that changes it."""
    if min(emission) < 0:
        ctx.warn(
            "out-of-range",
            prim.path,
            f"The emission {_color_text(emission)} is negative: it is clamped to 0.",
            "inputs:intensity",
        )
    if max(emission) > brightest:
        message = f"The emission {_color_text(emission)} is clamped to {brightest:g}."
        ctx.warn("out-of-range", prim.path, message, "inputs:intensity")
    r, g, b = (min(max(x, 0.0), brightest) for x in emission)
    return (r, g, b)


def _color_text(color: Color) -> str:
    return f"({color[0]:g}, {color[1]:g}, {color[2]:g})"


def _exp2(exposure: float) -> float:
    return math.pow(2.0, min(exposure, 1000.0))


def _over_area(prim: ResolvedPrim, radiance: Color, area: float, ctx: Context) -> Color | None:
    """Return `radiance`, divided by the area if normalize is on; None, with a diagnostic, if the area is 0 or infinite."""
    if area == 0 or not math.isfinite(area):
        ctx.warn("light-dark", prim.path, f"The light's area is {area:g}: it emits nothing.")
        return None
    return _divided(radiance, area) if _normalizes(prim, ctx) else radiance


def _size(prim: ResolvedPrim, name: str, default: float, ctx: Context) -> float:
    size = _number(prim, name, default, ctx)
    if size < 0:
        ctx.warn("out-of-range", prim.path, f"{name} = {size:g} is negative: {-size:g} is used.", name)
    return max(abs(size), SMALLEST) if _normalizes(prim, ctx) else abs(size)


def _has_depth(prim: ResolvedPrim, matrix: Doubles, ctx: Context) -> bool:
    """Return whether the transform keeps all three axes, which some lights need; report it if not."""
    if _spans_space(matrix[:3, :3].tobytes()):
        return True
    ctx.warn("light-dark", prim.path, "The transform scales the light to 0 along an axis: it emits nothing.")
    return False


@lru_cache(maxsize=256)
def _spans_space(linear: bytes) -> bool:
    axes = np.frombuffer(linear).reshape(3, 3)
    return bool(abs(np.linalg.det(axes)) > 1e-14 * np.prod(np.linalg.norm(axes, axis=0)))


def _sphere(prim: ResolvedPrim, matrix: Doubles, ctx: Context) -> Light | None:
    radius = _size(prim, "inputs:radius", 0.5, ctx)
    radiance = _radiance(prim, ctx)
    area, normalizes = sphere_area(matrix, radius), _normalizes(prim, ctx)
    if flag(prim.prim, "treatAsPoint", ctx.when, False) or (normalizes and radius <= SMALLEST):
        # The limit of a small sphere: I = L pi r^2, a quarter of its area (by Cauchy's formula an ellipsoid's mean, too).
        if not normalizes and area == 0:
            ctx.warn("light-dark", prim.path, "A sphere light of radius 0 without normalize emits nothing.")
            return None
        intensity = _multiplied(radiance, 0.25 if normalizes else 0.25 * area)
        return _make_light(prim, LightType.POINT, matrix, intensity, ctx)
    emission = _over_area(prim, radiance, area, ctx)
    if emission is None or not _has_depth(prim, matrix, ctx):
        return None
    return _make_light(prim, LightType.SPHERE, matrix, emission, ctx, radius=radius)


def _disk(prim: ResolvedPrim, matrix: Doubles, ctx: Context) -> Light | None:
    radius = _size(prim, "inputs:radius", 0.5, ctx)
    emission = _over_area(prim, _radiance(prim, ctx), disk_area(matrix, radius), ctx)
    return emission and _make_light(prim, LightType.DISK, matrix, emission, ctx, radius=radius)


def _rect(prim: ResolvedPrim, matrix: Doubles, ctx: Context) -> Light | None:
    width, height = _size(prim, "inputs:width", 1.0, ctx), _size(prim, "inputs:height", 1.0, ctx)
    emission = _over_area(prim, _radiance(prim, ctx), rect_area(matrix, width, height), ctx)
    if emission is None:
        return None
    return _make_light(prim, LightType.RECT, matrix, emission, ctx, width=width, height=height, texture=_texture(prim, ctx))


def _cylinder(prim: ResolvedPrim, matrix: Doubles, ctx: Context) -> Light | None:
    length, radius = _size(prim, "inputs:length", 1.0, ctx), _size(prim, "inputs:radius", 0.5, ctx)
    area = cylinder_area(matrix, length, radius)
    emission = _over_area(prim, _radiance(prim, ctx), area, ctx)
    if emission is None:
        return None
    if flag(prim.prim, "treatAsLine", ctx.when, False) or (_normalizes(prim, ctx) and radius <= SMALLEST):
        # The limit of a thin cylinder: a length dl shows a projected area of 2 r dl across, its lateral area over pi (by
        # Cauchy's formula also the mean over directions of an elliptic one).
        stretched = length * float(np.linalg.norm(matrix[:3, 0]))
        return _make_light(
            prim, LightType.LINE, matrix, _multiplied(emission, area / (math.pi * stretched)), ctx, length=length
        )
    if not _has_depth(prim, matrix, ctx):
        return None
    return _make_light(prim, LightType.CYLINDER, matrix, emission, ctx, length=length, radius=radius)


def _distant(prim: ResolvedPrim, matrix: Doubles, ctx: Context) -> Light:
    angle_deg = _clamped_number(prim, "inputs:angle", 0.53, 0.0, 360.0, ctx)
    radiance = _radiance(prim, ctx)
    if _normalizes(prim, ctx):
        radiance = _divided(radiance, distant_size_factor(angle_deg))
    return _make_light(prim, LightType.DISTANT, matrix, radiance, ctx, angle_deg=angle_deg)


def distant_size_factor(angle_deg: float) -> float:
    """Return UsdLux DistantLight's sizeFactor: 1 at angle 0, pi sin^2 theta up to 180 degrees, pi (2 - sin^2 theta) beyond."""
    theta = min(max(math.radians(angle_deg) / 2, 0.0), math.pi)
    if theta == 0:
        return 1.0
    squared = math.sin(theta) ** 2
    return math.pi * squared if theta <= math.pi / 2 else math.pi * (2.0 - squared)


def _dome(prim: ResolvedPrim, matrix: Doubles, ctx: Context) -> Light:
    """Return a dome; normalize has no effect on domes (UsdLux LightAPI)."""
    if prim.type_name == "DomeLight_1":
        matrix = matrix @ _pole_rotation(prim, ctx)
    texture = _texture(prim, ctx)
    dome = _make_light(prim, LightType.DOME, matrix, _radiance(prim, ctx), ctx, texture=texture)
    portals = read_portals(prim, matrix, ctx) if "portals" in prim.names else ()
    return replace(dome, texture_format=_texture_format(prim, ctx) if texture else "automatic", portals=portals)


def _pole_rotation(prim: ResolvedPrim, ctx: Context) -> Doubles:
    """Return DomeLight_1's rotation: with pole Z, latitude +pi/2 is at +Z, longitude 0 at -Y, longitude pi/2 still at +X."""
    axis = token(prim.prim, "poleAxis", ctx.when, "scene")
    if axis == "scene":
        axis = up_axis(ctx.stage)
    turned = np.eye(4)
    if axis == "Z":
        turned[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    return turned


def missing_texture_text(path: str, type_name: str) -> str:
    """Return the message for a light's texture that does not exist."""
    kind = "dome" if type_name.startswith("Dome") else "light"
    return f"{path} cannot be found: the {kind} is rendered without its texture."


def _texture(prim: ResolvedPrim, ctx: Context) -> TextureFile | None:
    """Return the texture of a dome or rectangle; None, with a diagnostic, if its file is missing."""
    if TEXTURE not in prim.names:
        return None
    asset = read(prim.prim, TEXTURE, ctx.when)
    if not isinstance(asset, Sdf.AssetPath) or not asset.path:
        return None
    if not asset.resolvedPath:
        ctx.warn("asset-missing", prim.path, missing_texture_text(asset.path, prim.type_name), TEXTURE)
        return None
    return light_texture(asset.resolvedPath, prim.prim.GetAttribute(TEXTURE), prim, ctx)


def _texture_format(prim: ResolvedPrim, ctx: Context) -> str:
    layout = token(prim.prim, "inputs:texture:format", ctx.when, "automatic")
    if layout in _FORMATS:
        return layout
    message = f"inputs:texture:format = {layout!r} is not one of {', '.join(_FORMATS)}: automatic is used."
    ctx.warn("light-input", prim.path, message, "inputs:texture:format")
    return "automatic"


def read_geometry_light(prim: ResolvedPrim, ctx: Context) -> Light:
    """Return the light of a shape that has LightAPI; its radiance is divided by the area later, once the shape is placed."""
    report_ignored_inputs(prim, ctx)
    return replace(
        _make_light(prim, LightType.GEOMETRY, np.eye(4), _radiance(prim, ctx), ctx), normalize=_normalizes(prim, ctx)
    )


def _make_light(
    prim: ResolvedPrim,
    kind: LightType,
    matrix: Doubles,
    emission: Color,
    ctx: Context,
    *,
    width: float = 1.0,
    height: float = 1.0,
    radius: float = 0.5,
    length: float = 1.0,
    angle_deg: float = 0.0,
    texture: TextureFile | None = None,
) -> Light:
    diffuse = _clamped_number(prim, "inputs:diffuse", 1.0, 0.0, BRIGHTEST_RADIANCE, ctx)
    specular = _clamped_number(prim, "inputs:specular", 1.0, 0.0, BRIGHTEST_RADIANCE, ctx)
    shaped = None
    if kind in (LightType.DISTANT, LightType.DOME):
        report_ignored_shaping(prim, ctx)
    else:
        shaped = read_shaping(prim, matrix, ctx)
    brightest = (BRIGHTEST_TINT if texture else BRIGHTEST_RADIANCE) / max(peak_factor(shaped), 1.0)
    emission = _emission(prim, emission, brightest, ctx)
    sizes = (width, height, radius, length, angle_deg)
    return Light(prim.path, kind, matrix, emission, *sizes, diffuse, specular, texture, shaping=shaped)


def _number(prim: ResolvedPrim, name: str, default: float, ctx: Context) -> float:
    # USD queries dominate for 100,000 lights, so unauthored names skip them. Only intensity's default varies by type.
    if name not in prim.names and name != "inputs:intensity":
        return default
    return number(prim.prim, name, ctx.when, default, ctx.diagnostics)


def _clamped_number(prim: ResolvedPrim, name: str, default: float, low: float, high: float, ctx: Context) -> float:
    """Return a number clamped to [low, high], with a diagnostic if that changes it."""
    found = _number(prim, name, default, ctx)
    inside = min(max(found, low), high)
    if inside != found:
        message = f"{name} = {found:g} is outside [{low:g}, {high:g}]: {inside:g} is used."
        ctx.warn("out-of-range", prim.path, message, name)
    return inside


def _normalizes(prim: ResolvedPrim, ctx: Context) -> bool:
    """Return whether emission is divided by the area: normalize is on, or a photometric amount is given."""
    if photometric_of(prim, ctx) is not None:
        return True
    return "inputs:normalize" in prim.names and flag(prim.prim, "inputs:normalize", ctx.when, False)


def _divided(color: Color, divisor: float) -> Color:
    return (color[0] / divisor, color[1] / divisor, color[2] / divisor)


def _multiplied(color: Color, factor: float) -> Color:
    return (color[0] * factor, color[1] * factor, color[2] * factor)


_BY_TYPE: dict[str, Callable[[ResolvedPrim, Doubles, Context], Light | None]] = {
    "SphereLight": _sphere,
    "DiskLight": _disk,
    "RectLight": _rect,
    "CylinderLight": _cylinder,
    "DistantLight": _distant,
    "DomeLight": _dome,
    "DomeLight_1": _dome,
}


def scaled_to_amount(prim: ResolvedPrim, light: Light, wanted: Photometric, ctx: Context) -> Light:
    """Return the light scaled to the wanted amount; dark, with a diagnostic, if no scale gives it."""
    if not any(light.emission):
        ctx.warn(
            "light-dark",
            prim.path,
            "The light's colour, intensity or exposure makes its emission 0, which cannot be scaled to the requested amount.",
        )
        return light
    if wanted.amount == 0:
        ctx.warn("light-dark", prim.path, "The requested amount is 0 lumens or lux: the light emits nothing.")
        return replace(light, emission=(0.0, 0.0, 0.0))
    if light.texture is not None:
        return replace(light, photometric=wanted)
    found = scaled_to(light, wanted, amount_of_unit_emission(light, wanted))
    if found is None:
        ctx.warn("light-dark", prim.path, DARK_TEXT)
        return replace(light, emission=(0.0, 0.0, 0.0))
    if max(found.emission) > BRIGHTEST_EMISSION:
        ctx.warn("out-of-range", prim.path, TOO_BRIGHT_TEXT)
    return clamped(found)


def report_ignored_inputs(prim: ResolvedPrim, ctx: Context) -> None:
    """Report light filters, and a light:shaderId other than the schema's own."""
    if "light:filters" in prim.names and targets(prim.prim, "light:filters"):
        ctx.warn("light-input", prim.path, "Light filters are ignored.", "light:filters")
    _report_foreign_shader(prim, ctx)


def _report_foreign_shader(prim: ResolvedPrim, ctx: Context) -> None:
    """Report a light:shaderId that is not the schema's own: no other shaders are implemented."""
    if "light:shaderId" not in prim.names:
        return
    shader = read(prim.prim, "light:shaderId", ctx.when)
    own = {prim.type_name, prim.type_name.removesuffix("_1"), "MeshLight", ""}
    if shader not in own:
        message = f"light:shaderId = {shader!r} is ignored: the light is rendered as a {prim.type_name}."
        ctx.warn("light-input", prim.path, message, "light:shaderId")
