"""Pictures that readings are taken from: of the stage's light alone, before a camera's exposure, with no settings of a picture.

What a stage or a user asks of a picture (crops, pixel shapes, clamps, staging, stopping rules) would change readings: only the
settings below are kept, so that a setting that is added later has no effect here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..description.scene import has_light
from ..diagnostics import Diagnostics
from ..errors import LimitError, RenderCancelled, SettingsError
from ..render.interruption import interruption
from ..render.prepare import OpenedStage, Steps, prepare
from ..render.render import picture_of
from ..report.report import Costs
from ..sampling.sampling import Sampling
from ..settings import WHOLE, RenderSettings, StudioLight
from ..settings.stage_settings import NOTHING_ASKED
from .meters import CODE

if TYPE_CHECKING:
    from ..description import SceneDescription
    from ..images.image import Image
    from ..render.prepare import Textures
    from ..report.prepared import Prepared
    from .readings import PrecisionJudge

# Settings that decide what is on the stage, how long it is sampled, and how much of the machine is used.
KEPT = (
    *("time_code", "variants", "load", "mask", "session_layer", "purposes", "render_context", "translated_shaders"),
    *("default_wrap", "surface_textures", "dicing_rate", "dome", "dome_rotation", "motion_error"),
    *("spp", "time_limit_s", "max_depth", "seed", "threads", "strict", "fail_on", "allow"),
    *("max_memory_bytes", "texture_memory_bytes", "texture_cache", "texture_cache_bytes"),
)


def settings_of_light(settings: RenderSettings) -> RenderSettings:
    """Return the settings of a picture of the stage's light; SettingsError for fewer samples than an interval needs."""
    if settings.spp is not None and settings.spp < 2:
        sentence = f"an interval needs 2 or more samples of each pixel, not {settings.spp}"
        raise SettingsError(sentence, where="spp", code=CODE)
    return RenderSettings(
        **{name: getattr(settings, name) for name in KEPT},
        aovs=(),
        adaptive=False,
        denoise=False,
        region=WHOLE,
        motion_blur=False,
        studio_light=StudioLight.OFF,
        default_light=False,
    )


class LightSteps(Steps):
    """The steps of a render, without the stage's render settings and the exposure of its camera.

    `has_light` is whether anything emits; where nothing does, that is reported, and a measurement need not look for light.
    """

    has_light = True
    _stage: Any = None

    def translate(self, stage: Any, settings: RenderSettings) -> tuple[SceneDescription, Diagnostics]:
        self._stage = stage
        description, told = super().translate(stage, settings)
        camera = replace(description.camera, exposure_scale=1.0)
        return replace(description, asked=NOTHING_ASKED, camera=camera), told

    def load_textures(
        self, description: SceneDescription, diagnostics: Diagnostics, settings: RenderSettings
    ) -> tuple[SceneDescription, Textures]:
        description, textures = super().load_textures(description, diagnostics, settings)
        self.has_light = has_light(description)
        if not self.has_light:
            diagnostics.add("no-light", "", _why_dark(self._stage, settings))
        return description, textures

    def as_sampled(self, prepared: Prepared) -> Prepared:
        """Return a picture with as few samples as an interval needs where nothing emits."""
        return prepared if self.has_light else replace(prepared, settings=replace(prepared.settings, spp=2))


def _why_dark(stage: Any, settings: RenderSettings) -> str:
    from .. import usd

    found = usd.undrawn_lights(stage, settings)
    if not found:
        return "Nothing emits light: the stage has neither lights nor emissive materials."
    parts = []
    for why, paths in found.items():
        more = f" and {len(paths) - 1} more" if len(paths) > 1 else ""
        parts.append(f"{paths[0]}{more} {'are' if more else 'is'} {why or 'without emission'}" if paths else why)
    return f"Nothing emits light: {'; '.join(parts)}."


def picture_of_light(opened: OpenedStage, settings: RenderSettings) -> Image:
    """Render a picture whose values are radiances, with an error of each pixel.

    LimitError where the time limit leaves a pixel without two independent halves; KeyboardInterrupt where Ctrl-C stops it.
    """
    from ..diagnostic_messages import Announcer

    costs, diagnostics = Costs(), Diagnostics()
    steps = LightSteps()
    prepared = steps.as_sampled(prepare(opened.stage, opened.diagnostics, settings, costs, diagnostics, steps=steps))
    Announcer(opened.name).tell(diagnostics)
    return picture_of(prepared, sampled(prepared, costs), costs, diagnostics)


def sampled(
    prepared: Prepared,
    costs: Costs,
    judge: PrecisionJudge | None = None,
    progress: Callable[[float, int, int], bool] | None = None,
) -> Sampling:
    """Return the sampling of a picture, which has ended, by `judge` where there is one.

    LimitError if a pixel has no samples in one of its independent halves: it has neither a mean nor an error. RenderCancelled
    where `progress` returned False; KeyboardInterrupt where Ctrl-C stopped it.
    """
    with costs.stage("render"), interruption() as signal:
        sampling = Sampling.begin(prepared.scene, prepared.settings)
        if judge is not None:
            sampling.judge_by = judge
        sampling.run(lambda *done: not signal.asked and (progress is None or progress(*done)))
    if signal.asked:
        raise KeyboardInterrupt
    if sampling.stop is not None and sampling.stop.reason == "interrupted":
        raise RenderCancelled("the measurement was stopped by its progress callback")
    if not np.all(sampling.film.counts):
        sentence = "the time limit ended before all pixels of the reading had two samples: give it more seconds"
        raise LimitError(sentence, where="time_limit_s")
    return sampling
