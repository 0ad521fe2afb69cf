"""Facts about a stage before translation: layers, variants, payloads, prims, times. For `primray inspect`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any

from pxr import Usd, UsdGeom

from ..stage.messages import scene_errors
from ..stage.metadata import (
    default_prim,
    end_time_code,
    frames_per_second,
    has_time_code_range,
    layer_names,
    meters_per_unit,
    start_time_code,
    time_codes_per_second,
    up_axis,
)
from ..stage.reads import default_value, purpose_of, targets, type_name
from ..stage.time_varying import earliest_value, span_of
from ..stage.traversal import all_prims, all_prims_in_prototypes


@scene_errors()
def stage_facts(stage: Usd.Stage) -> dict[str, Any]:
    """Return the facts as JSON. Prims of prototypes are counted once, whatever the number of their instances."""
    prims = all_prims(stage)
    every = prims + all_prims_in_prototypes(stage)
    return {
        "layers": layer_names(stage),
        "default_prim": default_prim(stage),
        "up_axis": up_axis(stage),
        "meters_per_unit": meters_per_unit(stage),
        "time": _time(stage, every),
        "variants": list(_variants(prims)),
        "payloads": _payloads(stage),
        "prim_types": dict(Counter(str(type_name(prim)) for prim in every if type_name(prim)).most_common()),
        "purposes": dict(Counter(purpose_of(prim) for prim in every if prim.IsA(UsdGeom.Gprim)).most_common()),
        "native_instances": sum(prim.IsInstance() for prim in every),
        "native_prototypes": len(stage.GetPrototypes()),
        "point_instancers": [_instancer(prim) for prim in every if prim.IsA(UsdGeom.PointInstancer)],
        "draw_modes": list(_draw_modes(prims)),
    }


def _time(stage: Usd.Stage, prims: list[Usd.Prim]) -> dict[str, Any]:
    """Return times of the stage; `start` and `end` are None if not authored, `sampled` is the range of values over time."""
    authored = has_time_code_range(stage)
    span = (start_time_code(stage), end_time_code(stage)) if authored else (None, None)
    sampled = span_of(stage, prims)
    return {
        "start": span[0],
        "end": span[1],
        "time_codes_per_second": time_codes_per_second(stage),
        "frames_per_second": frames_per_second(stage),
        "sampled": list(sampled) if sampled else None,
    }


def _variants(prims: list[Usd.Prim]) -> Iterator[dict[str, Any]]:
    for prim in prims:
        if prim.HasVariantSets():
            for name in prim.GetVariantSets().GetNames():
                chosen = prim.GetVariantSet(name)
                yield {
                    "prim": str(prim.GetPath()),
                    "set": name,
                    "selection": chosen.GetVariantSelection(),
                    "names": chosen.GetVariantNames(),
                }


def _payloads(stage: Usd.Stage) -> dict[str, Any]:
    loaded = set(stage.GetLoadSet())
    # Skip FindLoadable where everything is loaded: it visits every instance of every instance, which may be a thousand
    # million in a small file.
    all_loaded = stage.GetLoadRules() == Usd.StageLoadRules.LoadAll()
    unloaded = [] if all_loaded else sorted(str(path) for path in set(stage.FindLoadable()) - loaded)
    return {"loaded": sorted(map(str, loaded)), "unloaded": unloaded}


def _instancer(prim: Usd.Prim) -> dict[str, Any]:
    attribute = prim.GetAttribute("protoIndices")
    indices: Any = earliest_value(attribute) if attribute else None
    return {
        "path": str(prim.GetPath()),
        "instances": len(indices) if hasattr(indices, "__len__") else 0,
        "prototypes": [str(path) for path in targets(prim, "prototypes")],
    }


def _draw_modes(prims: list[Usd.Prim]) -> Iterator[dict[str, str]]:
    for prim in prims:
        attribute = prim.GetAttribute("model:drawMode")
        if attribute and attribute.HasAuthoredValue():
            yield {"prim": str(prim.GetPath()), "mode": str(default_value(attribute))}
