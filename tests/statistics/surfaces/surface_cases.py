"""The surfaces that the BSDF's tests look at, and its functions on arrays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from tests.described import kernels, lambert

from primray.core.inputs import surface_input
from primray.description import Surface

Floats = npt.NDArray[np.float32]
Booleans = npt.NDArray[np.bool_]
WHITE = Surface("", diffuse_color=(1.0, 1.0, 1.0))
COLORED = Surface("", diffuse_color=(0.9, 0.4, 0.1))

SURFACES: dict[str, Surface] = {
    "lambert": lambert((0.9, 0.4, 0.1)),
    "dielectric smooth": replace(COLORED, roughness=0.0),
    "dielectric 0.05": replace(COLORED, roughness=0.05),
    "dielectric 0.3": replace(COLORED, roughness=0.3),
    "dielectric 1": replace(COLORED, roughness=1.0),
    "dense dielectric": replace(COLORED, roughness=0.4, ior=5.0),
    "rare dielectric": replace(COLORED, roughness=0.4, ior=0.5),
    "ior 1": replace(COLORED, roughness=0.4, ior=1.0),
    "metal 0.02": replace(COLORED, metallic=1.0, roughness=0.02),
    "metal 0.2": replace(COLORED, metallic=1.0, roughness=0.2),
    "metal 0.8": replace(COLORED, metallic=1.0, roughness=0.8),
    "half metal": replace(COLORED, metallic=0.5, roughness=0.3),
    "specular workflow": replace(COLORED, use_specular_workflow=True, specular_color=(0.1, 0.5, 0.8), roughness=0.25),
    "specular workflow black": replace(COLORED, use_specular_workflow=True, roughness=0.6),
    "clearcoat": replace(COLORED, roughness=0.7, clearcoat=1.0, clearcoat_roughness=0.1),
    "clearcoat half, smooth": replace(COLORED, roughness=0.5, clearcoat=0.5, clearcoat_roughness=0.0),
    "clearcoat on metal": replace(COLORED, metallic=1.0, roughness=0.4, clearcoat=1.0, clearcoat_roughness=0.3),
    "mirror under clearcoat": replace(COLORED, metallic=1.0, roughness=0.0, clearcoat=0.7, clearcoat_roughness=0.2),
    "half transparent": replace(COLORED, roughness=0.3, opacity=0.5, thin=True),
    "rough glass": replace(COLORED, roughness=0.3, opacity=0.0),
    "rough glass, half opaque": replace(COLORED, roughness=0.5, opacity=0.5),
    "coated glass": replace(COLORED, roughness=0.2, opacity=0.2, clearcoat=0.8, clearcoat_roughness=0.15),
    "glass of ior 0.5": replace(COLORED, roughness=0.1, opacity=0.1, ior=0.5),
    "smooth glass of ior 0.5": replace(COLORED, roughness=0.0, opacity=0.0, ior=0.5),
    "presence": replace(COLORED, roughness=0.4, opacity=0.6, presence=True),
}
NON_TRANSMISSIVE = [name for name, s in SURFACES.items() if s.opacity == 1.0]


def direction(cos_theta: float, phi: float = 0.7) -> Floats:
    s = np.sqrt(1 - cos_theta * cos_theta)
    return np.array([s * np.cos(phi), s * np.sin(phi), cos_theta], np.float32)


def rows(w: Floats, n: int) -> Floats:
    return np.ascontiguousarray(np.broadcast_to(w, (n, 3)), np.float32)


def side(n: int, front: bool = True) -> npt.NDArray[np.int32]:
    return np.full(n, front, np.int32)


def evaluate(s: Surface, wo: Floats, wi: npt.NDArray[np.floating], front: bool = True) -> tuple[Floats, Floats, Floats]:
    """Diffuse and specular f_cos (N, 3) and pdf (N,) for one or N directions wo."""
    wi = np.ascontiguousarray(wi, np.float32)
    return kernels().bsdf_eval(surface_input(s), rows(wo, len(wi)), wi, side(len(wi), front))


def sample(
    s: Surface, wo: Floats, u: npt.NDArray[np.floating], front: bool = True
) -> tuple[Floats, Floats, Floats, Booleans, Booleans]:
    """wi, weight, pdf, is_delta, transmits for one or N directions wo."""
    u = np.ascontiguousarray(u, np.float32)
    wi, weight, pdf, is_delta, transmits = kernels().bsdf_sample(surface_input(s), rows(wo, len(u)), side(len(u), front), u)
    return wi, weight, pdf, is_delta.astype(bool), transmits.astype(bool)


def random_numbers(n: int, dimensions: int, seed: int) -> Floats:
    return np.random.default_rng(seed).random((n, dimensions), dtype=np.float32)


def lattice(n: int, dimensions: int) -> Floats:
    """Evenly spread points of [0,1)^d: Roberts 2018, "The Unreasonable Effectiveness of Quasirandom Sequences"."""
    g = 2.0
    for _ in range(64):
        g = (1 + g) ** (1 / (dimensions + 1))
    steps = (1 / g) ** np.arange(1, dimensions + 1)
    return np.minimum((0.5 + np.arange(n)[:, None] * steps) % 1.0, 1 - 2.0**-24).astype(np.float32)
