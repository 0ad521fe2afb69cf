"""Bounds on displacement before textures are read: texels count as values in [0, 1]."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from ...description import Primvar as SeamPrimvar
from ...description import PrimvarInput, Surface, TextureInput


def reach_of(surface: Surface, primvars: Collection[SeamPrimvar]) -> float:
    """Return the largest displacement distance of a surface, in the shape's own units; 0 if it is unknown, as for a node
    graph."""
    if surface.displacement is None:
        return 0.0
    value = surface.displacement[1]
    if isinstance(value, TextureInput):
        at = ["rgba".index(channel) for channel in value.channels]
        bias, scale = np.array(value.bias)[at], np.array(value.scale)[at]
        return float(np.linalg.norm(np.maximum(np.abs(bias), np.abs(scale + bias))))
    if not isinstance(value, PrimvarInput):
        return 0.0
    found = next((p.values for p in primvars if p.name == value.name), np.array([value.fallback], np.float32))
    return float(np.linalg.norm(found[:, : len(value.fallback)], axis=1).max(initial=0.0))
