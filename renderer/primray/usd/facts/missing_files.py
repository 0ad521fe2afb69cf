"""Files that a picture of the stage would lack, told as a render tells of them, without reading geometry or networks.

Those of lights, and of the textures of materials that are bound: what else names files (cards, clips, hidden variants) is told
by whoever reads it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from pxr import Sdf, Usd, UsdGeom, UsdShade

from ...diagnostics import Diagnostics
from ..adapters.lights.light import TEXTURE, missing_texture_text
from ..lights.ies_asset import FILE as PROFILE
from ..lights.ies_asset import missing_text as missing_profile_text
from ..materials.texture_asset import missing_text
from ..materialx.file_places import files_at, has_places, names_frame, tile_paths
from ..querying.guarded import computed, default_value, shader_id, type_name

_TEXTURED = ("DomeLight", "DomeLight_1", "RectLight")
_PROFILED = ("SphereLight", "RectLight", "DiskLight", "CylinderLight")


def note_missing_files(prims: Iterable[Usd.Prim], diagnostics: Diagnostics) -> None:
    """`prims`: those that stand in the world."""
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
    bound = _bound(drawn) if lacking else set()
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
    """The path that leads nowhere; "" where there is none."""
    asset = default_value(attribute) if attribute else None
    if not isinstance(asset, Sdf.AssetPath) or asset.resolvedPath or not asset.path:
        return ""
    return "" if has_places(asset.path) and _has_files(asset.path, attribute) else str(asset.path)


def _has_files(path: str, attribute: Usd.Attribute) -> bool:
    """Return whether a set has a tile, in a package too, or a sequence a file."""
    layers = [spec.layer for spec in attribute.GetPropertyStack(Usd.TimeCode.Default()) if spec.HasDefaultValue()]
    if not layers:
        return False
    if names_frame(path):
        return bool(files_at(str(Sdf.ComputeAssetPathRelativeToLayer(layers[0], path))))
    return bool(tile_paths(path, layers[0])[1])


def _bound(prims: list[Usd.Prim]) -> set[str]:
    """Paths of the materials of these prims."""
    nothing: tuple[list[UsdShade.Material], list[Usd.Relationship]] = ([], [])
    materials, _ = computed(lambda: UsdShade.MaterialBindingAPI.ComputeBoundMaterials(prims), nothing)
    return {str(material.GetPath()) for material in materials if material}
