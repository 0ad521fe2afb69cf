"""Bit depths of picture files: one depth for a PNG or TIFF, one per channel for an EXR.

Importing this module does not import NumPy, because command lines use it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..aovs import CRYPTOMATTES
from ..diagnostic_codes import CODES
from ..diagnostics import Diagnostic
from ..errors import SettingsError

if TYPE_CHECKING:
    import numpy.typing as npt

    from ..description.picture_file import HeaderValue

# Bit depths of each format, the default first. 32 means scene-linear floats instead of a view.
BIT_DEPTHS = {".png": (8, 16), ".tif": (16, 8, 32), ".tiff": (16, 8, 32)}
LINEAR_BITS = 32
LARGEST_HALF = 65504.0
ALL, NONE, PICTURE = "all", "none", "rgba"
WITH_LEVEL = {"zip": 9.0, "zips": 9.0, "dwaa": 1e6, "dwab": 1e6}  # compressions with a level, and the highest level
CODE = "half-channels"


@dataclass(frozen=True)
class Encoding:
    """How numbers are stored.

    `half` names channels of an EXR ("R"), layers ("stderr", "normal"), parts ("rgba", "depth"), "all" for all floats, or
    "none", which overrides a product's choice.
    """

    bit_depth: int | None = None
    half: tuple[str, ...] = ()
    compression: str = ""  # of an EXR, overriding a product's; "": the product's, else zip
    level: float | None = None  # compression level of zip and DWA
    header: tuple[tuple[str, HeaderValue], ...] = ()  # further attributes of an EXR's header
    flatten_over: tuple[float, float, float] | None = None  # display colour under views without alpha; None: black
    is_quick: bool = False  # a PNG takes a quarter of the time, and may be some per cent larger

    def __post_init__(self) -> None:
        """Raise SettingsError for a compression or an attribute that no EXR can have."""
        if not self.compression and self.level is None and not self.header:
            return
        from ..description.picture_file import COMPRESSIONS, is_free_in_header

        if self.compression not in ("", *COMPRESSIONS):
            sentence = f"{self.compression!r} is not a compression of EXR; expected one of {', '.join(COMPRESSIONS)}"
            raise SettingsError(sentence, where="compression", code="exr-setting")
        most = WITH_LEVEL.get(self.compression, -1.0)
        if self.level is not None and not 0 <= self.level <= most:
            levels = ", ".join(f"0 to {most:,.0f} with {name}" for name, most in WITH_LEVEL.items())
            sentence = f"compression levels are {levels}, not {self.level:g} with {self.compression or 'none'}"
            raise SettingsError(sentence, where="compression", code="exr-setting")
        for name, _ in self.header:
            if not is_free_in_header(name):
                sentence = f"{name!r} is not a valid metadata name, or is reserved for the picture's own attributes"
                raise SettingsError(sentence, where="metadata", code="exr-setting")

    def bits_of(self, suffix: str) -> int:
        """Return the bit depth of a file with this extension; SettingsError if the format does not have it."""
        known = BIT_DEPTHS.get(suffix.lower())
        if known is None or self.bit_depth is None:
            return 8 if known is None else known[0]
        if self.bit_depth not in known:
            listed = " or ".join(str(bits) for bits in sorted(known))
            sentence = f"{suffix} holds {listed} bits a channel, not {self.bit_depth}"
            raise SettingsError(sentence, where="bit_depth", code="bit-depth")
        return self.bit_depth

    def is_half(self, part: str, channel: str) -> bool:
        return any(name in self.half for name in _names(part, channel))


def compression_of(text: str | None) -> tuple[str, float | None]:
    """Return the compression and its level from NAME or NAME:LEVEL; SettingsError if the level is not a number."""
    kind, colon, level = (text or "").strip().lower().partition(":")
    if text is not None and not kind:
        raise SettingsError(
            "the compression has no name; expected one such as zip or dwaa:45", where="compression", code="exr-setting"
        )
    try:
        return kind, float(level) if colon else None
    except ValueError:
        sentence = f"{text!r} is not a compression; expected one such as dwaa:45"
        raise SettingsError(sentence, where="compression", code="exr-setting") from None


def _names(part: str, channel: str) -> tuple[str, ...]:
    """Return the names that select a channel. "rgba" selects the picture without its errors, which share a part."""
    layer = channel.rpartition(".")[0]
    return (ALL, channel, layer or PICTURE) if part == PICTURE else (ALL, channel, layer or part, part)


def check_bit_depth(encoding: Encoding, suffixes: Sequence[str]) -> None:
    """Raise SettingsError unless some output has a choice of bit depths, and each such output has the chosen one.

    Called before rendering.
    """
    choosing = [suffix for suffix in suffixes if suffix.lower() in BIT_DEPTHS]
    if encoding.bit_depth is not None and not choosing:
        raise SettingsError("a bit depth applies to PNG and TIFF, but no output is one", where="bit_depth", code="bit-depth")
    for suffix in choosing:
        encoding.bits_of(suffix)


def check_half(encoding: Encoding, suffixes: Sequence[str]) -> None:
    """Raise SettingsError if halves, a compression or metadata are requested and no output is an EXR."""
    if ".exr" in [suffix.lower() for suffix in suffixes]:
        return
    if encoding.half:
        raise SettingsError("halves apply to EXR, but no output is an EXR", where="half", code="half-output")
    if encoding.compression or encoding.header:
        what = "compression" if encoding.compression else "metadata"
        raise SettingsError(f"{what} applies to EXR, but no output is an EXR", where=what, code="exr-setting")


Part = tuple[Any, "npt.NDArray[Any]"]  # an OIIO ImageSpec and its values (H, W, C)


def store_halves(parts: Sequence[Part], encoding: Encoding) -> None:
    """Set in the parts' specs which channels are halves; integers never are."""
    import OpenImageIO as oiio

    for spec, values in parts:
        if NONE in encoding.half:
            if values.dtype.kind == "f":
                spec.set_format(oiio.FLOAT)
        elif encoding.half and _may_be_half(spec, values):
            kinds = [oiio.HALF if encoding.is_half(_name(spec), channel) else oiio.FLOAT for channel in spec.channelnames]
            if len(set(kinds)) == 1:
                spec.set_format(kinds[0])
            else:
                spec.channelformats = tuple(kinds)


