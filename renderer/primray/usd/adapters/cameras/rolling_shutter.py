"""Rolling shutter of a camera: attributes of OmniRtxRollingShutterAPI (NVIDIA's Omniverse), else of PrimrayLensAPI.

USD need not know these schemas. Names and meanings of the former are those of the ovrtx 0.7 documentation ("Rolling Shutter"):
times are fractions (numerator, denominator) of a second.
"""

from __future__ import annotations

from dataclasses import dataclass

from pxr import Usd

from ....diagnostics import Diagnostics
from ...scene.schemas import ROLLING_SHUTTER
from ...stage.reads import property_names
from ...stage.values import When, number, token, vector

ORDER, OFFSET, EXPOSURE = (f"{ROLLING_SHUTTER}{name}" for name in ("scanOrder", "lineOffset", "lineExposure"))
READOUT = "primray:lens:rollingShutter:readout"  # time codes from the first row to the last
# The direction (x right, y down) in which lines are exposed one after the other.
ORDERS = {"topToBottom": (0, 1), "bottomToTop": (0, -1), "leftToRight": (1, 0), "rightToLeft": (-1, 0)}


@dataclass(frozen=True)
class Scan:
    """Scan of a rolling shutter: direction of the lines, and offset and exposure of each."""

    direction: tuple[int, int]
    line_offset_s: float
    line_exposure_s: float | None  # None: as long as the camera's shutter is open
    readout: float = 0.0  # instead of line_offset_s: time codes from the first line to the last


def read_scan(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> Scan | None:
    """Return the scan; None if the whole film is exposed at once."""
    order = token(prim, ORDER, when, "none")
    if order == "none":
        readout = number(prim, READOUT, when, 0.0, diagnostics)
        return Scan((0, -1 if readout < 0 else 1), 0.0, None, abs(readout)) if readout else None
    if order not in ORDERS:
        message = f"{ORDER} = {order} is unknown: the whole film is exposed at once."
        diagnostics.add("camera-input", str(prim.GetPath()), message, ORDER)
        return None
    offset = _seconds(prim, OFFSET, when, diagnostics)
    exposure = _seconds(prim, EXPOSURE, when, diagnostics) if EXPOSURE in property_names(prim) else None
    return Scan(ORDERS[order], offset, exposure)


def _seconds(prim: Usd.Prim, name: str, when: When, diagnostics: Diagnostics) -> float:
    above, below = vector(prim, name, when, (0.0, 1.0), diagnostics)
    if below > 0 and above >= 0:
        return above / below
    message = f"{name} = ({above:g}, {below:g}) is not a fraction of a second: 0 is used."
    diagnostics.add("out-of-range", str(prim.GetPath()), message, name)
    return 0.0
