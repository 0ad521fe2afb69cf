"""Inherited state of a prim: transform, visibility, purpose, bound material, constant primvars, in USD's own terms.

`descend` computes a child's inherited state from its parent's; `bind_materials` asks USD for the bindings of many prims at
once.
"""

from __future__ import annotations

import math
from collections.abc import Container, Hashable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdShade

from ...arrays import Doubles
from ..motion.levels import Mover
from ..stage.edits import MODEL
from ..stage.reads import (
    default_value,
    element_size,
    interpolation,
    local_transform,
    local_transform_at,
    metadatum,
    property_names,
    world_transform,
)
from ..stage.time_varying import has_spline, scalar_operations
from ..stage.values import When, array, as_columns, is_single, number, read, time_of, value
from .bindings import BINDING, Subset
from .color_spaces import color_in_rendering_space, in_rendering_space, scope_below
from .context import NO_COLOR_SCOPE, ColorScope, Context
from .poses import ROOT, Poses

_IDENTITY = Gf.Matrix4d(1.0)
_PURPOSE_VISIBILITY = {f"{purpose}Visibility": purpose for purpose in ("guide", "proxy", "render")}
BLUR_SCALE = "motion:blurScale"
VISIBILITIES = frozenset({"visibility", *_PURPOSE_VISIBILITY})
_OF_IMAGEABLES = VISIBILITIES | {"purpose"}
_HANDED = _OF_IMAGEABLES | {"primvars:displayColor", "primvars:displayOpacity", BLUR_SCALE}
_HANDED |= {"model:drawMode", "model:cardVisibility"}
_CONSTANT = (None, "constant")  # a primvar's interpolation where nothing is authored, and the token


@dataclass(frozen=True)
class Binding:
    """A bound material; `stronger`: it overrides bindings of descendants; `rank`: its purpose's index among those asked for."""

    material: Usd.Prim
    stronger: bool = False
    rank: int = 0


@dataclass(frozen=True, kw_only=True)
class Inherited:
    """The state that a prim hands down. `outer` is the binding of the instance whose prototype is being walked.

    `proxy` is the path of that instance where a collection with a material distinguishes prims inside it; then prims are bound
    as its proxies are, and `outer` is what is bound around that instance's own prototype, if it is in one.
    """

    purpose: str = "default"
    draw_mode: str = "default"  # the nearest model:drawMode, whether or not it is applied
    card_visibility: str = "full"  # the nearest model:cardVisibility
    outer: Binding | None = None
    proxy: str = ""
    color: tuple[float, float, float] | None = None  # the nearest constant primvars:displayColor, the prim's own included
    opacity: float | None = None  # likewise primvars:displayOpacity
    primvars: tuple[tuple[str, tuple[float, ...]], ...] = ()  # constant ones that a material of the stage reads, likewise
    many: frozenset[tuple[str, int]] = frozenset()  # inherited constant primvars with several values, and how many
    per_instance: frozenset[str] = frozenset()  # primvars of which each surrounding instance has one value
    hidden: frozenset[str] = frozenset()  # such primvars that a nearer, unusable one hides
    colors: ColorScope = NO_COLOR_SCOPE
    outer_colors: tuple[tuple[str, ColorScope], ...] = ()  # colour spaces that surrounding instances hand to prototypes
    # For light linking (light_links.py): the instance whose proxies stand for the prims of a prototype; what the surrounding
    # point instancers say, by collection.
    seen_as: str = ""
    linked_by_instancers: tuple[tuple[int, bool], ...] = ()
    invisible: frozenset[str] = frozenset()  # purposes that VisibilityAPI hides, by the nearest opinion on each
    blur_scale: float = 1.0  # the nearest motion:blurScale, where the shutter is open
    # What the native prototype inherits, for point instancers in it whose prototypes may be elsewhere in it.
    top: Inherited | None = None


