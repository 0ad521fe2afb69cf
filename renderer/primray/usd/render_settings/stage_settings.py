"""Render settings authored on RenderSettings and RenderProducts: primray's own attributes, else those of other renderers.

PrimrayRenderSettingsAPI and PrimrayRenderProductAPI (schemas/usd) declare primray's. Authored attributes are read whether or
not the schemas are applied or registered; fallback values of the schemas do not count. A product's attribute overrides its
settings', attribute by attribute, as for UsdRenderProduct.

Samples and depth of other renderers are converted. The names are those of Karma's render properties (Houdini's documentation),
arnold-usd's options, hdPrman's options and integrators, and hdCycles' render settings. Depth here counts surface scatterings,
1 being direct light; the others count bounces, 0 being direct light, except PxrPathTracer's former maxPathLength.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import Usd

from ...description.picture_file import PictureView
from ...diagnostics import Diagnostics
from ...errors import LimitError, SettingsError, did_you_mean
from ...settings import MAX_STOPS, RenderSettings
from ...settings.choices import MAX_SPP
from ...settings.stage_settings import CHECKPOINT_EVERY, STOPS, Asked, StageSettings
from ..scene.schemas import (
    ARNOLD,
    ARNOLD_BOUNCES,
    CYCLES_SAMPLES,
    CYCLES_TIME,
    ERROR_THRESHOLDS,
    INTEGRATORS,
    KARMA,
    KARMA_BOUNCES,
    KARMA_SAMPLES,
    PATH_LENGTHS,
    RENDERMAN_SAMPLES,
    TOTAL_BOUNCES,
)
from ..stage.reads import authored_attributes, connections, targets
from ..stage.values import When, report_without_value, value

PREFIX = "primray:"
SHOWN = 80  # characters of a value that cannot be used
SETTINGS = {
    f"{PREFIX}samples": "spp",
    f"{PREFIX}targetError": "target_error",
    f"{PREFIX}errorMetric": "error_metric",
    f"{PREFIX}timeLimit": "time_limit_s",
    f"{PREFIX}maxDepth": "max_depth",
    f"{PREFIX}filter": "filter",
    f"{PREFIX}filterWidth": "filter_width",
    f"{PREFIX}denoise": "denoise",
    f"{PREFIX}motionError": "motion_error",
    f"{PREFIX}checkpointInterval": CHECKPOINT_EVERY,
}
VIEWS = {f"{PREFIX}view": "view", f"{PREFIX}display": "display", f"{PREFIX}look": "look", f"{PREFIX}exposure": "exposure"}
NAMES = frozenset({*SETTINGS, *VIEWS})  # of settings and products
VARIABLES = frozenset({f"{PREFIX}errors"})  # of render variables


def read_stage_settings(
    settings: Usd.Prim, product: Usd.Prim | None, when: When, diagnostics: Diagnostics
) -> tuple[StageSettings, PictureView]:
    """Return the render settings of a product (those that it does not author are its RenderSettings'), and its view."""
    for prim in (settings, *([] if product is None else [product])):
        report_without_value(prim, NAMES, when, diagnostics)
    found = _authored(settings, when)
    if product is not None:
        found |= _authored(product, when)
    if not found and not has_integrator(settings):
        return StageSettings(), PictureView()
    for prim in (settings, *([] if product is None else [product])):
        report_unknown_names(prim, [one.name for one in found.values() if one.prim == str(prim.GetPath())], NAMES, diagnostics)
    own = [one for name in SETTINGS if name in found and (one := _setting(found[name], diagnostics)) is not None]
    names = {one.name for one in own}
    has_stop = bool(names.intersection(STOPS))
    others = [one for one in read_foreign_settings(settings, product, found, when, diagnostics) if one.name not in names]
    own += [one for one in others if not (has_stop and one.name in STOPS)]
    return StageSettings(tuple(own)), _picture_view(found, diagnostics)


def _authored(prim: Usd.Prim, when: When) -> dict[str, Authored]:
    """Return the attributes in the namespaces of known renderers."""
    found = {}
    for attribute in authored_attributes(prim):
        name = attribute.GetName()
        if name.startswith((PREFIX, "karma:", "arnold:", "ri:", "cycles:")):
            given = value(attribute, when)
            if given is not None:
                found[name] = Authored(str(prim.GetPath()), name, _as_written(given, str(attribute.GetTypeName())))
    return found


def _as_written(given: Any, type_name: str) -> Any:
    """Return a float as its layer writes it: 0.001, not the double 0.0010000000474974513."""
    return float(str(np.float32(given))) if type_name in ("float", "half") and isinstance(given, float) else given


def report_unknown_names(prim: Usd.Prim, found: Iterable[str], names: frozenset[str], diagnostics: Diagnostics) -> None:
    """Report unknown attributes in primray's namespace, as a misspelt one would silently do nothing."""
    for name in found:
        if name.startswith(PREFIX) and name not in names:
            hint = did_you_mean(name, sorted(names), otherwise=f"there are {', '.join(sorted(names))}.")
            diagnostics.add("render-settings-input", str(prim.GetPath()), f"{name} is unknown: {hint}", name)


def _setting(found: Authored, diagnostics: Diagnostics) -> Asked | None:
    """Return the setting of an attribute; None, with a diagnostic, if its value is invalid."""
    name = SETTINGS[found.name]
    try:
        if name == CHECKPOINT_EVERY:
            RenderSettings(time_limit_s=found.value)  # has the same range
            accepted = float(found.value)
        else:
            accepted = getattr(RenderSettings(**{name: found.value}), name)
    except (SettingsError, LimitError) as error:
        message = f"{found.name} = {repr(found.value)[:SHOWN]} cannot be used, so the default is: {error.message}."
        diagnostics.add("render-settings-input", found.prim, message, found.name)
        return None
    return Asked(name, accepted, found.prim, found.name)


def _picture_view(found: dict[str, Authored], diagnostics: Diagnostics) -> PictureView:
    chosen: dict[str, Any] = {}
    for name, member in VIEWS.items():
        if name not in found:
            continue
        given = found[name].value
        is_number = isinstance(given, int | float) and not isinstance(given, bool) and abs(given) <= MAX_STOPS
        if is_number if member == "exposure" else isinstance(given, str) and bool(given):
            chosen[member] = float(given) if member == "exposure" else given
        else:
            wanted = f"number of stops from -{MAX_STOPS:g} to {MAX_STOPS:g}" if member == "exposure" else "name"
            message = f"{name} = {repr(given)[:SHOWN]} is not a {wanted}: the default is used."
            diagnostics.add("render-settings-input", found[name].prim, message, name)
    return PictureView(**chosen)


@dataclass(frozen=True)
class Authored:
    """An attribute that has a value at the time of the render."""

    prim: str
    name: str
    value: Any


AuthoredValues = Mapping[str, Authored]


def read_foreign_settings(
    settings: Usd.Prim, product: Usd.Prim | None, found: AuthoredValues, when: When, diagnostics: Diagnostics
) -> list[Asked]:
    """Return the settings, each field once: if several renderers set it, the first in this file's order counts."""
    found = dict(found) | _integrator_parameters(settings, when)
    reader = _ForeignReader(found, diagnostics)
    asked: dict[str, Asked] = {}
    for one in reader.settings():
        first = asked.setdefault(one.name, one)
        if first.value != one.value:
            message = f"{one.attribute} says {one.value}, {first.attribute} says {first.value}: the latter is used."
            diagnostics.add("foreign-settings", one.prim, message, one.attribute)
    return list(asked.values())


def has_integrator(settings: Usd.Prim) -> bool:
    return any(settings.HasProperty(name) for name in INTEGRATORS)


def _integrator_parameters(settings: Usd.Prim, when: When) -> dict[str, Authored]:
    """Return the parameters of RenderMan's integrator prim, under hdPrman's names for them on RenderSettings."""
    if not has_integrator(settings):
        return {}
    attribute = settings.GetAttribute(INTEGRATORS[1])
    paths = targets(settings, INTEGRATORS[0]) or (connections(attribute) if attribute else [])
    prim = settings.GetStage().GetPrimAtPath(paths[0].GetPrimPath()) if paths else None
    if not prim:
        return {}
    found = {}
    for own in authored_attributes(prim):
        name = own.GetName().removeprefix("inputs:").removeprefix("ri:")
        if name in ("maxIndirectBounces", "maxPathLength") and (given := value(own, when)) is not None:
            found[f"ri:integrator:PxrPathTracer:{name}"] = Authored(str(prim.GetPath()), own.GetName(), given)
    return found


class _ForeignReader:
    def __init__(self, found: AuthoredValues, diagnostics: Diagnostics) -> None:
        self.found, self.diagnostics = found, diagnostics

    def settings(self) -> Iterator[Asked]:
        yield from self._samples(KARMA_SAMPLES)
        yield from self._depth_of_kinds([[f"{prefix}{kind}" for prefix in KARMA] for kind in KARMA_BOUNCES])
        yield from self._arnold_samples()
        yield from self._arnold_depth()
        yield from self._samples(RENDERMAN_SAMPLES)
        yield from self._path_length()
        yield from self._total(TOTAL_BOUNCES)
        yield from self._samples(CYCLES_SAMPLES)
        yield from self._time_limit()
        self._note_errors()

    def _samples(self, names: tuple[str, ...]) -> Iterator[Asked]:
        name = self._first(names)
        if name is not None and (count := self._whole(name, 1, MAX_SPP, "a number of samples")) is not None:
            yield self._asked("spp", count, name, f"{count} samples a pixel")

    def _arnold_samples(self) -> Iterator[Asked]:
        """Yield Arnold's samples: the square of AA_samples, or of AA_samples_max with adaptive sampling."""
        name, most = (self._first([f"{prefix}{end}" for prefix in ARNOLD]) for end in ("AA_samples", "AA_samples_max"))
        adaptive = self._first([f"{prefix}enable_adaptive_sampling" for prefix in ARNOLD])
        if adaptive is not None and self.found[adaptive].value is True and most is not None:
            name = most
        if name is not None and (side := self._whole(name, 1, 4096, "a number whose square is the samples")) is not None:
            yield self._asked("spp", side * side, name, f"{side * side} samples a pixel, the square of {side}")

    def _arnold_depth(self) -> Iterator[Asked]:
        """Yield Arnold's depth: the total, or the sum of the kinds if that is smaller."""
        kinds = [[f"{prefix}{kind}" for prefix in ARNOLD] for kind in ARNOLD_BOUNCES]
        found = list(self._total([f"{prefix}GI_total_depth" for prefix in ARNOLD]))
        if not found or all(map(self._first, kinds)):
            found += self._depth_of_kinds(kinds)
        yield from sorted(found, key=lambda one: int(one.value))[:1]

    def _total(self, names: tuple[str, ...] | list[str]) -> Iterator[Asked]:
        name = self._first(names)
        if name is not None and (bounces := self._whole(name, 0, 2**20, "a number of bounces")) is not None:
            yield self._asked("max_depth", bounces + 1, name, f"a depth of {bounces + 1}: direct light and {bounces} bounces")

    def _path_length(self) -> Iterator[Asked]:
        name = self._first(PATH_LENGTHS)
        if name is not None and (depth := self._whole(name, 1, 2**20, "a length of paths")) is not None:
            yield self._asked("max_depth", depth, name, f"a depth of {depth}")

    def _depth_of_kinds(self, names: list[list[str]]) -> Iterator[Asked]:
        """Yield the sum of the limits per kind of bounce, a depth that keeps every path they keep; all limits are needed."""
        firsts = [self._first(of_kind) for of_kind in names]
        given = [name for name in firsts if name is not None]
        if not given:
            return
        if len(given) < len(firsts):
            missing = [of_kind[0] for of_kind, name in zip(names, firsts, strict=True) if name is None]
            message = f"{', '.join(given)} are ignored: without {', '.join(missing)} they do not limit the depth of paths."
            self.diagnostics.add("foreign-settings", self.found[given[0]].prim, message, given[0])
            return
        counts = [self._whole(name, 0, 2**20, "a number of bounces") for name in given]
        if None not in counts:
            total = sum(count for count in counts if count is not None)
            kinds = ", ".join(name.rpartition(":")[2] for name in given)
            text = f"a depth of {total + 1}: direct light and {total} bounces, the sum of {kinds}"
            yield self._asked("max_depth", total + 1, given[0], text)

    def _time_limit(self) -> Iterator[Asked]:
        """Yield Cycles' time limit in seconds; 0 is no limit."""
        one = self.found.get(CYCLES_TIME)
        if one is not None and isinstance(one.value, int | float) and 0 < one.value < 1e9:
            yield self._asked("time_limit_s", float(one.value), CYCLES_TIME, f"{one.value:g} seconds a frame")

    def _note_errors(self) -> None:
        for name in ERROR_THRESHOLDS:
            if name in self.found:
                message = f"{name} is ignored, as its unit is its own renderer's: author primray:targetError instead."
                self.diagnostics.add("foreign-settings", self.found[name].prim, message, name)

    def _first(self, names: tuple[str, ...] | list[str]) -> str | None:
        return next((name for name in names if name in self.found), None)

    def _whole(self, name: str, least: int, most: int, what: str) -> int | None:
        """Return a whole number in the range (some writers store floats); None, with a diagnostic, for anything else."""
        given: Any = self.found[name].value
        if isinstance(given, int | float) and not isinstance(given, bool) and least <= given <= most and given == int(given):
            return int(given)
        one = self.found[name]
        message = f"{one.name} = {repr(given)[:80]} is not {what} from {least} to {most}: it is ignored."
        self.diagnostics.add("render-settings-input", one.prim, message, one.name)
        return None

    def _asked(self, name: str, given: Any, attribute: str, meaning: str) -> Asked:
        one = self.found[attribute]
        return Asked(name, given, one.prim, one.name, meaning)
