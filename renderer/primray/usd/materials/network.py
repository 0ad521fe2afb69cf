"""Shaders and connections of a shading network, followed from an input to what gives it its value.

That is a constant or a node's output. Interfaces of materials and node graphs are passed through at any depth. A connection
that leads nowhere is ignored, so that the input's own value holds (UsdShade, "Connections and value resolution"). Shaders
without an id are identified by their source asset: MDL modules, and Houdini's principled shader, whose source asset is the
operator's definition.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from pxr import Gf, Sdf, Usd

from ...description import TextureFile
from ..scene.color_spaces import color_in_rendering_space, scope_of
from ..scene.context import Context
from ..stage.read_once import ReadOnce
from .authored import INPUT, AuthoredAttribute, AuthoredPrim

# Vectors of halves are missing: memoryview does not support them.
VECTORS = frozenset({Gf.Vec2f, Gf.Vec3f, Gf.Vec4f, Gf.Vec2d, Gf.Vec3d, Gf.Vec4d, Gf.Vec2i, Gf.Vec3i, Gf.Vec4i})


@dataclass(slots=True, eq=False)  # not frozen: these are made for each input that is read
class Constant:
    """A constant value, and the attribute that holds it."""

    attribute: AuthoredAttribute
    value: Any


@dataclass(eq=False)
class Node:
    """A shader node of a network, and the name of the output that is read, without "outputs:"."""

    shader: AuthoredPrim
    output: str
    network: Network = field(repr=False)

    @ReadOnce
    def id(self) -> str:
        """Shader id, "" where the shader has none."""
        return self.shader.id

    @property
    def path(self) -> Sdf.Path:
        return self.shader.path

    @property
    def shown(self) -> str:
        """The node's path as messages show it."""
        return self.network.ctx.shown(str(self.shader.path))

    def warn(self, code: str, message: str, attribute: str = "") -> None:
        self.network.ctx.warn(code, self.shown, message, attribute)

    def source(self, name: str) -> Constant | Node | None:
        """Return what gives an input its value; None where nothing does, and where there is no such input."""
        return self.network.source(self.shader.attribute(INPUT + name))

    def parameter(self, name: str) -> Constant | None:
        """Return the constant of an input that cannot vary; None, reported, where it is connected to a node."""
        source = self.source(name)
        if isinstance(source, Node):
            what = source.id or "a shader without id"
            message = f"{name} is connected to {what}, but must be constant: its default is used."
            self.warn("shader-ignored", message, INPUT + name)
            return None
        return source

    def numbers(self, name: str, default: tuple[float, ...], *, is_color: bool = False) -> tuple[float, ...]:
        """Return an input's finite numbers, as many as `default` has; `default`, reported, where it has others."""
        found = self.parameter(name)
        if found is None:
            return default
        values = as_numbers(found.value)
        if values is not None and len(values) == len(default):
            return constant_color(values, found, self.network.ctx) if is_color and len(values) >= 3 else values
        message = f"{name} = {found.value!r} is not {len(default)} finite numbers: {default} is used."
        self.warn("wrong-type", message, INPUT + name)
        return default

    def text(self, name: str, default: str) -> str:
        """Return a constant token or string input; the default, reported, where it is of another type."""
        found = self.parameter(name)
        if found is None:
            return default
        if isinstance(found.value, str):
            return found.value
        self.warn("wrong-type", f"{name} = {found.value!r} is not a string: {default!r} is used.", INPUT + name)
        return default


class Network:
    """The shading network of one material: what is authored in it, and the context that its faults are reported to.

    `recording`: the Recording (recipes.py) by which a material is evaluated that leaves a recipe, else None.
    """

    def __init__(self, ctx: Context, recording: object = None) -> None:
        self.ctx, self.recording = ctx, recording
        self.files: dict[tuple[Sdf.Path, str], TextureFile] = {}  # resolved files, by node and input
        self._prims: dict[Sdf.Path, AuthoredPrim] = {}

    @property
    def prims(self) -> Iterable[AuthoredPrim]:
        """The prims that have been read."""
        return self._prims.values()

    def at(self, path: Sdf.Path) -> AuthoredPrim | None:
        """Return what is authored on the prim at a path, None where there is no prim."""
        known = self._prims.get(path)
        if known is None and (prim := self.ctx.stage.GetPrimAtPath(path)):
            known = self._add(prim, path)
        return known

    def prim(self, prim: Usd.Prim) -> AuthoredPrim:
        """Return what is authored on a prim."""
        path = prim.GetPath()
        known = self._prims.get(path)
        return self._add(prim, path) if known is None else known

    def _add(self, prim: Usd.Prim, path: Sdf.Path) -> AuthoredPrim:
        made = self._prims[path] = AuthoredPrim(prim, path, self.ctx.when, self.ctx.caches.shader_ids.get(path))
        return made

    def node(self, prim: Usd.Prim) -> Node:
        """Return a shader as a node, of which no output is named."""
        return Node(self.prim(prim), "", self)

    def source(self, attribute: AuthoredAttribute | None) -> Constant | Node | None:
        """Return what gives an attribute its value: a constant or a node; None where nothing does."""
        return None if attribute is None else self._follow(attribute, ())

    def _follow(self, attribute: AuthoredAttribute, passed: tuple[AuthoredAttribute, ...]) -> Constant | Node | None:
        """Follow connections from an attribute; `passed`: the attributes on the way to it."""
        if attribute in passed:
            self._note(attribute, "Its connections form a cycle and are ignored.")
            return None
        sources = attribute.connections
        if len(sources) > 1:
            self._note(attribute, "It has several connections: only the first is used.")
        if sources:
            found = self._target(attribute, sources[0], passed)
            if found is not None:
                return found
        if attribute.value is not None:
            return Constant(attribute, attribute.value)
        node = attribute.default_node
        return None if node is None else Node(self.prim(node), "out", self)

    def _target(
        self, attribute: AuthoredAttribute, path: Sdf.Path, passed: tuple[AuthoredAttribute, ...]
    ) -> Constant | Node | None:
        at, name = self.at(path.GetPrimPath()), path.name
        if at is not None:
            is_output = name.startswith("outputs:")
            if is_output and at.is_shader:
                return Node(at, name.removeprefix("outputs:"), self)
            further = at.attribute(name)
            if further is not None and (is_output or name.startswith(INPUT)):
                return self._follow(further, (*passed, attribute))
        self._note(attribute, f"It is connected to {path}, which is no input or output of a shading node.")
        return None

    def _note(self, attribute: AuthoredAttribute, message: str) -> None:
        self.ctx.warn("shader-connection", self.ctx.shown(str(attribute.attribute.GetPrimPath())), message, attribute.name)


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
    at, own = source.attribute.attribute, source.attribute.color_space
    rgb = color_in_rendering_space((r, g, b), at, scope_of(at, ctx), ctx, own=own)
    return (*rgb, *values[3:])
