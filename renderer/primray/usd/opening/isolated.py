"""A stage in which each prim is its own: what is written to one prim reaches no other.

It has the composed values of another stage and none of its arcs but one: native instances refer to the prototypes that they
share, which nothing else names. So it is what a render edits where opinions would leak in a copy of the stage's layers (reach).
"""

from __future__ import annotations

from collections.abc import Callable

from pxr import Sdf, Usd, UsdShade

from ..querying.guarded import authored_attributes, default_value, type_name
from ..querying.stage_values import (
    authored_meters_per_unit,
    authored_up_axis,
    end_time_code,
    frames_per_second,
    render_settings_path,
    stage_value,
    start_time_code,
    time_codes_per_second,
)
from ..querying.traversal import attributes_in, populated
from .select_prims import populate

_METADATA: dict[str, Callable[[Usd.Stage], float | str]] = {
    "metersPerUnit": authored_meters_per_unit,
    "upAxis": authored_up_axis,
    "timeCodesPerSecond": time_codes_per_second,
    "framesPerSecond": frames_per_second,
    "startTimeCode": start_time_code,
    "endTimeCode": end_time_code,
}
_MAY_NAME_TILES = frozenset({"Shader", "Material", "NodeGraph"})


def isolated(stage: Usd.Stage) -> Usd.Stage:
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
    """Write what a render takes a stage's metadata for where they are of wrong types: UsdStage::Flatten drops those."""
    for name, taken_as in _METADATA.items():
        if stage_value(stage, name) is not None:
            flat.pseudoRoot.SetInfo(name, taken_as(stage))
    if (settings := render_settings_path(stage)) is not None:
        flat.pseudoRoot.SetInfo("renderSettingsPrimPath", settings)


def _anchor_tiles(stage: Usd.Stage, flat: Sdf.Layer, place: Callable[[Sdf.Path], Sdf.Path]) -> None:
    """Name sets of tiles by their resolved paths: UsdStage::Flatten resolves those of single files alone."""
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
    """Let path expressions in prototypes name the flattened ones: UsdStage::Flatten maps targets, and no expressions."""
    for prototype in [prim.GetPath() for prim in stage.GetPrototypes()]:
        flattened = place(prototype)
        for attribute in attributes_in(flat, flattened):
            if isinstance(attribute.default, Sdf.PathExpression):
                attribute.default = attribute.default.ReplacePrefix(prototype, flattened)


def _placed_in(stage: Usd.Stage, flat: Sdf.Layer) -> Callable[[Sdf.Path], Sdf.Path]:
    """Where the flattened layer has what is at a path of the stage, which may be in a native prototype."""
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