@dataclass(slots=True)
class ResolvedPrim:
    """A prim and what it inherits. Mutable: a stage may have millions, and materials are found last."""

    prim: Usd.Prim
    path: str
    type_name: str
    names: frozenset[str]  # authored properties
    inherited: Inherited = field(compare=False)
    poses: Poses = field(compare=False)
    pose: int = ROOT  # index into `poses`
    bound_as: Hashable = ""  # for shapes: leaf_materials.bound_alike
    material: Usd.Prim | None = None
    subsets: tuple[Subset, ...] = ()
    own_color: bool = False  # the colour in `inherited` is authored on it: one for all of it
    mover: Mover | None = None  # the moving space that `poses` are in; None: they are in the group's

    @property
    def group_from_prim(self) -> Doubles:
        """Matrix (4, 4) to the world, or to the prototype's space inside one; for a moving prim, to the mover's."""
        return self.poses.at(self.pose)


def local_matrix(prim: Usd.Prim, names: frozenset[str], when: When, cache: UsdGeom.XformCache) -> tuple[Gf.Matrix4d, bool]:
    """Return the prim's local transform and whether it resets the stack; values without a default are read at their earliest
    time."""
    if "xformOpOrder" not in names:
        return _IDENTITY, False
    if not reads_early(prim, names, when):
        return local_transform(cache, prim)
    return local_transform_at(prim, lambda attribute: time_of(attribute, when))


def transforms(when: When) -> UsdGeom.XformCache:
    """Return a cache for `local_matrix` and `world_matrix`, at the default time where there is no frame."""
    return UsdGeom.XformCache(when.time)


def world_matrix(prim: Usd.Prim, when: When, cache: UsdGeom.XformCache) -> Gf.Matrix4d:
    """Return world_from_prim as a row-vector matrix; values without a default are read at their earliest time."""
    upwards = [(each, frozenset(property_names(each))) for each in _upwards(prim)]
    if not (when.is_default and any(reads_early(each, names, when) for each, names in upwards)):
        at_once = world_transform(cache, prim)
        if at_once is not None:
            return at_once
    world = Gf.Matrix4d(1.0)
    for each, names in upwards:
        local, resets = local_matrix(each, names, when, cache)
        world = world * local
        if resets:
            break
    return world


def _upwards(prim: Usd.Prim) -> Iterator[Usd.Prim]:
    """Return the prim and its ancestors, without the pseudo-root."""
    while prim and not prim.IsPseudoRoot():
        yield prim
        prim = prim.GetParent()


def reads_early(prim: Usd.Prim, names: frozenset[str], when: When) -> bool:
    """Return whether the prim's local transform may have to be read at its earliest values; splines only occur on scalars."""
    if when.careful or not when.is_default:
        return when.careful
    scalars = scalar_operations(names)
    return bool(scalars) and any(has_spline(prim.GetAttribute(name)) for name in scalars)


def is_drawn(inherited: Inherited, purposes: Container[str]) -> bool:
    """Return whether a shape's purpose is rendered and visible."""
    return inherited.purpose in purposes and inherited.purpose not in inherited.invisible


def hands_down(names: frozenset[str], schemas: list[str], ctx: Context) -> bool:
    """Return whether prims with these authored names and schemas may change the state that they inherit."""
    return not names.isdisjoint(_HANDED | ctx.primvars_read) or any(s.startswith("ColorSpace") for s in schemas)


def effective_names(prim: Usd.Prim, names: frozenset[str]) -> frozenset[str]:
    """Return those of a prim's authored names that affect what it hands down.

    Visibility and purpose belong to UsdGeomImageable: USD ignores them on prims without a type, on types without a schema, on
    materials. The answer depends on the prim's type alone.
    """
    return names if names.isdisjoint(_OF_IMAGEABLES) or prim.IsA(UsdGeom.Imageable) else names - _OF_IMAGEABLES


