"""UsdGeomCamera to the description's camera: rigid transform, window conformed to the image, lens, exposure, clipping."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pxr import Gf, Usd, UsdGeom

from ...arrays import Doubles
from ...description import Camera, Projection
from ...diagnostics import Diagnostics
from ..render_settings.render_product import ProductSettings
from ..scene.inheritance import transforms, world_matrix
from ..stage.values import StandIns, When, matrix, number, read, token, vector
from .distortion import Sensor, read_sensor, report_ignored_distortion
from .lens import MM, WIDEST_TANGENT, Lens, read_diffusion, read_lens, report_ignored_lens, report_unread_lens_names
from .shutter import INSTANT, Shutter

# Larger exposures would overflow single precision, as radiance is multiplied by them.
BRIGHTEST_EXPOSURE = 2.0**64


@dataclass(frozen=True)
class Aperture:
    """Size and offset of the film in the camera's own units (tenths of scene units, or pixels of a calibrated sensor)."""

    width: float
    height: float
    offset_x: float = 0.0
    offset_y: float = 0.0

    @property
    def aspect(self) -> float:
        return self.width / self.height


def read_aperture(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> Aperture:
    """Return the film's aperture; for a camera with lens distortion that of the calibrated sensor, in pixels."""
    if not _is_orthographic(prim, when) and (sensor := read_sensor(prim, when, diagnostics)) is not None:
        return _sensor_aperture(sensor)
    return _film_aperture(prim, when, diagnostics)


def _is_orthographic(prim: Usd.Prim, when: When) -> bool:
    return token(prim, "projection", when, "perspective") == "orthographic"


def _sensor_aperture(sensor: Sensor) -> Aperture:
    x, y = sensor.center
    return Aperture(sensor.width, sensor.height, sensor.width / 2 - x, y - sensor.height / 2)


def _film_aperture(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> Aperture:
    def positive(name: str, default: float) -> float:
        size = number(prim, name, when, default, diagnostics)
        if size > 0:
            return size
        diagnostics.add("out-of-range", str(prim.GetPath()), f"{name} = {size:g} is not positive: {default:g} is used.", name)
        return default

    return Aperture(
        positive("horizontalAperture", 20.955),
        positive("verticalAperture", 15.2908),
        number(prim, "horizontalApertureOffset", when, 0.0, diagnostics),
        number(prim, "verticalApertureOffset", when, 0.0, diagnostics),
    )


def conform(aperture: Aperture, resolution: tuple[int, int], product: ProductSettings) -> Aperture:
    """Return the aperture conformed to the image (UsdRenderSettingsBase, aspectRatioConformPolicy); offsets are kept."""
    image = product.pixel_aspect_ratio * resolution[0] / resolution[1]
    policy = product.conform_policy
    wider = aperture.aspect > image
    taller, narrower = replace(aperture, height=aperture.width / image), replace(aperture, width=aperture.height * image)
    match policy:
        case "adjustPixelAspectRatio":
            return aperture  # pixels take its aspect: pixel_aspect_ratio
        case "adjustApertureWidth":
            return narrower
        case "adjustApertureHeight":
            return taller
        case "cropAperture":
            return narrower if wider else taller
        case _:
            return taller if wider else narrower


def pixel_aspect_ratio(aperture: Aperture, resolution: tuple[int, int], product: ProductSettings) -> float:
    """Return width over height of a pixel after conforming."""
    if product.conform_policy == "adjustPixelAspectRatio":
        return aperture.aspect * resolution[1] / resolution[0]
    return product.pixel_aspect_ratio


def read_camera(
    prim: Usd.Prim,
    when: When,
    resolution: tuple[int, int],
    product: ProductSettings,
    shutter: Shutter,
    diagnostics: Diagnostics,
    still: When | None = None,
) -> Camera:
    """Return the camera at the frame; with `still`, everything but the exposure is read at that instant."""
    then = still or when
    path = str(prim.GetPath())
    orthographic = _is_orthographic(prim, when)
    sensor = None if orthographic else read_sensor(prim, then, diagnostics)
    focal = number(prim, "focalLength", then, 50.0, diagnostics)
    if focal <= 0 and not orthographic:
        diagnostics.add("out-of-range", path, f"focalLength = {focal:g} is not positive: 50 is used.", "focalLength")
        focal = 50.0
    window, distortion = None, None
    if sensor is not None:
        window, distortion = _sensor_window(sensor, resolution, product), sensor.distortion
        if not _is_usable(window):
            diagnostics.add("camera-input", path, f"{_unusable_window_text(window)}: lens distortion is ignored.")
            window = distortion = None
    if window is None:
        aperture = conform(_film_aperture(prim, then, diagnostics), resolution, product)
        window = window_of(aperture, MM if orthographic else 1.0 / focal)
    if not _is_usable(window):
        diagnostics.add("camera-input", path, f"{_unusable_window_text(window)}: apertures are ignored.")
        focal, aperture = max(focal, 50.0), conform(Aperture(20.955, 15.2908), resolution, ProductSettings())
        window = window_of(aperture, MM if orthographic else 1.0 / focal)
    lens = Lens()
    if orthographic:
        report_ignored_distortion(prim, when, diagnostics)
        report_ignored_lens(prim, then, product.disable_depth_of_field, diagnostics)
    else:
        lens = read_lens(prim, focal, then, product.disable_depth_of_field, diagnostics)
    exposure_scale = _exposure_scale(prim, when, diagnostics)
    report_unread_lens_names(prim, when, diagnostics)
    return Camera(
        path=path,
        world_from_camera=_world_from_camera(prim, then, diagnostics),
        projection=Projection.ORTHOGRAPHIC if orthographic else Projection.PERSPECTIVE,
        window=window,
        clipping_range=clipping_range(prim, then, orthographic, diagnostics),
        lens_radius=lens.radius,
        focus_distance=lens.focus_distance,
        exposure_scale=0.0 if shutter is None else exposure_scale,
        blades=lens.blades,
        blade_rotation_deg=lens.rotation_deg,
        clipping_planes=clipping_planes(prim, when, diagnostics),
        shutter=shutter or INSTANT,
        diffusion=read_diffusion(prim, lens, then, diagnostics),
        distortion=distortion,
        nearest=_nearest(prim, then, diagnostics),
    )


def window_of(aperture: Aperture, scale: float) -> tuple[float, float, float, float]:
    """Return left, right, bottom, top (GfCamera::GetFrustum): the aperture about its offset, times `scale`."""
    x, y, w, h = aperture.offset_x, aperture.offset_y, aperture.width / 2, aperture.height / 2
    return ((x - w) * scale, (x + w) * scale, (y - h) * scale, (y + h) * scale)


def _sensor_window(sensor: Sensor, resolution: tuple[int, int], product: ProductSettings) -> tuple[float, float, float, float]:
    """Return the conformed sensor's window: pixels over the focal length, which may differ in x and y."""
    aperture = _sensor_aperture(sensor)
    left, right, bottom, top = window_of(aperture if sensor.fills_frame else conform(aperture, resolution, product), 1.0)
    across, down = sensor.focal
    return left / across, right / across, bottom / down, top / down


def _unusable_window_text(window: tuple[float, float, float, float]) -> str:
    """Return the beginning of a message about a window that is not usable."""
    return f"The film's window ({', '.join(f'{side:g}' for side in window)}) at unit distance is unusable"


def _is_usable(window: tuple[float, float, float, float]) -> bool:
    """Return whether the window's sides are distinct in single precision and their squares finite."""
    with np.errstate(over="ignore"):
        left, right, bottom, top = map(np.float32, window)
    return bool(left < right and bottom < top and np.abs([left, right, bottom, top]).max() < WIDEST_TANGENT)


def _exposure_scale(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> float:
    """Return UsdGeomCamera::ComputeLinearExposureScale: responsivity * time * iso / 100 * 2^exposure / fStop^2."""

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
        note("The exposure's time, iso or responsivity is negative: the whole exposure is ignored.")
        return 1.0
    # In double precision products and squares of these floats do not overflow; 2^exposure would, so it is clamped.
    scale = responsivity * time * iso / 100.0 / f_stop / f_stop
    scale *= math.pow(2.0, min(max(get("exposure", 0.0), -1000.0), 400.0))
    if not scale < BRIGHTEST_EXPOSURE:
        note(f"The exposure multiplies the picture by {scale:g}, which overflows: 1 is used.")
        return 1.0
    if scale < 1e-37:
        note(f"The exposure multiplies the picture by {scale:g}: it is black.")
    return scale


def _world_from_camera(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> Doubles:
    """Return world_from_camera (4, 4), rigid: scale and shear are removed as in GfFrustum."""
    gf = world_matrix(prim, when, transforms(when))
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
            "camera-scaled",
            str(prim.GetPath()),
            "Scale and shear are removed from the camera's transform, as USD's GfFrustum does.",
        )
    return after


def usd_camera(prim: Usd.Prim, when: When, stand_ins: StandIns, cache: UsdGeom.XformCache) -> Gf.Camera:
    """Return UsdGeomCamera::GetCamera; attributes without a default value are read at the stand-in time."""
    asked = stand_ins.of(prim)
    found = UsdGeom.Camera(asked).GetCamera(stand_ins.time)
    if when.is_default:
        found.transform = world_matrix(prim, when, cache)
    return found


def report_single_eye(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> None:
    """Report a stereo camera that is rendered alone."""
    role = token(prim, "stereoRole", when, "mono")
    if role != "mono":
        message = f"stereoRole = {role} is ignored: only this eye is rendered; --stereo renders the pair."
        diagnostics.add("camera-input", str(prim.GetPath()), message, "stereoRole")


Plane = tuple[float, float, float, float]
UNCLIPPED = (0.0, 3e38)
NEAREST = "primray:nearest"


def nearest_of(distance: float) -> float:
    """Return Camera.nearest for a camera that frames things from this distance on: the largest power of two up to half of it.

    It stays as it is while a camera goes around them.
    """
    return 2.0 ** (math.frexp(distance)[1] - 2) if 0 < distance < math.inf else 0.0


def _nearest(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> float:
    found = number(prim, NEAREST, when, 0.0, diagnostics)
    if 0 <= found < math.inf:
        return found
    diagnostics.add("out-of-range", str(prim.GetPath()), f"{NEAREST} = {found:g} is not a distance: it is ignored.", NEAREST)
    return 0.0


def clipping_range(prim: Usd.Prim, when: When, orthographic: bool, diagnostics: Diagnostics) -> tuple[float, float]:
    """Return the near and far distance in scene units; UNCLIPPED, with a diagnostic, if they are invalid."""
    near, far = vector(prim, "clippingRange", when, (1.0, 1e6), diagnostics)
    if near < far and (near >= 0 or orthographic):
        return (near, far)
    message = f"clippingRange = ({near:g}, {far:g}) is ignored: nothing is clipped."
    diagnostics.add("camera-input", str(prim.GetPath()), message, "clippingRange")
    return UNCLIPPED


def clipping_planes(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> tuple[Plane, ...]:
    """Return planes (a, b, c, d) in camera space; points with a x + b y + c z + d < 0 are clipped."""
    raw = read(prim, "clippingPlanes", when)
    if raw is None:
        return ()
    try:
        planes = [_finite_plane(row) for row in raw]
    except TypeError:
        planes = [None]
    bad = planes.count(None)
    if bad:
        message = f"{bad} of {len(planes)} clippingPlanes are not four finite numbers and are ignored."
        diagnostics.add("camera-input", str(prim.GetPath()), message, "clippingPlanes")
    return tuple(plane for plane in planes if plane is not None)


def _finite_plane(row: Any) -> Plane | None:
    try:
        a, b, c, d = (float(x) for x in row)
    except (TypeError, ValueError):
        return None
    return (a, b, c, d) if all(map(math.isfinite, (a, b, c, d))) else None
