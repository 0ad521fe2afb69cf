"""Metadata of an image file: meaning of its channels, whether it is sRGB, its wrap modes. Part of texture.py."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

from ..description import Wrap

# OpenImageIO's names of wrap modes, in textures made by maketx.
_WRAPS = {"black": Wrap.BLACK, "clamp": Wrap.CLAMP, "periodic": Wrap.REPEAT, "mirror": Wrap.MIRROR}
_PNG = b"\x89PNG\r\n\x1a\n"


@dataclass(frozen=True)
class Layout:
    """Indices of a file's grey or red, green and blue channels, followed by alpha if it has any."""

    channels: tuple[int, ...]
    colors: int  # channels before alpha: 1 or 3

    def reduced(self, wanted: frozenset[str]) -> Layout:
        """Return the layout without channels that are not read; "r" alone makes it a grey image's."""
        colors = 1 if self.colors == 3 and not wanted & {"g", "b"} else self.colors
        alpha = self.channels[self.colors :] if "a" in wanted else ()
        return Layout(self.channels[:colors] + alpha, colors)


def prefix_of(channel: str) -> str:
    """Return the layer in a channel's name: "diffuse" of "diffuse.R", "" of "R"."""
    return channel.rpartition(".")[0]


def layout_of(names: tuple[str, ...]) -> Layout:
    """Return the layout of channels: by name where there are R, G and B, alone or in a layer ("diffuse.R"), else by count.

    Channels without a layer come first, then those of the layers that MaterialX reads by default, then the first layer's. By
    count, one channel is grey, two are grey and alpha, three and more red, green, blue and alpha (UsdUVTexture).
    """
    upper = [name.upper() for name in names]
    layers = [name[:-1] for name in upper if name == "R" or name.endswith(".R")]
    layers = [layer for layer in layers if {layer + "G", layer + "B"} <= set(upper)]
    if layers:
        layer = next((named for named in ("", "DEFAULT.", "RGBA.") if named in layers), layers[0])
        rgb = tuple(upper.index(layer + c) for c in "RGB")
        return Layout(rgb + ((upper.index(layer + "A"),) if layer + "A" in upper else ()), 3)
    if "Y" in upper and not {"X", "Z"} & set(upper):
        return Layout((upper.index("Y"),) + ((upper.index("A"),) if "A" in upper else ()), 1)
    count = min(len(names), 4)
    return Layout(tuple(range(count)), 3 if count >= 3 else 1)


def is_srgb(spec: Any, path: str) -> bool:
    """Return whether "auto" means sRGB: by the file's metadata, else for 8 bits with 3 or 4 channels (UsdUVTexture)."""
    says = _png_says(path)
    if says is not None:
        return says
    if spec.getattribute("Exif:ColorSpace") == 1 or "sRGB" in str(spec.getattribute("ICCProfile:profile_description") or ""):
        return True
    import OpenImageIO as oiio

    return bool(spec.format.basetype == oiio.UINT8 and spec.nchannels in (3, 4))


def _png_says(path: str) -> bool | None:
    """Return whether a PNG's sRGB or gAMA chunk says sRGB; None for files that are no PNG or have neither.

    OpenImageIO's own attribute is sRGB also for files without either chunk.
    """
    gamma = None
    with open(path, "rb") as file:
        if file.read(8) != _PNG:
            return None
        while len(head := file.read(8)) == 8:
            length, kind = struct.unpack(">I4s", head)
            if kind == b"sRGB":
                return True
            if kind in (b"IDAT", b"IEND"):
                break
            if kind == b"gAMA" and length == 4:
                gamma = struct.unpack(">I", file.read(4))[0] / 100000
                length = 0
            file.seek(length + 4, 1)
    if gamma is None:
        return None
    return True if abs(gamma - 1 / 2.2) < 0.01 else False if abs(gamma - 1) < 0.01 else None


def wraps_of(spec: Any, unsaid: Wrap) -> tuple[Wrap, Wrap]:
    """Return the wrap modes in s and t, `unsaid` where the file has none."""
    modes = str(spec.getattribute("wrapmodes") or "").split(",")
    return _WRAPS.get(modes[0], unsaid), _WRAPS.get(modes[-1], unsaid)


def environment_of(spec: Any) -> str:
    """Return the environment layout from OpenEXR's envmap attribute or maketx's metadata, "" without one."""
    return {"LatLong Environment": "latlong", "CubeFace Environment": "cube"}.get(str(spec.getattribute("textureformat")), "")
