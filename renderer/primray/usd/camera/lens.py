"""Lens of a camera: thin lens from UsdGeomCamera, blades, flaws (vignetting, chromatic aberration) and diffusion.

Blades are read from attributes of known renderers. Flaws and diffusion are attributes `primray:lens:...` of PrimrayLensAPI
(schemas/usd), read whether or not the schema is registered or applied; settings of the render override them. Unknown names
in the namespace are reported, as a misspelt attribute would silently do nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from pxr import Usd

from ...description import Camera, Projection
from ...diagnostics import Diagnostics
from ...errors import SettingsError
from ...lens.diffusion import NO_DIFFUSION, Diffusion, fault_of
from ...settings import DIFFUSION, RenderSettings
from ..scene.schemas import CONVENTIONS, LENS_WORDS
from ..stage.reads import property_names
from ..stage.values import When, flag, number, read, report_without_value, vector
from .distortion import DISTORTION_PREFIX
from .shutter import READOUT

MM = 0.1  # camera lengths are tenths of scene units (UsdGeomCamera)
# Larger tangents would overflow single precision when squared.
WIDEST_TANGENT = 1e15
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
    if not max(radius, radius / focus) < WIDEST_TANGENT:
        sentence = f"A lens of radius {radius:g} cannot focus at {focus:g}: a pinhole is used."
        diagnostics.add("out-of-range", path, sentence, "fStop")
        return Lens()
    return Lens(radius, focus, *read_blades(prim, when, diagnostics))


def report_ignored_lens(prim: Usd.Prim, when: When, disabled: bool, diagnostics: Diagnostics) -> None:
    """Report depth of field of an orthographic camera, which has no focal length and so no aperture diameter."""
    lens = number(prim, "fStop", when, 0.0, diagnostics) > 0 and number(prim, "focusDistance", when, 0.0, diagnostics) > 0
    if lens and not disabled:
        message = "An orthographic camera has no lens: fStop and focusDistance are ignored."
        diagnostics.add("camera-input", str(prim.GetPath()), message, "fStop")


def read_blades(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> tuple[int, float]:
    """Return the number of blades (0: a circle) and the rotation of a corner in degrees; corners lie on the lens's circle."""
    path = str(prim.GetPath())
    authored = {name for name in property_names(prim) if _is_foreign_lens_name(name)}
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


def _is_foreign_lens_name(name: str) -> bool:
    """Return whether an attribute names the lens and is not one of this renderer's, or of the distortion schemas."""
    return any(word in name.lower() for word in LENS_WORDS) and not name.startswith((DISTORTION_PREFIX, LENS_PREFIX))


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


LENS_PREFIX = "primray:lens:"
NATURAL_VIGNETTING = f"{LENS_PREFIX}vignetting:natural"
RIM_DISTANCE, RIM_RADIUS = f"{LENS_PREFIX}vignetting:mechanicalDistance", f"{LENS_PREFIX}vignetting:mechanicalRadius"
MAGNIFICATION, FOCUS_SHIFT = f"{LENS_PREFIX}chromatic:lateral", f"{LENS_PREFIX}chromatic:longitudinal"
FLAW_NAMES = (NATURAL_VIGNETTING, RIM_DISTANCE, RIM_RADIUS, MAGNIFICATION, FOCUS_SHIFT)

RequestedFlaws = Mapping[str, tuple[float, ...]]


def with_lens_flaws(
    camera: Camera, prim: Usd.Prim | None, asked: RequestedFlaws, when: When, diagnostics: Diagnostics
) -> Camera:
    """Return the camera with the flaws that its prim authors; flaws asked for in the settings replace them."""
    authored = prim is not None and any(name in FLAW_NAMES for name in property_names(prim))
    if not authored and not asked:
        return camera
    if camera.projection is Projection.ORTHOGRAPHIC:
        diagnostics.add("camera-input", camera.path, "An orthographic camera has no lens: its flaws are ignored.")
        return camera
    if authored and prim is not None:
        camera = _with_authored_flaws(camera, prim, when, diagnostics)
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
    return _with_valid_focus(camera, diagnostics)


