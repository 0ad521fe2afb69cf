"""Thin lens of a camera: radius and focus distance from UsdGeomCamera, blades from attributes of known renderers."""

from __future__ import annotations

from dataclasses import dataclass

from pxr import Usd

from ....diagnostics import Diagnostics
from ...scene.schemas import CONVENTIONS, LENS_WORDS
from ...stage.reads import property_names
from ...stage.values import When, number, read
from .distortion import PREFIX
from .flaws import PREFIX as FLAWS

MM = 0.1  # camera lengths are tenths of scene units (UsdGeomCamera)
# Larger tangents would overflow single precision when squared.
WIDEST = 1e15
MOST_BLADES = 4096  # with more, the polygon is a circle to single precision


@dataclass(frozen=True)
class Lens:
    radius: float = 0.0  # scene units; 0: a pinhole
    focus_distance: float = 0.0
    blades: int = 0  # 0: a circle
    rotation_deg: float = 0.0


def read_lens(prim: Usd.Prim, focal: float, when: When, disabled: bool, diagnostics: Diagnostics) -> Lens:
    """Return the lens: a pinhole if fStop or focusDistance is 0 (UsdGeomCamera), or depth of field is `disabled`."""
    f_stop = number(prim, "fStop", when, 0.0, diagnostics)
    focus = number(prim, "focusDistance", when, 0.0, diagnostics)
    path = str(prim.GetPath())
    for name, found in (("fStop", f_stop), ("focusDistance", focus)):
        if found < 0:
            diagnostics.add("out-of-range", path, f"{name} = {found:g} is below 0: a pinhole is used.", name)
    if disabled or f_stop <= 0 or focus <= 0:
        return Lens()
    radius = MM * focal / (2.0 * f_stop)
    if not max(radius, radius / focus) < WIDEST:
        sentence = f"A lens of radius {radius:g} cannot focus at {focus:g}: a pinhole is used."
        diagnostics.add("out-of-range", path, sentence, "fStop")
        return Lens()
    return Lens(radius, focus, *blades_of(prim, when, diagnostics))


def note_no_lens(prim: Usd.Prim, when: When, disabled: bool, diagnostics: Diagnostics) -> None:
    """Report depth of field of an orthographic camera, which has no focal length and so no aperture diameter."""
    lens = number(prim, "fStop", when, 0.0, diagnostics) > 0 and number(prim, "focusDistance", when, 0.0, diagnostics) > 0
    if lens and not disabled:
        message = "An orthographic camera has no lens: fStop and focusDistance are ignored."
        diagnostics.add("camera-input", str(prim.GetPath()), message, "fStop")


def blades_of(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> tuple[int, float]:
    """Return the number of blades (0: a circle) and the rotation of a corner in degrees; corners lie on the lens's circle."""
    path = str(prim.GetPath())
    authored = {name for name in property_names(prim) if _is_foreign(name)}
    own = set(prim.GetPrimDefinition().GetPropertyNames())
    used = next((c for c in CONVENTIONS if c.blades in authored), None)
    followed = {used.blades, used.rotation_deg, used.roundness} if used else set()
    for name in sorted(authored - own - followed):
        if not _is_neutral(name, read(prim, name, when)):
            diagnostics.add("camera-input", path, f"{name} is ignored: this property of the lens is not supported.", name)
    if used is None:
        return 0, 0.0
    sides = read(prim, used.blades, when)
    if not isinstance(sides, int) or isinstance(sides, bool) or sides < 0 or sides in (1, 2):
        message = f"{used.blades} = {sides!r} is not a number of blades: a circle is used."
        diagnostics.add("camera-input", path, message, used.blades)
        return 0, 0.0
    roundness = number(prim, used.roundness, when, 0.0, diagnostics)
    if roundness not in (0.0, 1.0):
        message = f"{used.roundness} = {roundness:g} is ignored: the blades are straight."
        diagnostics.add("camera-input", path, message, used.roundness)
    if sides == 0 or sides > MOST_BLADES or roundness == 1.0:
        return 0, 0.0
    return sides, number(prim, used.rotation_deg, when, 0.0, diagnostics)


def _is_foreign(name: str) -> bool:
    """Return whether an attribute names the lens and is not one of this renderer's, or of the distortion schemas."""
    return any(word in name.lower() for word in LENS_WORDS) and not name.startswith((PREFIX, FLAWS))


# The neutral value of an attribute, by the end of its name; None: any value, as it only shapes blades.
_NEUTRAL = {
    "aspect_ratio": 1.0,
    "dofaspect": 1.0,
    "dofMult": 1.0,
    "ensity": 0.0,
    "oundness": None,
    "urvature": None,
    "ngle": None,
    "otation": None,
    "istortion": 0.0,
}


def _is_neutral(name: str, found: object) -> bool:
    """Return whether the value of an attribute has no effect."""
    for ending, neutral in _NEUTRAL.items():
        if name.endswith(ending):
            return neutral is None or found == neutral
    return False
