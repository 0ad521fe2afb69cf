"""A camera's thin lens: its radius and plane of focus from UsdGeomCamera, its blades from attributes of known renderers."""

from __future__ import annotations

from dataclasses import dataclass

from pxr import Usd

from ....diagnostics import Diagnostics
from ...querying.guarded import property_names
from ...resolving.read import When, number, read
from ...resolving.renderer_attributes import CONVENTIONS, LENS_WORDS
from .distortion import PREFIX
from .flaws import PREFIX as FLAWS

MM = 0.1  # camera lengths are tenths of scene units (UsdGeomCamera)
# Beyond this floats would overflow: tangents are squared.
WIDEST = 1e15
MOST_BLADES = 4096  # from here on the polygon is the circle to a float's precision


@dataclass(frozen=True)
class Lens:
    radius: float = 0.0  # scene units; 0: a pinhole
    focus_distance: float = 0.0
    blades: int = 0  # 0: a circle
    rotation_deg: float = 0.0


def read_lens(prim: Usd.Prim, focal: float, when: When, disabled: bool, diagnostics: Diagnostics) -> Lens:
    """A pinhole where fStop or focusDistance is 0 (UsdGeomCamera), or depth of field is `disabled`."""
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
    """An orthographic camera has no focal length that would give its aperture a size."""
    lens = number(prim, "fStop", when, 0.0, diagnostics) > 0 and number(prim, "focusDistance", when, 0.0, diagnostics) > 0
    if lens and not disabled:
        message = "An orthographic camera has no lens: fStop and focusDistance are ignored."
        diagnostics.add("camera-input", str(prim.GetPath()), message, "fStop")


def blades_of(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> tuple[int, float]:
    """Sides of the polygon, whose corners lie on the lens's circle, and the direction of one of them."""
    path = str(prim.GetPath())
    authored = {name for name in property_names(prim) if _is_foreign(name)}
    own = set(prim.GetPrimDefinition().GetPropertyNames())
    used = next((c for c in CONVENTIONS if c.blades in authored), None)
    followed = {used.blades, used.rotation_deg, used.roundness} if used else set()
    for name in sorted(authored - own - followed):
        if not _is_neutral(name, read(prim, name, when)):
            diagnostics.add("camera-input", path, f"{name} is ignored: what it does to the lens is not supported.", name)
    if used is None:
        return 0, 0.0
    sides = read(prim, used.blades, when)
    if not isinstance(sides, int) or isinstance(sides, bool) or sides < 0 or sides in (1, 2):
        message = f"{used.blades} = {sides!r} is no number of blades: a circle is used."
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
    """Whether it speaks of the lens, and is not read with its distortion and flaws."""
    return any(word in name.lower() for word in LENS_WORDS) and not name.startswith((PREFIX, FLAWS))


# By the end of an attribute's name, the value that changes nothing.
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
    """Shapes of blades mean nothing without blades."""
    for ending, neutral in _NEUTRAL.items():
        if name.endswith(ending):
            return neutral is None or found == neutral
    return False
