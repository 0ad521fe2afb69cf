"""PrimrayLensAPI: attributes `primray:lens:...` of a camera for what UsdGeomCamera does not define.

They are read whether or not the schema is registered or applied. Unknown names in the namespace are reported, as a misspelt
attribute would silently do nothing.
"""

from __future__ import annotations

from pxr import Usd

from ....diagnostics import Diagnostics
from ....lens.diffusion import NO_DIFFUSION, Diffusion, fault_of
from ...stage.reads import property_names
from ...stage.values import When, number, read
from .flaws import NAMES as FLAWS
from .flaws import PREFIX
from .lens import Lens, blades_of
from .rolling_shutter import READOUT

DIFFUSION = {
    "strength": "strength",
    "glare": "glare",
    "bloomWidth": "bloom_width",
    "starburst": "starburst",
    "starburstWidth": "starburst_width",
}
BLADES, ROTATION = f"{PREFIX}diffusion:blades", f"{PREFIX}diffusion:bladeRotation"
NAMES = frozenset({*(f"{PREFIX}diffusion:{name}" for name in DIFFUSION), BLADES, ROTATION, *FLAWS, READOUT})


def note_unknown_names(prim: Usd.Prim, diagnostics: Diagnostics) -> None:
    """Report attributes `primray:lens:...` that the schema does not have."""
    for name in sorted(property_names(prim)):
        if name.startswith(PREFIX) and name not in NAMES:
            message = f"{name} is ignored: PrimrayLensAPI has no such attribute."
            diagnostics.add("camera-input", str(prim.GetPath()), message, name)


def read_diffusion(prim: Usd.Prim, lens: Lens, when: When, diagnostics: Diagnostics) -> Diffusion:
    """Return the camera's diffusion; values out of range count as not authored. A pinhole's blades shape its starburst only."""
    values = {member: _number(prim, name, member, when, diagnostics) for name, member in DIFFUSION.items()}
    if values["glare"] + values["starburst"] > 1:
        sentence = f"glare {values['glare']:g} and starburst {values['starburst']:g} together must be at most 1"
        diagnostics.add("out-of-range", str(prim.GetPath()), f"{sentence}: defaults are used.", f"{PREFIX}diffusion:starburst")
        values |= {"glare": NO_DIFFUSION.glare, "starburst": NO_DIFFUSION.starburst}
    strength, glare, bloom_width, starburst, starburst_width = values.values()
    return Diffusion(strength, glare, bloom_width, starburst, starburst_width, *_aperture(prim, lens, when, diagnostics))


def _number(prim: Usd.Prim, name: str, member: str, when: When, diagnostics: Diagnostics) -> float:
    default: float = getattr(NO_DIFFUSION, member)
    attribute = f"{PREFIX}diffusion:{name}"
    found = number(prim, attribute, when, default, diagnostics)
    fault = fault_of(member, found)
    if fault:
        diagnostics.add("out-of-range", str(prim.GetPath()), f"{attribute}: {fault}; {default:g} is used.", attribute)
    return default if fault else found


def _aperture(prim: Usd.Prim, lens: Lens, when: When, diagnostics: Diagnostics) -> tuple[int | None, float]:
    """Return the starburst's blades and rotation; None for the blades if depth of field has them."""
    own = read(prim, BLADES, when)
    if own is not None:
        fault = "" if isinstance(own, int) and not isinstance(own, bool) else f"blades must be a whole number, not {own!r}"
        fault = fault or fault_of("blades", own)
        if not fault:
            return own, number(prim, ROTATION, when, 0.0, diagnostics)
        diagnostics.add("out-of-range", str(prim.GetPath()), f"{BLADES}: {fault}; the camera's are used.", BLADES)
    if lens.radius > 0:
        return None, 0.0
    blades, rotation = blades_of(prim, when, Diagnostics())
    return (blades, rotation) if blades else (None, 0.0)
