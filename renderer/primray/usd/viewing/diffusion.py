"""Diffusion of the image's lens: the settings' values, else the camera's."""

from __future__ import annotations

from dataclasses import replace

from ...description import Camera
from ...errors import SettingsError
from ...settings import DIFFUSION, RenderSettings


def with_diffusion(camera: Camera, settings: RenderSettings) -> Camera:
    """Return the camera with the settings' diffusion; SettingsError if its shares then add up to more than 1."""
    asked = {member: getattr(settings, name) for name, member in DIFFUSION.items()}
    asked = {member: value for member, value in asked.items() if value is not None}
    if not asked:
        return camera
    try:
        return replace(camera, diffusion=replace(camera.diffusion, **asked))
    except ValueError as error:
        sentence = f"with what the camera says, {error}"
        raise SettingsError(sentence, where="diffusion_starburst") from None