def descend(parent: Inherited, prim: Usd.Prim, names: frozenset[str], schemas: list[str], ctx: Context) -> Inherited | None:
    """Return what `prim` hands down, or None if it and everything below it is invisible.

    `names` are the authored ones that count (`names_that_count`), `schemas` those applied to it.
    """
    when = ctx.when
    if "visibility" in names and read(prim, "visibility", when) == "invisible":
        return None
    mine = parent
    if schemas and (colors := scope_below(parent.colors, prim, schemas, ctx)) is not parent.colors:
        mine = replace(mine, colors=colors)
    if "purpose" in names:
        purpose = default_value(prim.GetAttribute("purpose"))
        if isinstance(purpose, str):
            mine = replace(mine, purpose=purpose)
        elif purpose is not None:
            Tf.Warn(f"The purpose of {prim.GetPath()} is {purpose!r}, not a token: it is ignored.")
    if not names.isdisjoint(_PURPOSE_VISIBILITY):
        mine = _with_purpose_visibility(mine, prim, names)
    if BLUR_SCALE in names and not ctx.timing.is_frame and "MotionAPI" in schemas:
        mine = replace(mine, blur_scale=_blur_scale(prim, ctx))
    # UsdGeomModelAPI: opinions of prims that are not models do not count.
    if "model:drawMode" in names and (prim.IsModel() or MODEL in names):
        mode = read(prim, "model:drawMode", when)
        mine = replace(mine, draw_mode=mode) if isinstance(mode, str) and mode != "inherited" else mine
    if "model:cardVisibility" in names:
        shown = read(prim, "model:cardVisibility", when)
        mine = replace(mine, card_visibility=shown) if isinstance(shown, str) and shown != "inherited" else mine
    if "primvars:displayColor" in names:
        attribute = prim.GetAttribute("primvars:displayColor")
        color, count = constant_of(attribute, 3, names, when)
        if color is not None:
            mine = _with_count(mine, "primvars:displayColor", count)
            mine = _colored(mine, color_in_rendering_space((color[0], color[1], color[2]), attribute, mine.colors, ctx), ctx)
        elif (mine.color is not None or "displayColor" in mine.per_instance) and is_nearest(attribute):
            mine = _colored(mine, None, ctx)
    if "primvars:displayOpacity" in names:
        attribute = prim.GetAttribute("primvars:displayOpacity")
        opacity, count = constant_of(attribute, 1, names, when)
        if opacity is not None:
            mine = replace(_with_count(mine, "primvars:displayOpacity", count), opacity=opacity[0])
        elif (mine.opacity is not None or "displayOpacity" in mine.per_instance) and is_nearest(attribute):
            mine = _hiding(replace(mine, opacity=None), "displayOpacity")
    read_names = ctx.primvars_read
    return mine if names.isdisjoint(read_names) else _with_primvars(mine, prim, names & read_names, ctx)


def _blur_scale(prim: Usd.Prim, ctx: Context) -> float:
    """Return the prim's motion:blurScale (UsdGeomMotionAPI), at least 0, which means no blur."""
    scale = number(prim, BLUR_SCALE, ctx.when, 1.0, ctx.diagnostics)
    if scale < 0:
        message = f"{BLUR_SCALE} = {scale:g} is negative: 0 is used."
        ctx.warn("out-of-range", ctx.shown(str(prim.GetPath())), message, BLUR_SCALE)
    ctx.findings.blur_scales.add(max(scale, 0.0))
    return max(scale, 0.0)


def _with_purpose_visibility(parent: Inherited, prim: Usd.Prim, names: frozenset[str]) -> Inherited:
    """Apply UsdGeomVisibilityAPI: the nearest authored opinion counts, and "inherited" hides nothing
    (ComputeEffectiveVisibility).

    Without an opinion a purpose that is rendered is visible, guides included: the schema leaves that to the "calling context"
    for the others, and guides are only rendered on request.
    """
    if not prim.HasAPI(UsdGeom.VisibilityAPI):
        return parent
    invisible = set(parent.invisible)
    for name, purpose in _PURPOSE_VISIBILITY.items():
        opinion = default_value(prim.GetAttribute(name)) if name in names else None
        if opinion == "invisible":
            invisible.add(purpose)
        elif opinion is not None:
            invisible.discard(purpose)
    return replace(parent, invisible=frozenset(invisible))


