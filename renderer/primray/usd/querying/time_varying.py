"""What changes over time: the only place that knows the ways in which values may be given for times (a gate holds that).

These are time samples, value clips (samples in further files, which metadata name) and splines, which only scalars have
and USD counts as no samples. A layer lists its samples, not its clips and splines.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from functools import lru_cache
from typing import Any

from pxr import Gf, Sdf, Tf, Usd

from .guarded import authored_attributes, default_value, metadatum, value_at

MOST_SAMPLES = 16  # that are compared; what has more in a span is taken to change
_STEPS = 16  # between which a spline is looked at, besides its knots
_UNSET = (Usd.ResolveInfoSourceFallback, Usd.ResolveInfoSourceNone)
_SCALAR = re.compile("(translate|scale|rotate)[XYZ]$")
_SPLINED = frozenset(["double", "float", "half", "timecode"])  # the types that have splines (Ts.Spline.IsSupportedValueType)


EARLIEST = Usd.TimeCode.EarliestTime()  # for what USD computes of many attributes; a spline may be anywhere then


def has_samples(layers: Iterable[Sdf.Layer]) -> bool:
    """Whether any of the layers has time samples of its own."""
    return any(layer.ListAllTimeSamples() for layer in layers)


def has_clips(prim: Usd.Prim) -> bool:
    """Whether the prim brings value clips to itself and what is below it."""
    return bool(prim.HasAuthoredMetadata("clips"))


def is_below_clips(prim: Usd.Prim | None) -> bool:
    """Whether it or a prim above it brings some; of no prim nothing does."""
    while prim:
        if has_clips(prim):
            return True
        prim = prim.GetParent()
    return False


def changing(prims: Iterable[Usd.Prim]) -> set[Sdf.Path]:
    """Their attributes that may have other values at other times."""
    return {
        a.GetPath()
        for prim in prims
        for a in authored_attributes(prim)
        if a.ValueMightBeTimeVarying() or has_spline(a) or _names_frame(a)
    }


def _names_frame(attribute: Usd.Attribute) -> bool:
    """Whether it is the name of a file of a sequence ({frame} or {04frame}: MaterialX, "Filename Substitutions")."""
    if attribute.GetTypeName() != "asset":
        return False
    found = default_value(attribute)
    return isinstance(found, Sdf.AssetPath) and "frame}" in found.path


def is_timed(attribute: Usd.Attribute) -> bool:
    """Whether it has any value for a time."""
    return bool(attribute.GetNumTimeSamples()) or has_spline(attribute)


def has_spline(attribute: Usd.Attribute) -> bool:
    return bool(attribute.HasSpline())


def may_have_spline(attribute: Usd.Attribute) -> bool:
    """By its type."""
    return str(attribute.GetTypeName()) in _SPLINED


@lru_cache(maxsize=4096)
def scalar_operations(names: frozenset[str]) -> tuple[str, ...]:
    """Those of a prim's transform that may have splines."""
    return tuple(name for name in names if name.startswith("xformOp:") and _SCALAR.match(name.split(":")[1]))


def has_times(attribute: Usd.Attribute) -> bool:
    """Whether there are values for times, one at least."""
    return bool(attribute.HasSpline() or attribute.GetNumTimeSamples() > 0)


def earliest_if_unset(attribute: Usd.Attribute) -> Usd.TimeCode | None:
    """The time of the first value, where there is none for the default time but some for others."""
    if attribute.GetResolveInfo(Usd.TimeCode.Default()).GetSource() not in _UNSET:
        return None
    if attribute.HasSpline():
        return _first_knot(attribute)
    return EARLIEST if attribute.GetNumTimeSamples() > 0 else None


def earliest_value(attribute: Usd.Attribute) -> Any:
    """The first of its values for times, else the one for the default time."""
    time = _first_knot(attribute) if attribute.HasSpline() else None
    return value_at(attribute, EARLIEST if time is None else time)


def _first_knot(attribute: Usd.Attribute) -> Usd.TimeCode | None:
    """Before it a spline may go anywhere: at USD's earliest time one with a slope is beyond 1e300."""
    knots = _knot_times(attribute)
    return Usd.TimeCode(min(knots)) if knots else None


def _knot_times(attribute: Usd.Attribute) -> list[float]:
    """In the stage's time."""
    return [float(knot.GetTime()) for knot in attribute.GetSpline().GetKnots().values()]


