"""Variation over time: the only place that knows the ways in which values may be given for times (a gate holds that).

These are time samples, value clips (samples in further files, named by metadata) and splines, which only scalars have and which
USD does not count as samples. A layer lists its samples, but not its clips and splines.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from functools import lru_cache
from typing import Any

from pxr import Gf, Sdf, Tf, Usd

from .reads import authored_attributes, default_value, metadatum, value_at

MOST_SAMPLES = 16  # compared at most; an attribute with more in a span is assumed to change
_STEPS = 16  # steps of a span at which a spline is compared, besides its knots
_UNSET = (Usd.ResolveInfoSourceFallback, Usd.ResolveInfoSourceNone)
_SCALAR = re.compile("(translate|scale|rotate)[XYZ]$")
_SPLINED = frozenset(["double", "float", "half", "timecode"])  # the types that have splines (Ts.Spline.IsSupportedValueType)


EARLIEST = Usd.TimeCode.EarliestTime()  # for values that USD computes from many attributes; splines extrapolate at it


def has_samples(layers: Iterable[Sdf.Layer]) -> bool:
    """Return whether any of the layers has time samples itself."""
    return any(layer.ListAllTimeSamples() for layer in layers)


def has_clips(prim: Usd.Prim) -> bool:
    """Return whether value clips are authored on the prim, for itself and the prims below it."""
    return bool(prim.HasAuthoredMetadata("clips"))


def is_below_clips(prim: Usd.Prim | None) -> bool:
    """Return whether value clips are authored on the prim or on one of its ancestors; False for no prim."""
    while prim:
        if has_clips(prim):
            return True
        prim = prim.GetParent()
    return False


def changing(prims: Iterable[Usd.Prim]) -> set[Sdf.Path]:
    """Return the paths of those of the prims' attributes that may have different values at different times."""
    return {
        a.GetPath()
        for prim in prims
        for a in authored_attributes(prim)
        if a.ValueMightBeTimeVarying() or has_spline(a) or _names_frame(a)
    }


def _names_frame(attribute: Usd.Attribute) -> bool:
    """Return whether the attribute names files of a sequence ({frame} or {04frame}: MaterialX, "Filename Substitutions")."""
    if attribute.GetTypeName() != "asset":
        return False
    found = default_value(attribute)
    return isinstance(found, Sdf.AssetPath) and "frame}" in found.path


def has_time_values(attribute: Usd.Attribute) -> bool:
    """Return whether the attribute has any value for a time."""
    return bool(attribute.GetNumTimeSamples()) or has_spline(attribute)


def sample_times(attribute: Usd.Attribute) -> list[float]:
    """Return the stage times of the attribute's samples."""
    return list(attribute.GetTimeSamples())


def layer_times(layer: Sdf.Layer, path: Sdf.Path) -> list[float]:
    """Return the layer's own times of the samples of a spec."""
    return list(layer.ListTimeSamplesForPath(path))


def has_spline(attribute: Usd.Attribute) -> bool:
    return bool(attribute.HasSpline())


def may_have_spline(attribute: Usd.Attribute) -> bool:
    """Return whether the attribute's type allows splines."""
    return str(attribute.GetTypeName()) in _SPLINED


@lru_cache(maxsize=4096)
def scalar_operations(names: frozenset[str]) -> tuple[str, ...]:
    """Return the transform operations among these names that may have splines."""
    return tuple(name for name in names if name.startswith("xformOp:") and _SCALAR.match(name.split(":")[1]))


def earliest_if_unset(attribute: Usd.Attribute) -> Usd.TimeCode | None:
    """Return the time of the first value where there is none for the default time but some for others, else None."""
    if attribute.GetResolveInfo(Usd.TimeCode.Default()).GetSource() not in _UNSET:
        return None
    if attribute.HasSpline():
        return _first_knot(attribute)
    return EARLIEST if attribute.GetNumTimeSamples() > 0 else None


def earliest_value(attribute: Usd.Attribute) -> Any:
    """Return the earliest of the attribute's values for times, else the one for the default time."""
    time = _first_knot(attribute) if attribute.HasSpline() else None
    return value_at(attribute, EARLIEST if time is None else time)


