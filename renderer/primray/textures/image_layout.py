"""Layout of an image file: meaning of its channels, layers, display window, colour encoding and wrap modes; and its header.

Layers are parts of a multi-part EXR, and channels that share a prefix ("diffuse.R"). A part's name counts as a prefix of its
channels, so that "diffuse" names a part as well as channels of that prefix. A card that shows an image is placed by the
"worldtoscreen" matrix in the image's metadata.
"""

from __future__ import annotations

import struct
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles
from ..description import Wrap
from ..errors import AssetError
from ..read_files import note_read
from .image_errors import last_error

if TYPE_CHECKING:
    import OpenImageIO as oiio


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


def wraps_of(spec: Any, default_wrap: Wrap) -> tuple[Wrap, Wrap]:
    """Return the wrap modes in s and t, `default_wrap` where the file has none."""
    modes = str(spec.getattribute("wrapmodes") or "").split(",")
    return _WRAPS.get(modes[0], default_wrap), _WRAPS.get(modes[-1], default_wrap)


def environment_of(spec: Any) -> str:
    """Return the environment layout from OpenEXR's envmap attribute or maketx's metadata, "" without one."""
    return {"LatLong Environment": "latlong", "CubeFace Environment": "cube"}.get(str(spec.getattribute("textureformat")), "")


# Only this format's windows describe the picture: offsets in a PNG or TIFF are positions on a page.
_FORMAT = "openexr"


@dataclass(frozen=True)
class Windows:
    """Position (`x`, `y`) of the stored pixels from the picture's upper left, and both sizes as (width, height)."""

    x: int
    y: int
    stored: tuple[int, int]
    picture: tuple[int, int]

    @property
    def differ(self) -> bool:
        return (self.x, self.y) != (0, 0) or self.stored != self.picture

    @property
    def covers(self) -> bool:
        """Whether all of the picture is stored."""
        sides = zip((self.x, self.y), self.stored, self.picture, strict=True)
        return all(begin <= 0 and begin + has >= whole for begin, has, whole in sides)

    def pictured(self, pixels: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Return (H, W, C) stored pixels as the picture's: overscan is cropped, missing pixels are 0."""
        (width, height), (has_width, has_height) = self.picture, self.stored
        made = np.zeros((height, width, pixels.shape[2]), pixels.dtype)
        left, right = max(self.x, 0), min(self.x + has_width, width)
        top, bottom = max(self.y, 0), min(self.y + has_height, height)
        if left < right and top < bottom:
            made[top:bottom, left:right] = pixels[top - self.y : bottom - self.y, left - self.x : right - self.x]
        return made


def windows_of(spec: Any, format_name: str) -> Windows:
    """Return the windows in a file's header, as read by OpenImageIO."""
    stored = spec.width, spec.height
    if format_name != _FORMAT or spec.full_width < 1 or spec.full_height < 1:
        return Windows(0, 0, stored, stored)
    return Windows(spec.x - spec.full_x, spec.y - spec.full_y, stored, (spec.full_width, spec.full_height))


# MaterialX, image: "If no value for layer is provided and the input file has multiple layers", these, in this order.
_UNNAMED = ("default", "rgba")
_PLAIN = ("rgba", "rgb")  # names that applications use for channels without a prefix


def choose_layer(image: Any, name: str, shown: str) -> tuple[Any, Layout]:
    """Return the header of the part with a layer, and the layout of its channels; the image is left at that part.

    Without a name: the layer that MaterialX names, else the first part. Raises AssetError where the file has no such layer.
    """
    spec = image.spec()
    if not name:
        return _default_part(image, spec), layout_of(tuple(image.spec().channelnames))
    layers: list[str] = []
    for part in range(_parts(spec)):
        if not image.seek_subimage(part, 0):
            break
        spec = image.spec()
        names, label = tuple(spec.channelnames), _label(spec)
        chosen = _channels(names, label, name)
        if chosen:
            own = layout_of(tuple(names[c].rpartition(".")[2] for c in chosen))
            return spec, Layout(tuple(chosen[c] for c in own.channels), own.colors)
        layers += [found for found in dict.fromkeys([label, *map(prefix_of, names)]) if found]
    has = f"it has {', '.join(dict.fromkeys(layers))}" if layers else "it has no layers"
    raise AssetError(f"the texture has no layer {name!r}: {has}", where=shown, code="texture-unreadable")


def _parts(spec: Any) -> int:
    return max(int(spec.getattribute("oiio:subimages") or 1), 1)


def _label(spec: Any) -> str:
    return str(spec.getattribute("oiio:subimagename") or spec.getattribute("name") or "")


def _default_part(image: Any, spec: Any) -> Any:
    count = _parts(spec)
    if count > 1:
        labels: dict[str, int] = {}
        for part in range(count):
            if image.seek_subimage(part, 0):
                labels.setdefault(_label(image.spec()), part)
        image.seek_subimage(next((labels[name] for name in _UNNAMED if name in labels), 0), 0)
    return image.spec()


def _channels(names: tuple[str, ...], label: str, layer: str) -> list[int]:
    """Return the channels of a layer in a part that is named `label`."""
    prefixes = [prefix_of(name) for name in names]
    own = [i for i, prefix in enumerate(prefixes) if prefix == layer]
    if not own and label:
        own = [i for i, prefix in enumerate(prefixes) if (f"{label}.{prefix}" if prefix else label) == layer]
        own = own or (list(range(len(names))) if label == layer else [])
    if not own and layer.lower() in _PLAIN:
        own = [i for i, prefix in enumerate(prefixes) if not prefix]
    # A single channel by its full name ("N.Y").
    return own or [i for i, name in enumerate(names) if layer in (name, f"{label}.{name}")]


def read_header(path: str, read: Callable[[str], bytes]) -> oiio.ImageSpec | None:
    """Return an image's header with the size of its display window; None if it cannot be opened.

    `read` returns the bytes of a package's member ("package.usdz[member]").
    """
    note_read(path)
    if not path.endswith("]"):
        return _of_file(path)
    with tempfile.NamedTemporaryFile(suffix=PurePath(path[path.rindex("[") + 1 : -1]).suffix) as unpacked:
        unpacked.write(read(path))
        unpacked.flush()
        return _of_file(unpacked.name)


def _of_file(path: str) -> oiio.ImageSpec | None:
    import OpenImageIO as oiio

    image = oiio.ImageInput.open(path)
    if image is None:
        last_error(oiio)
        return None
    try:
        spec = image.spec()
        spec.width, spec.height = windows_of(spec, image.format_name()).picture
        return spec
    finally:
        image.close()


# OpenImageIO before 2.2 wrote "worldtoscreen" as "worldToNDC".
_NAMES = ("worldtoscreen", "worldToNDC")


def read_matrix(path: str, read: Callable[[str], bytes]) -> Doubles | None:
    """Return the (4, 4) matrix for row vectors as written, None where the file has none; `read` as for read_header."""
    header = read_header(path, read)
    if header is None:
        return None
    for name in _NAMES:
        values = header.getattribute(name)
        if isinstance(values, tuple | list) and len(values) == 16:
            return np.array(values, np.float64).reshape(4, 4)
    return None
