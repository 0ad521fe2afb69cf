"""Settings authored in a stage, and how they combine with those of the user, who takes precedence.

`usd/render_settings/stage_settings.py` reads them; nothing here knows USD.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from .render_settings import RenderSettings

# The stopping rules. A user who sets one of them overrides all of the stage's.
STOPS = ("spp", "target_error", "time_limit_s")
# The interval of checkpoints, which is not a field of RenderSettings.
CHECKPOINT_EVERY = "checkpoint_every_s"


@dataclass(frozen=True)
class Asked:
    """One setting that a stage requests, a field of RenderSettings or CHECKPOINT_EVERY, with where it is authored."""

    name: str
    value: Any
    prim: str
    attribute: str
    meaning: str = ""  # how another renderer's attribute was understood; "": the attribute is one of primray's own


@dataclass(frozen=True)
class StageSettings:
    """The settings that a stage requests, each at most once."""

    asked: tuple[Asked, ...] = ()

    def of(self, name: str) -> Any:
        """Return the requested value, or None."""
        return next((one.value for one in self.asked if one.name == name), None)

    def without(self, name: str) -> StageSettings:
        """Return the settings without the named one."""
        return StageSettings(tuple(one for one in self.asked if one.name != name))

    def without_places(self) -> StageSettings:
        """Return the settings without where they are authored, so that equal requests compare equal."""
        return StageSettings(tuple(replace(one, prim="", attribute="", meaning="") for one in self.asked))

    def applied_to(self, settings: RenderSettings) -> tuple[RenderSettings, tuple[Asked, ...]]:
        """Return the settings with the stage's values where they are open, and which of those were applied."""
        taken = tuple(one for one in self.asked if _is_open(one, self, settings))
        values = {one.name: one.value for one in taken if one.name != CHECKPOINT_EVERY}
        return (replace(settings, **values) if values else settings), taken

    def as_json(self) -> list[dict[str, Any]]:
        """Return the settings as reports and `inspect` list them."""
        return [asked_as_json(one) for one in self.asked]


NOTHING_ASKED = StageSettings()


def asked_as_json(one: Asked) -> dict[str, Any]:
    """Return a setting with the attribute that it comes from."""
    value = getattr(one.value, "value", one.value)
    return {"setting": one.name, "value": value, "prim": one.prim, "attribute": one.attribute, "meaning": one.meaning}


def _is_open(one: Asked, stage: StageSettings, settings: RenderSettings) -> bool:
    special = _OPEN.get(one.name)
    if special is not None:
        return special(stage, settings)
    return one.name == CHECKPOINT_EVERY or getattr(settings, one.name) is None


def _has_no_stop(settings: RenderSettings) -> bool:
    return settings.sample_range is None and all(getattr(settings, name) is None for name in STOPS)


def _target_is_open(stage: StageSettings, settings: RenderSettings) -> bool:
    """Return whether the stage's target applies.

    A target is a number in its own metric: with the user's choice of another metric it would mean something else.
    """
    metric, asked = settings.error_metric, stage.of("error_metric")
    is_of_metric = metric is None or metric is (replace(settings, error_metric=asked).metric)
    return _has_no_stop(settings) and is_of_metric


def _metric_is_open(stage: StageSettings, settings: RenderSettings) -> bool:
    return settings.error_metric is None and settings.target_error is None


def _width_is_open(stage: StageSettings, settings: RenderSettings) -> bool:
    """Return whether the stage's width applies, which belongs to the stage's filter."""
    return settings.filter is None and settings.filter_width is None


_OPEN: dict[str, Callable[[StageSettings, RenderSettings], bool]] = {
    "spp": lambda stage, settings: _has_no_stop(settings),
    "time_limit_s": lambda stage, settings: _has_no_stop(settings),
    "target_error": _target_is_open,
    "error_metric": _metric_is_open,
    "filter_width": _width_is_open,
}
