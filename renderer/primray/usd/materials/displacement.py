"""Displacement of a material: its displacement terminal, or the `displacement` input of its UsdPreviewSurface.

Scalars (UsdPreviewSurface, MaterialX) displace along the normal. MaterialX's vectors have components along the tangent, the
bitangent and the normal; with `inputs:space` = "object", which MaterialX's definition does not have, along the axes of object
space.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from ...description import Input, NodeOutput, Operand, Pattern, PatternInput, PrimvarInput, Surface
from ...description.shading import reads_view
from ...settings import RenderContext
from ..scene.context import Context
from .authored import AuthoredPrim
from .material_primvars import SURFACE_SHADERS
from .materialx.expressions import MOST_NODES, TooManyNodesError
from .network import Constant, Network, Node, as_numbers
from .node_values import FedInputs, NodeValues, definition_of
from .surface_inputs import NO_PRIMVAR, Reducer, appended, pruned

_TERMINALS = ("outputs:mtlx:displacement", "outputs:displacement")  # the render context decides which comes first
ALONG_NORMAL, ALONG_TANGENTS, ALONG_AXES = "displacement", "displacement_tangent", "displacement_object"
_STAYS = "the displacement is ignored"


@dataclass(frozen=True)
class _Found:
    """A displacement: its name among the surface's inputs, its value, and the pattern that the value reads."""

    name: str
    value: Input
    pattern: Pattern | None = None


def displaced(
    surface: Surface, network: Network, material: AuthoredPrim, shader: Node | None, path: str, ctx: Context
) -> Surface:
    """Return the surface with its displacement; `shader`: the material's surface shader."""
    found = _found(network, material, shader, path, ctx)
    if found is None:
        return surface
    value, pattern = found.value, surface.pattern
    if found.pattern is not None and isinstance(value, PatternInput):
        if reads_view(found.pattern, value.source.node):
            ctx.warn("displacement", path, f"Its displacement depends on the view direction: {_STAYS}.")
            return surface
        pattern, value = appended(surface.pattern, found.pattern, value)
    return replace(surface, inputs=(*surface.inputs, (found.name, value)), pattern=pattern)


def _found(network: Network, material: AuthoredPrim, shader: Node | None, path: str, ctx: Context) -> _Found | None:
    """Return the displacement of a material's first displacement terminal, else of its UsdPreviewSurface; None without one."""
    names = material.names
    first = _TERMINALS[:: 1 if ctx.settings.render_context is RenderContext.MTLX else -1]
    terminals = [name for name in first if name in names]
    for terminal in terminals:
        source = network.source(material.attribute(terminal))
        if isinstance(source, Node):
            return _of_shader(source, terminal, path, ctx)
    others = sorted(name for name in names if name.startswith("outputs:") and name.endswith(":displacement"))
    for terminal in (name for name in others if name not in terminals):
        source = network.source(material.attribute(terminal))
        if isinstance(source, Node):
            _note_unknown(source, terminal, path, ctx)
    return _of_preview(shader, ctx) if shader is not None and shader.id in SURFACE_SHADERS else None


def _of_shader(shader: Node, terminal: str, path: str, ctx: Context) -> _Found | None:
    """Return the displacement that a shader connected to a displacement terminal computes."""
    if shader.id in SURFACE_SHADERS:
        return _of_preview(shader, ctx)
    definition = definition_of(shader)
    if definition is None or definition.category != "displacement":
        _note_unknown(shader, terminal, path, ctx)
        return None
    values = NodeValues(ctx)
    try:
        given = {**definition.defaults, **values.inputs_of(shader, definition, beside=frozenset(["space"]))}
        wide = len(definition.defaults["displacement"] or ()) == 3
        product = "ND_multiply_vector3FA" if wide else "ND_multiply_float"
        value = values.expressions.apply(product, in1=_operand(given["displacement"]), in2=_operand(given["scale"]))
    except TooManyNodesError:
        ctx.warn("displacement", path, f"Its displacement has more than {MOST_NODES:,} nodes: {_STAYS}.", terminal)
        return None
    along = ALONG_NORMAL
    if wide:
        along = ALONG_AXES if shader.text("space", "tangent") == "object" else ALONG_TANGENTS
    if not isinstance(value, NodeOutput):
        return _of_constant(along, value if isinstance(value, tuple) else ())
    reduced = Reducer(values.expressions.nodes).input(value, 3 if wide else 1)
    pattern, inputs = pruned(values.expressions.nodes, {along: reduced})
    return _Found(along, inputs[along], pattern)


def _operand(value: Operand | None) -> Operand:
    return (0.0,) if value is None else value


def _note_unknown(shader: Node, terminal: str, path: str, ctx: Context) -> None:
    message = f"{shader.id or 'A shader without id'} is not a supported displacement shader: {_STAYS}."
    ctx.warn("displacement", path, message, terminal)


def _of_constant(along: str, value: tuple[float, ...]) -> _Found | None:
    """Return a constant displacement, None for zero."""
    return _Found(along, PrimvarInput(NO_PRIMVAR, value)) if any(value) else None


def _of_preview(shader: Node, ctx: Context) -> _Found | None:
    """Return the displacement of UsdPreviewSurface's `displacement` input."""
    source = shader.source("displacement")
    if isinstance(source, Constant):
        values = as_numbers(source.value)
        if values is None or len(values) != 1:
            message = f"displacement = {source.value!r} is not a finite number: {_STAYS}."
            shader.warn("wrong-type", message, "inputs:displacement")
            return None
        return _of_constant(ALONG_NORMAL, values)
    if source is None:
        return None
    fed = FedInputs(ctx)
    made = fed.read(shader, source, "displacement", 1)
    if made is None:
        shader.warn("displacement", f"displacement cannot be read: {_STAYS}.", "inputs:displacement")
    if isinstance(made, PatternInput):
        pattern, inputs = fed.pattern_of({ALONG_NORMAL: made})
        return _Found(ALONG_NORMAL, inputs[ALONG_NORMAL], pattern)
    if isinstance(made, tuple):
        return _of_constant(ALONG_NORMAL, made)
    return None if made is None else _Found(ALONG_NORMAL, made)
