"""Facts about a stage: layers, variants, payloads, prims, times; for setting up a render: cameras, settings, lights, files.

The former are for `primray inspect`. They are cheap compared with composition: no geometry is read. Notes have the same words
as a render's diagnostics. Files that are missing are those of lights, and of textures of bound materials; others (of cards,
clips, hidden variants) are reported by their own readers.
"""

from __future__ import annotations

import math
import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any

from pxr import Sdf, Usd, UsdGeom, UsdShade

from ...diagnostics import Diagnostics
from ...settings import RenderSettings
from ..camera.camera import read_aperture
from ..camera.view import cameras_of
from ..lights.authored import TEXTURE, missing_texture_text
from ..lights.shaping import FILE as PROFILE
from ..lights.shaping import missing_text as missing_profile_text
from ..materials.materialx.filename_tokens import files_at, has_frame_token, has_tokens, tile_paths
from ..materials.texture_files import missing_text
from ..render_settings.render_settings import product_settings
from ..scene.notes import unrendered
from ..stage.messages import error_text, scene_errors
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
from ..stage.open import open_stage
from ..stage.reads import computed, default_value, purpose_of, shader_id, targets, type_name
from ..stage.time_varying import earliest_value, span_of
from ..stage.traversal import all_prims, all_prims_in_prototypes, world_prims
from ..stage.values import When, is_hidden, when_of, when_of_few
from ..translate import LIGHTS, SHAPES


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


MOST = 500  # items of each list: cameras, render settings, variants
# Types that are drawn: those with adapters, and those that the walk expands.
_DRAWN = frozenset(SHAPES) | {"PointInstancer", "Points", "Volume"}
# Types that are never reported: they are not drawn themselves, or are reported elsewhere.
_QUIET = frozenset(("Shader", "Material", "Scope", "Xform", "Camera", "NodeGraph", "GeomSubset", "PortalLight"))
MOST_OF_TYPE = 50
_MISSING = re.compile(
    r"Could not (?:open asset @(?P<asset>.*?)@ for (?P<arc>\w+) introduced by @(?P<by>.*?)@<(?P<prim>.*?)>"
    r"|load sublayer @(?P<sublayer>.*?)@ of layer @(?P<of>.*?)@)",
    re.DOTALL,
)


@dataclass(frozen=True)
class MissingLayer:
    layer: str  # USD's identifier of the layer that names it
    asset_path: str
    prim: str
    arc: str  # sublayer, reference, payload


@dataclass(frozen=True)
class Note:
    code: str
    prim: str
    detail: str
    severity: str
    attribute: str = ""


@dataclass(frozen=True)
class SceneFacts:
    facts: dict[str, Any]
    notes: list[Note]
    missing: list[MissingLayer]
    drawable: int  # prims that could appear in a picture, lights included
    used_layers: int


@scene_errors()
def scene_facts(path: str | os.PathLike[str]) -> SceneFacts:
    """Return facts about the stage whose root is this file; raise the errors of open_stage."""
    diagnostics = Diagnostics()
    stage = open_stage(path, diagnostics)
    missing = _missing_layers(stage)
    found = stage_facts(stage)
    prims = list(world_prims(stage))
    cameras = cameras_of(stage)
    settings = [prim for prim in prims if type_name(prim) == "RenderSettings"]
    unused = Diagnostics()
    when = when_of(stage, None)
    chosen = product_settings(stage, RenderSettings(), settings, when, unused)
    types: dict[str, int] = found["prim_types"]
    used_layers = sum(not layer.anonymous for layer in stage.GetUsedLayers())
    lights = sum(count for name, count in types.items() if name in LIGHTS)
    facts = {
        "cameras": [_camera(prim, when) for prim in cameras[:MOST]],
        "camera": _default_camera(chosen.camera, cameras),
        "resolution": list(chosen.resolution) if chosen.resolution else None,
        "render_settings": [_settings(prim) for prim in settings[:MOST]],
        "frame_range": _frame_range(found["time"]),
        "up_axis": found["up_axis"],
        "meters_per_unit": found["meters_per_unit"],
        "default_prim": found["default_prim"],
        "variants": [v | {"names": v["names"][:MOST]} for v in found["variants"][:MOST]],
        "counts": {
            "prims": sum(types.values()),
            "lights": lights,
            "cameras": len(cameras),
            "meshes": types.get("Mesh", 0),
            "native_instances": found["native_instances"],
            "point_instances": sum(instancer["instances"] for instancer in found["point_instancers"]),
            "layers": used_layers,
        },
        "prim_types": dict(list(types.items())[:MOST]),
    }
    note_missing_files(prims, diagnostics)
    _note_unrendered(prims, chosen.purposes, diagnostics)
    notes = [Note(d.code, d.prim_path, d.message, d.severity.value, d.attribute) for d in diagnostics]
    notes += _product_notes(settings)
    drawable = lights + sum(count for name, count in types.items() if name in _DRAWN)
    return SceneFacts(facts, notes, missing, drawable, used_layers)


