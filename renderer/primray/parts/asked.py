"""Settings of a distributed frame's parts, and of the frame that they are merged to."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ..denoising.denoiser import check_denoiser
from ..errors import SettingsError
from ..settings import Metric, RenderSettings, StopAt
from .board import Range


def check(asked: RenderSettings) -> None:
    """Raise SettingsError for settings that a distributed frame cannot have."""
    faults = {
        "adaptive": asked.adaptive is True and "adaptive sampling cannot be rendered in parts",
        "sample_range": asked.sample_range is not None and "a frame in parts has all samples: leave the sample range out",
        "stop_at": asked.stop_at is StopAt.DENOISED
        and "a frame in parts can stop at the picture's error, not at the denoised one's",
        "spp": asked.is_quick_look and "a quick look has too few samples for parts: render it without them",
    }
    for name, fault in faults.items():
        if fault:
            raise SettingsError(fault, where=name, code="parts-setting")
    if asked.denoise:
        check_denoiser()
    if asked.metric is Metric.DISPLAY:  # measured in this process
        from ..sampling.error import DisplayView

        DisplayView().check()


def part_settings(asked: RenderSettings, part: Range) -> RenderSettings:
    """Return the settings that one part is rendered with."""
    return replace(asked, sample_range=part, spp=None, target_error=None, time_limit_s=None, adaptive=None)


def by_samples(asked: RenderSettings) -> dict[str, Any]:
    """Return the stopping rules by samples alone: the time limit is one of wall-clock time, and applied by the caller."""
    spp = asked.most_samples if asked.target_error is None else asked.spp
    return {"spp": spp, **_uniform(asked), "time_limit_s": None}


def as_told(asked: RenderSettings) -> dict[str, Any]:
    """Return the stopping rules as the report of one render has them."""
    spp = asked.spp if asked.stops_early else asked.most_samples
    return {"spp": spp, **_uniform(asked), "time_limit_s": asked.time_limit_s}


def _uniform(asked: RenderSettings) -> dict[str, Any]:
    adaptive = asked.adaptive if asked.target_error is None else False
    return {"target_error": asked.target_error, "adaptive": adaptive, "sample_range": None}
