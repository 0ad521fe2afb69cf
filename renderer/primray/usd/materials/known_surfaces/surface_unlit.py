"""MaterialX's surface_unlit: what shines without being lit, and lets light straight through."""

from __future__ import annotations

from ....description import Operand
from .record import ONE, WHITE, ZERO, KnownSurface, Reader

SHADERS = ("ND_surface_unlit",)
_LEAST = (1e-3,)  # that is there of a surface that lets all through, for what it emits to be on


def read(r: Reader) -> KnownSurface:
    emission, opacity = r.scaled(r["emission_color"], r["emission"]), r["opacity"]
    if r["transmission"] != ZERO:
        r.rest(transmission_color=WHITE)
        emission, opacity = _seen_through(r, emission)
    return KnownSurface(emission=emission, opacity=opacity, unlit=True, unused=tuple(r.unused))


def _seen_through(r: Reader, emission: Operand) -> tuple[Operand, Operand]:
    """What is there of it is less by the part that passes, and shines the more."""
    e = r.expressions
    kept = e.apply("ND_clamp_float", **{"in": r.one_minus(r["transmission"]), "low": _LEAST, "high": ONE})
    return e.apply("ND_divide_color3FA", in1=emission, in2=kept), r.times(r["opacity"], kept)
