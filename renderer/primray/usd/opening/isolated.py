"""A flattened stage in which an edit of one prim reaches no other prim.

It has the composed values of another stage and only one kind of arc: native instances refer to the prototypes that they share,
which nothing else refers to. A render edits such a stage where its opinions would leak in a copy of the original layers
(reach.py).
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
    """Write stage metadata of wrong types as the values that a render uses for them: UsdStage::Flatten drops these."""
    for name, taken_as in _METADATA.items():
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
