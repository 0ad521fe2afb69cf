"""Prims that opinions written to a copy of a stage reach besides those they are written for.

USD composes a prim's opinions into every prim of the same layer stack that references, inherits or specializes it, or has it as
a payload; and opinions below a native instance, which USD ignores, count as soon as the prim is no instance any more. In both
cases the copy is no longer the stage with one edit. Pcp itself is asked which prims compose which opinions.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from pxr import Pcp, Sdf, Usd

from ..querying.model_marks import mark_models, models_below
from ..querying.traversal import prims_in

# Fields whose opinions are merged with weaker ones, which they do not hide.
_MERGED = frozenset({"apiSchemas", "connectionPaths", "customData", "inheritPaths", "targetPaths"})

_BY_ARCS = Pcp.DependencyTypeAnyNonVirtual & ~Pcp.DependencyTypeRoot
Fields = set[tuple[str, str]]


class OpinionsLeak(Exception):
    """Raised where opinions written for one prim count, or would count, for another."""


def check_reach(stage: Usd.Stage, layers: Iterable[Sdf.Layer] = ()) -> None:
    """Raise OpinionsLeak if any prim composes opinions in these layers that are at another prim's path.

    `layers` belong to the stage's session; by default its session layer is checked. An opinion that is hidden by a stronger one
    of the other prim does no harm.
    """
    written = tuple(layers) or (stage.GetSessionLayer(),)
    for path in dict.fromkeys(path for layer in written for path in prims_in(layer)):
        if (others := composers(stage, path)) and (fields := _fields(written, path)):
            for other in others:
                if not _hide(_fields(written, other), fields):
                    raise OpinionsLeak(f"{other} composes what is written to {path}")


def composers(stage: Usd.Stage, path: Sdf.Path) -> set[Sdf.Path]:
    """Return the other prims that compose the opinions at a path of the stage's own layers."""
    cache = stage._GetPcpCache()
    found = cache.FindSiteDependencies(cache.layerStack, path, _BY_ARCS, False, False, False)
    return {dependency.indexPath for dependency in found} - {path}


def end_instance(instance: Usd.Prim) -> None:
    """Make a native instance a plain prim, whose descendants can be edited; raise OpinionsLeak if others would change.

    The opinion is written to the stage's edit target; models inside the instance stay models.
    """
    if has_ignored_opinions(instance):
        raise OpinionsLeak(f"opinions below the instance {instance.GetPath()} would count")
    models = models_below(instance)
    instance.SetInstanceable(False)
    mark_models(instance.GetStage(), models)


def has_ignored_opinions(instance: Usd.Prim) -> bool:
    """Return whether there are opinions on descendants of a native instance that USD ignores.

    Opinions that count come by arcs on the instance itself (UsdPrim::IsInstance, Pcp/instancing.h); those at the instance's own
    path, and at paths that arcs on its ancestors lead to, do not.
    """
    nodes = [instance.GetPrimIndex().rootNode]
    while nodes:
        node = nodes.pop()
        if not (node.IsRootNode() or node.IsDueToAncestor()):
            continue
        specs = (layer.GetPrimAtPath(node.path) for layer in node.layerStack.layers)
        if any(spec and spec.nameChildren for spec in specs):
            return True
        nodes += node.children
    return False


def _fields(layers: Sequence[Sdf.Layer], path: Sdf.Path) -> Fields:
    """Return the fields that these layers author at a prim's path, as pairs of property name ("" for the prim itself) and field
    name."""
    found: Fields = set()
    for layer in layers:
        spec = layer.GetPrimAtPath(path)
        if spec:
            found.update(("", str(key)) for key in spec.ListInfoKeys())
            found.update((str(each.name), str(key)) for each in spec.properties for key in each.ListInfoKeys())
            if spec.specifier == Sdf.SpecifierOver:
                found.discard(("", "specifier"))
    return found


def _hide(own: Fields, others: Fields) -> bool:
    return others <= own and not any(field in _MERGED for _, field in others)
