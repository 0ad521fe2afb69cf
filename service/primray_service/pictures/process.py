"""The process that turns previews into pictures: `python -m primray_service.pictures.process`, used over pipes.

A request is a line of JSON: {"path", and PictureRequest's members}, or {"table": [SPACE, VIEW, DISPLAY, LOOK]} for a view. An
answer is a line of JSON, {"bytes", "media_type", "headers"} or {"error"}, followed by that many bytes. The process ends when
its standard input does, however its server died.

A picture is 8-bit pixels: the picture as its PNG will be, one channel of it, or its error in false colours; and PNG files.
The display transform is also available as a table, so that the page, which has no OpenColorIO, draws parts of files alike. It
holds the default view's 8-bit values at a cube of linear colours, whose sides are spaced by log2(value + LEAST) from 0 to MOST;
interpolation is within one 8-bit step, except for a few in a hundred of the most saturated colours. Format: length of the JSON
(4 bytes, little-endian), JSON {side, least, most, display, view}, then side^3 x 3 values, blue running fastest.
"""

from __future__ import annotations

import json
import os
import struct
import sys
import tempfile
import zlib
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import numpy.typing as npt

from primray.color.color_space import LUMINANCE_WEIGHTS, named
from primray.color.ocio import check_view, to_display
from primray.errors import SettingsError
from primray.images.exposure import View, exposure_that_serves
from primray.images.image import encode

from ..worker.preview import BadPreview, Preview, read_preview
from .request import MEDIA_TYPES, PictureRequest

Values = npt.NDArray[Any]

LUMINANCE = np.array(LUMINANCE_WEIGHTS, np.float32)
# Viridis at even steps, by S. van der Walt and N. Smith, CC0: https://bids.github.io/colormap/
VIRIDIS = np.array([
    (68, 1, 84), (72, 40, 120), (62, 74, 137), (49, 104, 142), (38, 130, 142),
    (31, 158, 137), (53, 183, 121), (109, 205, 89), (180, 222, 44), (253, 231, 37),
], np.float32)  # fmt: skip
NO_ESTIMATE = (96, 96, 96)  # grey, which is not in the colour map
NO_ERROR = (0, 0, 0)
MOST_DECADES = 4
DARK = 1e-3  # luminance below which the error is relative to this value, since relative to black it is meaningless


def picture(preview: Preview, request: PictureRequest) -> tuple[Values, dict[str, str]]:
    """Return (H, W, 1, 3 or 4) uint8, and the answer's headers."""
    if request.view == "beauty":
        values = _beauty(_narrowed(preview.rgb, request), _narrowed(preview.alpha[..., None], request), request)
        return values, {} if request.channel == "a" else {"preview-view": _view_in_header(request)}
    return _error_map(preview, request)


def _view_in_header(request: PictureRequest) -> str:
    """Return VIEW (DISPLAY), percent-encoded if a header cannot hold it."""
    display, view = check_view(request.through, request.display)
    return quote(f"{view} ({display})", safe=" ()-.,:/+")


def _beauty(rgb: Values, alpha: Values, request: PictureRequest) -> Values:
    if request.channel == "a":
        return (np.clip(alpha, 0, 1) * 255 + 0.5).astype(np.uint8)
    if request.channel == "rgb":
        return _encoded(np.concatenate([rgb, alpha], axis=2), request, _stops(rgb, alpha, request))
    grey = np.repeat(_one_channel(rgb, request.channel)[..., None], 3, axis=2)
    return _encoded(np.concatenate([grey, np.ones_like(alpha)], axis=2), request, _stops(rgb, alpha, request))


def _encoded(pixels: Values, request: PictureRequest, stops: float) -> Values:
    return encode(pixels, view=request.through, display=request.display, look=request.look, exposure=stops)


