"""Selection of what is composed: variants, payloads, the population mask, and session layers.

Choices are written to the stage's session layer, which is in memory: no file changes. A choice that does not exist is a
SettingsError that lists those that do.

Our session layer is stronger than those that a stage is opened with, and has their metadata: USD reads metadata of a stage
(expression variables, time codes per second, units, renderSettingsPrimPath) from its root layer and its session layer alone,
never from sublayers of either. Opinions of the layers below stay where they are, and their relative paths are still anchored to
them.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Any

from pxr import Ar, Sdf, Tf, Usd

from ...composition import Composition, VariantChoice
from ...diagnostics import Diagnostics
from ...errors import SettingsError
from .metadata import layer_value
from .reads import FAILURES
from .traversal import all_children

_LISTED = 20


def populate(
    root: Sdf.Layer, session: Sdf.Layer, context: Ar.ResolverContext | None, composition: Composition | None
) -> Usd.Stage:
    """Open the stage of these layers, without payloads if these are chosen later, and within the mask if there is one."""
    load = Usd.Stage.LoadAll if composition is None or composition.load is None else Usd.Stage.LoadNone
    if composition is None or composition.mask is None:
        return Usd.Stage.Open(root, session, context, load) if context is not None else Usd.Stage.Open(root, session, load)
    mask = Usd.StagePopulationMask([_prim_path(path, "mask") for path in composition.mask])
    if context is None:
        context = Ar.GetResolver().CreateDefaultContextForAsset(root.identifier)
    return Usd.Stage.OpenMasked(root, session, context, mask, load)


def add_load_rules(stage: Usd.Stage, load: tuple[str, ...] | None) -> None:
    """Load the payloads of these prims and of everything below them."""
    for path in load or ():
        try:
            stage.Load(_prim_path(path, "load"), Usd.LoadWithDescendants)
        except Tf.ErrorException:  # raised for paths whose parent does not exist either
            _prim(stage, path, "load")


def choose_variants(stage: Usd.Stage, choices: Iterable[VariantChoice]) -> None:
    """Apply the choices in order: an earlier one may bring the variant sets of a later one."""
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        for choice in choices:
            _choose(stage, choice)


def check_population(stage: Usd.Stage, composition: Composition) -> None:
    """Widen a mask by what its prims refer to, such as materials; raise SettingsError for paths that lead to no prim."""
    if composition.mask is not None:
        stage.ExpandPopulationMask()
    for what, paths in (("mask", composition.mask or ()), ("load", composition.load or ())):
        for path in paths:
            if not stage.GetPrimAtPath(_prim_path(path, what)):
                stage.SetPopulationMask(Usd.StagePopulationMask.All())  # so that the error can list the prims that exist
            _prim(stage, path, what)


def note_unloaded(stage: Usd.Stage, diagnostics: Diagnostics) -> None:
    for path in sorted(set(stage.FindLoadable()) - set(stage.GetLoadSet())):
        diagnostics.add("payloads-unloaded", str(path), "Its payload is not loaded.")


def _choose(stage: Usd.Stage, choice: VariantChoice) -> None:
    prim = _prim(stage, choice.prim, "variant")
    if prim.IsInstanceProxy():
        instance = prim
        while instance.IsInstanceProxy():
            instance = instance.GetParent()
        raise SettingsError(
            f"it is inside the instance {instance.GetPath()}, whose prims are shared; choose the variant on the instance",
            where=choice.prim,
            code="unknown-variant",
        )
    sets = prim.GetVariantSets().GetNames()
    if choice.set not in sets:
        raise _unknown(f"there is no variant set {choice.set}", "its variant sets", sets, choice.prim, "unknown-variant")
    names = prim.GetVariantSet(choice.set).GetVariantNames()
    if choice.name and choice.name not in names:
        raise _unknown(
            f"the variant set {choice.set} has no {choice.name}", "its variants", names, choice.prim, "unknown-variant"
        )
    if choice.name:
        prim.GetVariantSet(choice.set).SetVariantSelection(choice.name)
    else:
        prim.GetVariantSet(choice.set).BlockVariantSelection()


def _prim_path(path: str, what: str) -> Sdf.Path:
    if not Sdf.Path.IsValidPathString(path) or not Sdf.Path(path).IsAbsoluteRootOrPrimPath():
        raise SettingsError("it is not a prim path, such as /World/car", where=path, code=f"unknown-{what}")
    return Sdf.Path(path)


def _prim(stage: Usd.Stage, path: str, what: str) -> Usd.Prim:
    prim = stage.GetPrimAtPath(_prim_path(path, what))
    if not prim:
        nearest = _prim_path(path, what)
        while not stage.GetPrimAtPath(nearest):
            nearest = nearest.GetParentPath()
        below = [str(child.GetPath()) for child in all_children(stage.GetPrimAtPath(nearest))]
        raise _unknown("there is no such prim", f"below {nearest} there are", below, path, f"unknown-{what}")
    return prim


def _unknown(problem: str, what: str, names: list[str], where: str, code: str) -> SettingsError:
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return SettingsError(f"{problem}; {what}: {', '.join(names[:_LISTED]) or 'none'}{more}", where=where, code=code)


# Fields that USD composes from every layer of a stack: repeated in our layer, they would count twice.
_COMPOSED = frozenset({"subLayers", "subLayerOffsets", "layerRelocates", "primOrder", "primChildren"})
_VARIABLES = "expressionVariables"


def session_over(weaker: Sequence[Sdf.Layer], muted: Collection[str] = ()) -> Sdf.Layer:
    """Return a new session layer above these, strongest first, with their metadata repeated in it."""
    session = Sdf.Layer.CreateAnonymous("session.usda")
    session.subLayerPaths = [str(layer.identifier) for layer in weaker]
    _write(session, _metadata(weaker, muted))
    return session


def follow_session_layers(stage: Usd.Stage) -> None:
    """Update the metadata that `session_over` has repeated after edits of the layers below."""
    session = stage.GetSessionLayer()
    found = _metadata([layer for layer in map(Sdf.Layer.Find, session.subLayerPaths) if layer], stage.GetMutedLayers())
    before = {name: layer_value(session, name) for name in _metadata_names(session)}
    if found != before:
        with Sdf.ChangeBlock():
            for name in before.keys() - found.keys():
                session.pseudoRoot.ClearInfo(name)
            _write(session, {name: value for name, value in found.items() if before.get(name) != value})


def _write(session: Sdf.Layer, metadata: dict[str, Any]) -> None:
    for name, value in metadata.items():
        try:
            session.pseudoRoot.SetInfo(name, value)
        except FAILURES:  # a value whose type is not the schema's; reported for the layer that has it
            continue


def _metadata(layers: Sequence[Sdf.Layer], muted: Collection[str]) -> dict[str, Any]:
    """Compose the layers' metadata, strongest first. USD reads only the expression variables of a muted session layer."""
    found: dict[str, Any] = {}
    for layer in layers:
        for name in _metadata_names(layer):
            if name == _VARIABLES or layer.identifier not in muted:
                value = _anchored(layer_value(layer, name), layer)
                found[name] = _over(found[name], value) if name in found else value
    return found


def _metadata_names(layer: Sdf.Layer) -> list[str]:
    return [str(name) for name in layer.pseudoRoot.ListInfoKeys() if name not in _COMPOSED]


def _over(stronger: Any, weaker: Any) -> Any:
    """Compose two opinions as USD does: dictionaries entry by entry, all else by strength."""
    if not (isinstance(stronger, dict) and isinstance(weaker, dict)):
        return stronger
    both = {name: _over(stronger[name], weaker[name]) for name in stronger.keys() & weaker.keys()}
    return {**weaker, **stronger, **both}


def _anchored(value: Any, layer: Sdf.Layer) -> Any:
    """Return the value with relative asset paths made absolute, as the layer resolves them."""
    if isinstance(value, dict):
        return {name: _anchored(entry, layer) for name, entry in value.items()}
    if isinstance(value, Sdf.AssetPath) and value.path and not value.path.startswith("`"):
        return Sdf.AssetPath(str(layer.ComputeAbsolutePath(value.path)))
    return value
