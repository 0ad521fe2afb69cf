"""Open Image Denoise, through the package pyoidn (extra primray[denoise]), and stopping by the denoised picture's error.

Results are bit-identical for any number of threads. The error is evaluated where that of the noisy picture is, and at the end.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Floats
from ..errors import InternalError, SettingsError
from ..installed_packages import version_of
from ..settings import RenderSettings, StopAt

if TYPE_CHECKING:
    from ..core import CoreScene
    from ..sampling.sampling import Sampling
    from .denoised import Denoised, Denoising


PACKAGE = "pyoidn"


@dataclass(frozen=True)
class Guides:
    """Denoiser guides: first-hit albedo and normal (H, W, 3), filtered like the picture."""

    albedo: Floats
    normal: Floats


def has_denoiser() -> bool:
    return find_spec(PACKAGE) is not None


def check_denoiser() -> None:
    """Raise SettingsError ("denoiser-missing") unless the package is installed. Called before rendering."""
    if not has_denoiser():
        sentence = "denoising needs Open Image Denoise: pip install 'primray[denoise]'"
        raise SettingsError(sentence, where="denoise", code="denoiser-missing")


def denoiser_name() -> str:
    version = version_of(PACKAGE) or "unknown"
    return f"Open Image Denoise {'.'.join(version.split('.')[:3])}"


class Denoiser:
    """A denoiser for pictures of one size with the same guides (None: no guides)."""

    def __init__(self, guides: Guides | None, threads: int) -> None:
        check_denoiser()
        self._oidn: Any = import_module(PACKAGE)
        self._device = self._oidn.Device(self._oidn.OIDN_DEVICE_TYPE_CPU)
        self._device.set_int("numThreads", threads)
        self._device.commit()
        self._raise_if_failed()
        pairs = [] if guides is None else [("albedo", guides.albedo), ("normal", guides.normal)]
        self._guides = [(name, np.array(values, np.float32, order="C")) for name, values in pairs]

    def denoise(self, color: Floats) -> Floats:
        """Return the denoised image of a finite scene-linear one (H, W, 3)."""
        noisy = np.array(color, np.float32, order="C")
        made: Floats = np.zeros_like(noisy)
        height, width = noisy.shape[:2]
        oidn = self._oidn
        run = oidn.Filter(self._device, oidn.OIDN_FILTER_TYPE_RT)
        for name, values in [("color", noisy), *self._guides, ("output", made)]:
            run.set_image(name, values, oidn.OIDN_FORMAT_FLOAT3, width, height)
        run.set_bool("hdr", True)
        run.commit()
        run.execute()
        self._raise_if_failed()
        run.release()
        return made

    def close(self) -> None:
        self._device.release()

    def _raise_if_failed(self) -> None:
        error = self._device.get_error()
        if error is not None:
            raise InternalError(f"Open Image Denoise failed: {error}")


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
