"""Choice of the camera, and the view through it: resolution, frame, stereo eye and exposure of lines.

The camera is the user's choice, else the stage's, else the view that the authoring tool's viewport showed last, else an
automatic one. The user may give a prim's path or name, a `Camera`, or a matrix with UsdGeomCamera's default lens.

Stereo pairs: UsdGeomCamera's stereoRole says which eye a camera is, but not which two belong together. The pair is searched
among the siblings of the chosen camera, then among its descendants, then on the whole stage. The first of these with both
roles decides, and must have exactly one camera of each. A chosen camera that has a role is part of the pair.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import islice

import numpy as np
from pxr import Sdf, Usd

from ...description import Camera, Frame, Projection
from ...description.scene import pixels_within
from ...diagnostics import Diagnostics
from ...errors import InvalidSceneError, LimitError, SettingsError
from ...settings import MAX_RESOLUTION, AutoCamera, Eye, Panorama, limit_pixels
from ...settings.camera_choice import Matrix, flaws_of
from ..motion.timing import Foreseen, Rolling, pixels_of
from ..render_settings.render_product import ProductSettings
from ..scene.bounds import Bounds
from ..scene.context import Context
from ..stage.metadata import meters_per_unit, time_codes_per_second, up_axis
from ..stage.reads import type_name
from ..stage.traversal import prims_in_instances, world_prims
from ..stage.values import When, token
from .automatic import APERTURE, FOCAL_LENGTH, bound_camera, framing_camera, three_quarter_camera, viewport_camera
from .camera import UNCLIPPED, Aperture, conform, pixel_aspect_ratio, read_aperture, read_camera, report_single_eye, window_of
from .framed_objects import FramedObjects
from .lens import with_lens_flaws
from .motion import camera_when
from .shutter import INSTANT, Shutter, line_exposures, render_timing, resolve_scan, resolve_shutter, whole_shutter

SAME_ASPECT = 1e-12  # relative: aspect ratios that differ in rounding only
NAMED_CAMERAS = 10  # cameras in a message
MOST_IN_INSTANCES = 1000  # a crowd of assets may each have left one behind

DEFAULT_WIDTH = 960  # usdrecord's default
NAMED_OUTLIERS = 5  # prims named in a message among those outside of the automatic camera's frame


def select_camera(stage: Usd.Stage, ctx: Context, product: ProductSettings, cameras: list[Usd.Prim]) -> Usd.Prim | None:
    """Return the prim of the camera, or of the requested eye of its stereo pair; None if no camera of the stage is to be used.

    SettingsError if the camera asked for does not exist.
    """
    eye = ctx.settings.eye
    if eye is None:
        return _default_camera(stage, ctx, product, cameras)
    if ctx.settings.camera is not None and not isinstance(ctx.settings.camera, str):
        raise SettingsError(
            "a camera that is not a prim has no stereo pair: render each eye with its own camera",
            where="eye",
            code="stereo-pair",
        )
    is_named = ctx.settings.camera is not None or product.camera is not None
    chosen = _default_camera(stage, ctx, product, cameras) if is_named else bound_camera(ctx)
    return eye_of_pair(chosen, cameras, eye, ctx.when)


def _default_camera(stage: Usd.Stage, ctx: Context, product: ProductSettings, cameras: list[Usd.Prim]) -> Usd.Prim | None:
    asked = ctx.settings.camera
    if asked is not None:
        return _named_camera(stage, asked, cameras) if isinstance(asked, str) else None
    if product.camera is not None:
        prim = stage.GetPrimAtPath(product.camera)
        if prim and type_name(prim) == "Camera":
            return prim
        ctx.warn("render-settings-input", product.camera, "The camera that RenderSettings names does not exist.")
    if ctx.settings.auto_camera is not AutoCamera.USDRECORD and (bound := bound_camera(ctx)) is not None:
        return bound
    if len(cameras) > 1:
        others = ", ".join(str(c.GetPath()) for c in cameras[1:6])
        ctx.warn("camera-chosen", str(cameras[0].GetPath()), f"The first of {len(cameras)} cameras is used; others: {others}.")
    elif cameras:
        ctx.warn("camera-chosen", str(cameras[0].GetPath()), "The stage's only camera is used.")
    return cameras[0] if cameras else None


def view_through(
    prim: Usd.Prim | None,
    ctx: Context,
    product: ProductSettings,
    shutter: Shutter,
    bounds: Callable[[], Bounds],
    drawn: Callable[[], FramedObjects],
) -> tuple[Camera, Frame]:
    """Return the camera, conformed to the image, and the image's frame.

    The scene's `bounds` (as usdrecord computes them) or objects (`drawn`) are only needed to make an automatic camera.
    """
    found, frame = view_without_scene(prim, ctx, product, shutter)
    if found is not None:
        if prim is not None and ctx.settings.eye is None:
            report_single_eye(prim, ctx.when, ctx.diagnostics)
        return _with_requested_flaws(found, prim, ctx), frame
    resolution = frame.resolution
    z_up = up_axis(ctx.stage) == "Z"
    if ctx.settings.auto_camera is AutoCamera.USDRECORD:
        ctx.warn("camera-automatic", "", "The stage has no camera: usdrecord's framing is used.")
        framed = _looking_around(framing_camera(bounds(), z_up, resolution, product), _panorama(ctx))
        return _with_requested_flaws(with_shutter(framed, shutter), None, ctx), frame
    has_ground = ctx.settings.ground is not None
    made, left_out = three_quarter_camera(drawn(), z_up, resolution, product, has_ground=has_ground)
    ctx.warn(
        "camera-automatic",
        "",
        f"The stage has no camera: an automatic three-quarter view from above is used{_outliers_text(left_out)}.",
    )
    made = _looking_around(made, _panorama(ctx))
    return _with_requested_flaws(with_shutter(made, shutter), None, ctx), frame


def _with_requested_flaws(found: Camera, prim: Usd.Prim | None, ctx: Context) -> Camera:
    return with_lens_flaws(found, prim if found.path else None, flaws_of(ctx.settings.lens_flaws), ctx.when, ctx.diagnostics)


def view_without_scene(
    prim: Usd.Prim | None, ctx: Context, product: ProductSettings, shutter: Shutter
) -> tuple[Camera | None, Frame]:
    """Return the camera and frame without looking at the scene; None for the camera if an automatic one has to be made."""
    asked = _camera_without_prim(prim, ctx)
    if asked is not None:
        aperture = given_aperture(asked)
        if isinstance(asked, Camera) and asked.pixels_follow_window:
            product = replace(product, conform_policy="adjustPixelAspectRatio")
    else:
        aperture = read_aperture(prim, ctx.when, ctx.diagnostics) if prim is not None else APERTURE
    around = _panorama(ctx)
    if around is not None:
        aperture, product = given_aperture(around), replace(product, conform_policy="adjustPixelAspectRatio")
    resolution = _scaled(_resolution(ctx.settings.resolution, product, aperture), ctx.settings.resolution_scale)
    if ctx.settings.region is not None:
        product = replace(product, data_window=ctx.settings.region)
    frame = _frame(resolution, product, pixel_aspect_ratio(aperture, resolution, product))
    if asked is not None:
        return _looking_around(conform_given_camera(asked, aperture, resolution, product, shutter), around), frame
    if prim is not None:
        still = camera_when(prim, ctx, ctx.timing.opens) if not ctx.timing.is_open else None
        found = read_camera(prim, ctx.when, resolution, product, shutter, ctx.diagnostics, still)
        return _looking_around(found, around), frame
    return None, frame


EYE_DISTANCE_M = 0.064  # of people's eyes


def _panorama(ctx: Context) -> Camera | None:
    """Return a camera at the origin with the panorama that is asked for; None without one."""
    asked = ctx.settings.panorama
    if asked is None:
        return None
    if asked.value.startswith("cube"):
        columns = {Panorama.CUBE_2: 2, Panorama.CUBE_3: 3, Panorama.CUBE_6: 6}.get(asked, 1)
        return Camera.cube(columns=columns)
    return Camera.lat_long(
        span_deg=(180.0, 180.0) if "180" in asked.value else (360.0, 180.0),
        eye_distance=EYE_DISTANCE_M / meters_per_unit(ctx.stage) if asked.value.startswith("stereo") else 0.0,
        side_by_side=asked.value.endswith("side-by-side"),
    )


def _looking_around(camera: Camera, around: Camera | None) -> Camera:
    """Return the camera with the view of `around`, sharp from where it begins to see."""
    if around is None:
        return camera
    return replace(
        camera,
        projection=around.projection,
        window=around.window,
        distortion=around.distortion,
        pixels_follow_window=True,
        lens_radius=0.0,
        natural_vignetting=False,
    )


def columns_and_rows(prim: Usd.Prim | None, ctx: Context, product: ProductSettings) -> tuple[int, int]:
    """Return columns and rows of the image through a camera of the stage."""
    aperture = read_aperture(prim, ctx.when, Diagnostics()) if prim is not None else APERTURE
    return _scaled(_resolution(ctx.settings.resolution, product, aperture), ctx.settings.resolution_scale)


def _camera_without_prim(prim: Usd.Prim | None, ctx: Context) -> Camera | Matrix | None:
    """Return the user's camera without a prim or, if there is no camera at all, the one of the author's viewport."""
    asked = ctx.settings.camera
    if asked is not None and not isinstance(asked, str):
        return asked
    return viewport_camera(ctx) if prim is None and ctx.settings.auto_camera is not AutoCamera.USDRECORD else None


def _outliers_text(left_out: list[str]) -> str:
    if not left_out:
        return ""
    more = f" and {len(left_out) - NAMED_OUTLIERS} more" if len(left_out) > NAMED_OUTLIERS else ""
    return f"; left out of the framing, far larger or farther than the rest: {', '.join(left_out[:NAMED_OUTLIERS])}{more}"


def _named_camera(stage: Usd.Stage, asked: str, cameras: list[Usd.Prim]) -> Usd.Prim:
    """Return the camera of this path or, if only one has it, of this name; SettingsError otherwise."""
    if Sdf.Path.IsValidPathString(asked) and Sdf.Path(asked).IsAbsolutePath():
        prim = stage.GetPrimAtPath(asked)
        if prim and type_name(prim) == "Camera":
            return prim
    named = [c for c in cameras if c.GetName() == asked]
    if len(named) == 1:
        return named[0]
    listed = ", ".join(str(c.GetPath()) for c in (named or cameras)[:20]) or "none"
    problem = f"Several cameras are called {asked}" if named else f"There is no camera {asked}"
    raise SettingsError(f"{problem}; the stage's cameras: {listed}", where=asked, code="unknown-camera")


def _resolution(asked: tuple[int, int] | None, product: ProductSettings, aperture: Aperture) -> tuple[int, int]:
    """Return the resolution; a width or height of 0 follows from the other by the camera's aspect ratio."""
    width, height = asked or product.resolution or (DEFAULT_WIDTH, 0)
    # If the policy adjusts the pixel aspect ratio, a free side is chosen for square pixels.
    square = product.conform_policy == "adjustPixelAspectRatio"
    aspect = aperture.aspect / (1.0 if square else product.pixel_aspect_ratio)
    if width < 0 or height < 0 or (width == 0 and height == 0):
        raise SettingsError(f"an image of {width} x {height} pixels cannot be made", code="resolution")
    if height == 0:
        height = max(1, round(width / aspect))
    elif width == 0:
        width = max(1, round(height * aspect))
    return width, height


