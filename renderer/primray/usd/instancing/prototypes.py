"""Inherited state of a point instancer's prototype, below its instancer or anywhere else, also inside native instances.

Below the instancer it is what the instancer hands down, changed by the prims between the two. Elsewhere it goes by namespace,
as USD answers for the prototype's own prims: purpose, draw modes, primvars, bindings, colour spaces. Where namespace says
nothing about purpose or about a primvar, the instancer's counts, which is at the root of each instance (UsdGeomPointInstancer).
Visibility above a prototype's root does not count: artists hide prototypes that way.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from pxr import Usd

from ..scene.color_spaces import scope_at
from ..scene.context import NO_COLOR_SCOPE, Context
from ..scene.inheritance import VISIBILITIES, Inherited, descend, effective_names
from ..scene.schemas import applied_schemas
from ..stage.reads import property_names, type_name
from ..stage.traversal import find_below


def handed_to_prototype(
    handed: Inherited, instancer: Usd.Prim, root: Usd.Prim, top: Inherited | None, ctx: Context
) -> Inherited:
    """Return what the prototype at `root` inherits of an instancer that hands down `handed`.

    `root` may be the proxy of a prim in a native instance. `top` is what is handed to the native prototype that the instancer
    is in, None in the world.
    """
    is_below = root != instancer and root.GetPath().HasPrefix(instancer.GetPath())
    above = _above(root, instancer if is_below else None)
    if is_below:
        around = handed
        found = _descended(around, above, ctx)
    else:
        around = _by_namespace(top if root.IsInPrototype() else None)
        found = _with_colors_of(root, _combined(handed, _descended(around, above, ctx)), ctx)
        if not root.IsInPrototype():
            found = replace(found, outer=None, proxy="")
    inner_top: Inherited | None = top if root.IsInPrototype() else None
    if root.IsInstanceProxy():
        found = replace(found, proxy=_proxy(root, found.proxy))
        instance = max(k for k, prim in enumerate(above) if prim.IsInstance())
        inner_top = _descended(around, above[: instance + 1], ctx)
        root = root.GetPrimInPrototype()
    inner_top = inner_top if root.IsInPrototype() and _holds_instancers(root, ctx) else None
    return found if found.top is inner_top else replace(found, top=inner_top)


def _above(root: Usd.Prim, end: Usd.Prim | None) -> list[Usd.Prim]:
    """Return the prims above a root, outermost first, below `end` or the root of its namespace."""
    found: list[Usd.Prim] = []
    prim = root.GetParent()
    while prim and prim != end and not prim.IsPseudoRoot() and not prim.IsPrototype():
        found.append(prim)
        prim = prim.GetParent()
    return found[::-1]


def _descended(handed: Inherited, prims: Iterable[Usd.Prim], ctx: Context) -> Inherited:
    for prim in prims:
        names = effective_names(prim, frozenset(property_names(prim))) - VISIBILITIES
        handed = descend(handed, prim, names, applied_schemas(prim), ctx) or handed
    return handed


def _by_namespace(top: Inherited | None) -> Inherited:
    """Return the state at the root of a namespace, in the world or in a native prototype; a purpose of "" is unauthored."""
    if top is None:
        return Inherited(purpose="")
    return replace(top, purpose="") if top.purpose == "default" else top


def _combined(handed: Inherited, named: Inherited) -> Inherited:
    """Return what an instancer hands down combined with the state by namespace, which takes precedence."""
    return replace(
        handed,
        purpose=named.purpose or handed.purpose,
        draw_mode=named.draw_mode,
        card_visibility=named.card_visibility,
        color=handed.color if named.color is None else named.color,
        opacity=handed.opacity if named.opacity is None else named.opacity,
        primvars=tuple(sorted((dict(handed.primvars) | dict(named.primvars)).items())),
    )


def _with_colors_of(root: Usd.Prim, handed: Inherited, ctx: Context) -> Inherited:
    """Return the state with the colour spaces of the prototype's namespace (ColorSpaceAPI), wherever it is placed."""
    around = replace(ctx, outer_colors=handed.outer_colors)
    outer = handed.outer_colors
    instance = root
    while instance.IsInstanceProxy() and not instance.IsInstance():
        instance = instance.GetParent()
    if instance.IsInstance() and instance != root and (above := scope_at(instance, around)) is not NO_COLOR_SCOPE:
        outer = ((str(instance.GetPrototype().GetPath()), above), *outer)
    return replace(handed, colors=scope_at(root.GetParent(), around), outer_colors=outer)


def _proxy(root: Usd.Prim, around: str) -> str:
    """Return the path of the native instance that a proxy is in, in the stage where `around` is the instance around that."""
    inner = root.GetPrimInPrototype().GetPath()
    instance = str(root.GetPath()).removesuffix(str(inner)[len(str(inner.GetPrefixes()[0])) :])
    if not around or not root.IsInPrototype():
        return instance
    return around + instance[len(str(root.GetPath().GetPrefixes()[0])) :]


def _holds_instancers(root: Usd.Prim, ctx: Context) -> bool:
    """Return whether there are point instancers below a prim of a native prototype."""
    known, path = ctx.caches.holds_instancers, str(root.GetPath())
    if path not in known:
        known[path] = any(type_name(prim) == "PointInstancer" for prim in find_below(root))
    return known[path]
