"""Checks of a finished picture: whether anything is visible, and what light a bias leaves out.

The light removed by a clamp or by switched-off caustics is accumulated like the picture itself, so its mean is an unbiased
estimate of the bias: the picture plus what is left out converges to the picture without the bias.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from itertools import product
from typing import Any

import numpy as np

from .. import core
from ..arrays import Doubles, Floats
from ..color.color_space import ColorSpace, luminance_weights
from ..description import Camera, Projection
from ..diagnostic_codes import Kind, Severity
from ..diagnostics import Diagnostic, Diagnostics
from ..settings import BIAS, RenderSettings
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


def weighed_errors(pixels: Floats, errors: Floats, reference: Floats | None = None) -> Doubles:
    """Return squared standard errors (H, W) over (value^2 + 0.01), the weight of relMSE.

    The values are those of `reference`, if given.
    """
    squares = np.where(np.isfinite(errors), errors, 0.0).astype(np.float64) ** 2
    reference = pixels if reference is None else reference
    values: Doubles = (squares / (reference[..., :3].astype(np.float64) ** 2 + 0.01)).mean(axis=2)
    return values


BAND = 64  # rows
MOST_PIXELS = 5  # number of pixels listed, those that lose most
BIAS_NAMES = {"clamp_indirect": "the clamp of indirect light", "caustics": "leaving out caustics"}


# Limits of walks that no pixel resolves, and so their error (integrator/nested_media.hpp): a body whose radius is half of the
# least thickness is brighter by 1.5 mean free paths over the radius.
MOST_CURVED_ERROR = 0.003
MOST_SHAPES = 5  # that are named


def note_unseen_walks(prepared: Prepared, film: core.Film, diagnostics: Diagnostics) -> None:
    """Report the shapes that the camera sees with light leaving where it entered, and the error's bound."""
    walks: dict[str, float] = {}
    for number, pixels in film.unseen_walks.items():
        path = prepared.scene.uploaded.shape_rows.path_of(number) if prepared.scene.uploaded is not None else ""
        walks[path] = max(walks.get(path, 0.0), pixels)
    if not walks:
        return
    longest, named = max(walks.values()), sorted(walks)
    others = f" and {len(named) - MOST_SHAPES} more" if len(named) > MOST_SHAPES else ""
    diagnostics.add(
        "subsurface-unresolved",
        named[0],
        f"Light leaves {', '.join(named[:MOST_SHAPES])}{others} where it entered, of the colour that it would have: walks "
        f"below the surface end {longest:.2g} pixels away on average. A pixel at a hard edge of light is off by "
        f"{50 * longest:.2g} % of the step at most, a curved body by {100 * MOST_CURVED_ERROR:.1g} %; parts thinner than "
        "1,000 mean free paths or 20 diffusion lengths have walks.",
    )


def left_out(film: core.Film, settings: RenderSettings, space: ColorSpace) -> dict[str, Any]:
    """Return the light left out, by setting; empty if no bias was asked for."""
    asked = {why: name for why, name in core.REMOVALS.items() if getattr(settings, name) != BIAS[name]}
    return {name: {"value": getattr(settings, name), **_estimate(film, why, space)} for why, name in asked.items()}


def _estimate(film: core.Film, why: str, space: ColorSpace) -> dict[str, Any]:
    """Return the mean over pixels with samples, its standard error, its share of all light, and the pixels that lose most.

    Rows are processed in bands, because a film may be most of the process's memory.
    """
    weights = np.array(luminance_weights(space))
    counts, picture, height = film.counts, film.pixels, film.resolution[1]
    colors, squares, lost, kept, pixels, touched = np.zeros(3), np.zeros(4), 0.0, 0.0, 0, 0
    most: list[tuple[float, int, int]] = []
    for first in range(0, height, BAND):
        end = min(first + BAND, height)
        means, differences = film.removed_rows(why, first, end)
        sampled = counts[:, first:end].sum(axis=0) > 0
        luminances = means @ weights
        colors += means.sum(axis=(0, 1))
        squares += (np.concatenate([differences, (differences @ weights)[..., None]], axis=2)[sampled] ** 2).sum(axis=0)
        lost += float(luminances.sum())
        kept += float((picture[first:end, :, :3].astype(np.float64) @ weights).sum())
        pixels += int(sampled.sum())
        touched += int((luminances != 0).sum())
        most = sorted(most + _most(luminances, first), key=lambda found: (-found[0], found[2], found[1]))[:MOST_PIXELS]
    count = max(pixels, 1)
    errors = [math.sqrt(value) / count if pixels and math.isfinite(value) else None for value in squares.tolist()]
    total = lost + kept
    return {
        "mean": [value / count for value in colors.tolist()],
        "stderr": errors[:3],
        "luminance": lost / count,
        "luminance_stderr": errors[3],
        "share": lost / total if total > 0 else 0.0,
        "share_stderr": None if errors[3] is None or total <= 0 else errors[3] * count / total,
        "pixels": touched,
        "most": [[x, y, value] for value, x, y in most],
    }


def _most(luminances: Any, first_row: int) -> list[tuple[float, int, int]]:
    """Return (luminance, x, y) of the pixels of a band that lose most, y from the picture's top."""
    flat, width = luminances.ravel(), luminances.shape[1]
    order = np.argsort(-flat, kind="stable")[:MOST_PIXELS]
    return [(float(flat[i]), int(i % width), first_row + int(i // width)) for i in order if flat[i] > 0]


def left_out_lines(report: Mapping[str, Any]) -> list[str]:
    """Return a sentence for each bias in a report."""
    return [_line(name, found) for name, found in report.get("left_out", {}).items()]


def _line(name: str, found: Mapping[str, Any]) -> str:
    error, share_error = found["luminance_stderr"], found["share_stderr"]
    value = f" at {found['value']:g}" if name == "clamp_indirect" else ""
    by = "" if error is None else f" ± {error:.2g}"
    of_all = f"{100 * found['share']:.3g} %" + ("" if share_error is None else f" ± {100 * share_error:.2g}")
    sentence = f"bias: {BIAS_NAMES[name]}{value} removed mean luminance {found['luminance']:.3g}{by}, {of_all} of all light"
    if found["most"]:
        x, y, most = found["most"][0]
        sentence += f"; most at pixel {x}, {y}: {most:.3g}"
    return sentence
