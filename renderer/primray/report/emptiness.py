"""Detection of pictures in which nothing is visible, and the likely reason."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product

import numpy as np

from ..arrays import Doubles, Floats
from ..description import Camera, Projection
from ..diagnostic_codes import Kind, Severity
from ..diagnostics import Diagnostic
from .prepared import Prepared

# Codes of missing texture files. They affect lights and materials, but hide no geometry.
IMAGES = frozenset({"asset-missing", "texture-unreadable", "tile-missing"})
UNKNOWN = "without faces, fully transparent, in no instance or level of detail that is drawn, or of an unsupported type"


def is_empty(pixels: Floats, told: Iterable[Diagnostic]) -> bool:
    """Return whether no pixel of (H, W, 4) received light from the stage. A default light behind nothing does not count."""
    if not pixels[..., :3].any():
        return True
    return not pixels[..., 3].any() and any(d.code == "default-light" for d in told)


def is_bare(prepared: Prepared, told: Iterable[Diagnostic]) -> bool:
    """Return whether a stage that has geometry, or lacks a part that may contain some, draws none of it.

    Visible lights do not count. A stage of nothing but lights is intended.
    """
    if prepared.hidden_from_camera:
        return True
    return prepared.scene.bounds is None and (bool(prepared.left_out) or bool(_missing(told)))


def _missing(told: Iterable[Diagnostic]) -> list[Diagnostic]:
    """Return the diagnostics of possibly missing geometry, excluding missing textures of lights and materials."""
    told = [d for d in told if d.kind is Kind.MISSING and d.code not in IMAGES]
    return [d for d in told if d.severity is Severity.ERROR or d.code == "payloads-unloaded"]


def why_empty(prepared: Prepared, pixels: Floats, told: Iterable[Diagnostic]) -> str:
    """Return a sentence on why nothing is visible, from the diagnostics `told` of the translation."""
    if prepared.scene.bounds is None:
        return f"Nothing is drawn: {_why_nothing_drawn(prepared.left_out, told)}."
    if prepared.hidden_from_camera:
        return "The camera sees nothing: all geometry is hidden from it (cameraVisibility of the render pass)."
    if not pixels[..., 3].any():
        return f"The camera sees nothing: {_why_not_seen(prepared)}."
    dark = "no light reaches it" if prepared.lights else "there is no light"
    advice = "" if any(d.code == "default-light" for d in told) else " --studio-light on adds a light."
    return f"Everything the camera sees is black: {dark}, or its materials reflect nothing.{advice}"


def _why_nothing_drawn(left_out: dict[str, int], told: Iterable[Diagnostic]) -> str:
    told, left_out = list(told), dict(left_out)
    missing = _missing(told)
    if missing:
        left_out.pop("", None)
    reasons = [
        f"{count} {'shape is' if count == 1 else 'shapes are'} {why or UNKNOWN}" if count else why
        for why, count in left_out.items()
    ]
    if missing:
        more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        reasons.append(f"{missing[0].prim_path or 'a part'}{more} {'are' if more else 'is'} missing ({missing[0].code})")
    return "; ".join(reasons) or "the stage holds no geometry"


def _why_not_seen(prepared: Prepared) -> str:
    bounds = prepared.scene.bounds
    assert bounds is not None
    camera, (near, far) = prepared.camera, prepared.camera.clipping_range
    if camera.distortion is not None:
        return f"no geometry is in its lens's view or clipping range (it extends from {_places(bounds)})"
    corners = np.array(list(product(*zip(*bounds, strict=True))))
    depth, beside = _seen_from(camera, corners)
    if depth.max() <= 0 and camera.projection is Projection.PERSPECTIVE:
        return f"all geometry is behind it (from {_places(bounds)})"
    if depth.max() < near:
        return f"all geometry is nearer than its near clipping plane, {near:g}"
    if depth.min() > far:
        return f"all geometry is beyond its far clipping plane, {far:g}"
    if beside:
        return f"all geometry is outside its view (from {_places(bounds)})"
    return "geometry in its view is transparent, cut off by a clipping plane, or far smaller than a pixel"


def _seen_from(camera: Camera, corners: Doubles) -> tuple[Doubles, bool]:
    """Return the depths of corners along the camera's axis, and whether all of them are beyond one side of its window."""
    camera_from_world = np.linalg.inv(camera.world_from_camera)
    p = corners @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
    depth = -p[:, 2]
    left, right, bottom, top = camera.window
    wide = depth if camera.projection is Projection.PERSPECTIVE else np.ones(len(p))
    x, y = p[:, 0], p[:, 1]
    outside = (x < left * wide, x > right * wide, y < bottom * wide, y > top * wide)
    return depth, any(bool(side.all()) for side in outside)


def _places(bounds: tuple[Doubles, Doubles]) -> str:
    low, high = (", ".join(f"{v:.4g}" for v in corner) for corner in bounds)
    return f"({low}) to ({high})"