def _scaled(resolution: tuple[int, int], scale: float) -> tuple[int, int]:
    """Return the scaled resolution, at least 1 x 1; LimitError if it is too large."""
    width, height = (max(1, round(side * scale)) for side in resolution)
    limit_pixels(width, height)
    return width, height


def _frame(resolution: tuple[int, int], product: ProductSettings, aspect_ratio: float) -> Frame:
    """Return the frame with the pixels of the data window; InvalidSceneError or LimitError if they cannot be rendered."""
    where = product.path or product.settings_path
    if max(abs(side) for side in product.data_window) * max(resolution) > MAX_RESOLUTION:
        sides = ", ".join(f"{side:g}" for side in product.data_window)
        raise LimitError(f"dataWindowNDC = ({sides}) lies more than {MAX_RESOLUTION} pixels outside", where=where)
    pixels = pixels_within(product.data_window, resolution)
    if pixels.width == 0 or pixels.height == 0:
        sides = ", ".join(f"{side:g}" for side in product.data_window)
        message = f"dataWindowNDC = ({sides}) contains no pixel centre: there is nothing to render"
        raise InvalidSceneError(message, where=where, code="empty-data-window")
    limit_pixels(pixels.width, pixels.height, where)
    return Frame(resolution, pixels, aspect_ratio)


