"""File inputs of shaders as TextureFiles: resolved by Ar, UDIM sets tile by tile, with their colour space.

Colour space, in order: sourceColorSpace other than auto; the file attribute's colorSpace metadata; for colours, the nearest
ColorSpaceAPI (which covers files, too: OpenUSD's Color User's Guide) unless sourceColorSpace is authored as auto.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pxr import Sdf, Usd

from ...color.color_space import SRGB, ColorSpace, matrix
from ...description import TextureFile
from ..scene.color_spaces import authored_space, scope_at, scope_of, space_named
from ..scene.context import Context
from .authored import INPUT
from .materialx.filename_tokens import Frames, frames_of, has_frame_token, is_tiles, resolved, tile_paths, with_frame
from .network import Constant, Node

if TYPE_CHECKING:
    from ..scene.inheritance import ResolvedPrim

# Nodes that pass a file name on, and the input that has it.
_NAMING = {"ND_constant_filename": "value", "ND_dot_filename": "in"}
_OF_PRIMVARS = {  # primvar readers, and the input that names the primvar
    "UsdPrimvarReader_string": "varname", "ND_UsdPrimvarReader_string": "varname", "ND_UsdPrimvarReader_filename": "varname",
    "ND_geompropvalueuniform_string": "geomprop", "ND_geompropvalueuniform_filename": "geomprop",
}  # fmt: skip
_NAMING |= {reader: "default" if name == "geomprop" else "fallback" for reader, name in _OF_PRIMVARS.items()}
_MOST_HANDING_ON = 16


def texture_file(node: Node, *, is_color: bool = True, name: str = "file", tiles: tuple[str, ...] = ()) -> TextureFile:
    """Return the file that an input names, read as colours or numbers; its path is "" without a file, which is reported.

    `tiles`: what stands for <UDIM> in file names of the node's renderer.
    """
    found = _named(node, name)
    if tiles and found is not None:
        found = _with_udim(found, tiles)
    files, key = node.network.files, (node.path, name)
    if key not in files:  # several inputs may read channels of one image
        files[key] = _file(node, found, name)
    return in_space(files[key], _color_space(node, found, name, is_color), is_color, node.network.ctx)


def missing_text(path: str) -> str:
    """Return the message for a texture whose file, or all of whose tiles, cannot be found."""
    if is_tiles(path):
        return f"{path} has no tile from 1001 to 1100: the fallback is used."
    return f"{path} cannot be found: the fallback is used."


def in_space(file: TextureFile, space: str | ColorSpace, is_color: bool, ctx: Context) -> TextureFile:
    """Return the file in a colour space, normalised so that files with the same pixels compare equal."""
    if isinstance(space, ColorSpace):
        plain = {SRGB: "sRGB", ctx.rendering_space: "raw"}
        space = "raw" if space.is_data else plain.get(space, space)
    if isinstance(space, ColorSpace):
        mixes = matrix(space, ctx.rendering_space) is not None
    else:
        mixes = space in ("auto", "sRGB") and matrix(SRGB, ctx.rendering_space) is not None
    return replace(file, color_space=space, target=ctx.rendering_space, is_color=is_color or not mixes)


def light_texture(path: str, attribute: Usd.Attribute, prim: ResolvedPrim, ctx: Context) -> TextureFile:
    """Return the texture of a light's file attribute; its space is "auto" where none is authored."""
    space = authored_space(attribute, prim.inherited.colors, ctx)
    return in_space(TextureFile(path, "auto"), "auto" if space is None else space, True, ctx)


def _named(node: Node, name: str) -> Constant | None:
    """Return the constant that names a node's file: its own value, one passed on by a node, or a primvar reader's fallback.

    The primvar itself may differ between shapes and is not read; this is reported with the file used instead.
    """
    source = node.source(name)
    for _ in range(_MOST_HANDING_ON):
        if not isinstance(source, Node) or source.id not in _NAMING:
            break
        handed_on = source.source(_NAMING[source.id])
        if source.id in _OF_PRIMVARS:
            _note_primvar(node, source, handed_on, name)
        if handed_on is None:
            return None
        source = handed_on
    return source if isinstance(source, Constant) else node.parameter(name)


def _with_udim(found: Constant, tiles: tuple[str, ...]) -> Constant:
    """Return a value with <UDIM> in place of another renderer's token for it."""
    path = found.value.path if isinstance(found.value, Sdf.AssetPath) else found.value
    named = path if isinstance(path, str) else ""
    for token in tiles:
        named = named.replace(token, "<UDIM>")
    return found if named == path or not named else replace(found, value=Sdf.AssetPath(named))


