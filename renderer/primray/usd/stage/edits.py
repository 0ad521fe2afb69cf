"""Edits of a render's own copy of a stage, and what else they affect.

USD composes a prim's opinions into every prim of the same layer stack that references, inherits or specializes it, or has it as
a payload; and opinions below a native instance, which USD ignores, count as soon as the prim is no instance any more. In both
cases the copy is no longer the stage with one edit: `check_reach` asks Pcp who composes which opinions. Where they leak, a
render edits a flattened stage, in which native instances share prototypes that nothing else refers to.

USD treats the root of a prototype as a group of models (UsdPrim::IsModel), whatever is above its instances. Models of an
instance that is ended are marked, so that their draw modes still count.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager

from pxr import Pcp, Sdf, Usd, UsdShade

from .composition import populate
from .metadata import (
    authored_meters_per_unit,
    authored_up_axis,
    end_time_code,
    frames_per_second,
    render_settings_path,
    stage_value,
    start_time_code,
    time_codes_per_second,
)
from .reads import authored_attributes, default_value, type_name
from .traversal import attributes_in, is_in_world, models_in, populated, prims_in

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


def deactivate(stage: Usd.Stage, paths: Collection[Sdf.Path]) -> None:
    """Deactivate these prims, and so everything below them; prims in native instances are named by their proxies."""
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        for path in topmost(paths):
            if stage.GetPrimAtPath(path):
                editable(stage, path).SetActive(False)


def editable(stage: Usd.Stage, path: Sdf.Path) -> Usd.Prim:
    """Return the prim at a path so that it can be edited: native instances around it are made plain prims."""
    prim = stage.GetPrimAtPath(path)
    while prim.IsInstanceProxy():
        for above in path.GetPrefixes():
            instance = stage.GetPrimAtPath(above)
            if instance.IsInstance() and not instance.IsInstanceProxy():
                end_instance(instance)
                break
        prim = stage.GetPrimAtPath(path)
    return prim


def topmost(paths: Collection[Sdf.Path]) -> list[Sdf.Path]:
    """Return the paths without those below another one, in order; never the pseudo-root."""
    among = frozenset(paths)
    return [path for path in sorted(among) if path != Sdf.Path.absoluteRootPath and not _has_above(path, among)]


def _has_above(path: Sdf.Path, paths: frozenset[Sdf.Path]) -> bool:
    return any(above in paths for above in path.GetPrefixes()[:-1])


MODEL = "primray:model"  # attribute that marks models of an ended instance


def models_below(instance: Usd.Prim) -> list[Sdf.Path]:
    """Return the paths of the models in a native instance that would not be models if it were ended."""
    if instance.IsGroup():
        return []
    prototype = instance.GetPrototype()
    root = prototype.GetPath()
    return [prim.GetPath().ReplacePrefix(root, instance.GetPath()) for prim in models_in(prototype)]


def mark_models(stage: Usd.Stage, paths: Iterable[Sdf.Path]) -> None:
    for path in paths:
        stage.GetPrimAtPath(path).CreateAttribute(MODEL, Sdf.ValueTypeNames.Bool).Set(True)


_STAGE_METADATA: dict[str, Callable[[Usd.Stage], float | str]] = {
    "metersPerUnit": authored_meters_per_unit,
    "upAxis": authored_up_axis,
    "timeCodesPerSecond": time_codes_per_second,
    "framesPerSecond": frames_per_second,
    "startTimeCode": start_time_code,
    "endTimeCode": end_time_code,
}
_MAY_NAME_TILES = frozenset({"Shader", "Material", "NodeGraph"})


def isolated_copy(stage: Usd.Stage) -> Usd.Stage:
    """Return the stage flattened, with the composed values and no arcs but those of native instances to their prototypes."""
    layer = stage.Flatten(addSourceFileComment=False)
    _keep_metadata(stage, layer)
    place = _placed_in(stage, layer)
    _anchor_tiles(stage, layer, place)
    _place_expressions(stage, layer, place)
    session = Sdf.Layer.CreateAnonymous("session.usda")
    made = populate(layer, session, stage.GetPathResolverContext(), None)
    made.SetInterpolationType(stage.GetInterpolationType())
    return made


def _keep_metadata(stage: Usd.Stage, flat: Sdf.Layer) -> None:
    """Write stage metadata of wrong types as the values that a render uses for them: UsdStage::Flatten drops these."""
    for name, taken_as in _STAGE_METADATA.items():
        if stage_value(stage, name) is not None:
            flat.pseudoRoot.SetInfo(name, taken_as(stage))
    if (settings := render_settings_path(stage)) is not None:
        flat.pseudoRoot.SetInfo("renderSettingsPrimPath", settings)


def _anchor_tiles(stage: Usd.Stage, flat: Sdf.Layer, place: Callable[[Sdf.Path], Sdf.Path]) -> None:
    """Replace paths of UDIM tile sets by resolved ones: UsdStage::Flatten resolves only those of single files."""
    for prim in populated(stage):
        if type_name(prim) not in _MAY_NAME_TILES:
            continue
        for attribute in authored_attributes(prim):
            if attribute.GetTypeName() != Sdf.ValueTypeNames.Asset:
                continue
            for spec in attribute.GetPropertyStack():
                if isinstance(spec, Sdf.AttributeSpec) and spec.HasDefaultValue():
                    _anchor(default_value(attribute), spec.layer, flat.GetAttributeAtPath(place(attribute.GetPath())))
                    break


def _anchor(asset: object, layer: Sdf.Layer, made: Sdf.AttributeSpec | None) -> None:
    if made and isinstance(asset, Sdf.AssetPath) and UsdShade.UdimUtils.IsUdimIdentifier(asset.path):
        made.default = Sdf.AssetPath(UsdShade.UdimUtils.ResolveUdimPath(asset.path, layer) or asset.path)


def _place_expressions(stage: Usd.Stage, flat: Sdf.Layer, place: Callable[[Sdf.Path], Sdf.Path]) -> None:
    """Rewrite path expressions in prototypes to name the flattened prims: UsdStage::Flatten maps targets only."""
    for prototype in [prim.GetPath() for prim in stage.GetPrototypes()]:
        flattened = place(prototype)
        for attribute in attributes_in(flat, flattened):
            if isinstance(attribute.default, Sdf.PathExpression):
                attribute.default = attribute.default.ReplacePrefix(prototype, flattened)


def _placed_in(stage: Usd.Stage, flat: Sdf.Layer) -> Callable[[Sdf.Path], Sdf.Path]:
    """Return a function from paths of the stage, also in native prototypes, to paths of the flattened layer."""
    roots: dict[Sdf.Path, Sdf.Path] = {}

    def place(path: Sdf.Path) -> Sdf.Path:
        root = path.GetPrefixes()[0]
        prototype = stage.GetPrimAtPath(root)
        if not prototype.IsPrototype():
            return path
        if root not in roots:
            instance = flat.GetPrimAtPath(place(prototype.GetInstances()[0].GetPath()))
            roots[root] = instance.referenceList.GetAddedOrExplicitItems()[0].primPath
        return path.ReplacePrefix(root, roots[root])

    return place


@contextmanager
def temporarily_defined(stage: Usd.Stage, paths: Iterable[str]) -> Iterator[None]:
    """Define these prims and their ancestors by opinions in the stage's session layer, and restore them on exit.

    The stage must be a copy that is ours to write to (scratch_copy). Prims in native prototypes cannot have opinions and are
    skipped.
    """
    layer = stage.GetSessionLayer()
    undefined = list(dict.fromkeys(path for prim in map(stage.GetPrimAtPath, paths) for path in _undefined_paths(prim)))
    _set_specifier(layer, undefined, Sdf.SpecifierDef)
    try:
        yield
    finally:
        _set_specifier(layer, undefined, Sdf.SpecifierOver)


def _undefined_paths(prim: Usd.Prim) -> list[Sdf.Path]:
    """Return the paths of the prim and its ancestors that are not defined."""
    if not prim or prim.IsInPrototype() or prim.IsInstanceProxy() or is_in_world(prim):
        return []
    stage = prim.GetStage()
    return [path for path in prim.GetPath().GetPrefixes() if stage.GetPrimAtPath(path).GetSpecifier() != Sdf.SpecifierDef]


def _set_specifier(layer: Sdf.Layer, paths: list[Sdf.Path], specifier: Sdf.Specifier) -> None:
    with Sdf.ChangeBlock():
        for path in paths:
            Sdf.CreatePrimInLayer(layer, path).specifier = specifier
