"""Surface models by the names of their MaterialX definitions."""

from __future__ import annotations

from collections.abc import Callable

from . import disney_principled, gltf_pbr, open_pbr_surface, standard_surface, surface_unlit
from .record import KnownSurface, Reader

READS: dict[str, Callable[[Reader], KnownSurface]] = {
    name: model.read
    for model in (disney_principled, gltf_pbr, open_pbr_surface, standard_surface, surface_unlit)
    for name in model.SHADERS
}
