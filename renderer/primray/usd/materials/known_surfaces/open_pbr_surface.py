"""The Academy Software Foundation's open_pbr_surface."""

from __future__ import annotations

from dataclasses import fields

from ....description import OpenPbr
from .record import KnownSurface, Reader

SHADERS = ("ND_open_pbr_surface_surfaceshader",)
_OURS = ("coat_roughening",)
_GEOMETRY = ("opacity", "thin_walled", "normal", "tangent", "coat_normal", "coat_tangent")


def read(r: Reader) -> KnownSurface:
    """Return the surface that the node's inputs describe."""
    same = [f.name for f in fields(OpenPbr) if f.name not in _OURS]
    # The coat's colour is the square of its transmittance in one direction ("Coat", "Emission").
    through = r.expressions.apply("ND_power_color3FA", in1=r["coat_color"], in2=(0.5,))
    shining = r.scaled(r["emission_color"], r["emission_luminance"])
    return KnownSurface(
        **{name: r[name] for name in same},  # type: ignore[arg-type]
        **{name: r[f"geometry_{name}"] for name in _GEOMETRY},  # type: ignore[arg-type]
        emission=r.shining_through(shining, r["coat_weight"], through),
        called={name: f"geometry_{name}" for name in _GEOMETRY},
    )