def number_of(time: Usd.TimeCode, attribute: Usd.Attribute) -> float | None:
    """A time as a number, the earliest as that of the attribute's first sample; None for the default time."""
    if time.IsEarliestTime():
        samples = attribute.GetTimeSamples()
        return samples[0] if samples else None
    return None if time.IsDefault() else float(time.GetValue())


def might_change(attribute: Usd.Attribute) -> bool:
    """Asked before `changes`, cheaply."""
    return bool(attribute.ValueMightBeTimeVarying())


def changes(attribute: Usd.Attribute, opens: float, closes: float) -> bool:
    """Whether its value is another one at some time of this span; no where USD cannot read it."""
    try:
        samples = attribute.GetTimeSamplesInInterval(Gf.Interval(opens, closes))
        if len(samples) > MOST_SAMPLES:
            return True
        times = [*samples, *_looked_at(attribute, opens, closes), closes]
        first = value_at(attribute, opens)
        return any(value_at(attribute, time) != first for time in times)
    except (Tf.ErrorException, UnicodeDecodeError):
        return False


def times_between(attribute: Usd.Attribute, opens: float, closes: float) -> list[float]:
    """Times within a span at which its path may bend: those of samples, of clips' and of a spline's knots, in order. Before one
    at which the value may jump is the time just before it; of a jump as the span ends there is that time alone."""
    samples = list(map(float, attribute.GetTimeSamplesInInterval(Gf.Interval(opens, closes, False, True))))
    knots = [time for time in _knot_times(attribute) if opens < time <= closes] if attribute.HasSpline() else []
    before = [math.nextafter(time, -math.inf) for time in (*_jumping(attribute, samples, opens), *knots)]
    return sorted({time for time in (*samples, *knots, *before) if opens < time < closes})


def _jumping(attribute: Usd.Attribute, samples: list[float], opens: float) -> list[float]:
    """Those of the samples that the value before does not go to: clips have values of their own, and blocks none."""
    if not samples or not is_linear(attribute, samples[0]):
        return samples
    if attribute.GetTypeName().isArray:
        return []
    there = [value_at(attribute, time) is not None for time in (opens, *samples)]
    return [time for time, before, now in zip(samples, there, there[1:], strict=False) if not (before and now)]


def bracket(attribute: Usd.Attribute, time: float) -> tuple[float, float] | None:
    """The times of the samples before and after, the same for a time that has one and beyond the ends; None: there is none."""
    around = attribute.GetBracketingTimeSamples(time)
    return (float(around[0]), float(around[-1])) if around else None


def is_linear(attribute: Usd.Attribute, time: float) -> bool:
    """Whether values between two samples are computed from these: not where clips have their own, nor where they are held."""
    held = attribute.GetStage().GetInterpolationType() == Usd.InterpolationTypeHeld
    return not held and attribute.GetResolveInfo(time).GetSource() == Usd.ResolveInfoSourceTimeSamples


def _looked_at(attribute: Usd.Attribute, opens: float, closes: float) -> list[float]:
    """Times within a span at which a spline is compared: a curve may come back to where it was."""
    if not attribute.HasSpline():
        return []
    knots = [time for time in _knot_times(attribute) if opens < time < closes]
    return knots[:MOST_SAMPLES] + [opens + (closes - opens) * k / _STEPS for k in range(1, _STEPS)]


def span_of(stage: Usd.Stage, prims: Iterable[Usd.Prim]) -> tuple[float, float] | None:
    """The first and the last time that values are given for: by layers and clips in their own time, by these prims' splines."""
    times = [t for layer in stage.GetUsedLayers() for t in _ends(layer.ListAllTimeSamples())]
    for prim in prims:
        if has_clips(prim):
            times += _ends(_times_of_clips(prim))
        for attribute in authored_attributes(prim):
            if attribute.HasSpline():
                times += _ends(_knot_times(attribute))
    return (min(times), max(times)) if times else None


def _ends(times: Iterable[float]) -> list[float]:
    finite = [float(t) for t in times if math.isfinite(t)]
    return [min(finite), max(finite)] if finite else []


def _times_of_clips(prim: Usd.Prim) -> list[float]:
    """As the metadata say: without opening any of what may be thousands of files."""
    sets = metadatum(prim, "clips")
    found: list[float] = []
    for clips in sets.values() if isinstance(sets, dict) else ():
        pairs = clips.get("times") or clips.get("active") or ()
        found += [pair[0] for pair in pairs] or [clips[key] for key in ("templateStartTime", "templateEndTime") if key in clips]
    return found
