"""Render settings resolved to the numbers that the core takes: threads and path depth."""

from __future__ import annotations

import os

from ..settings import RenderSettings

NO_DEPTH_LIMIT = 1 << 20


def threads(settings: RenderSettings) -> int:
    return settings.threads or len(os.sched_getaffinity(0))


def max_depth(settings: RenderSettings) -> int:
    return NO_DEPTH_LIMIT if settings.max_depth is None else settings.max_depth
