"""UsdGeomCamera to the description's camera: rigid frame, window conformed to the image, thin lens, exposure."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from pxr import Gf, Usd, UsdGeom

from ...description import Camera, Doubles, Projection
from ...diagnostics import Diagnostics
from ..convert import matrix
from ..read import When, number, read, token, vector
from ..resolve import local_matrix
from .render_product import ProductSettings

MM = 0.1  # camera lengths are tenths of scene units (UsdGeomCamera)

# Beyond these floats would overflow: tangents are squared, an exposure is multiplied by radiance.
WIDEST_WINDOW = 1e15
BRIGHTEST = 2.0**64


@dataclass(frozen=True)
class Aperture:
    """The film's extent and offset in the camera's own units."""

    width: float
    height: float
    offset_x: float = 0.0
    offset_y: float = 0.0

    @property
    def aspect(self) -> float:
        return self.width / self.height


def read_aperture(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> Aperture:
    def positive(name: str, default: float) -> float:
        size = number(prim, name, when, default, diagnostics)
        if size > 0:
            return size
        diagnostics.add("camera-input", str(prim.GetPath()), f"{name} = {size:g} is not positive: {default:g} is used.")
        return default

    return Aperture(
        positive("horizontalAperture", 20.955),
        positive("verticalAperture", 15.2908),
        number(prim, "horizontalApertureOffset", when, 0.0, diagnostics),
        number(prim, "verticalApertureOffset", when, 0.0, diagnostics),
    )


def conform(aperture: Aperture, resolution: tuple[int, int], product: ProductSettings) -> Aperture:
    """The aperture adapted to the image (UsdRenderSettingsBase, aspectRatioConformPolicy); offsets stay as they are."""
    image = product.pixel_aspect_ratio * resolution[0] / resolution[1]
    policy = product.conform_policy
    wider = aperture.aspect > image
    taller, narrower = replace(aperture, height=aperture.width / image), replace(aperture, width=aperture.height * image)
    match policy:
        case "adjustPixelAspectRatio":
            return aperture
        case "adjustApertureWidth":
            return narrower
        case "adjustApertureHeight":
            return taller
        case "cropAperture":
            return narrower if wider else taller
        case _:
            return taller if wider else narrower


def camera(
    prim: Usd.Prim, when: When, resolution: tuple[int, int], product: ProductSettings, diagnostics: Diagnostics
) -> Camera:
    path = str(prim.GetPath())
    aperture = conform(read_aperture(prim, when, diagnostics), resolution, product)
    orthographic = token(prim, "projection", when, "perspective") == "orthographic"
    focal = number(prim, "focalLength", when, 50.0, diagnostics)
    if focal <= 0 and not orthographic:
        diagnostics.add("camera-input", path, f"focalLength = {focal:g} is not positive: 50 is used.")
        focal = 50.0
    window = window_of(aperture, MM if orthographic else 1.0 / focal)
    if not _is_usable(window):
        shown = ", ".join(f"{side:g}" for side in window)
        diagnostics.add("camera-input", path, f"No film can be as wide as ({shown}) at unit distance: apertures are ignored.")
        focal, aperture = max(focal, 50.0), conform(Aperture(20.955, 15.2908), resolution, ProductSettings())
        window = window_of(aperture, MM if orthographic else 1.0 / focal)
    lens_radius, focus = (0.0, 0.0) if orthographic else _lens(prim, focal, when, product, diagnostics)
    _note_ignored(prim, when, diagnostics)
    return Camera(
        path,
        _world_from_camera(prim, when, diagnostics),
        Projection.ORTHOGRAPHIC if orthographic else Projection.PERSPECTIVE,
        window,
        _clipping_range(prim, when, orthographic, diagnostics),
        lens_radius,
        focus,
        _exposure_scale(prim, when, diagnostics),
    )


def window_of(aperture: Aperture, scale: float) -> tuple[float, float, float, float]:
    """GfCamera::GetFrustum: the aperture about its offset, over the focal length or in scene units."""
    x, y, w, h = aperture.offset_x, aperture.offset_y, aperture.width / 2, aperture.height / 2
    return ((x - w) * scale, (x + w) * scale, (y - h) * scale, (y + h) * scale)


def _is_usable(window: tuple[float, float, float, float]) -> bool:
    """Whether floats can tell its sides apart, and square them."""
    with np.errstate(over="ignore"):
        left, right, bottom, top = map(np.float32, window)
    return bool(left < right and bottom < top and np.abs([left, right, bottom, top]).max() < WIDEST_WINDOW)


def _lens(prim: Usd.Prim, focal: float, when: When, product: ProductSettings, diagnostics: Diagnostics) -> tuple[float, float]:
    """Lens radius and focus distance in scene units; (0, 0) is a pinhole (fStop or focusDistance 0, UsdGeomCamera)."""
    f_stop = number(prim, "fStop", when, 0.0, diagnostics)
    focus = number(prim, "focusDistance", when, 0.0, diagnostics)
    if f_stop <= 0 or focus <= 0 or product.disable_depth_of_field:
        return (0.0, 0.0)
    lens_radius = MM * focal / (2.0 * f_stop)
    if max(lens_radius, lens_radius / focus) < WIDEST_WINDOW:
        return (lens_radius, focus)
    sentence = f"A lens of radius {lens_radius:g} cannot focus at {focus:g}: a pinhole is used."
    diagnostics.add("camera-input", str(prim.GetPath()), sentence)
    return (0.0, 0.0)


def _clipping_range(prim: Usd.Prim, when: When, orthographic: bool, diagnostics: Diagnostics) -> tuple[float, float]:
    near, far = vector(prim, "clippingRange", when, (1.0, 1e6), diagnostics)
    if near < far and (near >= 0 or orthographic):
        return (near, far)
    diagnostics.add("camera-input", str(prim.GetPath()), f"clippingRange = ({near:g}, {far:g}) is ignored: nothing is clipped.")
    return (0.0, 3e38)


def _exposure_scale(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> float:
    """UsdGeomCamera::ComputeLinearExposureScale: responsivity * time * iso / 100 * 2^exposure / fStop^2."""

    def get(name: str, default: float) -> float:
        return number(prim, name, when, default, diagnostics)

    def note(what: str) -> None:
        diagnostics.add("camera-input", str(prim.GetPath()), what)

    f_stop = get("exposure:fStop", 1.0)
    time, iso, responsivity = get("exposure:time", 1.0), get("exposure:iso", 100.0), get("exposure:responsivity", 1.0)
    if f_stop <= 0:
        note(f"exposure:fStop = {f_stop:g} is not positive: 1 is used.")
        f_stop = 1.0
    if min(time, iso, responsivity) < 0:
        note("An exposure (time, iso or responsivity) below 0 is ignored: 1 is used for all.")
        return 1.0
    # In double, where neither these floats' products nor their squares overflow; powers of two would.
    scale = responsivity * time * iso / 100.0 / f_stop / f_stop
    scale *= math.pow(2.0, min(max(get("exposure", 0.0), -1000.0), 400.0))
    if not scale < BRIGHTEST:
        note(f"The exposure multiplies the picture by {scale:g}, beyond what its floats hold: 1 is used.")
        return 1.0
    if scale < 1e-37:
        note(f"The exposure multiplies the picture by {scale:g}: it is black.")
    return scale


def _world_from_camera(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> Doubles:
    """Rigid, as GfFrustum makes it: scale and shear are removed."""
    gf = _world_matrix(prim, when)
    if not np.isfinite(np.array(gf)).all():
        diagnostics.add(
            "invalid-transform", str(prim.GetPath()), "The camera's transform is not finite: it is placed at the origin."
        )
        return np.eye(4)
    rigid = gf.RemoveScaleShear()
    rigid.Orthonormalize()
    before, after = matrix(gf), matrix(rigid)
    if not np.allclose(before[:3, :3], after[:3, :3], atol=1e-4):
        diagnostics.add(
            "camera-scaled", str(prim.GetPath()), "Scale and shear are removed from its transform, as USD's GfFrustum does."
        )
    return after


def _world_matrix(prim: Usd.Prim, when: When) -> Gf.Matrix4d:
    cache = UsdGeom.XformCache(when.time)
    if not when.careful:
        return cache.GetLocalToWorldTransform(prim)
    world = Gf.Matrix4d(1.0)
    while prim and not prim.IsPseudoRoot():
        local, resets = local_matrix(prim, frozenset(prim.GetAuthoredPropertyNames()), when, cache)
        world = world * local
        if resets:
            break
        prim = prim.GetParent()
    return world


def _note_ignored(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> None:
    path = str(prim.GetPath())
    opened, closed = number(prim, "shutter:open", when, 0.0, diagnostics), number(prim, "shutter:close", when, 0.0, diagnostics)
    if opened != closed:
        diagnostics.add("motion", path, f"The shutter interval [{opened:g}, {closed:g}] is ignored.")
    planes = read(prim, "clippingPlanes", when)
    if planes is not None and len(planes):
        diagnostics.add("camera-input", path, f"{len(planes)} clippingPlanes are ignored.")
    if token(prim, "stereoRole", when, "mono") != "mono":
        diagnostics.add("camera-input", path, "stereoRole is ignored: one eye is rendered.")
