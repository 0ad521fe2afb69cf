"""UsdLux lights: L = color * temperature * intensity * 2^exposure / sizeFactor (UsdLux LightAPI).

Lights given in lumens or lux are scaled to that amount here or, if they have a texture, once it is read. Portals of domes are
the rectangles that a dome's `portals` relationship names, in world space (UsdLux PortalLight).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np
from pxr import Gf, Usd

from ...arrays import Doubles
from ...description import Light, LightType, Portal, Shaping, TextureFile
from ...description.lighting import Photometric
from ...photometry.flux import BRIGHTEST_EMISSION, DARK_TEXT, TOO_BRIGHT_TEXT, amount_of_unit_emission, clamped, scaled_to
from ...photometry.light_shape import cylinder_area, disk_area, rect_area, sphere_area
from ..scene.context import Context, PortalPrim
from ..scene.inheritance import ResolvedPrim, local_matrix, transforms
from ..stage.metadata import up_axis
from ..stage.reads import property_names, targets, type_name
from ..stage.values import matrix, number
from .authored import BRIGHTEST_RADIANCE, SMALLEST, AuthoredLight
from .light_color import Color
from .shaping import changes_emission, peak_factor, report_ignored_shaping


def read_portals(dome: ResolvedPrim, world_from_dome: Doubles, ctx: Context) -> tuple[Portal, ...]:
    """Return the portals of a dome that have an area; invisible ones too, since portals do not change the expected image."""
    found = []
    for target in targets(dome.prim, "portals"):
        prim = ctx.stage.GetPrimAtPath(target)
        if not prim or type_name(prim) != "PortalLight":
            what = f"a {type_name(prim) or 'prim without a type'}" if prim else "nothing"
            message = f"portals names {ctx.shown(str(target))}, which is {what} and not a PortalLight: it is ignored."
            ctx.warn("light-input", dome.path, message, "portals")
            continue
        ctx.findings.named_portals.add(ctx.shown(str(prim.GetPath())))
        portal = _portal(dome, world_from_dome, prim, ctx)
        if portal is not None:
            found.append(portal)
    return tuple(found)


def _portal(dome: ResolvedPrim, world_from_dome: Doubles, prim: Usd.Prim, ctx: Context) -> Portal | None:
    path = ctx.shown(str(prim.GetPath()))
    width = abs(number(prim, "inputs:width", ctx.when, 1.0, ctx.diagnostics))
    height = abs(number(prim, "inputs:height", ctx.when, 1.0, ctx.diagnostics))
    world, together = world_from_prim(prim, ctx), None
    if dome.prim.IsInPrototype() and prim.IsInPrototype():  # both move with the instance
        root_from_dome = world_from_prim(dome.prim, ctx)
        if abs(np.linalg.det(root_from_dome[:3, :3])) > 0:
            world, together = world_from_dome @ np.linalg.inv(root_from_dome) @ world, dome.prim
    area = width * height * float(np.linalg.norm(np.cross(world[:3, 0], world[:3, 1])))
    if not np.isfinite(world).all() or not np.isfinite(area) or area == 0:
        ctx.warn("light-input", path, "The portal's area is 0: it is ignored.")
        return None
    portal = Portal(world, width, height)
    if ctx.timing.is_open:
        ctx.findings.moving_portals[id(portal)] = PortalPrim(portal, path, prim, together, world_from_dome)
    return portal


def world_from_prim(prim: Usd.Prim, ctx: Context, offset: float = 0.0) -> Doubles:
    """Return world_from_prim (4, 4), or prototype_from_prim, at `offset` time codes after the frame."""
    when = ctx.when.after(offset) if offset else ctx.when
    cache = transforms(when)
    total = Gf.Matrix4d(1.0)
    for each in self_and_ancestors(prim):
        local, resets = local_matrix(each, frozenset(property_names(each)), when, cache)
        total = total * local
        if resets:
            break
    return matrix(total)


def self_and_ancestors(prim: Usd.Prim) -> Iterator[Usd.Prim]:
    """Yield the prim and its ancestors, up to the world or the prototype that it is in."""
    while prim and not prim.IsPseudoRoot() and not prim.IsPrototype():
        yield prim
        prim = prim.GetParent()


def report_unnamed_portals(ctx: Context) -> None:
    """Report PortalLights that no dome names; called after all lights are translated."""
    named = ctx.findings.named_portals
    for path in ctx.findings.portals:
        if path not in named:
            ctx.warn("light-input", path, "No dome's `portals` names this PortalLight: it has no effect.", "portals")


BRIGHTEST_TINT = 1e15  # BRIGHTEST_RADIANCE of lights with an image, whose texels it multiplies


def light_at(authored: AuthoredLight, world_from_light: Doubles) -> Light | None:
    """Return the light at this matrix; None, with a diagnostic, if it emits nothing."""
    made = _BY_TYPE[authored.prim.type_name](authored, world_from_light)
    wanted = authored.amount
    return made if made is None or wanted is None else scaled_to_amount(authored, made, wanted)


def _emission(authored: AuthoredLight, emission: Color, brightest: float) -> Color:
    """Return the emission clamped to [0, brightest], with a diagnostic if that changes it."""
    if min(emission) < 0:
        message = f"The emission {_color_text(emission)} is negative: it is clamped to 0."
        authored.warn("out-of-range", message, "inputs:intensity")
    if max(emission) > brightest:
        message = f"The emission {_color_text(emission)} is clamped to {brightest:g}."
        authored.warn("out-of-range", message, "inputs:intensity")
    r, g, b = (min(max(x, 0.0), brightest) for x in emission)
    return (r, g, b)


def _color_text(color: Color) -> str:
    return f"({color[0]:g}, {color[1]:g}, {color[2]:g})"


def _over_area(authored: AuthoredLight, area: float) -> Color | None:
    """Return the radiance, divided by the area if normalize is on; None, with a diagnostic, if the area is 0 or infinite."""
    radiance = authored.radiance
    if area == 0 or not math.isfinite(area):
        authored.warn("light-dark", f"The light's area is {area:g}: it emits nothing.")
        return None
    return _divided(radiance, area) if authored.normalizes else radiance


def _has_depth(authored: AuthoredLight, matrix: Doubles) -> bool:
    """Return whether the transform keeps all three axes, which some lights need; report it if not."""
    if _spans_space(matrix[:3, :3].tobytes()):
        return True
    authored.warn("light-dark", "The transform scales the light to 0 along an axis: it emits nothing.")
    return False


@lru_cache(maxsize=256)
def _spans_space(linear: bytes) -> bool:
    axes = np.frombuffer(linear).reshape(3, 3)
    return bool(abs(np.linalg.det(axes)) > 1e-14 * np.prod(np.linalg.norm(axes, axis=0)))


def _sphere(authored: AuthoredLight, matrix: Doubles) -> Light | None:
    radius, radiance, normalizes = authored.radius, authored.radiance, authored.normalizes
    area = sphere_area(matrix, radius)
    if authored.is_point or (normalizes and radius <= SMALLEST):
        # The limit of a small sphere: I = L pi r^2, a quarter of its area (by Cauchy's formula an ellipsoid's mean, too).
        if not normalizes and area == 0:
            authored.warn("light-dark", "A sphere light of radius 0 without normalize emits nothing.")
            return None
        return _make_light(authored, LightType.POINT, matrix, _multiplied(radiance, 0.25 if normalizes else 0.25 * area))
    emission = _over_area(authored, area)
    if emission is None or not _has_depth(authored, matrix):
        return None
    return _make_light(authored, LightType.SPHERE, matrix, emission, radius=radius)


def _disk(authored: AuthoredLight, matrix: Doubles) -> Light | None:
    radius = authored.radius
    emission = _over_area(authored, disk_area(matrix, radius))
    return emission and _make_light(authored, LightType.DISK, matrix, emission, radius=radius)


def _rect(authored: AuthoredLight, matrix: Doubles) -> Light | None:
    width, height = authored.width, authored.height
    emission = _over_area(authored, rect_area(matrix, width, height))
    if emission is None:
        return None
    return _make_light(authored, LightType.RECT, matrix, emission, width=width, height=height, texture=authored.texture)


def _cylinder(authored: AuthoredLight, matrix: Doubles) -> Light | None:
    length, radius = authored.length, authored.radius
    area = cylinder_area(matrix, length, radius)
    emission = _over_area(authored, area)
    if emission is None:
        return None
    if authored.is_line or (authored.normalizes and radius <= SMALLEST):
        # The limit of a thin cylinder: a length dl shows a projected area of 2 r dl across, its lateral area over pi (by
        # Cauchy's formula also the mean over directions of an elliptic one).
        stretched = length * float(np.linalg.norm(matrix[:3, 0]))
        per_length = _multiplied(emission, area / (math.pi * stretched))
        return _make_light(authored, LightType.LINE, matrix, per_length, length=length)
    if not _has_depth(authored, matrix):
        return None
    return _make_light(authored, LightType.CYLINDER, matrix, emission, length=length, radius=radius)


def _distant(authored: AuthoredLight, matrix: Doubles) -> Light:
    angle_deg, radiance = authored.angle_deg, authored.radiance
    if authored.normalizes:
        radiance = _divided(radiance, distant_size_factor(angle_deg))
    return _make_light(authored, LightType.DISTANT, matrix, radiance, angle_deg=angle_deg)


def distant_size_factor(angle_deg: float) -> float:
    """Return UsdLux DistantLight's sizeFactor: 1 at angle 0, pi sin^2 theta up to 180 degrees, pi (2 - sin^2 theta) beyond."""
    theta = min(max(math.radians(angle_deg) / 2, 0.0), math.pi)
    if theta == 0:
        return 1.0
    squared = math.sin(theta) ** 2
    return math.pi * squared if theta <= math.pi / 2 else math.pi * (2.0 - squared)


