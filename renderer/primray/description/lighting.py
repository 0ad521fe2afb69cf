"""Lights of a scene description: what UsdLux lights emit, how that is shaped, and which shapes it reaches."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import assert_never

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles, Floats
from .motion import MatrixMotion
from .shading import TextureFile

Color = tuple[float, float, float]


class LightType(Enum):
    DISTANT = "distant"
    POINT = "point"
    SPHERE = "sphere"
    DISK = "disk"
    RECT = "rect"
    CYLINDER = "cylinder"
    DOME = "dome"
    LINE = "line"
    GEOMETRY = "geometry"  # a shape that emits (Mesh.light); never in SceneDescription.lights


@dataclass(frozen=True, eq=False)
class IesProfile:
    """Luminous intensity over the directions of a light from a photometric file, tabulated for bilinear lookup.

    Angles ascend; outside `vertical_deg` there is no light. `horizontal_deg` spans 0 to 360, or has one value for rotational
    symmetry; an angle given twice is a step. Horizontal angle 0 is the light's -X, 90 its -Y (ies.py says why).

    With `horizontal_pole` (photometric type B) a direction has vertical angle v about the light's Y, from its -Z towards its
    -X, and horizontal angle h from there towards its +Y; outside the range of either angle there is no light.
    """

    vertical_deg: Floats  # (V,), from the light's -Z
    horizontal_deg: Floats  # (H,), about that axis
    candela: Floats  # (H, V), including all multipliers in the file
    power: float  # total power, by which ies:normalize divides
    horizontal_pole: bool = False


@dataclass(frozen=True)
class Shaping:
    """UsdLux ShapingAPI, with defaults that have no effect. Applies to all lights except distant lights and domes."""

    focus: float = 0.0
    focus_tint: Color = (0.0, 0.0, 0.0)
    cone_angle_deg: float = 180.0
    cone_softness: float = 0.0
    ies: IesProfile | None = None
    ies_angle_scale: float = 0.0
    ies_normalize: bool = False


@dataclass(frozen=True)
class Shadow:
    """UsdLux ShadowAPI, with defaults that have no effect. Lengths are in scene units; negative ones mean no limit."""

    enabled: bool = True
    color: Color = (0.0, 0.0, 0.0)
    distance: float = -1.0
    falloff: float = -1.0
    falloff_gamma: float = 1.0


@dataclass(frozen=True, eq=False)
class Linked:
    """Light and shadow linking: membership of shapes (by their `link_row`) in collections (by the numbers that lights have).

    Row 0 is in every collection, and collection 0 contains every row. Empty if nothing is linked.
    """

    collections: tuple[str, ...] = ()  # paths of collections from number 1 on; equal ones have the path of the first light's
    members: npt.NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, 0), np.bool_))  # (rows, 1 + collections)


NO_LINKS = Linked()


@dataclass(frozen=True, eq=False)
class Portal:
    """Rectangle in its XY plane through which a dome's light enters, along -Z; it guides the dome's samples."""

    world_from_portal: Doubles  # (4, 4)
    width: float = 1.0
    height: float = 1.0
    motion: MatrixMotion | None = None  # like Light.motion


@dataclass(frozen=True)
class Photometric:
    """Photometric amount of a textured light, from which photometry.scaled computes its emission once the image is read.

    `amount` is of luminance by `weights`. For area lights it is lumens over the square metres per squared scene unit; with
    `distance`, lux on a surface that faces the light `distance` scene units along -Z from its origin; for domes, lux on a
    surface that faces `up`.
    """

    amount: float
    weights: Color
    distance: float | None = None
    up: Color = (0.0, 1.0, 0.0)  # world


@dataclass(frozen=True)
class Light:
    """UsdLux light, reduced to what it emits.

    Local frames are those of UsdLux: rect and disk are in the XY plane and emit along -Z; cylinder is along X; distant emits
    along -Z; a dome's pole is +Y, the centre of its image +Z, the left edge of the image at +Z rotated by pi, s = 0.5 -
    atan2(x, z) / 2 pi. `emission` is, for DISTANT with angle 0, irradiance at normal incidence; for POINT, radiant intensity in
    scene units squared; for LINE (along X, without a radius), radiant intensity per length, perpendicular to it, in scene
    units; for all others, radiance (with a texture, a factor on it). A RECT's texture has its first row and column at +Y and
    +X, so that it is upright and unmirrored seen from the lit side.

    GEOMETRY is a shape that emits: its surface's emission times `emission` at every point, or `emission` alone (`own_color`).
    The camera, mirrors and refractions see the surface's emission, or with `shows_own` that of the light. `normalize` divides
    by the area of the shape in the world. Its matrix is that of the shape.
    """

    path: str
    type: LightType
    world_from_light: Doubles  # (4, 4), including scale
    emission: Color
    width: float = 1.0
    height: float = 1.0
    radius: float = 0.5
    length: float = 1.0
    angle_deg: float = 0.0  # full angle of a distant light
    diffuse: float = 1.0
    specular: float = 1.0
    texture: TextureFile | None = None  # rect, dome
    image: Floats | None = None  # dome, in place of a texture: (H, W, 3) linear values, lat-long
    shaping: Shaping | None = None
    shadow: Shadow | None = None
    # Numbers of collections in SceneDescription.linked: shapes that the light reaches, and those that cast its shadows; 0 is
    # all.
    light_link: int = 0
    shadow_link: int = 0
    group: str = ""  # for light path expressions: a name that lights may share
    visible_to_camera: bool = True
    texture_format: str = "automatic"  # dome: UsdLux token; "automatic" is resolved when the file is read
    portals: tuple[Portal, ...] = ()  # dome
    normalize: bool = False  # geometry only, like the next two
    own_color: bool = False
    shows_own: bool = False
    motion: MatrixMotion | None = None  # of world_from_light, which is that at the frame; rigid, so sizes do not change
    photometric: Photometric | None = None  # rect and dome with a texture, until it is read; emission is relative till then


def half_extent(light: Light) -> tuple[float, float, float]:
    """Return half the size of a light's shape along its own axes; 0 for lights without a size or at infinity."""
    kind = light.type
    match kind:
        case LightType.RECT:
            return light.width / 2, light.height / 2, 0.0
        case LightType.DISK:
            return light.radius, light.radius, 0.0
        case LightType.SPHERE:
            return light.radius, light.radius, light.radius
        case LightType.CYLINDER:
            return light.length / 2, light.radius, light.radius
        case LightType.LINE:
            return light.length / 2, 0.0, 0.0
        case LightType.POINT | LightType.DISTANT | LightType.DOME | LightType.GEOMETRY:
            return 0.0, 0.0, 0.0
        case _:
            assert_never(kind)