def given_aperture(asked: Camera | Matrix) -> Aperture:
    """Return the aperture of a given camera, in units of its window."""
    if isinstance(asked, tuple):
        return APERTURE
    left, right, bottom, top = asked.window
    return Aperture(right - left, top - bottom, (left + right) / 2, (bottom + top) / 2)


def conform_given_camera(
    asked: Camera | Matrix, aperture: Aperture, resolution: tuple[int, int], product: ProductSettings, shutter: Shutter
) -> Camera:
    """Return the given camera with its window conformed to the image; a window of that aspect keeps its bits.

    It has no path, so nothing on the stage moves it. A product without depth of field makes it a pinhole, like the stage's
    cameras.
    """
    fitted = conform(aperture, resolution, product)
    if isinstance(asked, tuple):
        window = window_of(fitted, 1.0 / FOCAL_LENGTH)
        return with_shutter(Camera("", np.array(asked), Projection.PERSPECTIVE, window, UNCLIPPED), shutter)
    if not math.isclose(fitted.aspect, aperture.aspect, rel_tol=SAME_ASPECT):
        asked = replace(asked, window=window_of(fitted, 1.0))
    if product.disable_depth_of_field:
        asked = replace(asked, lens_radius=0.0)
    return with_shutter(replace(asked, path=""), shutter)


