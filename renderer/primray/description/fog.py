"""Fog that fills the scene."""

from __future__ import annotations

from dataclasses import dataclass

Vector = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Fog:
    """Fog of constant density below a height, which thins out exponentially above it; outside of objects with an interior.

    `density` is the extinction per world unit below the top, and `emission` the radiance per world unit emitted there; both
    follow the same profile.
    """

    path: str  # of the prim that asks for it
    density: float
    albedo: Vector = (1.0, 1.0, 1.0)  # scattered share of the extinction
    emission: Vector = (0.0, 0.0, 0.0)
    anisotropy: float = 0.0  # mean cosine of the phase function (Henyey and Greenstein)
    droplets: float = 0.0  # diameter of water droplets in micrometres, whose phase function it has; 0: none
    top: float | None = None  # world coordinate along the up axis; None: the fog has no top
    up: Vector = (0.0, 1.0, 0.0)
    falloff: float = 0.0  # world units above the top over which the density falls to 1 / e; 0: it ends at the top
    hidden: bool = False  # from the camera: it attenuates and scatters light, but camera rays pass it
