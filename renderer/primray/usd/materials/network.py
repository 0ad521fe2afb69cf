"""Shaders and connections of a shading network, followed from an input to what gives it its value.

That is a constant or a node's output. Interfaces of materials and node graphs are passed through at any depth. A connection
that leads nowhere is ignored, so that the input's own value holds (UsdShade, "Connections and value resolution"). Shaders
without an id are identified by their source asset: MDL modules, and Houdini's principled shader, whose source asset is the
operator's definition.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from pxr import Gf, Sdf, Usd, UsdShade

from ..scene.color_spaces import color_in_rendering_space, scope_of
from ..scene.context import Context
from ..stage.reads import connections, default_value, shader_id
from ..stage.values import value
from .materialx.document_marks import DEFAULT_NODE

# Vectors of halves are missing: memoryview does not support them.
VECTORS = frozenset({Gf.Vec2f, Gf.Vec3f, Gf.Vec4f, Gf.Vec2d, Gf.Vec3d, Gf.Vec4d, Gf.Vec2i, Gf.Vec3i, Gf.Vec4i})


@dataclass(frozen=True)
class Constant:
    """A constant value, and the attribute that holds it."""

    attribute: Usd.Attribute  # the one that holds the value
    value: Any


@dataclass(frozen=True)
class Node:
    """A shader node, and the name of the output that is read, without "outputs:"."""

    prim: Usd.Prim
    output: str
    known: str | None = field(default=None, compare=False)  # cached id

    @cached_property
    def id(self) -> str:
        """Shader id, "" where the shader has none."""
        return shader_id(self.prim) if self.known is None else self.known

    @property
    def path(self) -> Sdf.Path:
        path: Sdf.Path = self.prim.GetPath()
        return path


def find_source(attribute: Usd.Attribute, ctx: Context) -> Constant | Node | None:
    """Return what gives an attribute its value: a constant or a node; None where nothing does."""
    return _follow(attribute, ctx, ())


def _follow(attribute: Usd.Attribute, ctx: Context, passed: tuple[Sdf.Path, ...]) -> Constant | Node | None:
    """Follow connections from an attribute; `passed`: the attributes on the way to it."""
    if passed and attribute.GetPath() in passed:
        _note(attribute, "Its connections form a cycle and are ignored.", ctx)
        return None
    sources = connections(attribute)
    if len(sources) > 1:
        _note(attribute, "It has several connections: only the first is used.", ctx)
    if sources:
        found = _target(attribute, sources[0], ctx, passed)
        if found is not None:
            return found
    raw = value(attribute, ctx.when)
    return _default_node(attribute) if raw is None else Constant(attribute, raw)


def _default_node(attribute: Usd.Attribute) -> Node | None:
    """Return the node that gives what an input of a MaterialX document has by default, None where there is none."""
    name = attribute.GetCustomDataByKey(DEFAULT_NODE) if attribute.HasAuthoredMetadata("customData") else None
    prim = attribute.GetPrim().GetChild(name) if isinstance(name, str) and Sdf.Path.IsValidIdentifier(name) else None
    return Node(prim, "out") if prim else None


def _target(attribute: Usd.Attribute, path: Sdf.Path, ctx: Context, passed: tuple[Sdf.Path, ...]) -> Constant | Node | None:
    at = path.GetPrimPath()
    prim = ctx.stage.GetPrimAtPath(at)
    if not prim:
        _note(attribute, f"It is connected to {path}, which does not exist.", ctx)
        return None
    name: str = path.name
    is_output = name.startswith("outputs:")
    if is_output:
        known = ctx.caches.shader_ids.get(at)
        if known is not None or prim.IsA(UsdShade.Shader):
            return Node(prim, name.removeprefix("outputs:"), known)
    further = prim.GetAttribute(name)
    if not further or not (is_output or name.startswith("inputs:")):
        _note(attribute, f"It is connected to {path}, which does not exist.", ctx)
        return None
    return _follow(further, ctx, (*passed, attribute.GetPath()))


def _note(attribute: Usd.Attribute, message: str, ctx: Context) -> None:
    ctx.warn("shader-connection", ctx.shown(str(attribute.GetPrim().GetPath())), message, str(attribute.GetName()))


def node_path(node: Node, ctx: Context) -> str:
    """Return a node's path as messages show it."""
    return ctx.shown(str(node.path))


def parameter(node: Node, name: str, ctx: Context) -> Constant | None:
    """Return the constant of an input that cannot vary; None, reported, where it is connected to a node."""
    attribute = node.prim.GetAttribute(f"inputs:{name}")
    source = find_source(attribute, ctx) if attribute else None
    if isinstance(source, Node):
        ctx.warn(
            "shader-ignored",
            node_path(node, ctx),
            f"{name} is connected to {source.id or 'a shader without id'}, but must be constant: its default is used.",
            f"inputs:{name}",
        )
        return None
    return source


def numbers(node: Node, name: str, default: tuple[float, ...], ctx: Context, *, is_color: bool = False) -> tuple[float, ...]:
    """Return an input's finite numbers, as many as `default` has; `default`, reported, where it has others."""
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
    """Return a number or a vector as a tuple; None where it is neither, or not finite."""
    try:
        values = (float(raw),) if isinstance(raw, (int, float)) else tuple(map(float, _listed(raw)))
    except (TypeError, ValueError):
        return None
    return values if all(map(math.isfinite, values)) else None


def _listed(raw: Any) -> Any:
    """Return a vector's numbers through its buffer: iterating over USD's vectors is slow."""
    return memoryview(raw).tolist() if type(raw) in VECTORS else raw


def constant_color(values: tuple[float, ...], source: Constant, ctx: Context) -> tuple[float, ...]:
    """Return a constant with its first three numbers converted from their attribute's colour space to the rendering space."""
    r, g, b = values[:3]
    rgb = color_in_rendering_space((r, g, b), source.attribute, scope_of(source.attribute, ctx), ctx)
    return (*rgb, *values[3:])


def text(node: Node, name: str, default: str, ctx: Context) -> str:
    """Return a constant token or string input; the default, reported, where it is of another type."""
    found = parameter(node, name, ctx)
    if found is None:
        return default
    if isinstance(found.value, str):
        return found.value
    ctx.warn(
        "wrong-type", node_path(node, ctx), f"{name} = {found.value!r} is not a string: {default!r} is used.", f"inputs:{name}"
    )
    return default


def module_of(shader: Node) -> str:
    """Return the path of a shader's MDL module, "" where it has none."""
    asset = default_value(shader.prim.GetAttribute("info:mdl:sourceAsset"))
    return str(asset.path) if isinstance(asset, Sdf.AssetPath) else ""


PRINCIPLED = "principledshader"
_ASSETS = ("info:sourceAsset", "info:karma:sourceAsset", "info:vex:sourceAsset", "info:VEX:sourceAsset")


def is_principled(shader: Usd.Prim) -> bool:
    """Return whether the source asset of a shader without id is a principled shader's surface, of any version."""
    for name in _ASSETS:
        attribute = shader.GetAttribute(name)
        asset = default_value(attribute) if attribute else None
        if isinstance(asset, Sdf.AssetPath) and f"/{PRINCIPLED}" in asset.path and "Displacement" not in asset.path:
            return True
    return False
