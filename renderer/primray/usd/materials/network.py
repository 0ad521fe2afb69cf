"""Following connections through a shading network to what gives an input its value: a constant, or a node's output.

Materials' and node graphs' interfaces are passed through, whatever their depth. A connection that leads nowhere counts as
none, so that the input's own value holds (UsdShade, "Connections and value resolution").
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from pxr import Sdf, Usd, UsdShade

from ..querying.guarded import connections, shader_id
from ..resolving.color_spaces import color_in_rendering_space, scope_at
from ..resolving.context import Context
from ..resolving.read import value


@dataclass(frozen=True)
class Constant:
    attribute: Usd.Attribute  # the one that holds the value
    value: Any


@dataclass(frozen=True)
class Node:
    """A shader node, and the output of it that is asked for (its name without "outputs:")."""

    prim: Usd.Prim
    output: str

    @property
    def id(self) -> str:
        return shader_id(self.prim)


def find_source(attribute: Usd.Attribute, ctx: Context) -> Constant | Node | None:
    """What gives the attribute its value; None where nothing does."""
    return _follow(attribute, ctx, [])


def _follow(attribute: Usd.Attribute, ctx: Context, passed: list[Sdf.Path]) -> Constant | Node | None:
    path = attribute.GetPath()
    if path in passed:
        _note(attribute, "The connections lead back to where they began: none counts.", ctx)
        return None
    sources = connections(attribute)
    if len(sources) > 1:
        _note(attribute, "It has several connections: only the first counts.", ctx)
    if sources:
        found = _target(attribute, sources[0], ctx, [*passed, path])
        if found is not None:
            return found
    raw = value(attribute, ctx.when)
    return None if raw is None else Constant(attribute, raw)


def _target(attribute: Usd.Attribute, path: Sdf.Path, ctx: Context, passed: list[Sdf.Path]) -> Constant | Node | None:
    prim = attribute.GetStage().GetPrimAtPath(path.GetPrimPath())
    if not prim:
        _note(attribute, f"It is connected to {path}, which does not exist.", ctx)
        return None
    kind = UsdShade.Utils.GetType(path.name)
    if kind == UsdShade.AttributeType.Output and prim.IsA(UsdShade.Shader):
        return Node(prim, str(path.name).removeprefix("outputs:"))
    further = prim.GetAttribute(path.name)
    if not further or kind == UsdShade.AttributeType.Invalid:
        _note(attribute, f"It is connected to {path}, which does not exist.", ctx)
        return None
    return _follow(further, ctx, passed)


def _note(attribute: Usd.Attribute, message: str, ctx: Context) -> None:
    ctx.warn("shader-connection", ctx.shown(str(attribute.GetPrim().GetPath())), message, str(attribute.GetName()))


def node_path(node: Node, ctx: Context) -> str:
    return ctx.shown(str(node.prim.GetPath()))


def parameter(node: Node, name: str, ctx: Context) -> Constant | None:
    """A node's input that can only be constant; None, noted, where another node computes it."""
    attribute = node.prim.GetAttribute(f"inputs:{name}")
    source = find_source(attribute, ctx) if attribute else None
    if isinstance(source, Node):
        ctx.warn(
            "shader-ignored",
            node_path(node, ctx),
            f"{name} comes from {source.id or 'a shader without id'}: its default is used.",
            f"inputs:{name}",
        )
        return None
    return source


def numbers(node: Node, name: str, default: tuple[float, ...], ctx: Context, *, is_color: bool = False) -> tuple[float, ...]:
    """As many finite numbers as `default` has; one number stands for itself."""
    found = parameter(node, name, ctx)
    if found is None:
        return default
    values = as_numbers(found.value)
    if values is not None and len(values) == len(default):
        return constant_color(values, found, ctx) if is_color and len(values) >= 3 else values
    message = f"{name} = {found.value!r} is not {len(default)} finite numbers: {default} is used."
    ctx.warn("wrong-type", node_path(node, ctx), message, f"inputs:{name}")
    return default


def as_numbers(raw: Any) -> tuple[float, ...] | None:
    """A number or a vector of them as a tuple; None when it is neither, or not finite."""
    try:
        values = (float(raw),) if isinstance(raw, int | float) else tuple(float(x) for x in raw)
    except (TypeError, ValueError):
        return None
    return values if all(map(math.isfinite, values)) else None


def constant_color(values: tuple[float, ...], source: Constant, ctx: Context) -> tuple[float, ...]:
    """The first three of a constant's numbers in the rendering space, by the space of the attribute that holds them."""
    r, g, b = values[:3]
    rgb = color_in_rendering_space((r, g, b), source.attribute, scope_at(source.attribute.GetPrim(), ctx), ctx)
    return (*rgb, *values[3:])


def text(node: Node, name: str, default: str, ctx: Context) -> str:
    """A token or string."""
    found = parameter(node, name, ctx)
    if found is None:
        return default
    if isinstance(found.value, str):
        return found.value
    ctx.warn("wrong-type", node_path(node, ctx), f"{name} = {found.value!r} is no text: {default!r} is used.", f"inputs:{name}")
    return default
