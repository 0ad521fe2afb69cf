"""Input structures of the compiled core, filled from settings and descriptions."""

from __future__ import annotations

from dataclasses import fields
from typing import TypeVar

from ..description import Fog, HomogeneousVolume, Surface, VolumeMedium
from ..settings import RenderSettings
from . import compiled
from .native import max_depth

Made = TypeVar("Made")
_FILLED_APART = frozenset({"path", "inputs", "pattern", "open_pbr", "hair", "camera", "volume"})  # of a Surface
_DROPLETS = 2.0  # where phase functions of droplets begin: kDroplets in medium/phase_function.hpp


def filled(made: Made, **values: object) -> Made:
    """Return `made` with these fields set.

    Raise AttributeError for a field that it does not have.
    """
    for name, value in values.items():
        setattr(made, name, value)
    return made


def surface_input(surface: Surface) -> compiled.SurfaceInput:
    """Return the constants of a surface."""
    names = [f.name for f in fields(surface) if f.name not in _FILLED_APART]
    made = filled(compiled.SurfaceInput(), **{name: getattr(surface, name) for name in names})
    made.camera = compiled.CameraVisibility[surface.camera.value]
    lobes = surface.open_pbr
    if lobes is not None:
        made.open_pbr = filled(compiled.OpenPbrInput(), **{f.name: getattr(lobes, f.name) for f in fields(lobes)})
    if surface.volume is not None:
        volume = surface.volume
        made.volume = filled(
            compiled.VolumeInput(),
            extinction=volume.extinction,
            scattering=volume.scattering,
            emission=volume.emission,
            phase=phase_number(volume),
        )
    if surface.hair is not None:
        made.hair = filled(compiled.HairInput(), **{f.name: getattr(surface.hair, f.name) for f in fields(surface.hair)})
    return made


def phase_number(medium: Fog | HomogeneousVolume | VolumeMedium) -> float:
    """Return the core's number of a phase function (medium/phase_function.hpp)."""
    return _DROPLETS + medium.droplets if medium.droplets > 0 else medium.anisotropy


def integrator_settings(settings: RenderSettings, **values: object) -> compiled.IntegratorSettings:
    """Return settings for one thread at the render's depth, with these fields set."""
    return filled(compiled.IntegratorSettings(), max_depth=max_depth(settings), **values)
