"""Open Image Denoise, through the package pyoidn (extra primray[denoise]).

Results are bit-identical for any number of threads.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np

from ..arrays import Floats
from ..errors import InternalError, SettingsError
from ..installed_packages import version_of

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