def _missing_layers(stage: Usd.Stage) -> list[MissingLayer]:
    found = (_MISSING.search(error_text(error)) for error in stage.GetCompositionErrors())
    return [
        MissingLayer(said["of"], said["sublayer"], "", "sublayer")
        if said["sublayer"] is not None
        else MissingLayer(said["by"], said["asset"], said["prim"], said["arc"])
        for said in found
        if said is not None
    ]


def _camera(prim: Usd.Prim, when: When) -> dict[str, Any]:
    aspect = read_aperture(prim, when, Diagnostics()).aspect
    return {
        "path": str(prim.GetPath()),
        "name": prim.GetName(),
        "aspect": aspect if math.isfinite(aspect) else None,
        "projection": _text(prim, "projection") or "perspective",
    }


def _default_camera(asked: str | None, cameras: list[Usd.Prim]) -> str | None:
    paths = [str(prim.GetPath()) for prim in cameras]
    return asked if asked in paths else paths[0] if paths else None


def _settings(prim: Usd.Prim) -> dict[str, Any]:
    resolution = prim.GetAttribute("resolution")
    size = default_value(resolution) if resolution and resolution.HasAuthoredValue() else None
    products = [prim.GetStage().GetPrimAtPath(path) for path in _targets(prim, "products")]
    return {
        "path": str(prim.GetPath()),
        "resolution": _whole(size),
        "camera": next(iter(_targets(prim, "camera")), None),
        "products": [_product(product) for product in products[:MOST] if product],
    }


def _product(prim: Usd.Prim) -> dict[str, Any]:
    return {
        "path": str(prim.GetPath()),
        "name": _text(prim, "productName"),
        "type": _text(prim, "productType"),
        "vars": _targets(prim, "orderedVars")[:MOST],
    }


def _targets(prim: Usd.Prim, name: str) -> list[str]:
    return [str(path) for path in targets(prim, name)]


def _whole(size: Any) -> list[int] | None:
    """Return the numbers as a list of int; None where they are not numbers."""
    try:
        return [int(side) for side in size] if size is not None else None
    except (TypeError, ValueError, OverflowError):
        return None


def _text(prim: Usd.Prim, name: str) -> str:
    value = default_value(prim.GetAttribute(name))
    return str(value)[:1024] if value is not None else ""


def _frame_range(time: dict[str, Any]) -> dict[str, Any]:
    """Return the authored range, else that of the samples; `sampled` tells whether anything moves."""
    sampled = time["sampled"]
    start, end = (time["start"], time["end"]) if time["start"] is not None else (sampled or (None, None))
    return {"start": start, "end": end, "fps": time["frames_per_second"], "sampled": sampled is not None}


def _product_notes(settings: Iterable[Usd.Prim]) -> list[Note]:
    """Report product names that would lead out of the output folder: they are ignored."""
    notes = []
    for prim in settings:
        for path in _targets(prim, "products"):
            product = prim.GetStage().GetPrimAtPath(path)
            name = _text(product, "productName") if product else ""
            parts = PurePosixPath(name.replace("\\", "/")).parts
            if name and (name[0] in "/\\" or ".." in parts or re.match(r"[A-Za-z][A-Za-z0-9+.-]*:", name)):
                detail = "Its productName leads out of the output folder; it is ignored; the service names the files of a job."
                notes.append(Note("product-name-rewritten", path, detail, "warning"))
    return notes


