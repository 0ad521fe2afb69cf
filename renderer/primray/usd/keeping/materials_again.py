"""Translation of materials again: new surfaces replace those of before, where nothing else depends on the difference."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from pxr import Sdf, Usd

from ...description import Surface
from ..adapters.materials.material import Material, MaterialKey, Materials, translated
from ..materials.network import ShaderIds
from ..querying.guarded import authored_attributes, connections
from ..querying.traversal import everything_in_instances
from ..resolving.context import Context
from ..resolving.notes import LightShapes
from ..resolving.surface_table import SurfaceTable
from .not_known import NotKnownError


@dataclass
class MaterialsAgain:
    """Materials of one translation."""

    beyond: list[MaterialKey] | None = None  # materials connected to prims that are not below them; None: not known yet

    def surfaces(self, edited: set[Sdf.Path], ctx: Context) -> SurfaceTable:
        """Return the table of surfaces with the materials that read these prims translated again; update their cache."""
        known = ctx.kept.of(Materials)
        ctx.kept.of(ShaderIds).clear()  # an edit may be of one
        if ctx.kept.of(LightShapes):
            raise NotKnownError
        if self.beyond is None:
            self.beyond = [key for key in known if _reads_beyond(ctx.stage.GetPrimAtPath(key[0]))]
        above = {prefix for path in edited for prefix in path.GetPrefixes()}
        keys = [key for key in known if key[0] in above or key in self.beyond]
        found = list(ctx.surfaces)
        for key in keys:
            made, told = translated(key, ctx)
            if told != known[key][1]:
                raise NotKnownError
            found = _replaced(found, known[key][0], made)
            known[key] = made, told
        if len(set(found)) != len(found):
            raise NotKnownError
        table = SurfaceTable()
        for surface in found:
            table.index_of(surface)
        return table


def _reads_beyond(material: Usd.Prim) -> bool:
    if not material or material.IsInPrototype():
        return True
    below = material.GetPath()
    return any(not path.HasPrefix(below) for path in _connected(material))


def _connected(material: Usd.Prim) -> Iterator[Sdf.Path]:
    for prim in everything_in_instances(material):
        for attribute in authored_attributes(prim):
            yield from connections(attribute)


def _replaced(surfaces: list[Surface], before: Material, now: Material) -> list[Surface]:
    """Return the surfaces with the old material's replaced by the new one, thin and solid: shapes choose between these."""
    old, new = before.surface, now.surface
    if old == new and before.hidden == now.hidden:
        return surfaces
    if old is None or new is None or before.hidden or now.hidden or old.inputs != new.inputs or _asks(old) != _asks(new):
        raise NotKnownError
    found = []
    for surface in surfaces:
        if surface.path == old.path:
            if replace(surface, thin=old.thin) != old:
                raise NotKnownError
            surface = replace(new, thin=surface.thin)
        found.append(surface)
    return found


def _asks(surface: Surface) -> tuple[bool, bool, bool, float]:
    """Return the properties that decide whether a shape's surface is thin, and which parts of it are holes."""
    return surface.transmits, surface.bends_nothing, surface.thin, surface.opacity_threshold
