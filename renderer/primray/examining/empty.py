"""Reasons why nothing is seen, or something is not: hidden, missing, behind the camera, or tiny; and the stage's size."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..diagnostic_codes import CODES, Severity
from ..fidelity import Kind
from ..report.emptiness import IMAGES, why_empty
from .examined import Examined
from .finding import Finding, Question

SMALL = 0.01  # fraction of the pixels
LARGEST_M, SMALLEST_M = 1e5, 1e-3  # sizes of plausible stages in metres: from a jewel to a landscape


def findings(seen: Examined) -> Iterator[Finding]:
    yield from _view(seen)
    yield from _missing(seen)
    yield from _hidden(seen)
    yield from _size(seen)


def _view(seen: Examined) -> Iterator[Finding]:
    bounds, share = seen.prepared.scene.bounds, seen.hit_share
    camera = seen.prepared.camera.path or "the automatic camera"
    here = (seen.prepared.camera.path,) if seen.prepared.camera.path else ()
    if bounds is None:
        said = why_empty(seen.prepared, seen.image.pixels, seen.diagnostics)
        yield Finding(Question.EMPTY, "nothing-drawn", said, "Add or show what the message names.", here, 1.0)
    elif share == 0 and not seen.image.pixels[..., 3].any():
        said = f"No ray of {camera} hits anything. {why_empty(seen.prepared, seen.image.pixels, seen.diagnostics)}"
        advice = "Use another camera (--camera), or let --auto-camera frame the stage."
        yield Finding(Question.EMPTY, "camera-sees-nothing", said, advice, here, 1.0)
    elif share < SMALL:
        depth = seen.image.aovs["depth"].values[..., 0]
        nearest = float(depth.min(initial=np.inf, where=np.isfinite(depth)))
        diameter = float(np.linalg.norm(np.subtract(bounds[1], bounds[0])))
        said = f"Surfaces cover {share:.2%} of the picture: the stage is {diameter:.4g} units across" + (
            f", and {nearest:.4g} away from {camera}" if np.isfinite(nearest) else ""
        )
        advice = "Move the camera closer, correct the scale (metersPerUnit) of referenced assets, or use --auto-camera."
        yield Finding(Question.EMPTY, "small-in-view", f"{said}.", advice, here, 1 - share)


def _missing(seen: Examined) -> Iterator[Finding]:
    """Yield what the stage lacks, from diagnostics; `grey` reports missing files of materials."""
    of_code: dict[str, list[str]] = {}
    for told in seen.diagnostics:
        severe = told.severity is Severity.ERROR or told.code == "payloads-unloaded"
        if told.kind is Kind.MISSING and severe and told.code not in IMAGES:
            of_code.setdefault(told.code, []).append(told.prim_path)
    for code, prims in of_code.items():
        yield Finding(Question.EMPTY, code, CODES[code].meaning, CODES[code].advice, tuple(dict.fromkeys(prims)))


def _hidden(seen: Examined) -> Iterator[Finding]:
    for why, prims in seen.hidden.items():
        if not why:
            continue
        counted = f"{len(prims):,} shape{'s are' if len(prims) > 1 else ' is'}"
        advice = "Name the purposes to render (--purposes default,proxy,guide)."
        if "purpose" not in why:
            advice = "Make them visible at this frame, or active, if they should be seen."
        yield Finding(Question.EMPTY, "hidden", f"{counted} {why}.", advice, tuple(prims))


def _size(seen: Examined) -> Iterator[Finding]:
    bounds, unit = seen.prepared.scene.bounds, seen.description.meters_per_unit
    if bounds is None:
        return
    metres = float(np.linalg.norm(np.subtract(bounds[1], bounds[0]))) * unit
    if metres > LARGEST_M or 0 < metres < SMALLEST_M:
        said = f"The stage is {metres:.3g} m across (metersPerUnit {unit:g})."
        advice = "Correct metersPerUnit, or remove outlying prims: lenses, media and lights in lumens depend on the scale."
        yield Finding(Question.EMPTY, "size", said, advice)
