"""Driver parameters of render products and variables, which no USD schema defines: those that an EXR can have are applied.

Houdini writes driver:parameters:OpenEXR:NAME and driver:parameters:NAME (husk's manual, "Image output"), on variables
driver:parameters:aov:NAME; RenderMan reads driver:parameters:openexr:NAME (hdPrman), Arnold arnold:driver_exr:NAME and
arnold:NAME (arnold-usd, driver_exr). Names without a meaning for a driver become attributes of the EXR header, there and here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import PurePosixPath
from typing import Any

import numpy as np
from pxr import Usd

from ...aovs import data_type_of
from ...description.picture_file import COMPRESSIONS, OTHER_EXTENSIONS, HeaderValue, PictureFile, is_free_in_header
from ...diagnostics import Diagnostics
from ..stage.reads import authored_attributes
from ..stage.values import When, value

PREFIXES = ("driver:parameters:openexr:", "driver:parameters:", "arnold:driver_exr:", "arnold:")
VARIABLE_PREFIXES = ("driver:parameters:aov:husk:", "driver:parameters:aov:")
UNSUPPORTED_CODE = "output-parameter"
LEVELS = frozenset({"dwa_compression_level", "dwacompressionlevel", "compressionlevel", "compression_level"})
PIXEL_TYPES = frozenset({"pixeltype", "pixel_type", "exrpixeltype", "type"})
HALF_PRECISION = "half_precision"
# Fixed properties of files here; other values are reported.
FIXED_VALUES = {"multipart": True, "asrgba": True, "tiled": False, "autocrop": False, "storage": "scanline", "append": False}
_SILENT = frozenset({"multisampled"})  # on variables; without effect on a file of pixels


class _Reader:
    def __init__(self, prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> None:
        self.prim, self.when, self.diagnostics = prim, when, diagnostics

    def parameters(self, prefixes: tuple[str, ...]) -> Iterator[tuple[str, str, Any]]:
        """Yield the attribute's name, the parameter's name and its value, for parameters with a value."""
        for attribute in authored_attributes(self.prim):
            name = attribute.GetName()
            prefix = next((p for p in prefixes if name.lower().startswith(p)), None)
            if prefix is not None and (found := value(attribute, self.when)) is not None:
                yield name, name[len(prefix) :], found

    def refuse(self, attribute: str, found: object, why: str) -> None:
        message = f"{attribute} = {found!r} {why}."
        self.diagnostics.add("render-settings-input", str(self.prim.GetPath()), message, attribute)

    def leave(self, attribute: str, found: object, why: str) -> None:
        self.diagnostics.add(UNSUPPORTED_CODE, str(self.prim.GetPath()), f"{attribute} = {found!r}: {why}.", attribute)


def read_product_file(product: Usd.Prim, name: str, when: When, diagnostics: Diagnostics) -> PictureFile:
    """Return the file settings of a product; `name` is its productName, whose extension need not be the file's."""
    if PurePosixPath(name).suffix.lower() in OTHER_EXTENSIONS:  # a file with any other extension is an EXR
        return _plain_file(product, when, diagnostics)
    reader = _Reader(product, when, diagnostics)
    compression, level, half, header = "", None, tuple[str, ...](), dict[str, HeaderValue]()
    for attribute, name, found in reader.parameters(PREFIXES):
        key = name.lower()
        if key == "compression":
            compression = _compression(reader, attribute, found) or compression
        elif key in LEVELS:
            level = _level(reader, attribute, found, level)
        elif key in PIXEL_TYPES or key == HALF_PRECISION:
            half = ("all",) if _is_half(reader, attribute, key, found) else half
        elif key in FIXED_VALUES:
            if found != FIXED_VALUES[key]:
                reader.leave(attribute, found, f"files here always have {FIXED_VALUES[key]}")
        elif attribute.lower().startswith("arnold:"):
            reader.leave(attribute, found, "only Arnold uses it")
        else:
            _add_to_header(reader, attribute, name, found, header)
    return PictureFile(half, compression, level, tuple(header.items()))


def _plain_file(product: Usd.Prim, when: When, diagnostics: Diagnostics) -> PictureFile:
    """Report all driver parameters of a file that is no EXR: other formats have none of them."""
    reader = _Reader(product, when, diagnostics)
    for attribute, _, found in reader.parameters(PREFIXES):
        reader.leave(attribute, found, "only EXR files have this")
    return PictureFile()


def _compression(reader: _Reader, attribute: str, found: object) -> str:
    name = str(found).lower().removesuffix("_compression")
    if name not in COMPRESSIONS:
        reader.refuse(attribute, found, f"is not a known compression ({', '.join(COMPRESSIONS)}): zip is used")
        return ""
    return name


def _level(reader: _Reader, attribute: str, found: object, before: float | None) -> float | None:
    if isinstance(found, int | float) and math.isfinite(found) and 0 <= found <= 1e6:
        return float(found)
    reader.refuse(attribute, found, "is not a compression level: the default is used")
    return before


def _is_half(reader: _Reader, attribute: str, key: str, found: object) -> bool:
    if key == HALF_PRECISION and isinstance(found, bool | int):
        return bool(found)
    if found in ("half", "float"):
        return bool(found == "half")
    reader.leave(attribute, found, "only half and float are supported: the variables' own types are used")
    return False


def _add_to_header(reader: _Reader, attribute: str, name: str, found: object, header: dict[str, HeaderValue]) -> None:
    made = _header_value(found)
    if not is_free_in_header(name):
        reader.leave(attribute, found, "the header has the picture's own value for this")
    elif made is None:
        reader.leave(attribute, found, "headers hold text, numbers, and vectors of two to four numbers")
    else:
        header[name] = made


def _header_value(found: Any) -> HeaderValue | None:
    if isinstance(found, str):
        return found
    if isinstance(found, bool | int):
        return int(found) if -(2**31) <= found < 2**31 else None
    if isinstance(found, float):
        return found if math.isfinite(found) else None
    try:
        numbers = np.asarray(found)
    except (TypeError, ValueError):
        return None
    if numbers.ndim != 1 or not 2 <= len(numbers) <= 4 or numbers.dtype.kind not in "fiu" or not np.isfinite(numbers).all():
        return None
    kind = int if numbers.dtype.kind in "iu" else float
    return tuple(kind(number) for number in numbers.tolist())


def read_variable_parameters(variable: Usd.Prim, when: When, diagnostics: Diagnostics) -> dict[str, str]:
    """Return the usable name, channel_prefix and format of a variable; report other parameters."""
    reader, found = _Reader(variable, when, diagnostics), dict[str, str]()
    for attribute, name, given in reader.parameters(VARIABLE_PREFIXES):
        key = name.lower()
        if key in ("name", "channel_prefix", "format"):
            if not isinstance(given, str) or (key == "format" and given and data_type_of(given) is None) or not _is_text(given):
                reader.refuse(attribute, given, "cannot be used: the variable's own value is used")
            elif given or key == "channel_prefix":
                found.setdefault(key, given)
        elif key == "clearvalue":
            if np.any(np.asarray(given, dtype=object) != 0):
                reader.leave(attribute, given, "the background's depth is infinite, and everything else is 0")
        elif key not in _SILENT:
            reader.leave(attribute, given, "it has no effect here")
    return found


def _is_text(given: str) -> bool:
    return len(given) <= 255 and given.isprintable()
