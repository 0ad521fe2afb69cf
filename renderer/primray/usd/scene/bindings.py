"""Material bindings: those that lead nowhere, collections, and subsets of a mesh with materials."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pxr import Sdf, Tf, Usd, UsdShade

from ..stage.messages import tf_message
from ..stage.reads import default_value, metadatum, property_names, targets, type_name
from ..stage.traversal import EXISTING_IN_INSTANCES, children

if TYPE_CHECKING:
    from .context import CollectionBindings, Context

BINDING = "material:binding"
NO_MATERIAL = "which is not a Material"
FACE, TETRAHEDRON, SEGMENT = "face", "tetrahedron", "segment"
# Element types that subsets may hold, by the type of their prim; faces for all other types.
ELEMENTS = {"TetMesh": (FACE, TETRAHEDRON), "BasisCurves": (SEGMENT,)}


@dataclass(frozen=True)
class Subset:
    """A GeomSubset of faces, of tetrahedra, or of segments of curves; a later one in its mesh's list is stronger."""

    path: str
    prim: Usd.Prim
    family: str = ""
    material: Usd.Prim | None = None
    element: str = FACE


def note_bindings(prim: Usd.Prim, path: str, names: tuple[str, ...], ctx: Context) -> list[list[Sdf.Path]]:
    """Return the targets of these bindings, of any purpose, and report those that are no material."""
    found, known = [targets(prim, name) for name in names], ctx.caches.binding_faults
    for name, led_to in zip(names, found, strict=True):
        if is_collection(name) and led_to:
            _note_members(led_to[0], prim.GetPath(), ctx)
        for target in led_to:
            if target not in known:
                known[target] = _fault_of(target, ctx) if target.IsPrimPath() else ""
            wrong = known[target]
            if wrong and not (wrong == NO_MATERIAL and is_collection(name)):
                ctx.warn("binding-missing", path, f"{name} leads to {ctx.shown(str(target))}, {wrong}.", name)
    return found


def _note_members(collection: Sdf.Path, bound_at: Sdf.Path, ctx: Context) -> None:
    """Record below which prims only some are members of the collection, or may be where it is an expression."""
    bindings = ctx.findings.collection_bindings
    if collection not in bindings.is_expression:
        bindings.is_expression[collection] = _look_into(collection, bound_at, bindings, ctx)
    if bindings.is_expression[collection]:  # evaluated below each prim that binds it
        bindings.expressed.add(bound_at)


def _look_into(collection: Sdf.Path, bound_at: Sdf.Path, bindings: CollectionBindings, ctx: Context) -> bool:
    """Add the prims below which some are members and some are not; return whether the collection is an expression."""
    try:
        api = Usd.CollectionAPI.GetCollection(ctx.stage, collection)
        rules = api.ComputeMembershipQuery().GetAsPathExpansionRuleMap() if api else {}
    except Tf.ErrorException as error:
        ctx.warn("wrong-type", ctx.shown(str(bound_at)), f"{collection} cannot be read as a collection: {tf_message(error)}")
        return False
    for path, rule in rules.items():
        above = path if rule == Usd.Tokens.explicitOnly else path.GetParentPath()
        bindings.has_members_below.update(above.GetPrefixes())
    expression = default_value(api.GetMembershipExpressionAttr()) if api else None
    return isinstance(expression, Sdf.PathExpression) and not expression.IsEmpty()


def binds_by_collection(prim: Usd.Prim, ctx: Context) -> bool:
    """Return whether a prim or one of its ancestors binds materials by a collection; record what these hold.

    It is for the ancestors of a point instancer's prototype below `class` and `over`, which no walk visits.
    """
    found = False
    while prim and not prim.IsPseudoRoot():
        for name in filter(is_collection, binding_names(frozenset(property_names(prim)))):
            found = True
            if led_to := targets(prim, name):
                _note_members(led_to[0], prim.GetPath(), ctx)
        prim = prim.GetParent()
    return found


def strengths_of(prim: Usd.Prim, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return how strong each of these bindings of a prim is, as authored."""
    found = map(prim.GetRelationship, names)
    return tuple(str(metadatum(relationship, "bindMaterialAs")) if relationship else "" for relationship in found)


def binding_names(names: frozenset[str]) -> tuple[str, ...]:
    """Return the properties among these that bind materials."""
    return tuple(sorted(name for name in names if name.startswith(BINDING)))


def _fault_of(target: Sdf.Path, ctx: Context) -> str:
    found = ctx.stage.GetPrimAtPath(target)
    if not found:
        return "which does not exist"
    return "" if found.IsA(UsdShade.Material) else NO_MATERIAL


def is_collection(name: str) -> bool:
    """Return whether a binding is by collection: its first target is the collection, or a prim whose default collection it
    is."""
    return ":collection:" in name


def subsets_of(mesh: Usd.Prim, ctx: Context) -> list[Subset]:
    """Return the subsets that have a material: those of the family materialBind, and any others that bind one.

    Hydra's renderers accept subsets of any family; materialBind is the family meant for it and wins where both hold a face.
    """
    others: list[Subset] = []
    meant: list[Subset] = []
    for child in children(mesh, EXISTING_IN_INSTANCES):
        if type_name(child) != "GeomSubset":
            continue
        names = frozenset(property_names(child))
        path = ctx.shown(str(child.GetPath()))
        family = str(default_value(child.GetAttribute("familyName")) or "")
        is_meant = family == UsdShade.Tokens.materialBind
        if not is_meant and not any(name.startswith(BINDING) for name in names):
            continue
        note_bindings(child, path, binding_names(names), ctx)
        element = str(default_value(child.GetAttribute("elementType")))
        kind = type_name(mesh)
        if element not in ELEMENTS.get(kind, (FACE,)):
            meant_for = " or ".join(ELEMENTS.get(kind, (FACE,)))
            ctx.warn("subset-ignored", path, f"It holds elements of the type {element}, not {meant_for}s.", "elementType")
            continue
        (meant if is_meant else others).append(Subset(path, child, family, element=element))
    return others + meant
