"""The seam's lights: what UsdLux lights emit, how that is shaped, what it reaches. Part of description.py."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import assert_never

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles, Floats
from .motion import MatrixMotion
from .texture_file import TextureFile

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
    GEOMETRY = "geometry"  # worn by a shape (Mesh.light), never in SceneDescription.lights


@dataclass(frozen=True, eq=False)
class IesProfile:
    """A photometric file as luminous intensity over directions of the light, ready to be read bilinearly.

    Angles ascend; outside `vertical_deg` there is no light. `horizontal_deg` spans 0 to 360, one value means all round; an
    angle that stands twice is a step. Horizontal angle 0 is the light's -X, 90 its -Y (ies.py says why).

    With `horizontal_pole` (photometric type B) a direction has vertical angle v about the light's Y, from its -Z towards its
    -X, and leans by h from there towards its +Y; outside the angles of either kind there is no light.
    """

    vertical_deg: Floats  # (V,), from -Z of the light
    horizontal_deg: Floats  # (H,), about it
    candela: Floats  # (H, V), with all of the file's multipliers
    power: float  # what normalize divides by
    horizontal_pole: bool = False


@dataclass(frozen=True)
class Shaping:
    """UsdLux ShapingAPI; these defaults change nothing. Of all lights but distant ones and domes."""

    focus: float = 0.0
    focus_tint: Color = (0.0, 0.0, 0.0)
    cone_angle_deg: float = 180.0
    cone_softness: float = 0.0
    ies: IesProfile | None = None
    ies_angle_scale: float = 0.0
    ies_normalize: bool = False


@dataclass(frozen=True)
class Shadow:
    """UsdLux ShadowAPI; these defaults change nothing. Lengths are scene units, negative: no limit."""

    enabled: bool = True
    color: Color = (0.0, 0.0, 0.0)
    distance: float = -1.0
    falloff: float = -1.0
    falloff_gamma: float = 1.0


@dataclass(frozen=True, eq=False)
class Linked:
    """Which shapes are in which collections: by a shape's `link_row` and the number that a light has for whom it reaches.

    Row 0 is in every collection, and collection 0 holds every row. Empty where nothing is linked.
    """

    collections: tuple[str, ...] = ()  # paths of those from number 1 on, each of the first light that has it
    members: npt.NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, 0), np.bool_))  # (rows, 1 + collections)


NO_LINKS = Linked()


@dataclass(frozen=True, eq=False)
class Portal:
    """A rectangle in its XY plane that guides a dome's samples to where light comes through it, along -Z."""

    world_from_portal: Doubles  # (4, 4)
    width: float = 1.0
    height: float = 1.0
    motion: MatrixMotion | None = None  # as Light's


@dataclass(frozen=True)
class Photometric:
    """How much of its light there is to be, where that takes its image: photometry.scaled makes its emission so.

    `amount` is of luminance by `weights`: lumens over the metres squared in a scene unit squared, of all that an area light
    emits; lux `distance` scene units ahead of its origin, along -Z, on what faces it; of a dome, lux on what faces `up`.
    """

    amount: float
    weights: Color
    distance: float | None = None
    up: Color = (0.0, 1.0, 0.0)  # world


@dataclass(frozen=True)
class Light:
    """One UsdLux light, already reduced to what it emits.

    Local frames as in UsdLux: rect, disk in the XY plane emitting along -Z; cylinder along X; distant emits along -Z;
    dome's pole +Y, image centre +Z, left edge of the image at +Z rotated by pi, s = 0.5 - atan2(x, z) / 2 pi.
    `emission`: DISTANT with angle 0: irradiance at normal incidence; POINT: radiant intensity per steradian, in scene units
    squared; LINE (along X, without a radius): radiant intensity per length at a right angle to it, in scene units; all others:
    radiance (with a texture the factor of that). A RECT's texture has its first row and column at +Y and +X: upright and
    unmirrored for whom it shines at.

    GEOMETRY is a shape that gives light: the glow of its surface times `emission` at every point, or `emission` alone
    (`own_color`). The camera, mirrors and refractions see the glow as it is, or what is given (`shows_own`). `normalize`:
    divided by the area of the shape where it stands. Its matrix is the shape's.
    """

    path: str
    type: LightType
    world_from_light: Doubles  # (4, 4), with all scaling
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
    # Numbers of SceneDescription.linked: whom the light reaches and who casts its shadows; 0 is everybody.
    light_link: int = 0
    shadow_link: int = 0
    group: str = ""  # of lights that light path expressions may name together
    visible_to_camera: bool = True
    texture_format: str = "automatic"  # dome: as UsdLux names it; automatic ones are settled when the file is read
    portals: tuple[Portal, ...] = ()  # dome
    normalize: bool = False  # geometry: this and the next two
    own_color: bool = False
    shows_own: bool = False
    motion: MatrixMotion | None = None  # of world_from_light, which is that at the frame: rigid, so that sizes stay
    photometric: Photometric | None = None  # rect and dome with a texture, until that is read; its emission is relative then


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
