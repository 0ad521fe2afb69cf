"""The scene under construction: shapes, prototypes, placements and lights translated so far."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from ...arrays import Doubles
from ...description import Light, MovingInstances, Placed, Placement, Prototype, Shape, Sphere
from ..lights.light_links import Links
from ..lights.motion import LightPath
from ..resolving.context import Context
from ..resolving.resolve import ResolvedPrim
from ..viewing.drawn import Drawn, drawn

ShapeAdapter = Callable[[ResolvedPrim, Context], Shape | None]
LightAdapter = Callable[[ResolvedPrim, Doubles, Context], Light | None]


@dataclass(frozen=True)
class Adapters:
    """The functions that turn prims into description objects, by prim type."""

    shapes: Mapping[str, ShapeAdapter]
    lights: Mapping[str, LightAdapter]


@dataclass
class Scene:
    """The scene translated so far."""

    adapters: Adapters
    links: Links | None  # which shapes each light illuminates; None: all
    shapes: list[Shape] = field(default_factory=list)
    static: list[Placed] = field(default_factory=list)
    prototypes: list[Prototype] = field(default_factory=list)
    placements: list[Placement] = field(default_factory=list)
    lights: list[Light] = field(default_factory=list)
    has_lights: bool = False  # even if none of them emits anything
    number: dict[int, int] = field(default_factory=dict)  # prototype's index by group
    blur_scales: dict[int, float] = field(default_factory=dict)  # by prototype
    moving_lights: list[tuple[int, LightPath]] = field(default_factory=list)  # light's index, and its path over time

    @property
    def drawn(self) -> Drawn:
        return drawn(self.shapes, self.static, self.prototypes, self.placements)

    @property
    def moves(self) -> bool:
        placements = [*self.placements, *(inner for prototype in self.prototypes for inner in prototype.placements)]
        return (
            any(isinstance(level, MovingInstances) for placement in placements for level in placement.levels)
            or any(not isinstance(shape, Sphere) and shape.motion is not None for shape in self.shapes)
            or any(light.motion is not None for light in self.lights)
        )
