"""Files that a picture of the stage would lack, reported as a render reports them, without reading geometry or networks.

They are those of lights, and of textures of bound materials. Other missing files (of cards, clips, hidden variants) are
reported by their own readers.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from pxr import Sdf, Usd, UsdGeom, UsdShade

from ...diagnostics import Diagnostics
from ..lights.light import TEXTURE, missing_texture_text
from ..lights.shaping import FILE as PROFILE
from ..lights.shaping import missing_text as missing_profile_text
from ..materials.texture_asset import missing_text
from ..materialx.file_places import files_at, has_places, names_frame, tile_paths
from ..querying.guarded import computed, default_value, shader_id, type_name

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
    """Return the asset path that does not resolve; "" where it does."""
    asset = default_value(attribute) if attribute else None
    if not isinstance(asset, Sdf.AssetPath) or asset.resolvedPath or not asset.path:
        return ""
    return "" if has_places(asset.path) and _has_files(asset.path, attribute) else str(asset.path)


def _has_files(path: str, attribute: Usd.Attribute) -> bool:
    """Return whether a tile set has a tile, also in a package, or a sequence a file."""
    layers = [spec.layer for spec in attribute.GetPropertyStack(Usd.TimeCode.Default()) if spec.HasDefaultValue()]
    if not layers:
        return False
    if names_frame(path):
        return bool(files_at(str(Sdf.ComputeAssetPathRelativeToLayer(layers[0], path))))
    return bool(tile_paths(path, layers[0])[1])


def _bound(prims: list[Usd.Prim]) -> set[str]:
    """Return the paths of the materials of these prims."""
    nothing: tuple[list[UsdShade.Material], list[Usd.Relationship]] = ([], [])
    materials, _ = computed(lambda: UsdShade.MaterialBindingAPI.ComputeBoundMaterials(prims), nothing)
    return {str(material.GetPath()) for material in materials if material}