def with_shutter(camera: Camera, shutter: Shutter) -> Camera:
    """Return the camera with this shutter; a shutter of None (closes before it opens) makes the image black."""
    if shutter is None:
        return replace(camera, shutter=INSTANT, exposure_scale=0.0)
    return replace(camera, shutter=shutter)


def stereo_role(camera: Usd.Prim, when: When) -> str:
    return token(camera, "stereoRole", when, "mono")


def eye_of_pair(chosen: Usd.Prim | None, cameras: list[Usd.Prim], eye: Eye, when: When) -> Usd.Prim:
    """Return the camera of that eye in the pair of `chosen`; SettingsError if there is no pair, or more than one."""
    wanted = {role.value: _cameras_of_role(chosen, cameras, role.value, when) for role in Eye}
    for place in _candidate_sets(chosen, cameras):
        pair = {role: [camera for camera in place if camera in found] for role, found in wanted.items()}
        if all(len(found) == 1 for found in pair.values()):
            return pair[eye.value][0]
        if all(pair.values()):
            raise _ambiguous_pair(chosen, pair)
    raise _missing_pair(chosen, cameras, when)


def _cameras_of_role(chosen: Usd.Prim | None, cameras: list[Usd.Prim], role: str, when: When) -> list[Usd.Prim]:
    if chosen is not None and stereo_role(chosen, when) == role:
        return [chosen]
    return [camera for camera in cameras if stereo_role(camera, when) == role]


