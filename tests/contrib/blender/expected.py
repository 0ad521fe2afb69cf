"""How pictures of the add-on compare with Cycles': the figures that tests hold and docs/blender.md shows."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Expected:
    """The mean's relative difference and its tolerance, the mean difference of pixels, and codes of notes."""

    mean: float = 0.0
    tolerance: float = 0.004
    each: float = 0.01
    notes: tuple[str, ...] = ()


EXPECTED: dict[str, dict[str, Expected]] = {
    "lamps": {
        "point": Expected(),
        "point of no size": Expected(),
        "point, scaled": Expected(),
        "coloured": Expected(),
        "square": Expected(),
        "rectangle, turned": Expected(),
        "disk, scaled": Expected(),
        "ellipse": Expected(),
        "spread": Expected(),
        "sun": Expected(),
        "spot, hard": Expected(),
        "spot, soft": Expected(),
    },
    "worlds": {
        "constant": Expected(),
        "image": Expected(),
        "image, strong": Expected(),
        "image, turned": Expected(),
        "image, tilted": Expected(),
        "other nodes": Expected(notes=("world-baked",)),
    },
    "cameras": {
        "perspective": Expected(),
        "shifted": Expected(),
        "portrait": Expected(),
        "orthographic": Expected(),
        "equirectangular": Expected(),
        "fisheye": Expected(),
        "equisolid": Expected(),
    },
    "surfaces": {
        "default": Expected(),
        "rough": Expected(),
        "metal": Expected(each=0.02),
        "specular level": Expected(),
        "alpha": Expected(),
        "sheen": Expected(),
        "emission": Expected(),
        "coat": Expected(tolerance=0.006, each=0.02),
        "transmission": Expected(each=0.02),
        "anisotropic": Expected(0.015, 0.008, 0.03),
        "anisotropic, turned": Expected(0.011, 0.008, 0.03),
        "subsurface": Expected(0.052, 0.015, 0.09),
    },
    "shaders": {
        "Diffuse BSDF": Expected(),
        "Emission": Expected(),
        "Glass BSDF": Expected(0.011, 0.008, 0.05),
        "Mix Shader with Transparent BSDF": Expected(),
    },
    "instances": {"geometry nodes": Expected(each=0.02), "collections": Expected()},
    "curves": {"a curve with a bevel": Expected(), "a curve without one": Expected()},
    "volumes": {
        "smoke": Expected(each=0.03),
        "smoke, scaled": Expected(each=0.03),
        "absorption colour": Expected(each=0.03),
        "Volume Scatter by an attribute": Expected(each=0.04),
        "fire": Expected(each=0.02),
        "a mesh that absorbs": Expected(),
        "a mesh that scatters": Expected(each=0.02),
        "the world's": Expected(0.003, 0.01, 0.08, notes=("endless-fog", "out-of-range")),
    },
    "motions": {
        "an object": Expected(),
        "a turn": Expected(),
        "a shape": Expected(),
        "instances": Expected(each=0.015),
        "the camera": Expected(),
        "its start": Expected(),
        "not of this object": Expected(),
        "faces that change": Expected(notes=("motion-topology",)),
    },
    "hair": {"hair of particles": Expected(tolerance=0.01, each=0.06)},
}

# What other versions of Blender than 5.0 export or, in Cycles, render otherwise. primray's smoke in 4.5 has 5.0's bits.
IN_VERSION: dict[str, dict[tuple[str, str], Expected]] = {
    "4.5": {("volumes", "smoke, scaled"): Expected(-0.005, 0.004, 0.03)},
    "5.3": {("surfaces", "subsurface"): Expected(0.037, 0.015, 0.09)},
}


def expected_in(version: str, job: str, name: str) -> Expected:
    return IN_VERSION.get(version, {}).get((job, name), EXPECTED[job][name])
