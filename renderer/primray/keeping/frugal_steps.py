"""KeptSteps that let go of all that is kept before a picture is sampled, where the process has become large."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from .kept_steps import KeptSteps

if TYPE_CHECKING:
    from ..core import CoreScene
    from ..description import SceneDescription, Shape
    from ..render.steps import Textures
    from ..settings import RenderSettings


class FrugalSteps(KeptSteps):
    """`part`: of the machine's memory."""

    def __init__(self, part: float) -> None:
        self._most_bytes = part * os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
        super().__init__()

    def build(
        self, description: SceneDescription, textures: Textures, settings: RenderSettings, shapes: list[Shape]
    ) -> CoreScene:
        scene = super().build(description, textures, settings, shapes)
        most = self._most_bytes if settings.max_memory_bytes is None else min(self._most_bytes, settings.max_memory_bytes / 8)
        if resident_bytes() > most:
            self.forget()
        return scene


def resident_bytes() -> float:
    """Of this process."""
    try:
        return int(Path("/proc/self/statm").read_text("ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:  # there is no /proc
        return float("inf")
