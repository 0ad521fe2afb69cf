"""What every adapter is given: the stage's time, the user's settings, and where results that are shared go."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from pxr import Usd

from ..description import Surface
from ..diagnostics import Diagnostics
from ..settings import RenderSettings
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
    materials: dict[Any, Any] = field(default_factory=dict)  # material path -> what adapters.material made of it
    shared_geometry: dict[str, Any] = field(default_factory=dict)  # prim path -> geometry, where prototypes share it
    shared_faces: dict[Any, Any] = field(default_factory=dict)  # by content: topology.Faces, of small meshes
    shares: frozenset[str] = frozenset()  # prim paths that more than one prototype holds

    bound: dict[Any, str] = field(default_factory=dict)  # path that a material binding names -> what is wrong with it
    collections: set[Any] = field(default_factory=set)  # paths of those with a material that were looked into
    profiles: dict[str, Any] = field(default_factory=dict)  # resolved path -> what ies_asset made of the photometric file
    told_apart: set[Any] = field(default_factory=set)  # paths of prims below which such a collection has members
    expressed: set[Any] = field(default_factory=set)  # paths of prims that bind a collection which is an expression
    primvars_read: frozenset[str] = frozenset()  # "primvars:NAME" of all that materials of the stage read
    light_shapes: set[str] = field(default_factory=set)  # paths of shapes that LightAPI makes lights
    portals_met: list[str] = field(default_factory=list)  # paths of PortalLights
    portals_named: set[str] = field(default_factory=set)  # of those that a dome names
    prototype_names: dict[str, str] = field(default_factory=dict)  # /__Prototype_N -> its first instance

    def shown(self, path: str) -> str:
        """A path as users know it: what lies in a prototype by its first instance, since USD numbers prototypes as it likes."""
        if not path.startswith("/__Prototype_"):
            return path
        root, slash, rest = path[1:].partition("/")
        return self.prototype_names.get(f"/{root}", f"/{root}") + slash + rest

    def surface_index(self, surface: Surface) -> int:
        """The index of an equal surface, added if there is none."""
        return self.surfaces.setdefault(surface, len(self.surfaces))

    def warn(self, code: str, path: str, message: str, attribute: str = "") -> None:
        self.diagnostics.add(code, path, message, attribute)
