"""KeptSteps that drop all that is kept before a picture is sampled, where the process has become large."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..process_memory import machine_bytes, resident_bytes
from .kept_steps import KeptSteps

if TYPE_CHECKING:
    from ..core import CoreScene
    from ..description import SceneDescription, Shape
    from ..render.steps import Textures
    from ..settings import RenderSettings


KEPT_PART = 0.125  # of the available memory: a larger process keeps nothing


class FrugalSteps(KeptSteps):
    def build(
        self, description: SceneDescription, textures: Textures, settings: RenderSettings, shapes: list[Shape]
    ) -> CoreScene:
        scene = super().build(description, textures, settings, shapes)
        there_is = machine_bytes()
        if settings.max_memory_bytes is not None:
            there_is = min(there_is, settings.max_memory_bytes)
        if resident_bytes() > KEPT_PART * there_is:
            self.forget()
        return scene
