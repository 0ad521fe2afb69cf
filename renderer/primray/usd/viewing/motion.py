"""What moves while the shutter is open. The scene is rendered as it stands at the frame, and this says so."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from pxr import Gf, Tf, Usd, UsdGeom

from ...description import Camera
from ..resolving.context import Context
from ..resolving.read import When, has_time_samples, time_of

LISTED = 8
MOST_SAMPLES = 16  # that are compared; what has more while the shutter is open is taken to move
# Changes of these are no motion; primvars (but for normals, which follow points) are colours and the like.
STILL = frozenset(["visibility", "purpose", "extent", "extentsHint", "velocities", "accelerations", "angularVelocities"])
VELOCITIES = ("velocities", "angularVelocities")


@dataclass(frozen=True)
class Span:
    """The open shutter around the frame, and how that is read."""

    when: When
    opens: float
    closes: float

    def around(self, attribute: Usd.Attribute) -> tuple[float, float] | None:
        time = time_of(attribute, self.when)
        if time.IsEarliestTime():
            samples = attribute.GetTimeSamples()
            time = Usd.TimeCode(samples[0]) if samples else Usd.TimeCode.Default()
        if time.IsDefault():
            return None
        return time.GetValue() + self.opens, time.GetValue() + self.closes


def note_motion(camera: Camera, ctx: Context) -> None:
    """One diagnostic of the camera's, naming some of what moves and how much there is of it."""
    opens, closes = camera.shutter
    if not opens < closes or not has_time_samples(ctx.stage):
        return
    span = Span(ctx.when, opens, closes)
    count, named = 0, []
    for prim in _prims(ctx.stage, camera.path):
        moving = next(_moving(prim, span), None)
        if moving is None or not _is_seen(prim, span.when.time, ctx.purposes):
            continue
        count += 1
        if count <= LISTED:
            named.append(f"{prim.GetPath()} ({moving})")
    if count:
        more = f" and {count - LISTED:,} more" if count > LISTED else ""
        message = f"The shutter is open from {opens:g} to {closes:g}, but the scene is rendered at one instant. What moves: "
        ctx.warn("motion", camera.path, f"{message}{', '.join(named)}{more}.", "shutter:close")


def _prims(stage: Usd.Stage, camera: str) -> Iterator[Usd.Prim]:
    """Whatever has a place in the scene; of the cameras, the one that looks."""
    ranges = [stage.Traverse(), *(Usd.PrimRange(prototype) for prototype in stage.GetPrototypes())]
    for prims in ranges:
        for prim in prims:
            if prim.IsA(UsdGeom.Camera):
                if str(prim.GetPath()) == camera:
                    yield prim
            elif prim.IsA(UsdGeom.Imageable) or prim.GetTypeName() == "SkelAnimation":
                yield prim


def _moving(prim: Usd.Prim, span: Span) -> Iterator[str]:
    """Names of its attributes that change while the shutter is open, or of velocities that say that it moves."""
    for attribute in prim.GetAuthoredAttributes():
        name = attribute.GetName()
        if name in VELOCITIES:
            if _is_nonzero(attribute, span.when):
                yield name
        elif name not in STILL and not name.startswith("primvars:") and attribute.ValueMightBeTimeVarying():
            around = span.around(attribute)
            if around is not None and _changes(attribute, *around):
                yield name


def _changes(attribute: Usd.Attribute, opens: float, closes: float) -> bool:
    try:
        inside = attribute.GetTimeSamplesInInterval(Gf.Interval(opens, closes))
        if len(inside) > MOST_SAMPLES:
            return True
        first = attribute.Get(opens)
        return any(attribute.Get(time) != first for time in [*inside, closes])
    except (Tf.ErrorException, UnicodeDecodeError):
        return False


def _is_nonzero(attribute: Usd.Attribute, when: When) -> bool:
    """Velocities count from a sample of the positions on: without samples nothing moves."""
    if attribute.GetNumTimeSamples() == 0:
        return False
    try:
        values = np.asarray(attribute.Get(time_of(attribute, when)))
    except Tf.ErrorException:
        return False
    return values.dtype.kind == "f" and bool(values.any())


def _is_seen(prim: Usd.Prim, time: Usd.TimeCode, purposes: tuple[str, ...]) -> bool:
    imageable = UsdGeom.Imageable(prim)
    if not imageable:
        return True
    return imageable.ComputeVisibility(time) != "invisible" and str(imageable.ComputePurpose()) in purposes