def is_nearest(attribute: Usd.Attribute) -> bool:
    """Return whether a primvar ends the search for its name upwards.

    UsdGeomPrimvarsAPI skips only those without an authored value, and a primvar that varies over its prim is not inherited.
    """
    return bool(attribute and attribute.HasAuthoredValue())


def _with_primvars(parent: Inherited, prim: Usd.Prim, names: frozenset[str], ctx: Context) -> Inherited:
    handed, mine = dict(parent.primvars), parent
    for name in names:
        short = name.removeprefix("primvars:")
        values, count = constant_numbers(prim, name, ctx.when)
        if values is not None:
            mine = _with_count(mine, name, count)
            if name in ctx.color_primvars and len(values) >= 3:
                rgb = in_rendering_space(np.array(values[:3]), prim.GetAttribute(name), parent.colors, ctx)
                values = (*rgb.tolist(), *values[3:])
            handed[short] = values
        elif (short in handed or short in mine.per_instance) and is_nearest(prim.GetAttribute(name)):
            handed.pop(short, None)
            mine = _hiding(mine, short)
    return replace(mine, primvars=tuple(sorted(handed.items())))


def _hiding(mine: Inherited, name: str) -> Inherited:
    """Return what a prim hands down where its own primvar, unusable below it, ends the search for one of this name."""
    if name not in mine.per_instance:
        return mine
    return replace(mine, per_instance=mine.per_instance - {name}, hidden=mine.hidden | {name})


def _with_count(mine: Inherited, name: str, count: int) -> Inherited:
    """Return the state with the number of elements of the constant primvar that it hands down, where that is not one."""
    if count == 1 and not mine.many:
        return mine
    others = frozenset(item for item in mine.many if item[0] != name)
    return replace(mine, many=others if count == 1 else others | {(name, count)})


def element_count(inherited: Inherited, name: str) -> int:
    """Return how many elements the inherited constant primvar has: the first one is used."""
    return next((count for of, count in inherited.many if of == name), 1)


def constant_numbers(prim: Usd.Prim, name: str, when: When) -> tuple[tuple[float, ...] | None, int]:
    """Return a constant primvar of one to four finite numbers, and how many elements it has; (None, 0) for any other."""
    primvar = UsdGeom.Primvar(prim.GetAttribute(name))
    if interpolation(primvar) != UsdGeom.Tokens.constant:
        return None, 0
    raw = value(primvar.GetAttr(), when)
    if raw is None:
        return None, 0
    values = as_columns([raw] if is_single(raw) else raw, element_size(primvar))
    if values is None or len(values) == 0:
        return None, 0
    at, count = _first_index(primvar, len(values), when)
    return tuple(values[at].tolist()) if 0 <= at < len(values) and np.isfinite(values[at]).all() else None, count


def _first_index(primvar: UsdGeom.Primvar, values: int, when: When) -> tuple[int, int]:
    """Return which value is used, and how many elements there are: the number of indices, if there are any."""
    if not primvar.IsIndexed():
        return 0, values
    indices = array(value(primvar.GetIndicesAttr(), when), 1, "i")
    return (int(indices[0]), len(indices)) if indices is not None and len(indices) else (0, values)


def _colored(mine: Inherited, rgb: tuple[float, float, float] | None, ctx: Context) -> Inherited:
    """Return what a prim hands down with this colour, or with none: the same object for all children with the same colour."""
    colored = ctx.caches.colored
    known: tuple[Inherited, Inherited] | None = colored.get((id(mine), rgb))
    if known is None:
        made = replace(mine, color=rgb)
        made = _hiding(made, "displayColor") if rgb is None else made
        known = colored[id(mine), rgb] = mine, made  # keeps the object of this id alive
    return known[1]


