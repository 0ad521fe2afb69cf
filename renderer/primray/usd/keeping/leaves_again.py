"""Translation of single shapes and lights again, in place of their earlier versions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from ...arrays import Doubles
from ...description import Light, Placed
from ...diagnostics import Diagnostic, Diagnostics
from ..adapters.materials.material import Materials
from ..adapters.shapes.draw_mode import DRAW_MODES
from ..assembling.groups import linked, shape_of
from ..assembling.scene import Scene
from ..lights.assembly import add_lights
from ..lights.shaping import Profiles
from ..resolving.context import Context
from ..resolving.notes import LightShapes, PhysicalSchemas, PortalsMet
from ..shapes.topology import SharedFaces
from ..walking.record import Become, Record
from .not_known import NotKnownError

T = TypeVar("T")


@dataclass(frozen=True)
class LeavesAgain:
    """Translator of single leaves. `scene` is changed in place; `told` are the diagnostics of the leaves' first translation."""

    scene: Scene
    ctx: Context
    told: list[Diagnostic]

    def stand(self, become: Become, matrix: Doubles) -> None:
        """Replace a leaf's transform."""
        if become.leaf.type_name in self.scene.adapters.lights:
            self.light(become, matrix)
        elif become.shape is not None:
            placed = self.scene.static[become.shape]
            if placed.shape != become.shape:
                raise NotKnownError
            self.scene.static[become.shape] = Placed(placed.shape, matrix, placed.instance)

    def light(self, become: Become, matrix: Doubles) -> None:
        if become.light is None or self.ctx.kept.of(PortalsMet) or self.scene.lights[become.light].portals:
            raise NotKnownError
        leaf, apart = become.leaf, Scene(self.scene.adapters, self.scene.links)

        def make(ctx: Context) -> None:
            add_lights(apart, leaf, matrix, [()], 1, leaf.inherited.blur_scale, ctx)

        self._as_before(leaf.path, make)
        made: list[Light] = apart.lights
        if len(made) != 1 or made[0].portals:
            raise NotKnownError
        self.scene.lights[become.light] = made[0]

    def shape(self, become: Become) -> None:
        if become.shape is None or become.leaf.type_name in DRAW_MODES or self.ctx.kept.of(LightShapes):
            raise NotKnownError
        before, surfaces = self.scene.shapes[become.shape], len(list(self.ctx.surfaces))
        made = self._as_before(become.leaf.path, lambda ctx: shape_of(become.leaf, ctx, self.scene))
        if made is None or not np.array_equal(made.surface, before.surface) or len(list(self.ctx.surfaces)) != surfaces:
            raise NotKnownError
        self.scene.shapes[become.shape] = linked(made, become.leaf, self.scene)

    def _as_before(self, path: str, make: Callable[[Context], T]) -> T:
        """Return the translated object, if its diagnostics are those of before; else raise NotKnownError."""
        apart = Diagnostics(self.ctx.diagnostics.shown)
        kept = self.ctx.kept.sharing(Materials, Profiles, SharedFaces, LightShapes, PhysicalSchemas, Record)
        made = make(replace(self.ctx, diagnostics=apart, kept=kept))
        if list(apart) != [d for d in self.told if d.prim_path == path]:
            raise NotKnownError
        return made
