"""The display transform of the server's pictures as a table, so that the page draws parts of files like the server's pictures.

The page has no OpenColorIO. It gets the default view's 8-bit values at a cube of linear colours, whose sides are spaced by
log2(value + LEAST) from 0 to MOST, and interpolates: the result is within one 8-bit step, except for a few in a hundred of the
most saturated colours. Format: length of the JSON (4 bytes, little-endian), JSON {side, least, most, display, view}, then
side^3 x 3 values, blue running fastest.
"""

from __future__ import annotations

import json
import struct

import numpy as np

from primray.color.color_space import named
from primray.color.ocio import check_view, to_display

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
