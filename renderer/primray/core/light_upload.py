"""Upload of lights to the core's scene builder, with the images and IES profiles that several lights may share."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..arrays import Doubles, Floats
from ..description import Light, LightType, MatrixMotion, Shaping, TextureFile
from ..description.motion import handed_over
from . import compiled
from .dome_look import DomeLook, dome_look
from .inputs import filled
from .surface_upload import Textures

# The core's formats by UsdLux token; an unresolved `automatic` is read as lat-long.
DOME_FORMATS = {
    "automatic": "LAT_LONG",
    "latlong": "LAT_LONG",
    "mirroredBall": "MIRRORED_BALL",
    "angular": "ANGULAR",
    "cubeMapVerticalCross": "VERTICAL_CROSS",
}
# Fields with the same name in the core.
FIELDS = ("emission", "width", "height", "radius", "length", "angle_deg", "diffuse", "specular", "light_link", "shadow_link",
          "visible_to_camera")  # fmt: skip
NO_TEXTURE = np.zeros((0, 0, 3), np.float32)


@dataclass
class LightGroups:
    """Light groups by the core's numbers (0: no group), and which of them contain domes and other lights.

    `apart`: paths of lights that are groups of their own if they have none.
    """

    names: list[str] = field(default_factory=lambda: [""])
    domes: set[int] = field(default_factory=set)
    others: set[int] = field(default_factory=set)
    apart: frozenset[str] = frozenset()

    def number_of(self, light: Light) -> int:
        group = light.group or (light.path if light.path in self.apart else "")
        if group not in self.names:
            self.names.append(group)
        number = self.names.index(group)
        (self.domes if light.type is LightType.DOME else self.others).add(number)
        return number


class LightUpload:
    """`earlier`: of the domes that the builder keeps, each of which is given to a dome that looks like it. `apart`: as in
    LightGroups."""

    def __init__(self, builder: compiled.SceneBuilder, earlier: Sequence[DomeLook] = (), apart: Iterable[str] = ()) -> None:
        self._builder = builder
        self._earlier = dict(enumerate(earlier))
        self.domes: list[DomeLook] = []  # in the core's order
        self.groups = LightGroups(apart=frozenset(apart))
        self.has_mesh_lights = False  # some lights are shapes (MeshLightAPI)
        self.paths: dict[int, str] = {}  # by the core's row
        self.dome_paths: list[str] = []  # in the core's order
        self._profiles: dict[int, int] = {}  # the core's numbers by id(), since lights share profiles
        self._images: dict[TextureFile, int] = {}

    def add(self, lights: Iterable[Light], textures: Textures) -> None:
        """Add lights that are prims of their own, not shapes with MeshLightAPI."""
        for light in lights:
            pixels, image, kept = NO_TEXTURE, -1, -1
            if light.type is LightType.RECT:
                image = self._image(light.texture, textures)
            elif light.type is LightType.DOME:
                kept = self._kept_dome(light, textures)
                if kept < 0:
                    pixels = light_pixels(light.texture, textures) if light.image is None else light.image
            portals = np.array([[*p.world_from_portal[:3].ravel(), p.width, p.height] for p in light.portals], np.float64)
            made = filled(
                self._input(light, light.world_from_light),
                texture=pixels,
                earlier_dome=kept,
                format=compiled.DomeFormat[DOME_FORMATS[light.texture_format]],
                portals=portals.reshape(-1, 14),
            )
            if light.motion is not None:
                made.times, made.pose_matrices = _motion_matrices(light.motion)
            for k, portal in enumerate(light.portals):
                if portal.motion is not None:
                    made.set_portal_motion(k, *_motion_matrices(portal.motion))
            row = self._builder.add_light(made, image)
            if row is not None:
                self.paths[row] = light.path
            if light.type is LightType.DOME:
                self.dome_paths.append(light.path)

    def add_mesh_light(self, light: Light, group_from_object: Doubles) -> int:
        """Add the light of a shape with MeshLightAPI, placed at `group_from_object`; return its number."""
        made = filled(
            self._input(light, group_from_object),
            normalize=light.normalize,
            own_color=light.own_color,
            shows_own=light.shows_own,
        )
        self.has_mesh_lights = True
        return self._builder.add_geometry_light(made)

    def _kept_dome(self, light: Light, textures: Textures) -> int:
        """Return the number of the earlier dome whose tables this one takes; -1 if there is none."""
        self.domes.append(dome_look(light, textures))
        alike = next((number for number, look in self._earlier.items() if look.is_like(self.domes[-1])), -1)
        self._earlier.pop(alike, None)
        return alike

    def _input(self, light: Light, matrix: Doubles) -> compiled.LightInput:
        """Return the input of a light with the fields that all types share."""
        made = filled(
            compiled.LightInput(),
            type=compiled.LightType[light.type.name],
            world_from_light=np.ascontiguousarray(matrix, np.float64),
            **{name: getattr(light, name) for name in FIELDS},
        )
        made.group = self.groups.number_of(light)
        if light.shadow is not None:
            filled(
                made,
                casts_shadows=light.shadow.enabled,
                shadow_color=light.shadow.color,
                shadow_distance=light.shadow.distance,
                shadow_falloff=light.shadow.falloff,
                shadow_gamma=light.shadow.falloff_gamma,
            )
        if light.shaping is not None:
            made.shaping = self._shaping(light.shaping)
        return made

    def _shaping(self, shaping: Shaping) -> compiled.ShapingInput:
        made = filled(
            compiled.ShapingInput(),
            focus=shaping.focus,
            focus_tint=shaping.focus_tint,
            cone_angle_deg=shaping.cone_angle_deg,
            cone_softness=shaping.cone_softness,
            ies=self._profile(shaping),
            ies_angle_scale=shaping.ies_angle_scale,
        )
        if shaping.ies is not None and shaping.ies_normalize:
            made.ies_divisor = shaping.ies.power
        return made

    def _image(self, file: TextureFile | None, textures: Textures) -> int:
        if file is None or file not in textures:
            return -1
        if file not in self._images:
            self._images[file] = self._builder.add_light_image(light_pixels(file, textures))
        return self._images[file]

    def _profile(self, shaping: Shaping) -> int:
        """Return the number of the light's IES profile; -1 without one."""
        if shaping.ies is None:
            return -1
        profile = shaping.ies
        if id(profile) not in self._profiles:
            horizontal, candela = profile.horizontal_deg, profile.candela
            if len(horizontal) == 1:
                horizontal, candela = np.array([0.0, 360.0], np.float32), np.concatenate([candela, candela])
            self._profiles[id(profile)] = self._builder.add_ies_profile(
                profile.vertical_deg, horizontal, candela, profile.horizontal_pole
            )
        return self._profiles[id(profile)]


def _motion_matrices(motion: MatrixMotion) -> tuple[Floats, Doubles]:
    """Return times and matrices (S + 1, 3, 4)."""
    return handed_over(motion.times), np.ascontiguousarray(motion.matrices[:, :3], np.float64)


def light_pixels(file: TextureFile | None, textures: Textures) -> Floats:
    """Return the image (H, W, 3) of a light, or no pixels: a light without a texture is constant."""
    tiles = [] if file is None else textures.get(file, [])
    if not tiles:
        return NO_TEXTURE
    return tiles[0][1].rgb()
