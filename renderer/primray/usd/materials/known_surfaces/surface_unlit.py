"""MaterialX's surface_unlit: what shines without being lit."""

from __future__ import annotations

from .record import BLACK, WHITE, ZERO, KnownSurface, Reader

SHADERS = ("ND_surface_unlit",)


def read(r: Reader) -> KnownSurface:
    if r["transmission"] != ZERO:
        r.rest(transmission_color=WHITE)
    return KnownSurface(
        base_color=BLACK,
        specular_weight=ZERO,
        emission=r.scaled("emission_color", "emission"),
        transmission=r["transmission"],
        opacity=r["opacity"],
        unused=tuple(r.unused),
    )