def _stops(rgb: Values, alpha: Values, request: PictureRequest) -> float:
    """Return the exposure requested relative to that of the job's files."""
    if request.stops != "auto":
        return (request.stops or 0.0) + request.exposure
    view = View(request.through, request.display, request.look)
    return exposure_that_serves(np.concatenate([rgb, alpha], axis=2), view) + request.exposure


def _one_channel(values: Values, channel: str) -> Values:
    one: Values = values @ LUMINANCE if channel in ("rgb", "luminance") else values[..., "rgb".index(channel)]
    return one


def _error_map(preview: Preview, request: PictureRequest) -> tuple[Values, dict[str, str]]:
    """Return the standard error of luminance (or of one channel) on a logarithmic scale of whole decades, so that the scale is
    stable.

    Channels see the same paths, so their errors are added linearly, not in quadrature: that is an upper bound for luminance.
    """
    deviation = _one_channel(preview.stderr, request.channel)
    side = _side(deviation.shape[1], request)
    if side > 1:
        counts = np.float32(side * side)
        deviation = np.sqrt(_box_mean(np.square(deviation)[..., None], side)[..., 0] / counts)
    if request.view == "relative-error":
        mean = _one_channel(_box_mean(preview.rgb, side), request.channel)
        deviation = deviation / np.maximum(np.abs(mean), DARK)
    else:
        deviation = deviation * np.float32(2.0**request.exposure)
    known = np.isfinite(deviation) & (deviation > 0)
    low, high = _decades(deviation[known])
    position = np.zeros_like(deviation)
    position[known] = (np.log10(deviation[known]) - low) / (high - low)
    steps = np.clip(position, 0, 1) * (len(VIRIDIS) - 1)
    below = np.minimum(steps.astype(np.int32), len(VIRIDIS) - 2)
    share = (steps - below)[..., None]
    colors = VIRIDIS[below] * (1 - share) + VIRIDIS[below + 1] * share
    colors[deviation == 0] = NO_ERROR
    colors[~np.isfinite(deviation)] = NO_ESTIMATE
    unit = "1" if request.view == "relative-error" else "radiance"
    scale = f'log10;low=1e{low:d};high=1e{high:d};unit={unit};map=viridis;none="#000000";unknown="#606060"'
    return (colors + 0.5).astype(np.uint8), {"preview-scale": scale}


def _decades(values: Values) -> tuple[int, int]:
    """Return whole powers of ten around all but the most extreme thousandth of the values."""
    if not values.size:
        return -MOST_DECADES, 0
    low, high = (float(x) for x in np.log10(np.quantile(values, (0.001, 0.999))))
    top = int(np.ceil(high))
    return min(max(int(np.floor(low)), top - MOST_DECADES), top - 1), top


def _narrowed(values: Values, request: PictureRequest) -> Values:
    return _box_mean(values, _side(values.shape[1], request))


