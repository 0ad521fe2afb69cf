"""Pictures in tev, a high dynamic range viewer: outputs named tev://HOST:PORT/NAME, sent over TCP while they refine.

The packet format is that of tev's README ("Over a network") and src/Ipc.cpp: little-endian, a length that includes itself, a
type, then fields without padding; text ends with a zero byte. tev does not answer.
"""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlsplit

import numpy as np

from ..arrays import Floats
from ..errors import PrimrayError, SettingsError

if TYPE_CHECKING:
    from .image import Image

SCHEME = "tev://"
PORT = 14158  # tev's default
DEFAULT_NAME = "primray"
CREATE, UPDATE = 4, 6  # packet types; the latter with channel offsets and strides
BAND_BYTES = 1 << 22  # pixel bytes per packet: tev shows whole packets, whose lengths have 32 bits
CONNECT_S, SEND_S = 5.0, 20.0


@dataclass(frozen=True)
class TevAddress:
    """Host and port of a tev, and the picture's name there."""

    host: str
    port: int
    name: str


def tev_address(text: str) -> TevAddress:
    """Parse tev://HOST[:PORT][/NAME]; SettingsError ("tev-address") if it is malformed."""
    try:
        parts = urlsplit(text, allow_fragments=False)
        host, port = parts.hostname, parts.port
    except ValueError as error:
        raise _no_address(text, f": {error}") from None
    name = unquote(parts.path.removeprefix("/"))
    if not host or port == 0 or parts.query or parts.username is not None or "\0" in name:
        raise _no_address(text)
    return TevAddress(host, PORT if port is None else port, name or DEFAULT_NAME)


def _no_address(text: str, why: str = "") -> SettingsError:
    sentence = f"not an address of tev; expected one such as {SCHEME}localhost:{PORT} or {SCHEME}localhost:{PORT}/name{why}"
    return SettingsError(sentence, where=text, code="tev-address")


class TevPicture:
    """One picture in a tev, over its own connection: created by the first `show`, updated by later ones."""

    def __init__(self, output: str) -> None:
        """Connect to tev.

        SettingsError if `output` is malformed ("tev-address") or nothing listens there ("tev-unreachable").
        """
        self._output = output
        self._address = tev_address(output)
        self._made: tuple[object, ...] | None = None
        where = (self._address.host, self._address.port)
        try:
            self._socket = socket.create_connection(where, CONNECT_S)
        except (OSError, UnicodeError) as error:
            sentence = f"no tev is listening: {_reason(error)}; start tev, or check its --host"
            raise SettingsError(sentence, where=output, code="tev-unreachable") from None
        self._socket.settimeout(SEND_S)

    def show(self, image: Image) -> None:
        """Send R, G, B, A and the standard errors of all pixels; PrimrayError ("write-failed") if the connection is lost."""
        window, corner = _windows(image)
        made = (window, channels_of(image))
        packets = pixel_packets(self._address.name, channels_of(image), image.values, corner)
        try:
            if self._made != made:
                self._socket.sendall(create_packet(self._address.name, window, channels_of(image)))
            for packet in packets:
                self._socket.sendall(packet)
        except OSError as error:
            raise PrimrayError(
                f"tev does not accept the picture: {_reason(error)}", where=self._output, code="write-failed"
            ) from error
        self._made = made

    def close(self) -> None:
        self._socket.close()


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error) or type(error).__name__


def channels_of(image: Image) -> tuple[str, ...]:
    """Return channel names of `Image.values`; tev groups them by the part before the dot."""
    from .image import ERROR_CHANNELS

    return image.channels if image.errors is None else image.channels + ERROR_CHANNELS


def _windows(image: Image) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return (width, height) of a canvas for frame and pixels, and the corner (x, y) of the pixels. tev has no windows."""
    width, height = image.resolution
    if image.frame is None:
        return (width, height), (0, 0)
    pixels, whole = image.frame.pixels, image.frame.resolution
    x, y = min(pixels.x, 0), min(pixels.y, 0)
    size = max(pixels.x + width, whole[0]) - x, max(pixels.y + height, whole[1]) - y
    return size, (pixels.x - x, pixels.y - y)


def create_packet(name: str, size: tuple[int, int], channels: Sequence[str]) -> bytes:
    """Return a packet that creates a black picture of (width, height), replacing one of that name, and selects it."""
    return _packet(CREATE, b"\1" + _text(name) + struct.pack("<iii", *size, len(channels)) + b"".join(map(_text, channels)))


def pixel_packets(name: str, channels: Sequence[str], values: Floats, corner: tuple[int, int]) -> Iterator[bytes]:
    """Yield packets that set pixels (H, W, C) from the corner (x, y) on, in bands of whole rows."""
    height, width, count = values.shape
    rows = max(1, BAND_BYTES // (width * count * 4))
    head = b"\0" + _text(name) + struct.pack("<i", count) + b"".join(map(_text, channels))
    layout = struct.pack(f"<{2 * count}q", *range(count), *[count] * count)  # a pixel's channels side by side
    for top in range(0, height, rows):
        band = np.ascontiguousarray(values[top : top + rows], "<f4")
        box = struct.pack("<iiii", corner[0], corner[1] + top, width, len(band))
        yield _packet(UPDATE, head + box + layout + band.tobytes())


def _packet(kind: int, fields: bytes) -> bytes:
    return struct.pack("<IB", 5 + len(fields), kind) + fields


def _text(text: str) -> bytes:
    return text.encode("utf-8", "replace") + b"\0"
