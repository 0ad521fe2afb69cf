"""The context that every adapter is given: the stage, what is asked of it, and diagnostics, caches and findings of one
translation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pxr import Sdf, Usd

from ...arrays import Doubles
from ...color.color_space import REC709, ColorSpace
from ...color.ocio import Source
from ...description import MotionSteps, Portal, Surface
from ...diagnostics import Diagnostic, Diagnostics
from ...settings import RenderSettings
from ...textures.ies import IesFile
from ..lights.light_groups import NO_GROUPS, LightGroups
from ..mesh.triangulate import Triangulator, triangulated
from ..motion.timing import AT_FRAME, UNSEEN, Foreseen, Timing
from ..shapes.tessellate import Tessellated
from ..stage.values import When

if TYPE_CHECKING:
    from ..materials.translated_material import Material
    from ..motion.levels import ShapePlacements


class SurfaceTable:
    """Distinct surfaces, numbered as shapes refer to them."""

    def __init__(self) -> None:
        self._numbers: dict[Surface, int] = {}  # in order of their numbers
        self._by_id: dict[int, int] = {}  # numbers by identity of the stored surfaces

    def __iter__(self) -> Iterator[Surface]:
        return iter(self._numbers)

    def index_of(self, surface: Surface) -> int:
        """Return the index of an equal surface, added if there is none."""
        known = self._by_id.get(id(surface))  # comparing and hashing a whole surface is slower
        if known is not None:
            return known
        new = len(self._numbers)
        number = self._numbers.setdefault(surface, new)
        if number == new:  # the object itself was stored
            self._by_id[id(surface)] = number
        return number


@dataclass(frozen=True)
class ColorScope:
    """Inherited colour spaces: the nearest colorSpace:name, and custom spaces, the nearest first."""

    name: str = ""
    definitions: tuple[ColorSpace, ...] = ()


NO_COLOR_SCOPE = ColorScope()
OuterColors = tuple[tuple[str, ColorScope], ...]  # the scopes that instances pass to their prototypes, by prototype
MaterialKey = tuple[Sdf.Path, OuterColors]


@dataclass(kw_only=True)
class TranslationCaches:
    """Results that are computed once and used again: without any of them a translation is slower, and no different.

    Values of type Any are of types whose modules import this one; the functions that use them name these.
    """

    shader_ids: dict[Sdf.Path, str] = field(default_factory=dict)  # reading one from USD takes ten microseconds
    materials: dict[MaterialKey, tuple[Material, list[Diagnostic]]] = field(default_factory=dict)
    # Recipes of materials/recipes.py by the names of materials' children; None for each material that left none.
    recipes: dict[tuple[str, ...], list[Any]] = field(default_factory=dict)
    binding_faults: dict[Sdf.Path, str] = field(default_factory=dict)  # by a binding's target, "" for none
    color_scopes: dict[MaterialKey, ColorScope] = field(default_factory=dict)  # by prim and scopes around its prototype
    color_spaces: dict[str, Source | None] = field(default_factory=dict)  # by name; None: unknown
    # Copies of Inherited with another colour or none, by the id of the original, which is stored first so that it lives.
    colored: dict[tuple[int, tuple[float, float, float] | None], tuple[Any, Any]] = field(default_factory=dict)
    holds_instancers: dict[str, bool] = field(default_factory=dict)  # whether point instancers are below a prim
    faces: dict[tuple[bytes, bytes], Any] = field(default_factory=dict)  # Faces of small meshes, by counts and indices
    # Polygons or Cages of meshes that several prototypes contain, by prim path and motion:blurScale.
    mesh_geometries: dict[tuple[str, float], Any] = field(default_factory=dict)
    source_geometries: dict[tuple[Any, ...], Any] = field(default_factory=dict)  # likewise by mesh/sources.py's keys
    # By the function of tessellate.py and its arguments, since many prims are alike; None: sizes are not usable.
    tessellations: dict[tuple[Any, ...], Tessellated | None] = field(default_factory=dict)
    # Findings (code, message, attribute) about the inputs of lights, by type, applied schemas and authored names.
    light_inputs: dict[tuple[str, tuple[str, ...], frozenset[str]], list[tuple[str, str, str]]] = field(default_factory=dict)
    ies_files: dict[str, IesFile | str] = field(default_factory=dict)  # by resolved path: the file, or why it is unusable
    volume_files: set[str] = field(default_factory=set)  # resolved paths of the files that fields of volumes name
    defined_copy: list[Usd.Stage] = field(default_factory=list)  # at most one copy of the stage, to define prims in


@dataclass
class CollectionBindings:
    """The collections that materials are bound to."""

    is_expression: dict[Sdf.Path, bool] = field(default_factory=dict)  # collections that have been looked into
    has_members_below: set[Sdf.Path] = field(default_factory=set)  # prims below which such a collection has members
    expressed: set[Sdf.Path] = field(default_factory=set)  # prims that bind a collection which is an expression


@dataclass(frozen=True, eq=False)
class PortalPrim:
    """A portal that may move while the shutter is open."""

    portal: Portal  # stored so that its id stays unique
    path: str
    prim: Usd.Prim
    dome: Usd.Prim | None  # if both are in one prototype
    world_from_dome: Doubles  # (4, 4)


@dataclass(kw_only=True)
class Findings:
    """What one part of a translation finds and a later part reads."""

    property_names: set[frozenset[str]] = field(default_factory=set)  # sets of authored names that occur on prims
    blur_scales: set[float] = field(default_factory=set)  # authored values of motion:blurScale
    collection_bindings: CollectionBindings = field(default_factory=CollectionBindings)
    light_shapes: set[str] = field(default_factory=set)  # paths of shapes and volumes that LightAPI makes lights
    physical_schemas: dict[str, set[str]] = field(default_factory=dict)  # of the proposal "physical-lighting", by prim path
    portals: list[str] = field(default_factory=list)  # paths of PortalLights
    named_portals: set[str] = field(default_factory=set)  # those that domes name
    moving_portals: dict[int, PortalPrim] = field(default_factory=dict)  # by the id of the Portal
    unbounded_shapes: set[str] = field(default_factory=set)  # paths of shapes for which USD computes a wrong extent
    point_steps: list[MotionSteps] = field(default_factory=list)  # samplings of moving points, for the report


@dataclass(frozen=True)
class Context:
    """State that is fixed for all that are given it; translation continues with a copy once it knows more."""

    stage: Usd.Stage
    settings: RenderSettings
    when: When
    purposes: tuple[str, ...]
    material_purposes: tuple[str, ...]
    diagnostics: Diagnostics
    timing: Timing = AT_FRAME  # the shutter interval
    foreseen: Foreseen = UNSEEN  # how large things appear during it
    stands: ShapePlacements | None = None  # world placements of the prim being translated, while the shutter is open
    rendering_space: ColorSpace = REC709
    aov_primvars: tuple[str, ...] = ()  # primvars that AOVs show, without their namespace
    light_groups: LightGroups = NO_GROUPS  # from the render settings
    names_instances: bool = False  # an AOV asks for instances
    primvars_read: frozenset[str] = frozenset()  # "primvars:NAME" of all primvars that materials of the stage read
    color_primvars: frozenset[str] = frozenset()  # those that are colours, and those shown without a material
    shares: frozenset[str] = frozenset()  # prim paths that more than one prototype holds
    outer_colors: OuterColors = ()  # by prototype, around the material being translated
    prototype_names: dict[str, str] = field(default_factory=dict)  # /__Prototype_N -> its first instance, in order of discovery
    surfaces: SurfaceTable = field(default_factory=SurfaceTable)
    triangulate: Triangulator = triangulated
    caches: TranslationCaches = field(default_factory=TranslationCaches)
    findings: Findings = field(default_factory=Findings)

    def shown(self, path: str) -> str:
        """Return a path as users know it: a prim in a prototype by its first instance, since USD's numbers of prototypes
        vary."""
        if not path.startswith("/__Prototype_"):
            return path
        root, slash, rest = path[1:].partition("/")
        return self.prototype_names.get(f"/{root}", f"/{root}") + slash + rest

    def warn(self, code: str, path: str, message: str, attribute: str = "") -> None:
        self.diagnostics.add(code, path, message, attribute)