def _candidate_sets(chosen: Usd.Prim | None, cameras: list[Usd.Prim]) -> list[list[Usd.Prim]]:
    if chosen is None:
        return [cameras]
    path, beside = chosen.GetPath(), chosen.GetPath().GetParentPath()
    siblings = [camera for camera in cameras if camera.GetPath().GetParentPath() == beside]
    below = [camera for camera in cameras if camera.GetPath().HasPrefix(path)]
    return [siblings, below, cameras]


def _ambiguous_pair(chosen: Usd.Prim | None, pair: dict[str, list[Usd.Prim]]) -> SettingsError:
    listed = "; ".join(f"{role}: {', '.join(str(c.GetPath()) for c in found[:NAMED_CAMERAS])}" for role, found in pair.items())
    sentence = f"several cameras could form the stereo pair ({listed}): choose one eye with --camera"
    return SettingsError(sentence, where=_error_location(chosen), code="stereo-ambiguous")


def _missing_pair(chosen: Usd.Prim | None, cameras: list[Usd.Prim], when: When) -> SettingsError:
    listed = ", ".join(f"{c.GetPath()} ({stereo_role(c, when)})" for c in cameras[:NAMED_CAMERAS]) or "none"
    sentence = f"no two cameras form a pair with the stereoRoles left and right; the stage's cameras: {listed}"
    return SettingsError(sentence, where=_error_location(chosen), code="stereo-pair")


def _error_location(chosen: Usd.Prim | None) -> str:
    return "eye" if chosen is None else str(chosen.GetPath())


def exposure_times(camera: Usd.Prim | None, ctx: Context, product: ProductSettings) -> tuple[Shutter, Rolling | None]:
    """Return the whole shutter interval and the rolling shutter within it, None if all lines are exposed at once."""
    shutter = resolve_shutter(camera, ctx, product)
    scan = resolve_scan(camera, shutter, ctx, product)
    if scan is None or shutter is None:
        return shutter, None
    lines = columns_and_rows(camera, ctx, product)
    rolling = line_exposures(scan, shutter, lines, time_codes_per_second(ctx.stage))
    return whole_shutter(rolling, lines), rolling


def estimate_view(prim: Usd.Prim | None, ctx: Context, product: ProductSettings) -> Foreseen:
    """Return how large things appear through a camera's prim (None: without one) while its own shutter is open."""
    shutter = resolve_shutter(prim, ctx, product)
    return estimate_view_through(prim, shutter, replace(ctx, timing=render_timing(shutter, False, ctx)), product)


def estimate_view_through(prim: Usd.Prim | None, shutter: Shutter, ctx: Context, product: ProductSettings) -> Foreseen:
    """Return how large things appear through a camera's prim (None: without one) at `ctx.timing`."""
    timing, ctx = ctx.timing, replace(ctx, diagnostics=Diagnostics())
    if timing.is_frame:
        return Foreseen(timing)
    camera, frame = view_without_scene(prim, ctx, product, shutter)
    most, side = ctx.settings.most_motion_error, max(frame.resolution)
    if camera is None:
        return Foreseen(timing, most, None, side)
    seen = [camera]
    if prim is not None:
        for offset in (timing.opens, 0.5 * (timing.opens + timing.closes), timing.closes):
            then = camera_when(prim, ctx, offset)
            seen.append(read_camera(prim, ctx.when, frame.resolution, product, shutter, Diagnostics(), then))
    return Foreseen(timing, most, pixels_of(seen, frame.resolution), side)


def cameras_of(stage: Usd.Stage) -> list[Usd.Prim]:
    """Return all cameras, in the order in which the default camera is chosen."""
    return [prim for prim in world_prims(stage) if type_name(prim) == "Camera"] + cameras_in_instances(stage)


def cameras_in_instances(stage: Usd.Stage) -> list[Usd.Prim]:
    """Return the instance proxies of cameras in native instances (each has its instance's transform), the first thousand."""
    return list(islice(prims_in_instances(stage, "Camera"), MOST_IN_INSTANCES))
