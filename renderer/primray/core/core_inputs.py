"""The core's input structures, filled field by field by name."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from ..description import Surface
from ..settings import RenderSettings
from .limits import max_depth


def filled(made: Any, **values: Any) -> Any:
    """Return `made` with these fields set.

    Raise AttributeError for a field that it does not have.
    """
    for name, value in values.items():
        setattr(made, name, value)
    return made


def surface_input(core: Any, surface: Surface) -> Any:
    """Return the SurfaceInput of a surface: its constants."""
    names = [f.name for f in fields(surface) if f.name not in ("path", "inputs", "pattern", "open_pbr", "hair", "camera")]
    made = filled(core.SurfaceInput(), **{name: getattr(surface, name) for name in names})
    made.camera = getattr(core.CameraSight, surface.camera.value)
    lobes = surface.open_pbr
    if lobes is not None:
        made.open_pbr = filled(core.OpenPbrInput(), **{f.name: getattr(lobes, f.name) for f in fields(lobes)})
    if surface.hair is not None:
        made.hair = filled(core.HairInput(), **{f.name: getattr(surface.hair, f.name) for f in fields(surface.hair)})
    return made


def integrator_settings(core: Any, settings: RenderSettings, **values: Any) -> Any:
    """Return IntegratorSettings for one thread at the render's depth, with these fields set."""
    return filled(core.IntegratorSettings(), max_depth=max_depth(settings), **values)
