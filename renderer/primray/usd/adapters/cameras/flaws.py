"""Lens flaws beside distortion (vignetting, chromatic aberration): from PrimrayLensAPI (schemas/usd) or from the settings.

Attributes are read whether or not USD knows the schema. Without attributes and settings a lens has no flaws.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from pxr import Usd

from ....description import Camera, Projection
from ....diagnostics import Diagnostics
from ...stage.reads import property_names
from ...stage.values import When, flag, number, vector

PREFIX = "primray:lens:"
NATURAL = f"{PREFIX}vignetting:natural"
RIM_DISTANCE, RIM_RADIUS = f"{PREFIX}vignetting:mechanicalDistance", f"{PREFIX}vignetting:mechanicalRadius"
MAGNIFICATION, FOCUS_SHIFT = f"{PREFIX}chromatic:lateral", f"{PREFIX}chromatic:longitudinal"
NAMES = (NATURAL, RIM_DISTANCE, RIM_RADIUS, MAGNIFICATION, FOCUS_SHIFT)

Asked = Mapping[str, tuple[float, ...]]


def with_flaws(camera: Camera, prim: Usd.Prim | None, asked: Asked, when: When, diagnostics: Diagnostics) -> Camera:
    """Return the camera with the flaws that its prim authors; flaws asked for in the settings replace them."""
    authored = prim is not None and any(name in NAMES for name in property_names(prim))
    if not authored and not asked:
        return camera
    if camera.projection is Projection.ORTHOGRAPHIC:
        diagnostics.add("camera-input", camera.path, "An orthographic camera has no lens: its flaws are ignored.")
        return camera
    if authored and prim is not None:
        camera = _authored(camera, prim, when, diagnostics)
    if "natural-vignetting" in asked:
        camera = replace(camera, natural_vignetting=asked["natural-vignetting"][0] != 0)
    if "mechanical-vignetting" in asked:
        distance, radius = asked["mechanical-vignetting"]
        camera = replace(camera, rim=(distance, radius))
    if "lateral-chromatic" in asked:
        red, green, blue = asked["lateral-chromatic"]
        camera = replace(camera, channel_magnification=(red, green, blue))
    if "longitudinal-chromatic" in asked:
        red, green, blue = asked["longitudinal-chromatic"]
        camera = replace(camera, channel_focus_shift=(red, green, blue))
    return _focused(camera, diagnostics)


def _authored(camera: Camera, prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> Camera:
    path = str(prim.GetPath())

    def not_below_0(name: str) -> float:
        found = number(prim, name, when, 0.0, diagnostics)
        if found < 0:
            diagnostics.add("out-of-range", path, f"{name} = {found:g} is below 0: 0 is used.", name)
        return max(found, 0.0)

    red, green, blue = vector(prim, MAGNIFICATION, when, (1.0, 1.0, 1.0), diagnostics)
    if min(red, green, blue) <= 0:
        sentence = f"{MAGNIFICATION} = ({red:g}, {green:g}, {blue:g}) is not above 0: 1 is used."
        diagnostics.add("out-of-range", path, sentence, MAGNIFICATION)
        red = green = blue = 1.0
    shift_r, shift_g, shift_b = vector(prim, FOCUS_SHIFT, when, (0.0, 0.0, 0.0), diagnostics)
    return replace(
        camera,
        natural_vignetting=flag(prim, NATURAL, when, False),
        rim=(not_below_0(RIM_DISTANCE), not_below_0(RIM_RADIUS)),
        channel_magnification=(red, green, blue),
        channel_focus_shift=(shift_r, shift_g, shift_b),
    )


def _focused(camera: Camera, diagnostics: Diagnostics) -> Camera:
    """Return the camera without focus shifts, with a diagnostic, if one puts a channel's focus behind the camera."""
    if camera.lens_radius == 0 or min(camera.channel_focus_shift) + camera.focus_distance > 0:
        return camera
    message = f"{FOCUS_SHIFT} brings a channel's focus behind the camera: it is ignored."
    diagnostics.add("out-of-range", camera.path, message, FOCUS_SHIFT)
    return replace(camera, channel_focus_shift=(0.0, 0.0, 0.0))