def _side(width: int, request: PictureRequest) -> int:
    """Return the side of the boxes that reduce the picture to the requested width; it is never enlarged."""
    return 1 if request.width is None else max(1, -(-width // request.width))


def _box_mean(values: Values, side: int) -> Values:
    """Return (H, W, C) averaged over boxes of side x side; the last of a row or column are smaller."""
    if side == 1:
        return values
    height, width = values.shape[:2]
    rows, columns = np.arange(0, height, side), np.arange(0, width, side)
    sums = np.add.reduceat(np.add.reduceat(values, rows, axis=0), columns, axis=1)
    counts = np.diff(np.append(rows, height))[:, None, None] * np.diff(np.append(columns, width))[None, :, None]
    mean: Values = (sums / counts).astype(np.float32)
    return mean


SIDE = 65
LEAST, MOST = 0.03, 512.0


def view_table(space: str, view: str | None = None, display: str | None = None, look: str | None = None) -> bytes:
    """Return the table. `space`: one of request.Space; SettingsError for names that the configuration does not have."""
    places = np.geomspace(LEAST, MOST + LEAST, SIDE, dtype=np.float64) - LEAST
    places[0] = 0.0
    cube = np.stack(np.meshgrid(places, places, places, indexing="ij"), axis=-1).astype(np.float32)
    found = named(space)
    assert found is not None
    shown = to_display(cube.reshape(SIDE, -1, 3), view, display, look=look, space=found)
    values = (np.clip(np.nan_to_num(shown), 0, 1) * 255 + 0.5).astype(np.uint8)
    display, view = check_view(view, display)
    head = json.dumps({"side": SIDE, "least": LEAST, "most": MOST, "display": display, "view": view}).encode()
    return struct.pack("<I", len(head)) + head + values.tobytes()


SIGNATURE = b"\x89PNG\r\n\x1a\n"
COLOR_TYPES = {1: 0, 3: 2, 4: 6}  # channels -> table 8: greyscale, truecolour, truecolour with alpha
FILTER_UP = 2
COMPRESSION = 1  # noise hardly compresses, so speed matters more


def png(values: npt.NDArray[Any]) -> bytes:
    """Return a PNG of (H, W, C) uint8 with 1, 3 or 4 channels."""
    height, width, channels = values.shape
    rows = values.reshape(height, width * channels)
    filtered = np.empty((height, 1 + rows.shape[1]), np.uint8)
    filtered[:, 0] = FILTER_UP
    filtered[0, 1:] = rows[0]
    np.subtract(rows[1:], rows[:-1], out=filtered[1:, 1:])  # modulo 256, as the filter requires
    header = struct.pack(">IIBBBBB", width, height, 8, COLOR_TYPES[channels], 0, 0, 0)
    srgb = _chunk(b"sRGB", b"\0")
    body = zlib.compress(filtered.tobytes(), COMPRESSION)
    return SIGNATURE + _chunk(b"IHDR", header) + srgb + _chunk(b"IDAT", body) + _chunk(b"IEND", b"")


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


JPEG_QUALITY = 90


def main() -> None:
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # output of libraries must not mix with the answers
    for line in sys.stdin.buffer:
        try:
            head, data = answer(json.loads(line))
        except (BadPreview, OSError, SettingsError) as error:
            head, data = {"error": str(error) or type(error).__name__, "bytes": 0}, b""
        answers.write(json.dumps(head).encode() + b"\n" + data)
        answers.flush()


def answer(asked: dict[str, Any]) -> tuple[dict[str, Any], bytes]:
    if "table" in asked:
        data = view_table(*asked["table"])
        return {"bytes": len(data), "media_type": MEDIA_TYPES["raw"], "headers": {}}, data
    request = PictureRequest(**{name: value for name, value in asked.items() if name != "path"})
    preview = read_preview(Path(asked["path"]))
    values, headers = picture(preview, request)
    data = jpeg(values) if request.format == "jpeg" else png(values)
    headers |= facts(preview)
    return {"bytes": len(data), "media_type": MEDIA_TYPES[request.format], "headers": headers}, data


def facts(preview: Preview) -> dict[str, str]:
    """Return facts about the picture, for headers."""
    width, height = preview.picture
    return {
        "preview-pass": str(preview.passes),
        "preview-samples": str(preview.samples),
        "preview-resolution": f"{width}x{height}",
    }


def jpeg(values: Any) -> bytes:
    import OpenImageIO as oiio

    height, width, channels = values.shape
    kept = 1 if channels == 1 else 3  # JPEG has no alpha; the background is black
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder, "preview.jpg"))
        spec = oiio.ImageSpec(width, height, kept, "uint8")
        spec.attribute("Compression", f"jpeg:{JPEG_QUALITY}")
        if channels == 4:
            values = (values[..., :3] * (values[..., 3:] / 255.0) + 0.5).astype("uint8")
        file = oiio.ImageOutput.create(path)
        if file is None or not file.open(path, spec) or not file.write_image(values) or not file.close():
            raise OSError("the JPEG could not be written")
        return Path(path).read_bytes()


if __name__ == "__main__":
    main()