def _first_knot(attribute: Usd.Attribute) -> Usd.TimeCode | None:
    """Return the time of a spline's first knot. Before it a spline may extrapolate: with a slope it is beyond 1e300 at USD's
    earliest time."""
    knots = _knot_times(attribute)
    return Usd.TimeCode(min(knots)) if knots else None


def _knot_times(attribute: Usd.Attribute) -> list[float]:
    """Return the times of a spline's knots, in the stage's time."""
    return [float(knot.GetTime()) for knot in attribute.GetSpline().GetKnots().values()]


def number_of(time: Usd.TimeCode, attribute: Usd.Attribute) -> float | None:
    """Return a time as a number, the earliest one as the attribute's first sample; None for the default time."""
    if time.IsEarliestTime():
        samples = attribute.GetTimeSamples()
        return samples[0] if samples else None
    return None if time.IsDefault() else float(time.GetValue())


def might_vary(attribute: Usd.Attribute) -> bool:
    """Return whether the attribute may vary over time: a cheap test before `changes`."""
    return bool(attribute.ValueMightBeTimeVarying())


def varies(attribute: Usd.Attribute, opens: float, closes: float) -> bool:
    """Return whether the attribute's value differs anywhere in this span of time; False where USD cannot read it."""
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
    """Return the times within a span at which the value may change direction, in order: samples, clip samples, spline knots.

    A time at which the value may jump is preceded by the time just before it; for a jump at the end of the span that is
    included alone.
    """
    samples = list(map(float, attribute.GetTimeSamplesInInterval(Gf.Interval(opens, closes, False, True))))
    knots = [time for time in _knot_times(attribute) if opens < time <= closes] if attribute.HasSpline() else []
    before = [math.nextafter(time, -math.inf) for time in (*_jumping(attribute, samples, opens), *knots)]
    return sorted({time for time in (*samples, *knots, *before) if opens < time < closes})


def _jumping(attribute: Usd.Attribute, samples: list[float], opens: float) -> list[float]:
    """Return the samples that the value before does not interpolate to: clips have separate values, and blocks have none."""
    if not samples or not is_linear(attribute, samples[0]):
        return samples
    if attribute.GetTypeName().isArray:
        return []
    there = [value_at(attribute, time) is not None for time in (opens, *samples)]
    return [time for time, before, now in zip(samples, there, there[1:], strict=False) if not (before and now)]


def bracket(attribute: Usd.Attribute, time: float) -> tuple[float, float] | None:
    """Return the sample times before and after a time, equal at a sample and beyond the ends; None without samples."""
    around = attribute.GetBracketingTimeSamples(time)
    return (float(around[0]), float(around[-1])) if around else None


def is_linear(attribute: Usd.Attribute, time: float) -> bool:
    """Return whether values between two samples are interpolated: not for clips, and not where values are held."""
    held = attribute.GetStage().GetInterpolationType() == Usd.InterpolationTypeHeld
    return not held and attribute.GetResolveInfo(time).GetSource() == Usd.ResolveInfoSourceTimeSamples


def _looked_at(attribute: Usd.Attribute, opens: float, closes: float) -> list[float]:
    """Return times within a span at which a spline is compared: a curve may return to its first value."""
    if not attribute.HasSpline():
        return []
    knots = [time for time in _knot_times(attribute) if opens < time < closes]
    return knots[:MOST_SAMPLES] + [opens + (closes - opens) * k / _STEPS for k in range(1, _STEPS)]


def span_of(stage: Usd.Stage, prims: Iterable[Usd.Prim]) -> tuple[float, float] | None:
    """Return the first and last time that values are given for by layers and clips, in their own time, and by these prims'
    splines."""
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
    """Return the times of a prim's clips from its metadata, without opening any of perhaps thousands of files."""
    sets = metadatum(prim, "clips")
    found: list[float] = []
    for clips in sets.values() if isinstance(sets, dict) else ():
        pairs = clips.get("times") or clips.get("active") or ()
        found += [pair[0] for pair in pairs] or [clips[key] for key in ("templateStartTime", "templateEndTime") if key in clips]
    return found
