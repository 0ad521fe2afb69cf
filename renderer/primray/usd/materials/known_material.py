"""Materials with a MaterialX surface shader that is known by name: read, converted to OpenPBR, reduced to a Surface."""

from __future__ import annotations

from dataclasses import dataclass

from ...description import Surface
from ..materialx.expressions import MOST_NODES, TooManyNodesError
from ..scene.context import Context
from ..scene.notes import note_unknown_schemas
from .known_surfaces.as_open_pbr import as_open_pbr, is_hole
from .known_surfaces.by_name import READS
from .known_surfaces.record import Reader
from .network import Node, node_path
from .node_values import NodeValues, definition_of


@dataclass(frozen=True)
class KnownMaterial:
    """A translated material. `surface` is None where the shader cannot be read."""

    surface: Surface | None
    hidden: bool = False


def known_material(shader: Node, path: str, ctx: Context) -> KnownMaterial | None:
    """Return the material of a MaterialX surface shader, None where its definition is not a known surface."""
    found = definition_of(shader)
    if found is None or found.name not in READS:
        return None
    note_unknown_schemas(shader.prim, node_path(shader, ctx), ctx)
    values = NodeValues(ctx)
    try:
        given = values.inputs_of(shader, found)
        defaults = {i.name: i.default for i in found.inputs if i.default is not None}
        known = READS[found.name](Reader({**defaults, **given}, values.expressions))
        surface, told = as_open_pbr(known, values.expressions, path)
    except TooManyNodesError:
        ctx.warn("shader-ignored", path, f"Its network has more than {MOST_NODES:,} nodes: displayColor is used.")
        return KnownMaterial(None)
    if sentences := told.sentences():
        ctx.warn("material-input", node_path(shader, ctx), sentences)
    return KnownMaterial(surface, is_hole(known))