def _with_authored_flaws(camera: Camera, prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> Camera:
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
        natural_vignetting=flag(prim, NATURAL_VIGNETTING, when, False, diagnostics),
        rim=(not_below_0(RIM_DISTANCE), not_below_0(RIM_RADIUS)),
        channel_magnification=(red, green, blue),
        channel_focus_shift=(shift_r, shift_g, shift_b),
    )


def _with_valid_focus(camera: Camera, diagnostics: Diagnostics) -> Camera:
    """Return the camera without focus shifts, with a diagnostic, if one puts a channel's focus behind the camera."""
    if camera.lens_radius == 0 or min(camera.channel_focus_shift) + camera.focus_distance > 0:
        return camera
    message = f"{FOCUS_SHIFT} brings a channel's focus behind the camera: it is ignored."
    diagnostics.add("out-of-range", camera.path, message, FOCUS_SHIFT)
    return replace(camera, channel_focus_shift=(0.0, 0.0, 0.0))


DIFFUSION_ATTRIBUTES = {
    "strength": "strength",
    "glare": "glare",
    "bloomWidth": "bloom_width",
    "starburst": "starburst",
    "starburstWidth": "starburst_width",
}
BLADES, ROTATION = f"{LENS_PREFIX}diffusion:blades", f"{LENS_PREFIX}diffusion:bladeRotation"
LENS_NAMES = frozenset(
    {*(f"{LENS_PREFIX}diffusion:{name}" for name in DIFFUSION_ATTRIBUTES), BLADES, ROTATION, *FLAW_NAMES, READOUT}
)


def report_unread_lens_names(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> None:
    """Report attributes `primray:lens:...` that the schema does not have, or that have no value."""
    for name in sorted(property_names(prim)):
        if name.startswith(LENS_PREFIX) and name not in LENS_NAMES:
            message = f"{name} is ignored: PrimrayLensAPI has no such attribute."
            diagnostics.add("camera-input", str(prim.GetPath()), message, name)
    report_without_value(prim, LENS_NAMES, when, diagnostics)


def read_diffusion(prim: Usd.Prim, lens: Lens, when: When, diagnostics: Diagnostics) -> Diffusion:
    """Return the camera's diffusion; values out of range count as not authored. A pinhole's blades shape its starburst only."""
    values = {member: _diffusion_number(prim, name, member, when, diagnostics) for name, member in DIFFUSION_ATTRIBUTES.items()}
    if values["glare"] + values["starburst"] > 1:
        sentence = f"glare {values['glare']:g} and starburst {values['starburst']:g} together must be at most 1"
        diagnostics.add(
            "out-of-range", str(prim.GetPath()), f"{sentence}: defaults are used.", f"{LENS_PREFIX}diffusion:starburst"
        )
        values |= {"glare": NO_DIFFUSION.glare, "starburst": NO_DIFFUSION.starburst}
    blades, rotation_deg = _starburst_aperture(prim, lens, when, diagnostics)
    return Diffusion(**values, blades=blades, blade_rotation_deg=rotation_deg)


def _diffusion_number(prim: Usd.Prim, name: str, member: str, when: When, diagnostics: Diagnostics) -> float:
    default: float = getattr(NO_DIFFUSION, member)
    attribute = f"{LENS_PREFIX}diffusion:{name}"
    found = number(prim, attribute, when, default, diagnostics)
    fault = fault_of(member, found)
    if fault:
        diagnostics.add("out-of-range", str(prim.GetPath()), f"{attribute}: {fault}; {default:g} is used.", attribute)
    return default if fault else found


def _starburst_aperture(prim: Usd.Prim, lens: Lens, when: When, diagnostics: Diagnostics) -> tuple[int | None, float]:
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
    blades, rotation = read_blades(prim, when, Diagnostics())
    return (blades, rotation) if blades else (None, 0.0)


def with_diffusion(camera: Camera, settings: RenderSettings) -> Camera:
    """Return the camera with the settings' diffusion; SettingsError if its shares then add up to more than 1."""
    asked = {member: getattr(settings, name) for name, member in DIFFUSION.items()}
    asked = {member: value for member, value in asked.items() if value is not None}
    if not asked:
        return camera
    try:
        return replace(camera, diffusion=replace(camera.diffusion, **asked))
    except ValueError as error:
        sentence = f"with what the camera says, {error}"
        raise SettingsError(sentence, where="diffusion_starburst") from None
