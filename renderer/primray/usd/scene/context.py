"""The context that every adapter is given: the stage, what is asked of it, diagnostics, and the caches of one translation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, TypeVar

from pxr import Usd

from ...color.color_space import REC709, ColorSpace
from ...description import Surface
from ...diagnostics import Diagnostics
from ...settings import RenderSettings
from ..lights.light_groups import NO_GROUPS, LightGroups
from ..motion.levels import ShapePlacements
from ..motion.pixels import UNSEEN, Foreseen
from ..motion.timing import AT_FRAME, Timing
from ..stage.values import When


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


T = TypeVar("T")


class Kept:
    """Registry of caches. Modules declare a cache type, constructible without arguments, beside the functions that use it."""

    def __init__(self) -> None:
        self._objects: dict[type[Any], Any] = {}

    def of(self, kind: type[T]) -> T:
        """Return the cache of this type, created on first use."""
        found = self._objects.get(kind)
        if found is None:
            found = self._objects[kind] = kind()
        made: T = found
        return made

    def sharing(self, *kinds: type[Any]) -> Kept:
        """Return a registry that shares the caches of these types, and has no others yet."""
        other = Kept()
        other._objects = {kind: self.of(kind) for kind in kinds}
        return other


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
    levels_chosen: bool = False  # each root of levels of detail has one level left
    names_instances: bool = False  # an AOV asks for instances
    primvars_read: frozenset[str] = frozenset()  # "primvars:NAME" of all primvars that materials of the stage read
    color_primvars: frozenset[str] = frozenset()  # those that are colours, and those shown without a material
    shares: frozenset[str] = frozenset()  # prim paths that more than one prototype holds
    outer_colors: tuple[tuple[str, ColorScope], ...] = ()  # by prototype, around the material being translated
    prototype_names: dict[str, str] = field(default_factory=dict)  # /__Prototype_N -> its first instance, in order of discovery
    surfaces: SurfaceTable = field(default_factory=SurfaceTable)
    kept: Kept = field(default_factory=Kept)

    def shown(self, path: str) -> str:
        """Return a path as users know it: a prim in a prototype by its first instance, since USD's numbers of prototypes
        vary."""
        if not path.startswith("/__Prototype_"):
            return path
        root, slash, rest = path[1:].partition("/")
        return self.prototype_names.get(f"/{root}", f"/{root}") + slash + rest

    def warn(self, code: str, path: str, message: str, attribute: str = "") -> None:
        self.diagnostics.add(code, path, message, attribute)


@dataclass(frozen=True)
class ColorScope:
    """Inherited colour spaces: the nearest colorSpace:name, and custom spaces, the nearest first."""

    name: str = ""
    definitions: tuple[ColorSpace, ...] = ()


NO_COLOR_SCOPE = ColorScope()