def _note_unrendered(prims: list[Usd.Prim], purposes: tuple[str, ...], diagnostics: Diagnostics) -> None:
    """Report prims as a render does, at the stage's default time; only the first MOST_OF_TYPE of a type."""
    count: Counter[str] = Counter()
    for prim in prims:
        name = str(type_name(prim))
        if not name or name in _DRAWN or name in LIGHTS or count[name] >= MOST_OF_TYPE or name in _QUIET:
            continue
        found = unrendered(prim, name)
        if found is not None and (found[0] != "unsupported-prim" or _is_shown(prim, purposes)):
            count[name] += 1
            diagnostics.add(found[0], str(prim.GetPath()), found[1])


def _is_shown(prim: Usd.Prim, purposes: tuple[str, ...]) -> bool:
    return purpose_of(prim) in purposes and not is_hidden(prim, when_of_few(None))


def layer_file(identifier: str) -> str:
    """Return the path of a layer from its identifier, without arguments; `package[member]` for one in a package."""
    return str(Sdf.Layer.SplitIdentifier(identifier)[0])


_TEXTURED = ("DomeLight", "DomeLight_1", "RectLight")
_PROFILED = ("SphereLight", "RectLight", "DiskLight", "CylinderLight")


def note_missing_files(prims: Iterable[Usd.Prim], diagnostics: Diagnostics) -> None:
    """Report missing files of these prims, which are in the world."""
    shaders, drawn = [], []
    for prim in prims:
        name = str(type_name(prim))
        if name == "Shader":
            shaders.append(prim)
        elif prim.IsA(UsdGeom.Gprim) or name == "GeomSubset":
            drawn.append(prim)
        else:
            _note_light(prim, name, diagnostics)
    lacking = [(shader, path) for shader in shaders for path in _lacked_by(shader)]
    bound = _bound_materials(drawn) if lacking else set()
    for shader, path in lacking:
        if any(str(shader.GetPath()).startswith(f"{material}/") for material in bound):
            diagnostics.add("asset-missing", str(shader.GetPath()), missing_text(path), "inputs:file")


def _note_light(prim: Usd.Prim, name: str, diagnostics: Diagnostics) -> None:
    path = str(prim.GetPath())
    if name in _TEXTURED and (texture := _missing(prim.GetAttribute(TEXTURE))):
        diagnostics.add("asset-missing", path, missing_texture_text(texture, name), TEXTURE)
    if name in _PROFILED and (profile := _missing(prim.GetAttribute(PROFILE))):
        diagnostics.add("asset-missing", path, missing_profile_text(profile), PROFILE)


def _lacked_by(shader: Usd.Prim) -> Iterator[str]:
    name = shader_id(shader)
    if name != "UsdUVTexture" and not name.startswith("ND_"):
        return
    given = UsdShade.Shader(shader).GetInput("file")
    sources: list[Usd.Attribute] = computed(given.GetValueProducingAttributes, []) if given else []
    for attribute in sources[:1]:
        if path := _missing(attribute):
            yield path


def _missing(attribute: Usd.Attribute | None) -> str:
    """Return the asset path that does not resolve; "" where it does."""
    asset = default_value(attribute) if attribute else None
    if not isinstance(asset, Sdf.AssetPath) or asset.resolvedPath or not asset.path:
        return ""
    return "" if has_tokens(asset.path) and _has_files(asset.path, attribute) else str(asset.path)


def _has_files(path: str, attribute: Usd.Attribute) -> bool:
    """Return whether a tile set has a tile, also in a package, or a sequence a file."""
    layers = [spec.layer for spec in attribute.GetPropertyStack(Usd.TimeCode.Default()) if spec.HasDefaultValue()]
    if not layers:
        return False
    if has_frame_token(path):
        return bool(files_at(str(Sdf.ComputeAssetPathRelativeToLayer(layers[0], path))))
    return bool(tile_paths(path, layers[0])[1])


def _bound_materials(prims: list[Usd.Prim]) -> set[str]:
    """Return the paths of the materials of these prims."""
    nothing: tuple[list[UsdShade.Material], list[Usd.Relationship]] = ([], [])
    materials, _ = computed(lambda: UsdShade.MaterialBindingAPI.ComputeBoundMaterials(prims), nothing)
    return {str(material.GetPath()) for material in materials if material}
