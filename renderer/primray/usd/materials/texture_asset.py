"""A shader's file parameter as a TextureFile: resolved by Ar, <UDIM> sets tile by tile, with its colour space.

What says the space: sourceColorSpace other than auto, then the file attribute's colorSpace metadata, then, for colours, the
nearest ColorSpaceAPI (which speaks of files too: OpenUSD's Color User's Guide) unless sourceColorSpace says auto itself.
"""

from __future__ import annotations

from dataclasses import replace

from pxr import Sdf, Usd, UsdShade

from ...color.color_space import SRGB, ColorSpace, matrix
from ...description import TextureFile
from ..querying.guarded import color_space_name
from ..resolving.color_spaces import authored_space, scope_at, space_named
from ..resolving.context import Context
from ..resolving.read import time_of
from ..resolving.resolve import ResolvedPrim
from .network import Constant, Node, node_path, parameter, text


def texture_file(node: Node, ctx: Context, *, is_color: bool = True, name: str = "file") -> TextureFile:
    """What the node reads by that input, as colours or numbers; its path is "" where there is no file, which is noted."""
    found = parameter(node, name, ctx)
    made = _file(node, found, name, ctx)
    return in_space(made, _color_space(node, found, name, is_color, ctx), is_color, ctx)


def missing_text(path: str) -> str:
    """Of a texture's file that is not there; of a set, none of its tiles."""
    if UsdShade.UdimUtils.IsUdimIdentifier(path):
        return f"{path} has no tile from 1001 to 1100: the fallback is used."
    return f"{path} cannot be found: the fallback is used."


def in_space(file: TextureFile, space: str | ColorSpace, is_color: bool, ctx: Context) -> TextureFile:
    """The file in a space, told apart by what makes a difference to its pixels alone."""
    if isinstance(space, ColorSpace):
        plain = {SRGB: "sRGB", ctx.rendering_space: "raw"}
        space = "raw" if space.is_data else plain.get(space, space)
    if isinstance(space, ColorSpace):
        mixes = matrix(space, ctx.rendering_space) is not None
    else:
        mixes = space in ("auto", "sRGB") and matrix(SRGB, ctx.rendering_space) is not None
    return replace(file, color_space=space, target=ctx.rendering_space, is_color=is_color or not mixes)


def light_texture(path: str, attribute: Usd.Attribute, prim: ResolvedPrim, ctx: Context) -> TextureFile:
    """Of a light's file attribute: what the file says (auto) where nothing is authored."""
    space = authored_space(attribute, prim.inherited.colors, ctx)
    return in_space(TextureFile(path, "auto"), "auto" if space is None else space, True, ctx)


def _file(node: Node, found: Constant | None, name: str, ctx: Context) -> TextureFile:
    if found is None or not isinstance(found.value, Sdf.AssetPath) or not found.value.path:
        ctx.warn("texture-unset", node_path(node, ctx), "It names no file: its fallback is used.", f"inputs:{name}")
        return TextureFile("", "auto")
    asset = found.value
    if UsdShade.UdimUtils.IsUdimIdentifier(asset.path):
        return _tiles(node, asset, found.attribute, name, ctx)
    if not asset.resolvedPath:
        ctx.warn("asset-missing", node_path(node, ctx), missing_text(asset.path), f"inputs:{name}")
    return TextureFile(str(asset.resolvedPath), "auto")


def _tiles(node: Node, asset: Sdf.AssetPath, attribute: Usd.Attribute, name: str, ctx: Context) -> TextureFile:
    layer = _authoring_layer(attribute, ctx)
    found = UsdShade.UdimUtils.ResolveUdimTilePaths(asset.path, layer)  # 1001 to 1100, ten in U and ten in V
    tiles = [(int(number), str(path)) for path, number in found]
    if not tiles:
        message = missing_text(asset.path)
        ctx.warn("asset-missing", node_path(node, ctx), message, f"inputs:{name}")
        return TextureFile("", "auto")
    number, first = tiles[0]
    before, _, after = first.rpartition(str(number))
    return TextureFile(f"{before}<UDIM>{after}", "auto", tuple(sorted(tiles)))


def _authoring_layer(attribute: Usd.Attribute, ctx: Context) -> Sdf.Layer | None:
    for spec in attribute.GetPropertyStack(time_of(attribute, ctx.when)):
        if isinstance(spec, Sdf.AttributeSpec) and (spec.HasDefaultValue() or spec.HasInfo("timeSamples")):
            return spec.layer
    return None


def _color_space(node: Node, found: Constant | None, name: str, is_color: bool, ctx: Context) -> str | ColorSpace:
    said = _source_color_space(node, ctx)
    if said not in (None, "auto"):
        return said or "auto"
    attributes = [node.prim.GetAttribute(f"inputs:{name}")] + ([found.attribute] if found else [])
    own = [attribute for attribute in attributes if attribute and color_space_name(attribute)]
    asked = own if said == "auto" or not is_color else own or attributes[-1:]
    for attribute in asked:
        space = authored_space(attribute, scope_at(attribute.GetPrim(), ctx), ctx) if attribute else None
        if space is not None:
            return space
    return "auto"


def _source_color_space(node: Node, ctx: Context) -> str | ColorSpace | None:
    """None where nothing is authored. The text has raw, sRGB and auto; other names are taken for what they name."""
    if parameter(node, "sourceColorSpace", ctx) is None or not node.prim.GetAttribute("inputs:sourceColorSpace").IsAuthored():
        return None
    name = text(node, "sourceColorSpace", "auto", ctx)
    if name in ("auto", "raw", "sRGB"):
        return name
    space = space_named(name, scope_at(node.prim, ctx), ctx)
    if space is None:
        ctx.warn(
            "shader-parameter",
            node_path(node, ctx),
            f"sourceColorSpace = {name!r} is not known: auto is used.",
            "inputs:sourceColorSpace",
        )
        return "auto"
    return space
