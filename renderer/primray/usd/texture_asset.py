"""A shader's file parameter as a TextureFile: resolved by Ar, <UDIM> sets tile by tile, with its colour space."""

from __future__ import annotations

from pxr import Sdf, Usd, UsdShade

from ..description import TextureFile
from .context import Context
from .network import Constant, Node, node_path, parameter, text

_RAW = frozenset({"raw", "data", "identity", "unknown"})  # GfColorSpaceNames of values that are no colours
_COLOR_SPACES = ("auto", "raw", "sRGB")


def texture_file(node: Node, ctx: Context) -> TextureFile:
    """What the node reads; its path is "" where there is no file, which is noted."""
    found = parameter(node, "file", ctx)
    space = _color_space(node, found, ctx)
    if found is None or not isinstance(found.value, Sdf.AssetPath) or not found.value.path:
        ctx.warn("texture-unset", node_path(node, ctx), "It names no file: its fallback is used.", "inputs:file")
        return TextureFile("", space)
    asset = found.value
    if UsdShade.UdimUtils.IsUdimIdentifier(asset.path):
        return _tiles(node, asset, found.attribute, space, ctx)
    if not asset.resolvedPath:
        ctx.warn("asset-missing", node_path(node, ctx), f"{asset.path} cannot be found: the fallback is used.", "inputs:file")
    return TextureFile(str(asset.resolvedPath), space)


def _tiles(node: Node, asset: Sdf.AssetPath, attribute: Usd.Attribute, space: str, ctx: Context) -> TextureFile:
    layer = _authoring_layer(attribute, ctx)
    found = UsdShade.UdimUtils.ResolveUdimTilePaths(asset.path, layer)  # 1001 to 1100, ten in U and ten in V
    tiles = [(int(number), str(path)) for path, number in found]
    if not tiles:
        message = f"{asset.path} has no tile from 1001 to 1100: the fallback is used."
        ctx.warn("asset-missing", node_path(node, ctx), message, "inputs:file")
        return TextureFile("", space)
    number, first = tiles[0]
    before, _, after = first.rpartition(str(number))
    return TextureFile(f"{before}<UDIM>{after}", space, tuple(sorted(tiles)))


def _authoring_layer(attribute: Usd.Attribute, ctx: Context) -> Sdf.Layer | None:
    for spec in attribute.GetPropertyStack(ctx.when.time):
        if isinstance(spec, Sdf.AttributeSpec) and (spec.HasDefaultValue() or spec.HasInfo("timeSamples")):
            return spec.layer
    return None


def _color_space(node: Node, found: Constant | None, ctx: Context) -> str:
    """sourceColorSpace where it says raw or sRGB, else the file attribute's colorSpace metadata, else "auto"."""
    space = text(node, "sourceColorSpace", "auto", ctx)
    if space not in _COLOR_SPACES:
        message = f"sourceColorSpace = {space!r} is not known: auto is used."
        ctx.warn("shader-parameter", node_path(node, ctx), message, "inputs:sourceColorSpace")
        space = "auto"
    if space != "auto":
        return space
    attributes = [node.prim.GetAttribute("inputs:file")] + ([found.attribute] if found else [])
    for attribute in attributes:
        if attribute and attribute.HasColorSpace():
            name = str(attribute.GetColorSpace())
            return "raw" if name.lower() in _RAW else name
    return "auto"
