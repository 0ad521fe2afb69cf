"""Translation of a material whose surface shader is another renderer's, and the report of what was approximated."""

from __future__ import annotations

from collections.abc import Iterator

from ...scene.context import Context
from ..materialx.expressions import MOST_NODES, TooManyNodesError
from ..models.open_pbr import as_open_pbr, input_report, is_cut_out
from ..network import Node
from ..translated_material import Material
from . import arnold, houdini, renderman
from .values import RendererInputs, RendererNodeValues

VOCABULARIES = (arnold.VOCABULARY, renderman.VOCABULARY, houdini.VOCABULARY)
_MOST_NAMED = 12


def other_renderers_material(shader: Node, path: str, ctx: Context) -> Material | None:
    """Return the material of a supported renderer's shader; None for an unknown renderer or surface."""
    vocabulary = next((v for v in VOCABULARIES if v.kind_of(shader)), None)
    if vocabulary is None:
        return None
    values = RendererNodeValues(ctx, vocabulary=vocabulary)
    try:
        known = values.surface(shader)
        if known is None:
            return None
        surface, not_had = as_open_pbr(known, values.expressions, path)
    except TooManyNodesError:
        ctx.warn("shader-ignored", path, f"Its network has more than {MOST_NODES:,} nodes: displayColor is used.")
        return Material(None)
    kinds = ", ".join(_first_of(dict.fromkeys(n.kind for n in values.used)))
    message = f"{vocabulary.renderer}'s shaders are translated by their documentation, not interpreted: {kinds}."
    near = (*not_had.near, *(_named(n, shader, name) for n in values.used for name in sorted(n.near)))
    left = (*not_had.unused, *(_named(n, shader, name) for n in values.used for name in sorted(n.left_out())))
    shader.warn("translated", f"{message} {input_report(left, near).sentences()}".rstrip())
    return Material(surface, is_cut_out(known))


def _named(n: RendererInputs, shader: Node, name: str) -> str:
    """Return an input's name, with its node's where that is not the surface's shader."""
    return name if n.node.path == shader.path else f"{n.node.path.name}.{name}"


def _first_of(names: dict[str, None]) -> Iterator[str]:
    listed = list(names)
    yield from listed[:_MOST_NAMED]
    if len(listed) > _MOST_NAMED:
        yield f"and {len(listed) - _MOST_NAMED} more"
