"""Settings from the JSON in reports and checkpoints."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import Any, TypeVar

from .choices import AutoCamera, DefaultWrap, Eye, Filter, Ground, Metric, RenderContext, StopAt, StudioLight
from .render_settings import RenderSettings

Choice = TypeVar("Choice", bound=Enum)


def _optional(kind: type[Choice], value: object) -> Choice | None:
    return None if value is None else kind(value)


def settings_of_json(values: Mapping[str, Any]) -> RenderSettings:
    """Return the settings that report.settings_as_json wrote; TypeError or ValueError for unknown names or choices."""
    pairs = ("resolution", "sample_range", "shutter", "region")
    names = (*pairs, "joint_products", "purposes", "aovs", "lens_flaws", "variants", "load", "mask")
    tuples = {name: tuple(values[name]) for name in names if values.get(name) is not None}
    chosen: dict[str, Any] = {"filter": _optional(Filter, values.get("filter"))}
    chosen["error_metric"] = _optional(Metric, values.get("error_metric"))
    chosen["auto_camera"] = AutoCamera(values.get("auto_camera", AutoCamera.THREE_QUARTER))
    chosen["stop_at"] = StopAt(values.get("stop_at", StopAt.PICTURE))
    chosen["default_wrap"] = DefaultWrap(values.get("default_wrap", DefaultWrap.BLACK))
    chosen["render_context"] = RenderContext(values.get("render_context", RenderContext.MTLX))
    chosen["eye"] = None if values.get("eye") is None else Eye(values["eye"])
    chosen["studio_light"] = StudioLight(values.get("studio_light", StudioLight.AUTO))
    chosen["ground"] = None if values.get("ground") is None else Ground(values["ground"])
    if isinstance(values.get("camera"), Mapping):
        from ..camera import camera_of

        chosen["camera"] = camera_of(values["camera"])
    return RenderSettings(**{**values, **tuples, **chosen})
