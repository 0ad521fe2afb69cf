"""What every adapter is given: the stage's time, the user's settings, and where results that are shared go."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from pxr import Usd

from ...color.color_space import REC709, ColorSpace
from ...description import Surface
from ...diagnostics import Diagnostics
from ...settings import RenderSettings
from .read import When


@dataclass
class Context:
    stage: Usd.Stage
    settings: RenderSettings
    when: When
    purposes: tuple[str, ...]
    material_purposes: tuple[str, ...]
    diagnostics: Diagnostics
    surfaces: dict[Surface, int] = field(default_factory=dict)  # in order of their indices
    surface_numbers: dict[int, int] = field(default_factory=dict)  # by id(), of those in `surfaces`
    materials: dict[Any, Any] = field(default_factory=dict)  # material path -> what adapters.material made of it
    shared_geometry: dict[str, Any] = field(default_factory=dict)  # prim path -> geometry, where prototypes share it
    shared_faces: dict[Any, Any] = field(default_factory=dict)  # by content: topology.Faces, of small meshes
    shared_implicits: dict[Any, Any] = field(default_factory=dict)  # by type and numbers: tessellate.Tessellated
    shares: frozenset[str] = frozenset()  # prim paths that more than one prototype holds

    colored: dict[Any, Any] = field(default_factory=dict)  # id of an Inherited and a colour -> it, and the same in that colour
    bound: dict[Any, str] = field(default_factory=dict)  # path that a material binding names -> what is wrong with it
    collections: set[Any] = field(default_factory=set)  # paths of those with a material that were looked into
    profiles: dict[str, Any] = field(default_factory=dict)  # resolved path -> what ies_asset made of the photometric file
    told_apart: set[Any] = field(default_factory=set)  # paths of prims below which such a collection has members
    expressed: set[Any] = field(default_factory=set)  # paths of prims that bind a collection which is an expression
    primvars_read: frozenset[str] = frozenset()  # "primvars:NAME" of all that materials of the stage read
    color_primvars: frozenset[str] = frozenset()  # of these, what colours read; and what is shown without a material
    rendering_space: ColorSpace = REC709
    color_scopes: dict[Any, Any] = field(default_factory=dict)  # prim path and outer_colors -> color_spaces.ColorScope
    color_names: dict[str, Any] = field(default_factory=dict)  # a colour space's name -> what color.space_named says
    outer_colors: tuple[tuple[str, Any], ...] = ()  # (prototype, ColorScope) around the material that is translated
    property_names: set[frozenset[str]] = field(default_factory=set)  # what prims have authored, each set of names once
    light_inputs: dict[Any, Any] = field(default_factory=dict)  # by type, schemas and names: foreign_names.note_light_inputs
    light_shapes: set[str] = field(default_factory=set)  # paths of shapes that LightAPI makes lights
    portals_met: list[str] = field(default_factory=list)  # paths of PortalLights
    portals_named: set[str] = field(default_factory=set)  # of those that a dome names
    aov_primvars: tuple[str, ...] = ()  # that AOVs ask for, without their namespace
    names_instances: bool = False  # an AOV asks for instances
    prototype_names: dict[str, str] = field(default_factory=dict)  # /__Prototype_N -> its first instance

    def shown(self, path: str) -> str:
        """A path as users know it: what lies in a prototype by its first instance, since USD numbers prototypes as it likes."""
        if not path.startswith("/__Prototype_"):
            return path
        root, slash, rest = path[1:].partition("/")
        return self.prototype_names.get(f"/{root}", f"/{root}") + slash + rest

    def surface_index(self, surface: Surface) -> int:
        """The index of an equal surface, added if there is none."""
        known = self.surface_numbers.get(id(surface))  # comparing and hashing all of its numbers takes longer
        if known is not None:
            return known
        new = len(self.surfaces)
        number = self.surfaces.setdefault(surface, new)
        if number == new:  # this very object is kept
            self.surface_numbers[id(surface)] = number
        return number

    def warn(self, code: str, path: str, message: str, attribute: str = "") -> None:
        self.diagnostics.add(code, path, message, attribute)
