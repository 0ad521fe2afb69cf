"""MaterialX's surface_unlit: emission without shading, and straight transmission."""

from __future__ import annotations

from ....description import Operand
from .record import ONE, WHITE, ZERO, KnownSurface, Reader

SHADERS = ("ND_surface_unlit",)
_LEAST = (1e-3,)  # least opacity, so that a fully transmissive surface can still emit


def read(r: Reader) -> KnownSurface:
    """Return the surface that the node's inputs describe."""
    emission, opacity = r.scaled(r["emission_color"], r["emission"]), r["opacity"]
    if r["transmission"] != ZERO:
        r.rest(transmission_color=WHITE)
        emission, opacity = _seen_through(r, emission)
    return KnownSurface(emission=emission, opacity=opacity, unlit=True, unused=tuple(r.unused))


def _seen_through(r: Reader, emission: Operand) -> tuple[Operand, Operand]:
    """Return emission and opacity for a transmission: less opacity, and more emission in return."""
    e = r.expressions
    kept = e.apply("ND_clamp_float", **{"in": r.one_minus(r["transmission"]), "low": _LEAST, "high": ONE})
    return e.apply("ND_divide_color3FA", in1=emission, in2=kept), r.times(r["opacity"], kept)
