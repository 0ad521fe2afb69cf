"""OpenPBR surfaces that the BSDF's tests look at, and its functions on arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from tests.described import kernels

from primray import core
from primray.core.inputs import filled

Floats = npt.NDArray[np.float32]
WHITE = (1.0, 1.0, 1.0)
COLOR = (0.9, 0.4, 0.1)

# Inputs that differ from the text's defaults; "thin" is of the surface.
CASES: dict[str, dict[str, Any]] = {
    "default": {"base_color": COLOR},
    "rough diffuse": {"base_color": COLOR, "base_diffuse_roughness": 0.8, "specular_weight": 0.0},
    "smooth": {"base_color": COLOR, "specular_roughness": 0.0},
    "metal 0.1": {"base_color": COLOR, "base_metalness": 1.0, "specular_roughness": 0.1, "specular_color": (0.6, 0.9, 1.0)},
    "metal 0.7": {"base_color": COLOR, "base_metalness": 1.0, "specular_roughness": 0.7},
    "brushed metal": {
        "base_color": COLOR,
        "base_metalness": 1.0,
        "specular_roughness": 0.5,
        "specular_roughness_anisotropy": 0.8,
    },
    "brushed dielectric": {"base_color": COLOR, "specular_roughness": 0.4, "specular_roughness_anisotropy": 0.5},
    "half metal": {"base_color": COLOR, "base_metalness": 0.5},
    "glass": {"transmission_weight": 1.0, "specular_roughness": 0.0},
    "rough glass": {"transmission_weight": 1.0, "specular_roughness": 0.4, "transmission_color": (0.9, 0.8, 0.3)},
    "half glass": {"transmission_weight": 0.5, "base_color": COLOR},
    "rough dispersive glass": {
        "transmission_weight": 1.0,
        "specular_roughness": 0.3,
        "transmission_dispersion_scale": 1.0,
        "specular_ior": 1.8,
    },
    "rare glass": {"transmission_weight": 1.0, "specular_roughness": 0.3, "specular_ior": 0.7},
    "brushed glass": {"transmission_weight": 1.0, "specular_roughness": 0.4, "specular_roughness_anisotropy": 0.6},
    "pane": {"transmission_weight": 1.0, "specular_roughness": 0.0, "transmission_color": (0.9, 0.7, 0.4), "thin": True},
    "frosted pane": {
        "transmission_weight": 1.0,
        "specular_roughness": 0.4,
        "transmission_color": (0.9, 0.7, 0.4),
        "thin": True,
    },
    "leaf": {"subsurface_weight": 0.8, "subsurface_color": COLOR, "subsurface_scatter_anisotropy": 0.3, "thin": True},
    "wax": {"subsurface_weight": 1.0, "subsurface_color": COLOR, "specular_roughness": 0.5},
    "coat": {"base_color": COLOR, "coat_weight": 1.0, "coat_roughness": 0.2, "coat_color": (0.9, 0.5, 0.2)},
    "half coat": {"base_color": COLOR, "coat_weight": 0.5, "coat_roughness": 0.0, "specular_roughness": 0.5},
    "coated metal": {
        "base_color": COLOR,
        "base_metalness": 1.0,
        "coat_weight": 1.0,
        "coat_roughness": 0.3,
        "coat_roughness_anisotropy": 0.6,
    },
    "coated glass": {"transmission_weight": 1.0, "coat_weight": 0.7, "coat_color": COLOR, "coat_roughness": 0.2},
    "fuzz": {"base_color": COLOR, "fuzz_weight": 1.0, "fuzz_color": (0.3, 0.6, 0.9), "fuzz_roughness": 0.6},
    "thin film": {"base_color": COLOR, "thin_film_weight": 1.0, "thin_film_thickness": 0.4},
    "thin film on metal": {
        "base_color": COLOR,
        "base_metalness": 1.0,
        "thin_film_weight": 1.0,
        "thin_film_thickness": 0.6,
        "thin_film_ior": 1.6,
    },
    "soap bubble": {"transmission_weight": 1.0, "specular_roughness": 0.0, "thin_film_weight": 1.0, "thin": True},
    "all": {
        "base_color": COLOR,
        "base_metalness": 0.3,
        "base_diffuse_roughness": 0.5,
        "transmission_weight": 0.4,
        "coat_weight": 0.6,
        "coat_roughness": 0.3,
        "fuzz_weight": 0.5,
        "thin_film_weight": 0.5,
        "specular_roughness_anisotropy": 0.3,
    },
}


def surface(case: dict[str, Any]) -> Any:
    """The core's SurfaceInput."""
    own = {name: value for name, value in case.items() if name != "thin"}
    found = core.module()
    return filled(
        found.SurfaceInput(), lambert=False, open_pbr=filled(found.OpenPbrInput(), **own), thin=case.get("thin", False)
    )


def direction(cosine: float, phi: float = 0.7) -> Floats:
    sine = np.sqrt(1 - cosine * cosine)
    return np.array([sine * np.cos(phi), sine * np.sin(phi), cosine], np.float32)


def repeated(w: Floats, n: int) -> Floats:
    return np.ascontiguousarray(np.broadcast_to(w, (n, 3)), np.float32)


def side(n: int, front: bool) -> npt.NDArray[np.int32]:
    return np.full(n, front, np.int32)


def evaluate(made: Any, wo: Floats, wi: npt.NDArray[Any], front: bool = True, lanes: int = 0) -> tuple[Floats, Floats, Floats]:
    """f_cos (N, 3) of diffuse lobes and of the others, and densities (N,)."""
    n = len(wi)
    return kernels().bsdf_eval(made, repeated(wo, n), np.ascontiguousarray(wi, np.float32), side(n, front), lanes=lanes)


def sample(made: Any, wo: Floats, u: Floats, front: bool = True, lanes: int = 0) -> Any:
    """wi, weights, densities, whether of a delta lobe, whether it passes."""
    n = len(u)
    return kernels().bsdf_sample(made, repeated(wo, n), side(n, front), np.ascontiguousarray(u, np.float32), lanes=lanes)


def strata(n: int, seed: int) -> Floats:
    """(n * n, 3) numbers for lobe and direction, in strata of the directions; the lobes' are in strata, shuffled."""
    rng = np.random.default_rng(seed)
    i, j = (x.ravel() for x in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    u, v = (i + rng.random(n * n)) / n, (j + rng.random(n * n)) / n
    lobe = (rng.permutation(n * n) + rng.random(n * n)) / (n * n)
    return np.minimum(np.stack([lobe, u, v], 1), 1 - 2**-24).astype(np.float32)


def albedo(made: Any, wo: Floats, front: bool = True, n: int = 512, seed: int = 1) -> npt.NDArray[np.float64]:
    """What is reflected and transmitted of light from everywhere, (3,)."""
    _, weight, pdf, is_delta, _ = sample(made, wo, strata(n, seed), front)
    kept = (pdf > 0) | is_delta.astype(bool)
    return np.asarray(np.where(kept[:, None], weight, 0).astype(np.float64).mean(0))