def _dome(authored: AuthoredLight, matrix: Doubles) -> Light:
    """Return a dome; normalize has no effect on domes (UsdLux LightAPI)."""
    prim, ctx = authored.prim, authored.ctx
    if prim.type_name == "DomeLight_1":
        matrix = matrix @ _pole_rotation(authored)
    texture = authored.texture
    dome = _make_light(authored, LightType.DOME, matrix, authored.radiance, texture=texture)
    portals = read_portals(prim, matrix, ctx) if "portals" in prim.names else ()
    return replace(dome, texture_format=authored.texture_format if texture else "automatic", portals=portals)


def _pole_rotation(authored: AuthoredLight) -> Doubles:
    """Return DomeLight_1's rotation: with pole Z, latitude +pi/2 is at +Z, longitude 0 at -Y, longitude pi/2 still at +X."""
    axis = authored.pole_axis
    if axis == "scene":
        axis = up_axis(authored.ctx.stage)
    turned = np.eye(4)
    if axis == "Z":
        turned[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    return turned


def geometry_light(authored: AuthoredLight) -> Light:
    """Return the light of a shape that has LightAPI; its radiance is divided by the area later, once the shape is placed."""
    made = _make_light(authored, LightType.GEOMETRY, np.eye(4), authored.radiance)
    return replace(made, normalize=authored.normalizes)


def _make_light(
    authored: AuthoredLight,
    kind: LightType,
    matrix: Doubles,
    emission: Color,
    *,
    width: float = 1.0,
    height: float = 1.0,
    radius: float = 0.5,
    length: float = 1.0,
    angle_deg: float = 0.0,
    texture: TextureFile | None = None,
) -> Light:
    diffuse, specular = authored.diffuse, authored.specular
    shaping = _shaping(authored, kind, matrix)
    brightest = (BRIGHTEST_TINT if texture else BRIGHTEST_RADIANCE) / max(peak_factor(shaping), 1.0)
    return Light(
        path=authored.prim.path,
        type=kind,
        world_from_light=matrix,
        emission=_emission(authored, emission, brightest),
        width=width,
        height=height,
        radius=radius,
        length=length,
        angle_deg=angle_deg,
        diffuse=diffuse,
        specular=specular,
        texture=texture,
        shaping=shaping,
    )


def _shaping(authored: AuthoredLight, kind: LightType, matrix: Doubles) -> Shaping | None:
    """Return the shaping of the light at this matrix; None if it does not change the emission."""
    if kind in (LightType.DISTANT, LightType.DOME):
        report_ignored_shaping(authored.prim, authored.ctx)
        return None
    found = authored.shaping
    return found if found is not None and changes_emission(found, authored.prim, matrix) else None


def _divided(color: Color, divisor: float) -> Color:
    return (color[0] / divisor, color[1] / divisor, color[2] / divisor)


def _multiplied(color: Color, factor: float) -> Color:
    return (color[0] * factor, color[1] * factor, color[2] * factor)


_BY_TYPE: dict[str, Callable[[AuthoredLight, Doubles], Light | None]] = {
    "SphereLight": _sphere,
    "DiskLight": _disk,
    "RectLight": _rect,
    "CylinderLight": _cylinder,
    "DistantLight": _distant,
    "DomeLight": _dome,
    "DomeLight_1": _dome,
}


def scaled_to_amount(authored: AuthoredLight, light: Light, wanted: Photometric) -> Light:
    """Return the light scaled to the wanted amount; dark, with a diagnostic, if no scale gives it."""
    if not any(light.emission):
        sentence = (
            "The light's colour, intensity or exposure makes its emission 0, which cannot be scaled to the requested amount."
        )
        authored.warn("light-dark", sentence)
        return light
    if wanted.amount == 0:
        authored.warn("light-dark", "The requested amount is 0 lumens or lux: the light emits nothing.")
        return replace(light, emission=(0.0, 0.0, 0.0))
    if light.texture is not None:
        return replace(light, photometric=wanted)
    found = scaled_to(light, wanted, amount_of_unit_emission(light, wanted))
    if found is None:
        authored.warn("light-dark", DARK_TEXT)
        return replace(light, emission=(0.0, 0.0, 0.0))
    if max(found.emission) > BRIGHTEST_EMISSION:
        authored.warn("out-of-range", TOO_BRIGHT_TEXT)
    return clamped(found)