def constant_of(attribute: Usd.Attribute, columns: int, names: frozenset[str], when: When) -> tuple[list[float] | None, int]:
    """Return a constant primvar's value, and how many elements it has; None where it has no usable value.

    Only constant primvars are inherited (UsdGeomPrimvarsAPI).
    """
    if not attribute or metadatum(attribute, "interpolation") not in _CONSTANT:
        return None, 0
    values = array(value(attribute, when), columns, "f")
    if values is None or len(values) == 0:
        return None, 0
    at, count = 0, len(values)
    if f"{attribute.GetName()}:indices" in names:
        at, count = _first_index(UsdGeom.Primvar(attribute), count, when)
    if not 0 <= at < len(values):
        return None, 0
    row = values[at].tolist()
    numbers = [row] if columns == 1 else row
    return (numbers if all(map(math.isfinite, numbers)) else None), count


def as_bound(prim: Usd.Prim, inherited: Inherited) -> Usd.Prim:
    """Return the prim to ask for a binding: its proxy in the one instance that is walked, else the prim."""
    if not inherited.proxy or not prim.IsInPrototype():
        return prim
    path = prim.GetPath()
    return prim.GetStage().GetPrimAtPath(path.ReplacePrefix(path.GetPrefixes()[0], Sdf.Path(inherited.proxy))) or prim


def bind_materials(prims: list[Usd.Prim], purposes: tuple[str, ...]) -> list[Binding | None]:
    """Return the material bound to each prim within its namespace: by the first purpose that has one, last the general one."""
    found: list[Binding | None] = [None] * len(prims)
    for rank, purpose in enumerate(purposes):
        missing = [i for i, binding in enumerate(found) if binding is None or binding.rank > rank]
        if not missing:
            break
        materials, rels = _compute_bound([prims[i] for i in missing], purpose)
        for i, material, rel in zip(missing, materials, rels, strict=True):
            if material:
                found[i] = _first_by_rank(found[i], Binding(material.GetPrim(), _is_stronger(rel), _rank(rel, purposes)))
    return found


def _first_by_rank(a: Binding | None, b: Binding) -> Binding:
    return b if a is None or b.rank < a.rank else a


def _rank(rel: Usd.Relationship, purposes: tuple[str, ...]) -> int:
    """Return the rank of a binding's purpose. Asked for any purpose, USD returns the general binding where it has none
    (UsdShadeMaterialBindingAPI)."""
    purpose = _purpose(rel)
    return purposes.index(purpose) if purpose in purposes else len(purposes)


def _purpose(rel: Usd.Relationship) -> str:
    names = str(rel.GetName()).split(":")[2:]
    names = names[1:-1] if names[:1] == ["collection"] else names  # material:binding:collection:full:name
    return names[0] if names else ""


def _compute_bound(prims: list[Usd.Prim], purpose: str) -> tuple[list[UsdShade.Material], list[Usd.Relationship]]:
    """Return USD's bindings for all prims, and none for prims that it fails on, such as those whose binding is no
    relationship."""
    try:
        materials, rels = UsdShade.MaterialBindingAPI.ComputeBoundMaterials(prims, purpose)
        return list(materials), list(rels)
    except Tf.ErrorException:
        if len(prims) == 1:
            Tf.Warn(f"The material bound to {prims[0].GetPath()} cannot be read.")
            return [UsdShade.Material()], [Usd.Relationship()]
    half = len(prims) // 2
    parts = [_compute_bound(part, purpose) for part in (prims[:half], prims[half:])]
    return parts[0][0] + parts[1][0], parts[0][1] + parts[1][1]


def _is_stronger(rel: Usd.Relationship) -> bool:
    """Return whether a binding, or the direct binding that its collection replaced, is stronger than descendants'."""
    own = rel.GetPrim().GetRelationship(":".join(filter(None, (BINDING, _purpose(rel)))))
    strengths = [UsdShade.MaterialBindingAPI.GetMaterialBindingStrength(r) for r in (rel, own) if r]
    return bool(UsdShade.Tokens.strongerThanDescendants in strengths)


def inner_or_outer(inner: Binding | None, outer: Binding | None) -> Binding | None:
    """Return the binding that counts inside a prototype: the one of higher purpose; else the inner, unless the outer is
    stronger."""
    if inner is None or outer is None:
        return inner or outer
    if inner.rank != outer.rank:
        return min(inner, outer, key=lambda binding: binding.rank)
    return outer if outer.stronger else inner
