"""Textures of other renderers' nodes: the file, its colour space, its texture coordinates."""

from __future__ import annotations

from dataclasses import dataclass

from ....color.color_space import ColorSpace
from ....description import Operand, TextureFile
from ...scene.color_spaces import scope_at, space_named
from ...scene.context import ColorScope
from ..texture_files import in_space, texture_file
from .values import RendererInputs

_ENCODED = frozenset({"bmp", "gif", "jpeg", "jpg", "png", "psd", "tga", "webp"})  # formats that hold integers only
_SRGB = frozenset({"srgb", "srgb_texture", "srgb - texture", "utility - srgb - texture", "input - generic - srgb - texture"})
_LINEAR = frozenset({"raw", "linear", "utility - raw", "data", "non-color", "identity", "auto linear"})
_TILES = ("<udim>", "%(UDIM)d", "_MAPID_")  # tokens for <UDIM> of Arnold, Houdini and RenderMan
_WRAPS = {"periodic": "periodic", "repeat": "periodic", "clamp": "clamp", "mirror": "mirror", "black": "constant"}


@dataclass(frozen=True)
class Lookup:
    """Texture coordinates of an image lookup, and its wrap modes ("periodic", "clamp", "mirror", "black")."""

    st: Operand = "UV0"
    wrap_s: str = "periodic"
    wrap_t: str = "periodic"
    nearest: bool = False


def image(n: RendererInputs, name: str, space: str, at: Lookup, missing: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)) -> Operand:
    """Return the four channels of the file that an input names, `missing` where there is none.

    `space` names a colour space; "auto" is sRGB for formats that hold integers, linear for others.
    """
    n.asked.add(name)
    file = texture_file(n.node, name=name, tiles=_TILES)
    if not isinstance(file, TextureFile) or not file.path:
        return missing
    file = in_space(file, _space(n, file.path, space), True, n.values.ctx)
    filtering = "closest" if at.nearest else "linear"
    return n.e.apply(
        "ND_image_color4",
        file=file,
        default=missing,
        texcoord=at.st,
        uaddressmode=_WRAPS[at.wrap_s],
        vaddressmode=_WRAPS[at.wrap_t],
        filtertype=filtering,
    )


def texture_set(n: RendererInputs, name: str) -> Operand:
    """Return texture coordinates from the primvar that an input names, the first set where it names none."""
    primvar = n.text(name)
    return coordinates(n, primvar)


def coordinates(n: RendererInputs, primvar: str) -> Operand:
    if not primvar:
        return "UV0"
    return n.e.apply("ND_geompropvalue_vector2", geomprop=primvar, default=(0.0, 0.0))


def moved(n: RendererInputs, st: Operand, scale: Operand, offset: Operand) -> Operand:
    """Return coordinates times a scale, plus an offset."""
    return n.e.apply("ND_add_vector2", in1=n.e.apply("ND_multiply_vector2", in1=st, in2=scale), in2=offset)


def swapped(n: RendererInputs, st: Operand) -> Operand:
    if st == "UV0":
        st = n.e.apply("ND_texcoord_vector2", index=(0.0,))
    parts = [n.e.apply("ND_extract_vector2", **{"in": st, "index": (i,)}) for i in (1.0, 0.0)]
    return n.e.apply("ND_combine2_vector2", in1=parts[0], in2=parts[1])


def _space(n: RendererInputs, path: str, name: str) -> str | ColorSpace:
    known = name.strip().lower()
    if known in ("auto", ""):
        extension = path.rpartition(".")[2].rstrip("]").lower()
        return "sRGB" if extension in _ENCODED else "raw" if extension in ("exr", "hdr", "pfm") else "auto"
    if known in _SRGB:
        return "sRGB"
    if known in _LINEAR:
        return "raw"
    found = space_named(name, _scope(n), n.values.ctx)
    if found is None:
        n.node.warn("shader-parameter", f"Unknown colour space {name!r}: auto is used.")
        return _space(n, path, "auto")
    return found


def _scope(n: RendererInputs) -> ColorScope:
    return scope_at(n.node.shader.prim, n.values.ctx)