def half_faults(parts: Sequence[Part], encoding: Encoding, asked: Sequence[str] | None = None) -> list[Diagnostic]:
    """Return diagnostics for names in `asked` that match nothing, and for finite values that a half cannot hold."""
    asked = encoding.half if asked is None else asked
    return [Diagnostic(CODES[CODE].severity, CODE, "", message) for message in _half_faults(parts, encoding, asked)]


def _half_faults(parts: Sequence[Part], encoding: Encoding, asked: Sequence[str]) -> Iterator[str]:
    import numpy as np

    met = {ALL, NONE}
    for spec, values in parts:
        for number, channel in enumerate(spec.channelnames):
            met.update(_names(_name(spec), channel))
            is_half = str(spec.channelformat(number)) == "half" or encoding.is_half(_name(spec), channel)
            is_half &= NONE not in encoding.half
            if _may_be_half(spec, values) and is_half:
                beyond = np.isfinite(values[..., number]) & (np.abs(values[..., number]) > LARGEST_HALF)
                if count := beyond.sum():
                    of = "" if _name(spec) == PICTURE else f" of {_name(spec)}"
                    yield f"{channel}{of}: {count} values exceed {LARGEST_HALF:.0f}, the largest half, and become infinite"
    for name in asked:
        if name not in met:
            yield f"no channel, layer or part is named {name}"


def _may_be_half(spec: Any, values: npt.NDArray[Any]) -> bool:
    """Return whether the values may be stored as halves. Cryptomatte ids may not: they are bit patterns stored as floats."""
    return values.dtype.kind == "f" and spec.get_string_attribute("primray:source") not in CRYPTOMATTES


def _name(spec: Any) -> str:
    return str(spec.get_string_attribute("oiio:subimagename", PICTURE))