def _note_primvar(node: Node, reader: Node, fallback: Constant | Node | None, name: str) -> None:
    primvar = reader.text(_OF_PRIMVARS[reader.id], "")
    value = fallback.value if isinstance(fallback, Constant) else None
    shown = value.path if isinstance(value, Sdf.AssetPath) else value
    instead = f"its fallback {shown!r} is used" if shown else "no file is read"
    message = f"{name} reads the primvar {primvar!r}, which is not supported for file names: {instead}."
    node.warn("shader-ignored", message, INPUT + name)


def _file(node: Node, found: Constant | None, name: str) -> TextureFile:
    asset = found.value if found is not None else None
    if found is not None and isinstance(asset, str) and asset:  # the fallback of a string reader
        asset = Sdf.AssetPath(asset, resolved(asset, found.attribute.layer))
    if found is None or not isinstance(asset, Sdf.AssetPath) or not asset.path:
        node.warn("texture-unset", "No file is set: the fallback is used.", INPUT + name)
        return TextureFile("", "auto")
    path, layer = asset.path, None
    if has_frame_token(path):
        framed = _at_frame(node, path)
        if framed is None:
            return TextureFile("", "auto")
        path, layer = framed, found.attribute.layer
        asset = Sdf.AssetPath(path, resolved(path, layer))
    if is_tiles(path):
        return _tiles(node, path, layer or found.attribute.layer, name)
    if not asset.resolvedPath:
        node.warn("asset-missing", missing_text(path), INPUT + name)
    return TextureFile(str(asset.resolvedPath), "auto")


def _tiles(node: Node, path: str, layer: Sdf.Layer | None, name: str) -> TextureFile:
    set_path, tiles = tile_paths(path, layer)
    if not tiles:
        node.warn("asset-missing", missing_text(path), INPUT + name)
        return TextureFile("", "auto")
    return TextureFile(set_path, "auto", tiles)


def _at_frame(node: Node, path: str) -> str | None:
    """Return the path of a sequence's file for the frame; None where the node shows its default instead."""
    range_text = node.text("framerange", "")
    first, last = (frames_of(range_text) if range_text else None) or (None, None)
    if range_text and first is None:
        message = f"framerange = {range_text!r} is not a range of frames and is ignored."
        node.warn("shader-parameter", message, "inputs:framerange")
    offset = int(node.numbers("frameoffset", (0.0,))[0])
    number = Frames(first, last, offset, node.text("frameendaction", "constant")).number(frame_of(node))
    return None if number is None else with_frame(path, number)


def frame_of(node: Node) -> float:
    """Return the time code for time nodes and frame numbers in file names; 0, reported, when no frame is rendered."""
    ctx = node.network.ctx
    if ctx.when.is_default:
        node.warn("shader-parameter", "It depends on the frame, but none is rendered: time code 0 is used.")
        return 0.0
    if ctx.timing.is_open:
        message = "It depends on time, which is constant during the exposure: the frame's time code is used."
        node.warn("material-input", message)
    return float(ctx.when.time.GetValue())


def _color_space(node: Node, found: Constant | None, name: str, is_color: bool) -> str | ColorSpace:
    said = _source_color_space(node)
    if said not in (None, "auto"):
        return said or "auto"
    attributes = [node.shader.attribute(INPUT + name)] + ([found.attribute] if found else [])
    own = [attribute for attribute in attributes if attribute and attribute.color_space]
    asked = own if said == "auto" or not is_color else own or attributes[-1:]
    ctx = node.network.ctx
    for at in filter(None, asked):
        space = authored_space(at.attribute, scope_of(at.attribute, ctx), ctx, at.color_space)
        if space is not None:
            return space
    return "auto"


def _source_color_space(node: Node) -> str | ColorSpace | None:
    """Return sourceColorSpace, None where it is not authored.

    Its specified values are raw, sRGB and auto; other names are taken as names of colour spaces.
    """
    if "sourceColorSpace" not in node.shader.inputs or node.parameter("sourceColorSpace") is None:
        return None
    name = node.text("sourceColorSpace", "auto")
    if name in ("auto", "raw", "sRGB"):
        return name
    ctx = node.network.ctx
    space = space_named(name, scope_at(node.shader.prim, ctx), ctx)
    if space is None:
        node.warn("shader-parameter", f"sourceColorSpace = {name!r} is unknown: auto is used.", "inputs:sourceColorSpace")
        return "auto"
    return space
