"""Settings from the JSON that reports and checkpoints keep of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .choices import AutoCamera, DefaultWrap, Eye, Filter, Ground, Metric, RenderContext, StopAt, StudioLight
from .render_settings import RenderSettings


def settings_of_json(values: Mapping[str, Any]) -> RenderSettings:
    """What report.settings_as_json made; TypeError or ValueError for names or choices that there are not."""
    pairs = ("resolution", "sample_range", "shutter", "region")
    names = (*pairs, "joint_products", "purposes", "aovs", "lens_flaws", "variants", "load", "mask")
    tuples = {name: tuple(values[name]) for name in names if values.get(name) is not None}
    chosen: dict[str, Any] = {"filter": Filter(values["filter"]), "error_metric": Metric(values["error_metric"])}
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
