"""Stopping criterion by the denoised picture's error: evaluated where the error of the noisy picture is, and at the end."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..errors import SettingsError
from ..settings import RenderSettings, StopAt
from .denoiser import check_denoiser

if TYPE_CHECKING:
    from ..core import CoreScene
    from ..sampling.sampling import Sampling
    from .denoised import Denoised, Denoising

# The interval's upper end may be at most this many times the target; beyond that, the estimate is too uncertain.
MOST_DOUBT = 2.0


def check_denoising(settings: RenderSettings) -> None:
    """Raise SettingsError for settings that cannot be denoised. Called before rendering."""
    if not settings.denoises:
        return
    check_denoiser()
    if settings.stop_at is StopAt.DENOISED and settings.target_error is None:
        sentence = "stop_at denoised needs target_error, the error of the denoised picture to stop at"
        raise SettingsError(sentence, where="stop_at", code="denoised-target")


class DenoisedTarget:
    """A `sampling.sampling.Judge` by the denoised picture's error; caches the most recent denoised picture."""

    def __init__(self, denoising: Denoising, settings: RenderSettings) -> None:
        assert settings.target_error is not None
        self._denoising = denoising
        self._target = settings.target_error
        self._metric = settings.metric
        self._last: tuple[int, Denoised] | None = None

    def is_met(self, sampling: Sampling) -> bool:
        made = self.denoised(sampling)
        if made.error is None:
            return False
        found = made.error.of(self._metric)
        return found.value <= self._target and found.high <= MOST_DOUBT * self._target

    def denoised(self, sampling: Sampling) -> Denoised:
        """Return the denoised picture of all samples taken so far."""
        if self._last is None or self._last[0] != sampling.film.samples:
            self._last = sampling.film.samples, self._denoising.of(sampling.film)
        return self._last[1]


def denoised_target(scene: CoreScene, settings: RenderSettings) -> DenoisedTarget | None:
    """Return the stopping criterion by the denoised picture's error, or None if the settings use another."""
    if settings.stop_at is not StopAt.DENOISED or settings.target_error is None:
        return None
    from .denoised import Denoising, guides_of

    return DenoisedTarget(Denoising(guides_of(scene, settings), scene.exposure_scale, settings), settings)
